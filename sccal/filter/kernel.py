"""The compiled self-calibrating filter: ports and columns, no effect by name.

State (n = 10 + number of effect parameters)::

    0 x   1 y   2 θ   3 R_r   4 R_l   5 L   6 Ofs   7 b_h   8 b_e   9 b_n   10… p_j

x … Ofs are the state of Cantelli, Ligama, Muscato and Spina, Robotics 2016, 5(4), 23 (their section 3). b_h, b_e and
b_n are the correlated parts of the heading error and of the fix error, first-order Gauss-Markov; with standard
deviation zero they vanish and the filter is the paper's. p_j are parameters of effects, each entering at a port
through a column computed beforehand.

Prediction with the wheel angles φ_r and φ_l turned between two events, mid-arc heading::

    a_r = R_r φ_r + Σ p c      a_l = R_l φ_l + Σ p c
    s = (a_r + a_l)/2 + Σ p c      d = Σ p c      Δθ = (a_r − a_l)/L + Σ p c
    x += s cos(θ + Δθ/2) − d sin(θ + Δθ/2)
    y += s sin(θ + Δθ/2) + d cos(θ + Δθ/2)
    θ += Δθ

The derivatives by the constants may be taken at fixed values of them: a running estimate that wanders makes a filter
believe that it has seen directions of the parameter space that the drive never showed (Huang, Mourikis and Roumeliotis
2008, on first-estimates Jacobians). They use the wheels' motion freed of slip (see sccal.align.denoise).

Process noise enters by the two wheels: variance slip² |a| + the event's own extra variance.

Measurements::

    heading   z = θ + Ofs + b_h + Σ p c
    fix       z = (x + b_e, y + b_n) + Rot(θ) (Σ p c_forward, Σ p c_left) + (Σ p c_east, Σ p c_north)

The covariance is held in full, and every operation on it is symmetric to the last bit: rank-one downdates are formed
as (v_i v_j)/S, and the three rows that a prediction changes are mirrored. A fix is one 2-vector update, done as two
scalar ones after decorrelation, so both are linearised at the same state.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sccal.arrays import Bools, Floats, Rows
from sccal.filter.compiled import compiled

X, Y, THETA, RADIUS_RIGHT, RADIUS_LEFT, TRACK, OFFSET, HEADING_BIAS, EAST_BIAS, NORTH_BIAS = range(10)
BASE_STATES = 10
REPORTED_STATES = 7

PORT_ALONG, PORT_SIDE, PORT_TURN, PORT_RIGHT_WHEEL, PORT_LEFT_WHEEL = range(5)
PORT_ANTENNA_FORWARD, PORT_ANTENNA_LEFT, PORT_EAST, PORT_NORTH = range(4)

# What a forward pass carries from one call to the next, beside state and covariance.
MEM_HEADING_T, MEM_FIX_T, MEM_FIX_REJECTED, MEM_FIX_SINCE, MEM_HEADING_REJECTED, MEM_HEADING_SINCE = range(6)
MEM_RECOVERIES, MEM_FIX_LEVEL, MEM_ACCEPTED_SINCE = 6, 7, 8
MEMORY_SIZE = 9

TWO_PI = 2.0 * math.pi
OUTLIER_FRACTION = 0.01
OUTLIER_AREA_M2 = 1.0e4


class Events(NamedTuple):
    """One timeline, n events in order of time (see sccal.align.Timeline)."""

    t_s: Floats  # (n,)
    right_rad: Floats  # (n,) wheel angle since the event before
    left_rad: Floats  # (n,)
    right_clear_rad: Floats  # (n,) the same without slip: for the derivatives by R_r, R_l, L
    left_clear_rad: Floats  # (n,)
    loose_m2: Floats  # (n,) extra variance of each wheel's travel, m²
    heading_row: Rows  # (n,) int32, row of the heading reading here, or -1
    fix_row: Rows  # (n,) int32
    out_row: Rows  # (n,) int32, row of the output to fill here, or -1
    yaw_rad: Floats  # (h,) AHRS reading turned into enu
    yaw_var_rad2: Floats  # (h,) white part
    fix_east_m: Floats  # (f,)
    fix_north_m: Floats  # (f,)
    fix_var_east_m2: Floats  # (f,) white part
    fix_var_north_m2: Floats  # (f,)
    fix_cov_m2: Floats  # (f,)


class Columns(NamedTuple):
    """Effect columns by the room they act in; ``param`` counts from 0 and adds BASE_STATES to give the state."""

    motion: Floats  # (n, km), rows as Events.t_s
    motion_port: Rows  # (km,) int32
    motion_param: Rows  # (km,) int32
    heading: Floats  # (h, kh), rad per unit of the parameter
    heading_param: Rows  # (kh,) int32
    fix: Floats  # (f, kf)
    fix_port: Rows  # (kf,) int32
    fix_param: Rows  # (kf,) int32


class Model(NamedTuple):
    """Everything that is a number: noise, walks, gates."""

    slip2: float  # m² per m of each wheel
    heading_coloured_var: float  # rad²
    heading_tau_s: float
    fix_coloured_var: float  # m²
    fix_tau_s: float
    walk: Floats  # (n,) variance rate of each state, unit² per s (parameters only)
    linear: Floats  # (3,) R_r, R_l, L at which their derivatives are taken; not positive: at the current estimate
    lower: Floats  # (3,) bounds of R_r, R_l, L
    upper: Floats  # (3,)
    heading_gate: float  # χ² with 1 degree of freedom
    fix_gate: float  # χ² with 2 degrees of freedom
    soft_gate: bool  # instead of the gates: weigh each measurement by its probability of being no outlier
    recover_count: float  # rejected in a row …
    recover_s: float  # … for so long: the filter opens up again
    use_offset: bool


class Output(NamedTuple):
    """What a pass fills; rows of one call range are written, the others left."""

    state: Floats  # (m, REPORTED_STATES)
    sigma: Floats  # (m, REPORTED_STATES)
    heading_nu: Floats  # (h,) rad, NaN where not reached
    heading_var: Floats  # (h,) innovation variance S
    heading_ok: Bools  # (h,) bool, accepted
    fix_nu: Floats  # (f, 2) m
    fix_var: Floats  # (f, 3) S_ee, S_nn, S_en
    fix_ok: Bools  # (f,) bool
    antenna: Floats  # (f, 2) m, predicted antenna (without the fix-error states)
    total: Floats  # (2,) negative log-likelihood: heading, fixes


@compiled
def wrap_angle(angle: float) -> float:
    """Angle in [−π, π)."""
    return angle - TWO_PI * math.floor((angle + math.pi) / TWO_PI)


@compiled
def _move(
    x: Floats,
    P: Floats,
    work: Floats,
    right: float,
    left: float,
    right_clear: float,
    left_clear: float,
    loose: float,
    row: int,
    columns: Columns,
    slip2: float,
    linear: Floats,
) -> None:
    """Predict state and covariance through one step of the wheels."""
    n = x.shape[0]
    gs, gt, gd, S, T, D = work[0], work[1], work[2], work[3], work[4], work[5]
    km = columns.motion_port.shape[0]

    along_right = x[3] * right
    along_left = x[4] * left
    along, side, turn = 0.0, 0.0, 0.0
    inv_track = 1.0 / x[5]
    for k in range(km):
        c = columns.motion[row, k]
        j = 10 + columns.motion_param[k]
        gs[j] = 0.0
        gt[j] = 0.0
        gd[j] = 0.0
        pc = x[j] * c
        port = columns.motion_port[k]
        if port == 0:
            along += pc
        elif port == 1:
            side += pc
        elif port == 2:
            turn += pc
        elif port == 3:
            along_right += pc
        else:
            along_left += pc
    for k in range(km):
        c = columns.motion[row, k]
        j = 10 + columns.motion_param[k]
        port = columns.motion_port[k]
        if port == 0:
            gs[j] += c
        elif port == 1:
            gd[j] += c
        elif port == 2:
            gt[j] += c
        elif port == 3:
            gs[j] += 0.5 * c
            gt[j] += c * inv_track
        else:
            gs[j] += 0.5 * c
            gt[j] -= c * inv_track

    s = 0.5 * (along_right + along_left) + along
    dtheta = (along_right - along_left) * inv_track + turn
    middle = x[2] + 0.5 * dtheta
    cm = math.cos(middle)
    sm = math.sin(middle)
    ax = -(s * sm + side * cm)
    ay = s * cm - side * sm
    hx = 0.5 * ax
    hy = 0.5 * ay

    at_right = linear[0] if linear[0] > 0.0 else x[3]
    at_left = linear[1] if linear[1] > 0.0 else x[4]
    inv_at_track = 1.0 / (linear[2] if linear[2] > 0.0 else x[5])
    gs3 = 0.5 * right_clear
    gs4 = 0.5 * left_clear
    gt3 = right_clear * inv_at_track
    gt4 = -left_clear * inv_at_track
    effects = (along_right - x[3] * right) - (along_left - x[4] * left)
    gt5 = -(at_right * right_clear - at_left * left_clear + effects) * inv_at_track * inv_at_track

    for q in range(n):
        S[q] = gs3 * P[3, q] + gs4 * P[4, q]
        T[q] = gt3 * P[3, q] + gt4 * P[4, q] + gt5 * P[5, q]
        D[q] = 0.0
    for k in range(km):
        j = 10 + columns.motion_param[k]
        first = True
        for before in range(k):
            if columns.motion_param[before] == columns.motion_param[k]:
                first = False
        if first:
            for q in range(n):
                S[q] += gs[j] * P[j, q]
                T[q] += gt[j] * P[j, q]
                D[q] += gd[j] * P[j, q]

    # Left factor: the three pose rows of F P.
    for q in range(n):
        P[0, q] += ax * P[2, q] + cm * S[q] - sm * D[q] + hx * T[q]
        P[1, q] += ay * P[2, q] + sm * S[q] + cm * D[q] + hy * T[q]
        P[2, q] += T[q]
    # Right factor, needed for the 3 × 3 pose block only; the rest of the columns is the mirror image.
    for i in range(3):
        gsi = gs3 * P[i, 3] + gs4 * P[i, 4]
        gti = gt3 * P[i, 3] + gt4 * P[i, 4] + gt5 * P[i, 5]
        gdi = 0.0
        for k in range(km):
            j = 10 + columns.motion_param[k]
            first = True
            for before in range(k):
                if columns.motion_param[before] == columns.motion_param[k]:
                    first = False
            if first:
                gsi += gs[j] * P[i, j]
                gti += gt[j] * P[i, j]
                gdi += gd[j] * P[i, j]
        theta = P[i, 2]
        P[i, 0] += ax * theta + cm * gsi - sm * gdi + hx * gti
        P[i, 1] += ay * theta + sm * gsi + cm * gdi + hy * gti
        P[i, 2] = theta + gti
    P[1, 0] = P[0, 1]
    P[2, 0] = P[0, 2]
    P[2, 1] = P[1, 2]

    var_right = slip2 * abs(along_right) + loose
    var_left = slip2 * abs(along_left) + loose
    qss = 0.25 * (var_right + var_left)
    qtt = (var_right + var_left) * inv_track * inv_track
    qst = 0.5 * (var_right - var_left) * inv_track
    P[0, 0] += cm * cm * qss + 2.0 * cm * hx * qst + hx * hx * qtt
    P[1, 1] += sm * sm * qss + 2.0 * sm * hy * qst + hy * hy * qtt
    P[2, 2] += qtt
    xy = cm * sm * qss + (cm * hy + sm * hx) * qst + hx * hy * qtt
    xt = cm * qst + hx * qtt
    yt = sm * qst + hy * qtt
    P[0, 1] += xy
    P[1, 0] += xy
    P[0, 2] += xt
    P[2, 0] += xt
    P[1, 2] += yt
    P[2, 1] += yt
    for q in range(3, n):
        P[q, 0] = P[0, q]
        P[q, 1] = P[1, q]
        P[q, 2] = P[2, q]

    x[0] += s * cm - side * sm
    x[1] += s * sm + side * cm
    x[2] += dtheta


@compiled
def _decay(x: Floats, P: Floats, state: int, factor: float, stationary_var: float) -> None:
    """First-order Gauss-Markov step of one state: x ← f x, variance towards the stationary one."""
    n = x.shape[0]
    x[state] *= factor
    for q in range(n):
        P[state, q] *= factor
    for q in range(n):
        P[q, state] = P[state, q]
    P[state, state] = P[state, state] * factor + (1.0 - factor * factor) * stationary_var


@compiled
def _downdate(P: Floats, v: Floats, inv_s: float) -> None:
    """P ← P − v vᵀ/S, symmetric to the last bit."""
    n = v.shape[0]
    for i in range(n):
        vi = v[i]
        for j in range(n):
            P[i, j] -= (vi * v[j]) * inv_s


@compiled
def _clamp(x: Floats, lower: Floats, upper: Floats) -> None:
    for k in range(3):
        if x[3 + k] < lower[k]:
            x[3 + k] = lower[k]
        elif x[3 + k] > upper[k]:
            x[3 + k] = upper[k]


@compiled
def _open_position(x: Floats, P: Floats, nu_e: float, nu_n: float, level: float, use_offset: bool) -> None:
    """The way back from a lock-out: forget the position, and step by step what else may have been wrong.

    Level 1 forgets the position; level 2 the heading too, together with the opposite change of the offset, so that
    the AHRS reading stays explained; from level 3 on the wheels are given 5 % more.
    """
    n = x.shape[0]
    for state in range(2):
        for q in range(n):
            P[state, q] = 0.0
            P[q, state] = 0.0
    spread = 4.0 * (nu_e * nu_e + nu_n * nu_n) + 1.0
    P[0, 0] = spread
    P[1, 1] = spread
    if level >= 2:
        turn = (0.35 * (level - 1.0)) ** 2
        P[2, 2] += turn
        if use_offset:
            P[2, 6] -= turn
            P[6, 2] -= turn
            P[6, 6] += turn
    if level >= 3:
        for q in range(3, 6):
            P[q, q] += (0.05 * x[q]) ** 2


@compiled
def _expect_heading(
    x: Floats, P: Floats, v: Floats, events: Events, columns: Columns, use_offset: bool, h: int
) -> tuple[float, float]:
    """Innovation ν and its variance S of one heading reading; v (n,) becomes P Hᵀ."""
    n = x.shape[0]
    predicted = x[2] + x[7]
    if use_offset:
        predicted += x[6]
        for q in range(n):
            v[q] = P[2, q] + P[6, q] + P[7, q]
    else:
        for q in range(n):
            v[q] = P[2, q] + P[7, q]
    for k in range(columns.heading_param.shape[0]):
        c = columns.heading[h, k]
        j = 10 + columns.heading_param[k]
        predicted += c * x[j]
        for q in range(n):
            v[q] += c * P[j, q]
    s = events.yaw_var_rad2[h] + v[2] + v[7]
    if use_offset:
        s += v[6]
    for k in range(columns.heading_param.shape[0]):
        s += columns.heading[h, k] * v[10 + columns.heading_param[k]]
    return wrap_angle(events.yaw_rad[h] - predicted), s


@compiled
def _fix_row(port: int, c: float, ct: float, st: float) -> tuple[float, float]:
    """East and north derivative of a fix by a parameter whose column value is c."""
    if port == 0:
        return c * ct, c * st
    if port == 1:
        return -c * st, c * ct
    if port == 2:
        return c, 0.0
    return 0.0, c


@compiled
def _expect_fix(
    x: Floats, P: Floats, v: Floats, w: Floats, events: Events, columns: Columns, f: int, antenna: Floats
) -> tuple[float, float, float, float, float]:
    """Innovations east and north, S_ee, S_nn, S_en of one fix; v and w (n,) become P H_eᵀ and P H_nᵀ."""
    n = x.shape[0]
    kf = columns.fix_param.shape[0]
    ct = math.cos(x[2])
    st = math.sin(x[2])
    arm_forward, arm_left, shift_e, shift_n = 0.0, 0.0, 0.0, 0.0
    for k in range(kf):
        pc = columns.fix[f, k] * x[10 + columns.fix_param[k]]
        port = columns.fix_port[k]
        if port == 0:
            arm_forward += pc
        elif port == 1:
            arm_left += pc
        elif port == 2:
            shift_e += pc
        else:
            shift_n += pc
    antenna[f, 0] = x[0] + ct * arm_forward - st * arm_left + shift_e
    antenna[f, 1] = x[1] + st * arm_forward + ct * arm_left + shift_n
    nu_e = events.fix_east_m[f] - antenna[f, 0] - x[8]
    nu_n = events.fix_north_m[f] - antenna[f, 1] - x[9]
    he = -(st * arm_forward + ct * arm_left)
    hn = ct * arm_forward - st * arm_left
    for q in range(n):
        v[q] = P[0, q] + he * P[2, q] + P[8, q]
        w[q] = P[1, q] + hn * P[2, q] + P[9, q]
    for k in range(kf):
        j = 10 + columns.fix_param[k]
        ce, cn = _fix_row(columns.fix_port[k], columns.fix[f, k], ct, st)
        for q in range(n):
            v[q] += ce * P[j, q]
            w[q] += cn * P[j, q]
    see = events.fix_var_east_m2[f] + v[0] + he * v[2] + v[8]
    snn = events.fix_var_north_m2[f] + w[1] + hn * w[2] + w[9]
    sen = events.fix_cov_m2[f] + w[0] + he * w[2] + w[8]
    for k in range(kf):
        j = 10 + columns.fix_param[k]
        ce, cn = _fix_row(columns.fix_port[k], columns.fix[f, k], ct, st)
        see += ce * v[j]
        snn += cn * w[j]
        sen += ce * w[j]
    return nu_e, nu_n, see, snn, sen


@compiled
def forward(
    events: Events,
    columns: Columns,
    model: Model,
    x: Floats,
    P: Floats,
    memory: Floats,
    first: int,
    last: int,
    fixes_teach: bool,
    out: Output,
) -> None:
    """Run events first … last−1; x (n,), P (n, n) and memory are changed in place, so a pass can be continued.

    With ``fixes_teach`` false the fixes are predicted and compared, but teach the filter nothing (an outage).
    """
    n = x.shape[0]
    work = np.zeros((6, n))
    v = np.empty(n)
    w = np.empty(n)
    log_outlier_heading = math.log(OUTLIER_FRACTION / TWO_PI)
    log_outlier_fix = math.log(OUTLIER_FRACTION / OUTLIER_AREA_M2)
    log_inlier = math.log(1.0 - OUTLIER_FRACTION)
    last_dt_h, factor_h = -1.0, 1.0
    last_dt_f, factor_f = -1.0, 1.0
    walk = model.walk
    t_before = events.t_s[first - 1] if first > 0 else events.t_s[0]

    for i in range(first, last):
        t = events.t_s[i]
        dt = t - t_before
        t_before = t
        if dt > 0.0:
            for q in range(3, n):
                P[q, q] += walk[q] * dt
        right = events.right_rad[i]
        left = events.left_rad[i]
        right_clear = events.right_clear_rad[i]
        left_clear = events.left_clear_rad[i]
        standing = right == 0.0 and left == 0.0 and right_clear == 0.0 and left_clear == 0.0
        if not standing or events.loose_m2[i] > 0.0 or columns.motion_port.shape[0] > 0:
            _move(
                x,
                P,
                work,
                right,
                left,
                right_clear,
                left_clear,
                events.loose_m2[i],
                i,
                columns,
                model.slip2,
                model.linear,
            )

        h = events.heading_row[i]
        if h >= 0:
            if model.heading_coloured_var > 0.0:
                dth = t - memory[0]
                if dth != last_dt_h:
                    factor_h = math.exp(-dth / model.heading_tau_s)
                    last_dt_h = dth
                _decay(x, P, 7, factor_h, model.heading_coloured_var)
            memory[0] = t
            nu, s = _expect_heading(x, P, v, events, columns, model.use_offset, h)
            nis = nu * nu / s
            inlier = log_inlier - 0.5 * (nis + math.log(TWO_PI * s))
            weight = 1.0
            if model.soft_gate:
                weight = 1.0 / (1.0 + math.exp(min(log_outlier_heading - inlier, 50.0)))
                ok = weight > 0.5
            else:
                ok = nis <= model.heading_gate
            out.heading_nu[h] = nu
            out.heading_var[h] = s
            out.heading_ok[h] = ok
            out.total[0] -= (
                inlier + math.log1p(math.exp(log_outlier_heading - inlier))
                if inlier > log_outlier_heading
                else log_outlier_heading + math.log1p(math.exp(inlier - log_outlier_heading))
            )
            if not ok:
                if memory[4] == 0.0:
                    memory[5] = t
                memory[4] += 1.0
                if memory[4] >= model.recover_count and t - memory[5] >= model.recover_s:
                    state = 6 if model.use_offset else 2
                    P[state, state] += nu * nu
                    memory[4] = 0.0
                    memory[6] += 1.0
            else:
                memory[4] = 0.0
                inv_s = weight / s
                gain = nu * inv_s
                for q in range(n):
                    x[q] += v[q] * gain
                _downdate(P, v, inv_s)
                _clamp(x, model.lower, model.upper)

        f = events.fix_row[i]
        if f >= 0:
            if model.fix_coloured_var > 0.0:
                dtf = t - memory[1]
                if dtf != last_dt_f:
                    factor_f = math.exp(-dtf / model.fix_tau_s)
                    last_dt_f = dtf
                _decay(x, P, 8, factor_f, model.fix_coloured_var)
                _decay(x, P, 9, factor_f, model.fix_coloured_var)
            memory[1] = t
            nu_e, nu_n, see, snn, sen = _expect_fix(x, P, v, w, events, columns, f, out.antenna)
            ratio = sen / see
            s_n = snn - sen * ratio
            rest_n = nu_n - ratio * nu_e
            nis = nu_e * nu_e / see + rest_n * rest_n / s_n
            inlier = log_inlier - 0.5 * (nis + math.log(see * s_n)) - math.log(TWO_PI)
            weight = 1.0
            if model.soft_gate:
                weight = 1.0 / (1.0 + math.exp(min(log_outlier_fix - inlier, 50.0)))
                ok = weight > 0.5
            else:
                ok = nis <= model.fix_gate
            out.fix_nu[f, 0] = nu_e
            out.fix_nu[f, 1] = nu_n
            out.fix_var[f, 0] = see
            out.fix_var[f, 1] = snn
            out.fix_var[f, 2] = sen
            out.fix_ok[f] = ok
            out.total[1] -= (
                inlier + math.log1p(math.exp(log_outlier_fix - inlier))
                if inlier > log_outlier_fix
                else log_outlier_fix + math.log1p(math.exp(inlier - log_outlier_fix))
            )
            if fixes_teach:
                if not ok:
                    if memory[2] == 0.0:
                        memory[3] = t
                    memory[2] += 1.0
                    memory[8] = 0.0
                    if memory[2] >= model.recover_count and t - memory[3] >= model.recover_s:
                        memory[7] += 1.0
                        memory[6] += 1.0
                        memory[2] = 0.0
                        _open_position(x, P, nu_e, nu_n, memory[7], model.use_offset)
                else:
                    memory[2] = 0.0
                    memory[8] += 1.0
                    if memory[8] >= 10.0 * model.recover_count:
                        memory[7] = 0.0
                    inv_e = weight / see
                    for q in range(n):
                        w[q] -= ratio * v[q]
                    inv_n = weight / s_n
                    gain_e = nu_e * inv_e
                    gain_n = rest_n * inv_n
                    for q in range(n):
                        x[q] += v[q] * gain_e + w[q] * gain_n
                    _downdate(P, v, inv_e)
                    _downdate(P, w, inv_n)
                    _clamp(x, model.lower, model.upper)

        m = events.out_row[i]
        if m >= 0:
            for q in range(7):
                out.state[m, q] = x[q]
                out.sigma[m, q] = math.sqrt(max(P[q, q], 0.0))
