"""The filter once more, plain and slow: dense matrices, derivatives by complex steps, any float type.

It shares no line with the kernel. Motion and measurements are written once each, as functions of the state, and their
Jacobians are taken from these functions (Squire and Trapp 1998), so a wrong derivative in the kernel cannot hide here.

A measurement that counts only by its probability w of being no outlier has the variance R + S (1/w − 1).
"""

from __future__ import annotations

import numpy as np

from sccal.filter import layout as K

BASE = K.BASE_STATES
OUTLIERS = 0.01
OUTLIER_DENSITY = {1: 1 / (2 * np.pi), 2: 1e-4}
"""By the number of scalars: an outlying heading may be anything, an outlying fix anywhere in 100 m × 100 m."""


def motion(x, right, left, row, columns):
    """State after one step of the wheels; complex-safe."""
    along_right, along_left = x[3] * right, x[4] * left
    along = side = turn = 0.0
    for k, (port, param) in enumerate(zip(columns.motion_port, columns.motion_param, strict=True)):
        part = x[BASE + param] * columns.motion[row, k]
        along = along + part * (port == K.PORT_ALONG)
        side = side + part * (port == K.PORT_SIDE)
        turn = turn + part * (port == K.PORT_TURN)
        along_right = along_right + part * (port == K.PORT_RIGHT_WHEEL)
        along_left = along_left + part * (port == K.PORT_LEFT_WHEEL)
    s = (along_right + along_left) / 2 + along
    dtheta = (along_right - along_left) / x[5] + turn
    middle = x[2] + dtheta / 2
    after = x.copy()
    after[0] = x[0] + s * np.cos(middle) - side * np.sin(middle)
    after[1] = x[1] + s * np.sin(middle) + side * np.cos(middle)
    after[2] = x[2] + dtheta
    return after


def heading_reading(x, row, columns, use_offset):
    value = x[2] + x[7] + (x[6] if use_offset else 0.0) + columns.heading_known[row]
    beyond = x[2] - columns.heading_at[row]
    turns = np.floor((np.real(beyond) + np.pi) / (2 * np.pi))
    value = value + columns.heading_slope[row] * (beyond - 2 * np.pi * turns)
    for k, param in enumerate(columns.heading_param):
        value = value + x[BASE + param] * columns.heading[row, k]
    return np.array([value])


def fix_reading(x, row, columns):
    forward = left = east = north = 0.0
    for k, (port, param) in enumerate(zip(columns.fix_port, columns.fix_param, strict=True)):
        part = x[BASE + param] * columns.fix[row, k]
        forward = forward + part * (port == K.PORT_ANTENNA_FORWARD)
        left = left + part * (port == K.PORT_ANTENNA_LEFT)
        east = east + part * (port == K.PORT_EAST)
        north = north + part * (port == K.PORT_NORTH)
    at = x[2]
    if columns.fix_at.size and np.isfinite(columns.fix_at[row]):
        # About another heading: linear in the state, the product of two differences left out.
        beyond = x[2] - columns.fix_at[row]
        beyond = beyond - 2 * np.pi * np.floor((np.real(beyond) + np.pi) / (2 * np.pi))
        if abs(beyond) < 0.3:
            at = np.real(x[2] - beyond)
            c, s = np.cos(at), np.sin(at)
            east = east - (s * np.real(forward) + c * np.real(left)) * beyond
            north = north + (c * np.real(forward) - s * np.real(left)) * beyond
    c, s = np.cos(at), np.sin(at)
    return np.array([x[0] + x[8] + c * forward - s * left + east, x[1] + x[9] + s * forward + c * left + north])


def jacobian(function, x, step=1e-30):
    """Exact derivatives of a complex-safe function."""
    kind = np.clongdouble if x.dtype == np.longdouble else complex
    columns = []
    for k in range(x.size):
        shifted = x.astype(kind)
        shifted[k] += 1j * step
        columns.append(np.imag(function(shifted)) / step)
    return np.array(columns).T.astype(x.dtype)


def weight_of(nu, S, nis):
    """Probability that a measurement is no outlier."""
    determinant = float(S[0, 0]) if S.shape[0] == 1 else float(S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0])
    inlier = (1 - OUTLIERS) * np.exp(-nis / 2) / np.sqrt((2 * np.pi) ** nu.size * determinant)
    outlier = OUTLIERS * OUTLIER_DENSITY[nu.size]
    return inlier / (inlier + outlier), -np.log(inlier + outlier)


def taken(x, P, nu, H, R, gate, soft):
    """(x, P, accepted, negative log-likelihood) after one measurement, judged by a gate or weighed softly."""
    moved, shrunk, S, nis = update(x, P, nu, H, R)
    weight, nll = weight_of(nu, S, nis)
    if not soft:
        ok = nis <= gate
        return (moved, shrunk, ok, nll) if ok else (x, P, ok, nll)
    moved, shrunk, _, _ = update(x, P, nu, H, R + S * (1 / weight - 1))
    return moved, shrunk, weight > 0.5, nll


def update(x, P, nu, H, R):
    S = H @ P @ H.T + R
    if S.shape[0] == 1:
        inverse = 1.0 / S
    else:
        inverse = np.array([[S[1, 1], -S[0, 1]], [-S[1, 0], S[0, 0]]]) / (S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0])
    K_gain = P @ H.T @ inverse
    shrink = np.eye(x.size, dtype=x.dtype) - K_gain @ H
    return x + K_gain @ nu, shrink @ P @ shrink.T + K_gain @ R @ K_gain.T, S, float(nu @ inverse @ nu)


def run(events, columns, model, x, P, kind=np.float64):
    """All events; (x, P, heading innovations, fix innovations, accepted headings, accepted fixes, cost of both)."""
    x, P = x.astype(kind).copy(), P.astype(kind).copy()
    nu_h, nu_f, ok_h, ok_f, cost = [], [], [], [], np.zeros(2)
    t_before = t_heading = t_fix = events.t_s[0]
    for i, t in enumerate(events.t_s):
        P[np.arange(3, 10), np.arange(3, 10)] += model.walk[3:] * (t - t_before)
        t_before = t
        right, left = kind(events.right_rad[i]), kind(events.left_rad[i])
        F = jacobian(lambda z, r=right, le=left, i=i: motion(z, r, le, i, columns), x)
        variance = [model.slip2 * abs(r * a) + events.loose_m2[i] for r, a in ((x[3], right), (x[4], left))]
        # Travel of a wheel enters as its angle does: through the derivative by the angle, over the radius.
        B = jacobian(lambda z, i=i, x=x: motion(x.astype(z.dtype), z[0], z[1], i, columns), np.array([right, left]))
        B = B / np.array([x[3], x[4]])
        x = motion(x, right, left, i, columns)
        P = F @ P @ F.T + B @ np.diag(np.array(variance)) @ B.T

        h = events.heading_row[i]
        if h >= 0:
            if model.heading_coloured_var > 0:
                x, P = decay(x, P, 7, np.exp(-(t - t_heading) / model.heading_tau_s), model.heading_coloured_var)
            t_heading = t

            def reading(z, h=h):
                return heading_reading(z, h, columns, model.use_offset)

            nu = events.yaw_rad[h] - reading(x)
            nu = (nu + np.pi) % (2 * np.pi) - np.pi
            H = jacobian(reading, x)
            R = np.array([[kind(events.yaw_var_rad2[h])]])
            nu_h.append(float(nu[0]))
            x, P, ok, nll = taken(x, P, nu, H, R, model.heading_gate, model.soft_gate)
            ok_h.append(ok)
            cost[0] += nll

        f = events.fix_row[i]
        if f >= 0:
            if model.fix_coloured_var > 0:
                factor = np.exp(-(t - t_fix) / model.fix_tau_s)
                x, P = decay(x, P, 8, factor, model.fix_coloured_var)
                x, P = decay(x, P, 9, factor, model.fix_coloured_var)
            t_fix = t

            def position(z, f=f):
                return fix_reading(z, f, columns)

            nu = np.array([events.fix_east_m[f], events.fix_north_m[f]], dtype=kind) - position(x)
            cov = events.fix_cov_m2[f]
            R = np.array([[events.fix_var_east_m2[f], cov], [cov, events.fix_var_north_m2[f]]], dtype=kind)
            nu_f.append([float(v) for v in nu])
            x, P, ok, nll = taken(x, P, nu, jacobian(position, x), R, model.fix_gate, model.soft_gate)
            ok_f.append(ok)
            cost[1] += nll
    return x, P, np.array(nu_h), np.array(nu_f).reshape(-1, 2), np.array(ok_h), np.array(ok_f), cost


def decay(x, P, state, factor, stationary_var):
    x, P = x.copy(), P.copy()
    x[state] *= factor
    P[state, :] *= factor
    P[:, state] *= factor
    P[state, state] += (1 - factor**2) * stationary_var
    return x, P
