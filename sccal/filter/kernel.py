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

Process noise enters by the two wheels: variance slip² |R φ| + the event's own extra variance.

Measurements::

    heading   z = θ + Ofs + b_h + Σ p c
    fix       z = (x + b_e, y + b_n) + Rot(θ) (Σ p c_forward, Σ p c_left) + (Σ p c_east, Σ p c_north)

The covariance is held in full, and every operation on it is symmetric to the last bit: rank-one downdates are formed
as (v_i v_j)/S, and the three rows that a prediction changes are mirrored. A fix is one 2-vector update, done as two
scalar ones after decorrelation, so both are linearised at the same state.
"""

from __future__ import annotations

import math

import numpy as np

from sccal.arrays import Floats
from sccal.compiled import compiled
from sccal.filter.layout import (
    BASE_STATES,
    MEM_ACCEPTED_SINCE,
    MEM_FIX_LEVEL,
    MEM_FIX_REJECTED,
    MEM_FIX_SINCE,
    MEM_FIX_T,
    MEM_HEADING_REJECTED,
    MEM_HEADING_SINCE,
    MEM_HEADING_T,
    MEM_RECOVERIES,
    PORT_ALONG,
    PORT_ANTENNA_FORWARD,
    PORT_ANTENNA_LEFT,
    PORT_EAST,
    PORT_RIGHT_WHEEL,
    PORT_SIDE,
    PORT_TURN,
    Columns,
    Events,
    Model,
    Output,
)

TWO_PI = 2.0 * math.pi
OUTLIER_FRACTION = 0.01
OUTLIER_AREA_M2 = 1.0e4
OPENED_AT_MOST_M = 1.0e4


@compiled
def wrap_angle(angle: float) -> float:
    """Angle in [−π, π)."""
    return angle - TWO_PI * math.floor((angle + math.pi) / TWO_PI)


@compiled
def step_of(x: Floats, right: float, left: float, row: int, columns: Columns) -> tuple[float, float, float, float]:
    """s, d and Δθ of one step, and how much further the effects move the right wheel than the left one."""
    along, side, turn, more_right, more_left = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(columns.motion_port.shape[0]):
        pc = x[BASE_STATES + columns.motion_param[k]] * columns.motion[row, k]
        port = columns.motion_port[k]
        if port == PORT_ALONG:
            along += pc
        elif port == PORT_SIDE:
            side += pc
        elif port == PORT_TURN:
            turn += pc
        elif port == PORT_RIGHT_WHEEL:
            more_right += pc
        else:
            more_left += pc
    along_right = x[3] * right + more_right
    along_left = x[4] * left + more_left
    s = 0.5 * (along_right + along_left) + along
    return s, side, (along_right - along_left) / x[5] + turn, more_right - more_left


@compiled
def shares_of(port: int, c: float, inv_track: float) -> tuple[float, float, float]:
    """Derivatives of s, Δθ and d by a parameter whose column value is c."""
    if port == PORT_ALONG:
        return c, 0.0, 0.0
    if port == PORT_SIDE:
        return 0.0, 0.0, c
    if port == PORT_TURN:
        return 0.0, c, 0.0
    if port == PORT_RIGHT_WHEEL:
        return 0.5 * c, c * inv_track, 0.0
    return 0.5 * c, -c * inv_track, 0.0


@compiled
def move(
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
    s, side, dtheta, effects = step_of(x, right, left, row, columns)
    inv_track = 1.0 / x[5]
    for k in range(km):
        j = BASE_STATES + columns.motion_param[k]
        gs[j] = 0.0
        gt[j] = 0.0
        gd[j] = 0.0
    for k in range(km):
        c = columns.motion[row, k]
        j = BASE_STATES + columns.motion_param[k]
        along, turn, across = shares_of(columns.motion_port[k], c, inv_track)
        gs[j] += along
        gt[j] += turn
        gd[j] += across

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
    gt5 = -(at_right * right_clear - at_left * left_clear + effects) * inv_at_track * inv_at_track

    for q in range(n):
        S[q] = gs3 * P[3, q] + gs4 * P[4, q]
        T[q] = gt3 * P[3, q] + gt4 * P[4, q] + gt5 * P[5, q]
        D[q] = 0.0
    for k in range(km):
        j = BASE_STATES + columns.motion_param[k]
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
            j = BASE_STATES + columns.motion_param[k]
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

    # By the motion freed of slip: weights that grow with the slip itself would favour what slipped forward.
    var_right = slip2 * abs(at_right * right_clear) + loose
    var_left = slip2 * abs(at_left * left_clear) + loose
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
def decay(x: Floats, P: Floats, state: int, factor: float, stationary_var: float) -> None:
    """First-order Gauss-Markov step of one state: x ← f x, variance towards the stationary one."""
    n = x.shape[0]
    x[state] *= factor
    for q in range(n):
        P[state, q] *= factor
    for q in range(n):
        P[q, state] = P[state, q]
    P[state, state] = P[state, state] * factor + (1.0 - factor * factor) * stationary_var


@compiled
def downdate(P: Floats, v: Floats, inv_s: float) -> None:
    """P ← P − v vᵀ/S, symmetric to the last bit."""
    n = v.shape[0]
    for i in range(n):
        vi = v[i]
        for j in range(n):
            P[i, j] -= (vi * v[j]) * inv_s


@compiled
def clamp(x: Floats, lower: Floats, upper: Floats) -> None:
    """Hold R_r, R_l and L within their numeric limits."""
    for k in range(3):
        if x[3 + k] < lower[k]:
            x[3 + k] = lower[k]
        elif x[3 + k] > upper[k]:
            x[3 + k] = upper[k]


@compiled
def _open_position(x: Floats, P: Floats, nu_e: float, nu_n: float, level: float, use_offset: bool) -> None:
    """The way back from a lock-out: forget the position, and step by step what else may have been wrong.

    Level 1 forgets the position; level 2 the heading too, together with the opposite change of the offset, so that
    the AHRS reading stays explained; from level 3 on the wheels are given 5 % more. What lies beyond OPENED_AT_MOST_M
    is moved at once: a variance of thousands of kilometres squared leaves no digits for what a fix then teaches.
    """
    n = x.shape[0]
    away = math.hypot(nu_e, nu_n)
    if away > OPENED_AT_MOST_M:
        beyond = 1.0 - OPENED_AT_MOST_M / away
        x[0] += beyond * nu_e
        x[1] += beyond * nu_n
        nu_e -= beyond * nu_e
        nu_n -= beyond * nu_n
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
def expect_heading(
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
        j = BASE_STATES + columns.heading_param[k]
        predicted += c * x[j]
        for q in range(n):
            v[q] += c * P[j, q]
    s = events.yaw_var_rad2[h] + v[2] + v[7]
    if use_offset:
        s += v[6]
    for k in range(columns.heading_param.shape[0]):
        s += columns.heading[h, k] * v[BASE_STATES + columns.heading_param[k]]
    return wrap_angle(events.yaw_rad[h] - predicted), s


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
    x: Floats, P: Floats, v: Floats, w: Floats, events: Events, columns: Columns, f: int, antenna: Floats
) -> tuple[float, float, float, float, float]:
    """Innovations east and north, S_ee, S_nn, S_en of one fix; v and w (n,) become P H_eᵀ and P H_nᵀ."""
    n = x.shape[0]
    kf = columns.fix_param.shape[0]
    ct = math.cos(x[2])
    st = math.sin(x[2])
    arm_forward, arm_left, shift_e, shift_n = 0.0, 0.0, 0.0, 0.0
    for k in range(kf):
        pc = columns.fix[f, k] * x[BASE_STATES + columns.fix_param[k]]
        port = columns.fix_port[k]
        if port == PORT_ANTENNA_FORWARD:
            arm_forward += pc
        elif port == PORT_ANTENNA_LEFT:
            arm_left += pc
        elif port == PORT_EAST:
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
        j = BASE_STATES + columns.fix_param[k]
        ce, cn = fix_row(columns.fix_port[k], columns.fix[f, k], ct, st)
        for q in range(n):
            v[q] += ce * P[j, q]
            w[q] += cn * P[j, q]
    see = events.fix_var_east_m2[f] + v[0] + he * v[2] + v[8]
    snn = events.fix_var_north_m2[f] + w[1] + hn * w[2] + w[9]
    sen = events.fix_cov_m2[f] + w[0] + he * w[2] + w[8]
    for k in range(kf):
        j = BASE_STATES + columns.fix_param[k]
        ce, cn = fix_row(columns.fix_port[k], columns.fix[f, k], ct, st)
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
            move(
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
                dth = t - memory[MEM_HEADING_T]
                if dth != last_dt_h:
                    factor_h = math.exp(-dth / model.heading_tau_s)
                    last_dt_h = dth
                decay(x, P, 7, factor_h, model.heading_coloured_var)
            memory[MEM_HEADING_T] = t
            nu, s = expect_heading(x, P, v, events, columns, model.use_offset, h)
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
                if memory[MEM_HEADING_REJECTED] == 0.0:
                    memory[MEM_HEADING_SINCE] = t
                memory[MEM_HEADING_REJECTED] += 1.0
                if (
                    memory[MEM_HEADING_REJECTED] >= model.recover_count
                    and t - memory[MEM_HEADING_SINCE] >= model.recover_s
                ):
                    state = 6 if model.use_offset else 2
                    P[state, state] += nu * nu
                    memory[MEM_HEADING_REJECTED] = 0.0
                    memory[MEM_RECOVERIES] += 1.0
            else:
                memory[MEM_HEADING_REJECTED] = 0.0
                inv_s = weight / s
                gain = nu * inv_s
                for q in range(n):
                    x[q] += v[q] * gain
                downdate(P, v, inv_s)
                clamp(x, model.lower, model.upper)

        f = events.fix_row[i]
        if f >= 0:
            if model.fix_coloured_var > 0.0:
                dtf = t - memory[MEM_FIX_T]
                if dtf != last_dt_f:
                    factor_f = math.exp(-dtf / model.fix_tau_s)
                    last_dt_f = dtf
                decay(x, P, 8, factor_f, model.fix_coloured_var)
                decay(x, P, 9, factor_f, model.fix_coloured_var)
            memory[MEM_FIX_T] = t
            nu_e, nu_n, see, snn, sen = expect_fix(x, P, v, w, events, columns, f, out.antenna)
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
                    if memory[MEM_FIX_REJECTED] == 0.0:
                        memory[MEM_FIX_SINCE] = t
                    memory[MEM_FIX_REJECTED] += 1.0
                    memory[MEM_ACCEPTED_SINCE] = 0.0
                    if memory[MEM_FIX_REJECTED] >= model.recover_count and t - memory[MEM_FIX_SINCE] >= model.recover_s:
                        memory[MEM_FIX_LEVEL] += 1.0
                        memory[MEM_RECOVERIES] += 1.0
                        memory[MEM_FIX_REJECTED] = 0.0
                        _open_position(x, P, nu_e, nu_n, memory[MEM_FIX_LEVEL], model.use_offset)
                else:
                    memory[MEM_FIX_REJECTED] = 0.0
                    memory[MEM_ACCEPTED_SINCE] += 1.0
                    if memory[MEM_ACCEPTED_SINCE] >= 10.0 * model.recover_count:
                        memory[MEM_FIX_LEVEL] = 0.0
                    inv_e = weight / see
                    for q in range(n):
                        w[q] -= ratio * v[q]
                    inv_n = weight / s_n
                    gain_e = nu_e * inv_e
                    gain_n = rest_n * inv_n
                    for q in range(n):
                        x[q] += v[q] * gain_e + w[q] * gain_n
                    downdate(P, v, inv_e)
                    downdate(P, w, inv_n)
                    clamp(x, model.lower, model.upper)

        m = events.out_row[i]
        if m >= 0:
            for q in range(7):
                out.state[m, q] = x[q]
                out.sigma[m, q] = math.sqrt(max(P[q, q], 0.0))
