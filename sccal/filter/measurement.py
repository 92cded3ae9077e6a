"""Measurements: what a reading is expected to be, and what it teaches. See sccal.filter.kernel for the equations."""

from __future__ import annotations

import math

from sccal.arrays import Floats
from sccal.compiled import compiled
from sccal.filter.layout import (
    BASE_STATES,
    EAST_BIAS,
    HEADING_BIAS,
    NORTH_BIAS,
    OFFSET,
    PORT_ANTENNA_FORWARD,
    PORT_ANTENNA_LEFT,
    PORT_EAST,
    THETA,
    Belief,
    Columns,
    Events,
    X,
    Y,
)

TWO_PI = 2.0 * math.pi
FAR_RAD = 0.3
"""A heading so far from where the arm was to be linearised has nothing to do with it."""


@compiled
def wrap_angle(angle: float) -> float:
    """Angle in [−π, π)."""
    return angle - TWO_PI * math.floor((angle + math.pi) / TWO_PI)


@compiled
def expect_heading(
    belief: Belief, v: Floats, g: Floats, q: Floats, events: Events, columns: Columns, use_offset: bool, h: int
) -> tuple[float, float, float]:
    """Innovation ν, variance s̃ with the parameters known and s of one heading reading; v ← C Hᵀ, g, q ← Π gᵀ."""
    x, p, P, V = belief.x, belief.p, belief.core, belief.slope
    m = p.shape[0]
    ofs = 1.0 if use_offset else 0.0
    slope = columns.heading_slope[h]
    turns = 1.0 + slope
    predicted = x[THETA] + x[HEADING_BIAS] + ofs * x[OFFSET] + columns.heading_known[h]
    predicted += slope * wrap_angle(x[THETA] - columns.heading_at[h])
    for i in range(BASE_STATES):
        v[i] = turns * P[THETA, i] + P[HEADING_BIAS, i] + ofs * P[OFFSET, i]
    s_core = events.yaw_var_rad2[h] + turns * v[THETA] + v[HEADING_BIAS] + ofs * v[OFFSET]
    for k in range(m):
        g[k] = turns * V[THETA, k] + V[HEADING_BIAS, k] + ofs * V[OFFSET, k]
    for k in range(columns.heading_param.shape[0]):
        c = columns.heading[h, k]
        j = columns.heading_param[k]
        predicted += c * p[j]
        g[j] += c
    times(belief.params, g, q)
    return wrap_angle(events.yaw_rad[h] - predicted), s_core, s_core + dot(g, q, m)


@compiled
def fix_row(port: int, c: float, ct: float, st: float) -> tuple[float, float]:
    """East and north derivative of a fix by a parameter whose column value is c."""
    if port == PORT_ANTENNA_FORWARD:
        return c * ct, c * st
    if port == PORT_ANTENNA_LEFT:
        return -c * st, c * ct
    if port == PORT_EAST:
        return c, 0.0
    return 0.0, c


@compiled
def expect_fix(
    belief: Belief,
    v: Floats,
    w: Floats,
    g_e: Floats,
    g_n: Floats,
    events: Events,
    columns: Columns,
    f: int,
    antenna: Floats,
) -> tuple[float, float, float, float, float]:
    """Innovations east and north, and s̃_ee, s̃_nn, s̃_en of one fix; v, w ← C H_eᵀ, C H_nᵀ, and g_e, g_n."""
    x, p, P, V = belief.x, belief.p, belief.core, belief.slope
    m = p.shape[0]
    at = x[THETA]
    if columns.fix_at.shape[0] > 0 and not math.isnan(columns.fix_at[f]):
        at = x[THETA] - wrap_angle(x[THETA] - columns.fix_at[f])
        at = at if math.fabs(x[THETA] - at) < FAR_RAD else x[THETA]
    ct = math.cos(at)
    st = math.sin(at)
    arm_e, arm_n, shift_e, shift_n = 0.0, 0.0, 0.0, 0.0
    for k in range(columns.fix_param.shape[0]):
        port = columns.fix_port[k]
        ce, cn = fix_row(port, columns.fix[f, k] * p[columns.fix_param[k]], ct, st)
        if port < PORT_EAST:
            arm_e += ce
            arm_n += cn
        else:
            shift_e += ce
            shift_n += cn
    # h = p + R(θ̄) a + R'(θ̄) a (θ − θ̄): the antenna turned as told, and from there to the estimate.
    shift_e -= arm_n * (x[THETA] - at)
    shift_n += arm_e * (x[THETA] - at)
    antenna[f, 0] = x[X] + arm_e + shift_e
    antenna[f, 1] = x[Y] + arm_n + shift_n
    nu_e = events.fix_east_m[f] - antenna[f, 0] - x[EAST_BIAS]
    nu_n = events.fix_north_m[f] - antenna[f, 1] - x[NORTH_BIAS]
    for i in range(BASE_STATES):
        v[i] = P[X, i] - arm_n * P[THETA, i] + P[EAST_BIAS, i]
        w[i] = P[Y, i] + arm_e * P[THETA, i] + P[NORTH_BIAS, i]
    for k in range(m):
        g_e[k] = V[X, k] - arm_n * V[THETA, k] + V[EAST_BIAS, k]
        g_n[k] = V[Y, k] + arm_e * V[THETA, k] + V[NORTH_BIAS, k]
    for k in range(columns.fix_param.shape[0]):
        j = columns.fix_param[k]
        ce, cn = fix_row(columns.fix_port[k], columns.fix[f, k], ct, st)
        g_e[j] += ce
        g_n[j] += cn
    see = events.fix_var_east_m2[f] + v[X] - arm_n * v[THETA] + v[EAST_BIAS]
    snn = events.fix_var_north_m2[f] + w[Y] + arm_e * w[THETA] + w[NORTH_BIAS]
    sen = events.fix_cov_m2[f] + w[X] - arm_n * w[THETA] + w[EAST_BIAS]
    return nu_e, nu_n, see, snn, sen


@compiled
def downdate(P: Floats, v: Floats, inv_s: float) -> None:
    """P ← P − v vᵀ/s, symmetric to the last bit."""
    n = P.shape[0]
    for i in range(n):
        vi = v[i]
        if vi != 0.0:
            for j in range(n):
                P[i, j] -= (vi * v[j]) * inv_s


@compiled
def times(matrix: Floats, vector: Floats, result: Floats) -> None:
    """result ← M v for a symmetric M (m, m)."""
    m = matrix.shape[0]
    for k in range(m):
        result[k] = 0.0
    for j in range(m):
        vj = vector[j]
        if vj != 0.0:
            for k in range(m):
                result[k] += vj * matrix[j, k]


@compiled
def dot(a: Floats, b: Floats, count: int) -> float:
    """Σ a b over the first ``count``."""
    total = 0.0
    for k in range(count):
        total += a[k] * b[k]
    return total


@compiled
def dot_row(matrix: Floats, row: int, b: Floats, count: int) -> float:
    """The same for one row of a matrix, in four sums that do not wait for each other.

    A view of the row would be counted as a reference, which costs more than the products of a short one.
    """
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = count - count % 4
    for k in range(0, whole, 4):
        s0 += matrix[row, k] * b[k]
        s1 += matrix[row, k + 1] * b[k + 1]
        s2 += matrix[row, k + 2] * b[k + 2]
        s3 += matrix[row, k + 3] * b[k + 3]
    for k in range(whole, count):
        s0 += matrix[row, k] * b[k]
    return (s0 + s1) + (s2 + s3)


@compiled
def learn(belief: Belief, v: Floats, s_core: float, g: Floats, q: Floats, s: float, nu: float) -> None:
    """One scalar measurement: v (10,) = C Hᵀ, g (m,), q (m,) = Π gᵀ, both variances and the innovation."""
    x, p, P, V = belief.x, belief.p, belief.core, belief.slope
    m = p.shape[0]
    gain = nu / s
    inv_core = 1.0 / s_core
    for i in range(BASE_STATES):
        x[i] += (v[i] + dot_row(V, i, q, m)) * gain
        less = v[i] * inv_core
        if less != 0.0:
            for k in range(m):
                V[i, k] -= less * g[k]
    for k in range(m):
        p[k] += q[k] * gain
    downdate(P, v, inv_core)
    downdate(belief.params, q, 1.0 / s)


@compiled
def clamp(x: Floats, lower: Floats, upper: Floats) -> None:
    """Hold R_r, R_l and L within their numeric limits."""
    for k in range(3):
        if x[3 + k] < lower[k]:
            x[3 + k] = lower[k]
        elif x[3 + k] > upper[k]:
            x[3 + k] = upper[k]


@compiled
def learn_fix(
    belief: Belief,
    v: Floats,
    w: Floats,
    core: tuple[float, float, float],
    work: Floats,
    whole: tuple[float, float, float],
    nu: tuple[float, float],
) -> None:
    """East and then north of one fix, the second freed of what the first said, with the gains of both at one state."""
    x, p, P, V = belief.x, belief.p, belief.core, belief.slope
    m = p.shape[0]
    g_e, g_n, q_e, q_n = work[2], work[3], work[4], work[5]
    gain_e, gain_n, ratio = nu[0] / whole[0], nu[1] / whole[1], whole[2]
    core_ratio = core[2] / core[0]
    inv_e = 1.0 / core[0]
    inv_n = 1.0 / (core[1] - core[2] * core_ratio)
    for k in range(m):
        q_n[k] -= ratio * q_e[k]
    for i in range(BASE_STATES):
        x[i] += (v[i] + dot_row(V, i, q_e, m)) * gain_e + (w[i] - ratio * v[i] + dot_row(V, i, q_n, m)) * gain_n
    for i in range(BASE_STATES):
        w[i] -= core_ratio * v[i]
    for k in range(m):
        p[k] += q_e[k] * gain_e + q_n[k] * gain_n
        g_n[k] -= core_ratio * g_e[k]
    for i in range(BASE_STATES):
        less_e, less_n = v[i] * inv_e, w[i] * inv_n
        for k in range(m):
            V[i, k] -= less_e * g_e[k] + less_n * g_n[k]
    downdate(P, v, inv_e)
    downdate(P, w, inv_n)
    downdate(belief.params, q_e, 1.0 / whole[0])
    downdate(belief.params, q_n, 1.0 / whole[1])
