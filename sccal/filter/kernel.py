"""The compiled self-calibrating filter: one event loop, ports and columns, no effect by name.

Core state::

    0 x   1 y   2 θ   3 R_r   4 R_l   5 L   6 Ofs   7 b_h   8 b_e   9 b_n

x … Ofs are the state of Cantelli, Ligama, Muscato and Spina, Robotics 2016, 5(4), 23 (their section 3). b_h, b_e and
b_n are the correlated parts of the heading error and of the fix error, first-order Gauss-Markov; with standard
deviation zero they vanish and the filter is the paper's. Beside them stand the parameters p of effects, each entering
at a port through a column computed beforehand.

Prediction with the wheel angles φ_r and φ_l turned between two events, mid-arc heading::

    a_r = R_r φ_r + Σ p c      a_l = R_l φ_l + Σ p c
    s = (a_r + a_l)/2 + Σ p c      d = Σ p c      Δθ = (a_r − a_l)/L + Σ p c
    x += s cos(θ + Δθ/2) − d sin(θ + Δθ/2)
    y += s sin(θ + Δθ/2) + d cos(θ + Δθ/2)
    θ += Δθ

The derivatives by the constants may be taken at fixed values of them: a running estimate that wanders makes a filter
believe that it has seen directions of the parameter space that the drive never showed (Huang, Mourikis and Roumeliotis
2008, on first-estimates Jacobians). They use the wheels' motion freed of slip (see sccal.align.denoise).

Process noise enters by the two wheels: variance slip² |R φ| + the event's own extra variance.

Measurements::

    heading   z = θ + Ofs + b_h + Σ p c + k + (θ − θ₀) e
    fix       z = (x + b_e, y + b_n) + Rot(θ) (Σ p c_forward, Σ p c_left) + (Σ p c_east, Σ p c_north)

k and e are zero but for effects that are not linear in the heading or in their parameters (iron): there c is the
derivative by p at the last answer, e the one by the heading, θ₀ the heading on the last path, and k what makes the sum
exact at them.

Parameters do not move, so the filter is held in two stages (Friedland 1969, Treatment of bias in recursive filtering):
the core state as if they were known, covariance C (10, 10); how its estimate depends on them, V (10, m); and their own
covariance Π (m, m). A prediction V ← F V + B costs m, and only a measurement m². With H and D the derivatives of one
scalar measurement by the core and by the parameters, and R its variance::

    g = H V + D     s̃ = H C Hᵀ + R     s = s̃ + g Π gᵀ
    x += (C Hᵀ + V Π gᵀ) ν/s     p += Π gᵀ ν/s
    V −= C Hᵀ g/s̃     C −= C Hᵀ H C/s̃     Π −= Π gᵀ g Π/s

which is the filter with all of them in one state, digit for digit but for rounding. A fix is one 2-vector update, done
as two scalar ones after decorrelation, so both are linearised at the same state. A measurement that counts only by a
weight w has the variance R + s (1/w − 1).
"""

from __future__ import annotations

import math

import numpy as np

from sccal.arrays import Floats
from sccal.compiled import compiled
from sccal.filter.layout import (
    BASE_STATES,
    EAST_BIAS,
    HEADING_BIAS,
    MEM_ACCEPTED_SINCE,
    MEM_FIX_LEVEL,
    MEM_FIX_REJECTED,
    MEM_FIX_SINCE,
    MEM_FIX_T,
    MEM_HEADING_REJECTED,
    MEM_HEADING_SINCE,
    MEM_HEADING_T,
    MEM_RECOVERIES,
    NORTH_BIAS,
    OFFSET,
    RADIUS_RIGHT,
    REPORTED_STATES,
    THETA,
    TRACK,
    Belief,
    Columns,
    Events,
    Model,
    Output,
    X,
    Y,
)
from sccal.filter.measurement import TWO_PI, clamp, dot, dot_row, expect_fix, expect_heading, learn, learn_fix, times
from sccal.filter.motion import decay, move

OUTLIER_FRACTION = 0.01
OUTLIER_AREA_M2 = 1.0e4
OPENED_AT_MOST_M = 1.0e4
LOG_INLIER = math.log(1.0 - OUTLIER_FRACTION)
LOG_OUTLIER_HEADING = math.log(OUTLIER_FRACTION / TWO_PI)
LOG_OUTLIER_FIX = math.log(OUTLIER_FRACTION / OUTLIER_AREA_M2)


@compiled
def _open_position(belief: Belief, nu_e: float, nu_n: float, level: float, model: Model) -> None:
    """The way back from a lock-out: forget the position, and step by step what else may have been wrong.

    Level 1 forgets the position; level 2 the heading too, together with the opposite change of the offset, so that
    the AHRS reading stays explained; from level 3 on the wheels are given 5 % more, unless the pass estimates: to
    forget a constant there would be to unlearn what the log has said of it. What lies beyond OPENED_AT_MOST_M is moved
    at once: a variance of thousands of kilometres squared leaves no digits for what a fix then teaches.
    """
    x, P, V = belief.x, belief.core, belief.slope
    away = math.hypot(nu_e, nu_n)
    if away > OPENED_AT_MOST_M:
        beyond = 1.0 - OPENED_AT_MOST_M / away
        x[X] += beyond * nu_e
        x[Y] += beyond * nu_n
        nu_e -= beyond * nu_e
        nu_n -= beyond * nu_n
    for state in range(2):
        for q in range(BASE_STATES):
            P[state, q] = 0.0
            P[q, state] = 0.0
        for q in range(V.shape[1]):
            V[state, q] = 0.0
    spread = 4.0 * (nu_e * nu_e + nu_n * nu_n) + 1.0
    P[X, X] = spread
    P[Y, Y] = spread
    if level >= 2:
        turn = (0.35 * (level - 1.0)) ** 2
        P[THETA, THETA] += turn
        if model.use_offset:
            P[THETA, OFFSET] -= turn
            P[OFFSET, THETA] -= turn
            P[OFFSET, OFFSET] += turn
    if level >= 3 and not model.soft_gate:
        for q in range(RADIUS_RIGHT, TRACK + 1):
            P[q, q] += (0.05 * x[q]) ** 2


@compiled
def _mixture(inlier: float, outlier: float) -> float:
    """log(exp(inlier) + exp(outlier))."""
    if inlier > outlier:
        return inlier + math.log1p(math.exp(outlier - inlier))
    return outlier + math.log1p(math.exp(inlier - outlier))


@compiled
def _judged(inlier: float, outlier: float, nis: float, gate: float, soft: bool) -> tuple[float, bool]:
    """By how much a measurement counts, and whether it is accepted: softly by its probability, or by its gate."""
    if not soft:
        return 1.0, nis <= gate
    weight = 1.0 / (1.0 + math.exp(min(outlier - inlier, 50.0)))
    return weight, weight > 0.5


@compiled
def _take_heading(
    belief: Belief,
    events: Events,
    columns: Columns,
    model: Model,
    memory: Floats,
    work: Floats,
    t: float,
    h: int,
    out: Output,
) -> None:
    """One heading reading: expect, judge, learn or reject."""
    v, g, q = work[0], work[1], work[2]
    nu, s_core, s = expect_heading(belief, v, g, q, events, columns, model.use_offset, h)
    nis = nu * nu / s
    inlier = LOG_INLIER - 0.5 * (nis + math.log(TWO_PI * s))
    weight, ok = _judged(inlier, LOG_OUTLIER_HEADING, nis, model.heading_gate, model.soft_gate)
    out.heading_nu[h] = nu
    out.heading_var[h] = s
    out.heading_ok[h] = ok
    out.total[0] -= _mixture(inlier, LOG_OUTLIER_HEADING)
    if ok or model.soft_gate:
        learn(belief, v, s_core + s * (1.0 / weight - 1.0), g, q, s / weight, nu)
        clamp(belief.x, model.lower, model.upper)
    if ok:
        memory[MEM_HEADING_REJECTED] = 0.0
        return
    if memory[MEM_HEADING_REJECTED] == 0.0:
        memory[MEM_HEADING_SINCE] = t
    memory[MEM_HEADING_REJECTED] += 1.0
    if memory[MEM_HEADING_REJECTED] >= model.recover_count and t - memory[MEM_HEADING_SINCE] >= model.recover_s:
        state = OFFSET if model.use_offset else THETA
        belief.core[state, state] += nu * nu
        memory[MEM_HEADING_REJECTED] = 0.0
        memory[MEM_RECOVERIES] += 1.0


@compiled
def _take_fix(
    belief: Belief,
    events: Events,
    columns: Columns,
    model: Model,
    memory: Floats,
    work: Floats,
    t: float,
    f: int,
    fixes_teach: bool,
    out: Output,
) -> None:
    """One fix: expect, judge, learn or reject."""
    v, w, g_e, g_n, q_e, q_n = work[0], work[1], work[2], work[3], work[4], work[5]
    m = belief.p.shape[0]
    nu_e, nu_n, core_ee, core_nn, core_en = expect_fix(belief, v, w, g_e, g_n, events, columns, f, out.antenna)
    times(belief.params, g_e, q_e)
    times(belief.params, g_n, q_n)
    see = core_ee + dot(g_e, q_e, m)
    snn = core_nn + dot(g_n, q_n, m)
    sen = core_en + dot(g_e, q_n, m)
    ratio = sen / see
    s_n = snn - sen * ratio
    rest_n = nu_n - ratio * nu_e
    nis = nu_e * nu_e / see + rest_n * rest_n / s_n
    inlier = LOG_INLIER - 0.5 * (nis + math.log(see * s_n)) - math.log(TWO_PI)
    weight, ok = _judged(inlier, LOG_OUTLIER_FIX, nis, model.fix_gate, model.soft_gate)
    out.fix_nu[f, 0] = nu_e
    out.fix_nu[f, 1] = nu_n
    out.fix_var[f, 0] = see
    out.fix_var[f, 1] = snn
    out.fix_var[f, 2] = sen
    out.fix_ok[f] = ok
    out.total[1] -= _mixture(inlier, LOG_OUTLIER_FIX)
    if not fixes_teach:
        return
    if not ok:
        if memory[MEM_FIX_REJECTED] == 0.0:
            memory[MEM_FIX_SINCE] = t
        memory[MEM_FIX_REJECTED] += 1.0
        memory[MEM_ACCEPTED_SINCE] = 0.0
        if memory[MEM_FIX_REJECTED] >= model.recover_count and t - memory[MEM_FIX_SINCE] >= model.recover_s:
            memory[MEM_FIX_LEVEL] += 1.0
            memory[MEM_RECOVERIES] += 1.0
            memory[MEM_FIX_REJECTED] = 0.0
            _open_position(belief, nu_e, nu_n, memory[MEM_FIX_LEVEL], model)
            return
        if not model.soft_gate:
            return
    else:
        memory[MEM_FIX_REJECTED] = 0.0
        memory[MEM_ACCEPTED_SINCE] += 1.0
        if memory[MEM_ACCEPTED_SINCE] >= 10.0 * model.recover_count:
            memory[MEM_FIX_LEVEL] = 0.0
    less = 1.0 / weight - 1.0
    core_ee += less * see
    core_nn += less * snn
    core_en += less * sen
    learn_fix(belief, v, w, (core_ee, core_nn, core_en), work, (see / weight, s_n / weight, ratio), (nu_e, rest_n))
    clamp(belief.x, model.lower, model.upper)


@compiled
def _write(belief: Belief, row: int, out: Output) -> None:
    """The reported states, and their sigmas where there is room for them."""
    m = belief.p.shape[0]
    for i in range(REPORTED_STATES):
        out.state[row, i] = belief.x[i]
    if row >= out.sigma.shape[0]:
        return
    for i in range(REPORTED_STATES):
        slope = belief.slope[i]
        variance = belief.core[i, i]
        for k in range(m):
            if slope[k] != 0.0:
                variance += slope[k] * dot_row(belief.params, k, slope, m)
        out.sigma[row, i] = math.sqrt(max(variance, 0.0))


@compiled
def forward(
    events: Events,
    columns: Columns,
    model: Model,
    belief: Belief,
    memory: Floats,
    first: int,
    last: int,
    fixes_teach: bool,
    out: Output,
) -> None:
    """Run events first … last−1; belief and memory are changed in place, so a pass can be continued.

    With ``fixes_teach`` false the fixes are predicted and compared, but teach the filter nothing (an outage).
    """
    work = np.zeros((6, max(BASE_STATES, belief.p.shape[0])))
    last_dt_h, factor_h = -1.0, 1.0
    last_dt_f, factor_f = -1.0, 1.0
    P, walk = belief.core, model.walk
    has_columns = columns.motion_port.shape[0] > 0
    t_before = events.t_s[first - 1] if first > 0 else events.t_s[0]

    for i in range(first, last):
        t = events.t_s[i]
        dt = t - t_before
        t_before = t
        if dt > 0.0:
            for q in range(RADIUS_RIGHT, OFFSET + 1):
                P[q, q] += walk[q] * dt
        right = events.right_rad[i]
        left = events.left_rad[i]
        right_clear = events.right_clear_rad[i]
        left_clear = events.left_clear_rad[i]
        standing = right == 0.0 and left == 0.0 and right_clear == 0.0 and left_clear == 0.0
        if not standing or events.loose_m2[i] > 0.0 or has_columns:
            loose = events.loose_m2[i]
            move(belief, right, left, right_clear, left_clear, loose, i, columns, model.slip2, model.linear, work)

        h = events.heading_row[i]
        if h >= 0:
            if model.heading_coloured_var > 0.0:
                dth = t - memory[MEM_HEADING_T]
                if dth != last_dt_h:
                    factor_h = math.exp(-dth / model.heading_tau_s)
                    last_dt_h = dth
                decay(belief, HEADING_BIAS, factor_h, model.heading_coloured_var)
            memory[MEM_HEADING_T] = t
            _take_heading(belief, events, columns, model, memory, work, t, h, out)

        f = events.fix_row[i]
        if f >= 0:
            if model.fix_coloured_var > 0.0:
                dtf = t - memory[MEM_FIX_T]
                if dtf != last_dt_f:
                    factor_f = math.exp(-dtf / model.fix_tau_s)
                    last_dt_f = dtf
                decay(belief, EAST_BIAS, factor_f, model.fix_coloured_var)
                decay(belief, NORTH_BIAS, factor_f, model.fix_coloured_var)
            memory[MEM_FIX_T] = t
            _take_fix(belief, events, columns, model, memory, work, t, f, fixes_teach, out)

        if events.out_row[i] >= 0:
            _write(belief, events.out_row[i], out)
