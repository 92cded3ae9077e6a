"""Prediction: one step of the wheels, and the decay of correlated errors. See sccal.filter.kernel for the equations."""

from __future__ import annotations

import math

from sccal.arrays import Floats
from sccal.compiled import compiled
from sccal.filter.layout import (
    BASE_STATES,
    PORT_ALONG,
    PORT_RIGHT_WHEEL,
    PORT_SIDE,
    PORT_TURN,
    RADIUS_LEFT,
    RADIUS_RIGHT,
    THETA,
    TRACK,
    Belief,
    Columns,
    X,
    Y,
)


@compiled
def move(
    belief: Belief,
    right: float,
    left: float,
    right_clear: float,
    left_clear: float,
    loose: float,
    row: int,
    columns: Columns,
    slip2: float,
    linear: Floats,
    work: Floats,
) -> None:
    """Predict the belief through one step of the wheels; work is (6, max(10, m))."""
    x, p, P, V = belief.x, belief.p, belief.core, belief.slope
    m = p.shape[0]
    ds, dt, dd = work[0], work[1], work[2]
    at_right = linear[0] if linear[0] > 0.0 else x[RADIUS_RIGHT]
    at_left = linear[1] if linear[1] > 0.0 else x[RADIUS_LEFT]
    inv_at_track = 1.0 / (linear[2] if linear[2] > 0.0 else x[TRACK])
    inv_track = 1.0 / x[TRACK]

    # What the effects add, and the derivatives of s, Δθ and d by their parameters.
    along, side, turn, more_right, more_left = 0.0, 0.0, 0.0, 0.0, 0.0
    for q in range(m):
        ds[q] = 0.0
        dt[q] = 0.0
        dd[q] = 0.0
    for k in range(columns.motion_port.shape[0]):
        c = columns.motion[row, k]
        q = columns.motion_param[k]
        port = columns.motion_port[k]
        if port == PORT_ALONG:
            along += p[q] * c
            ds[q] += c
        elif port == PORT_SIDE:
            side += p[q] * c
            dd[q] += c
        elif port == PORT_TURN:
            turn += p[q] * c
            dt[q] += c
        elif port == PORT_RIGHT_WHEEL:
            more_right += p[q] * c
            ds[q] += 0.5 * c
            dt[q] += c * inv_track
        else:
            more_left += p[q] * c
            ds[q] += 0.5 * c
            dt[q] -= c * inv_track
    along_right = x[RADIUS_RIGHT] * right + more_right
    along_left = x[RADIUS_LEFT] * left + more_left
    s = 0.5 * (along_right + along_left) + along
    dtheta = (along_right - along_left) * inv_track + turn

    middle = x[THETA] + 0.5 * dtheta
    cm = math.cos(middle)
    sm = math.sin(middle)
    ax = -(s * sm + side * cm)
    ay = s * cm - side * sm
    hx = 0.5 * ax
    hy = 0.5 * ay
    gs3 = 0.5 * right_clear
    gs4 = 0.5 * left_clear
    gt3 = right_clear * inv_at_track
    gt4 = -left_clear * inv_at_track
    gt5 = -(at_right * right_clear - at_left * left_clear + more_right - more_left) * inv_at_track * inv_at_track

    for q in range(m):
        along_q = ds[q] + gs3 * V[RADIUS_RIGHT, q] + gs4 * V[RADIUS_LEFT, q]
        turn_q = dt[q] + gt3 * V[RADIUS_RIGHT, q] + gt4 * V[RADIUS_LEFT, q] + gt5 * V[TRACK, q]
        V[X, q] += ax * V[THETA, q] + cm * along_q - sm * dd[q] + hx * turn_q
        V[Y, q] += ay * V[THETA, q] + sm * along_q + cm * dd[q] + hy * turn_q
        V[THETA, q] += turn_q

    # F differs from the identity in the three pose rows: left factor, right factor, mirror image.
    S, T = work[3], work[4]
    for q in range(BASE_STATES):
        S[q] = gs3 * P[RADIUS_RIGHT, q] + gs4 * P[RADIUS_LEFT, q]
        T[q] = gt3 * P[RADIUS_RIGHT, q] + gt4 * P[RADIUS_LEFT, q] + gt5 * P[TRACK, q]
    for q in range(BASE_STATES):
        P[X, q] += ax * P[THETA, q] + cm * S[q] + hx * T[q]
        P[Y, q] += ay * P[THETA, q] + sm * S[q] + hy * T[q]
        P[THETA, q] += T[q]
    for i in range(RADIUS_RIGHT):
        gsi = gs3 * P[i, RADIUS_RIGHT] + gs4 * P[i, RADIUS_LEFT]
        gti = gt3 * P[i, RADIUS_RIGHT] + gt4 * P[i, RADIUS_LEFT] + gt5 * P[i, TRACK]
        theta = P[i, THETA]
        P[i, X] += ax * theta + cm * gsi + hx * gti
        P[i, Y] += ay * theta + sm * gsi + hy * gti
        P[i, THETA] = theta + gti
    P[Y, X] = P[X, Y]
    P[THETA, X] = P[X, THETA]
    P[THETA, Y] = P[Y, THETA]

    # By the motion freed of slip: weights that grow with the slip itself would favour what slipped forward.
    var_right = slip2 * abs(at_right * right_clear) + loose
    var_left = slip2 * abs(at_left * left_clear) + loose
    qss = 0.25 * (var_right + var_left)
    qtt = (var_right + var_left) * inv_track * inv_track
    qst = 0.5 * (var_right - var_left) * inv_track
    P[X, X] += cm * cm * qss + 2.0 * cm * hx * qst + hx * hx * qtt
    P[Y, Y] += sm * sm * qss + 2.0 * sm * hy * qst + hy * hy * qtt
    P[THETA, THETA] += qtt
    xy = cm * sm * qss + (cm * hy + sm * hx) * qst + hx * hy * qtt
    xt = cm * qst + hx * qtt
    yt = sm * qst + hy * qtt
    P[X, Y] += xy
    P[Y, X] += xy
    P[X, THETA] += xt
    P[THETA, X] += xt
    P[Y, THETA] += yt
    P[THETA, Y] += yt
    for q in range(RADIUS_RIGHT, BASE_STATES):
        P[q, X] = P[X, q]
        P[q, Y] = P[Y, q]
        P[q, THETA] = P[THETA, q]

    x[X] += s * cm - side * sm
    x[Y] += s * sm + side * cm
    x[THETA] += dtheta


@compiled
def decay(belief: Belief, state: int, factor: float, stationary_var: float) -> None:
    """First-order Gauss-Markov step of one core state: x ← f x, variance towards the stationary one."""
    x, P, V = belief.x, belief.core, belief.slope
    x[state] *= factor
    for q in range(BASE_STATES):
        P[state, q] *= factor
    for q in range(BASE_STATES):
        P[q, state] = P[state, q]
    P[state, state] = P[state, state] * factor + (1.0 - factor * factor) * stationary_var
    for q in range(V.shape[1]):
        V[state, q] *= factor
