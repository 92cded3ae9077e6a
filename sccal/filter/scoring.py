"""One pass that scores every candidate: sensitivities of the filter to parameters held at zero.

Separate-bias estimation (Friedland 1969): beside state and covariance, carry S = ∂x/∂p for all K candidates. In the
prediction S ← F S + B, in an update g = H S + D (the derivative of the expected measurement) and S ← S − K g. The
innovation of a filter that knew p would be ν − g p, so over blocks of time

    u = Σ gᵀν/σ²        I = Σ gᵀg/σ²

give the best values I⁻¹u and the gain in log-likelihood ½ uᵀI⁻¹u of any set of candidates, without another pass.
Rejected measurements count for nothing. Candidates may act at the same ports as the effects already in the filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats, Ints, Rows
from sccal.compiled import compiled
from sccal.filter.kernel import clamp, decay, downdate, expect_fix, expect_heading, fix_row, move, shares_of, step_of
from sccal.filter.layout import (
    BASE_STATES,
    MEM_FIX_T,
    MEM_HEADING_T,
    Columns,
    Events,
    Model,
)


@dataclass(frozen=True)
class Scores:
    """What one pass says about K candidates, block by block."""

    u: Floats
    """(b, K)"""
    information: Floats
    """(b, K, K)"""
    cost: Floats
    """(b,) Σ ν²/σ² of the accepted measurements."""
    count: Ints
    """(b,) accepted scalar measurements."""


@compiled
def _carry(
    S: Floats,
    x: Floats,
    right: float,
    left: float,
    right_clear: float,
    left_clear: float,
    row: int,
    columns: Columns,
    candidates: Columns,
    linear: Floats,
    slopes: Floats,
) -> None:
    """S ← F S + B through one step; x is still the state before it."""
    n_candidates = S.shape[1]
    ds, dt, dd = slopes[0], slopes[1], slopes[2]
    s, side, dtheta, effects = step_of(x, right, left, row, columns)
    middle = x[2] + 0.5 * dtheta
    cm = math.cos(middle)
    sm = math.sin(middle)
    ax = -(s * sm + side * cm)
    ay = s * cm - side * sm
    at_right = linear[0] if linear[0] > 0.0 else x[3]
    at_left = linear[1] if linear[1] > 0.0 else x[4]
    inv_at_track = 1.0 / (linear[2] if linear[2] > 0.0 else x[5])
    inv_track = 1.0 / x[5]
    gt3 = right_clear * inv_at_track
    gt4 = -left_clear * inv_at_track
    gt5 = -(at_right * right_clear - at_left * left_clear + effects) * inv_at_track * inv_at_track
    for q in range(n_candidates):
        ds[q] = 0.5 * (right_clear * S[3, q] + left_clear * S[4, q])
        dt[q] = gt3 * S[3, q] + gt4 * S[4, q] + gt5 * S[5, q]
        dd[q] = 0.0
    for k in range(columns.motion_port.shape[0]):
        c = columns.motion[row, k]
        j = BASE_STATES + columns.motion_param[k]
        along, turn, across = shares_of(columns.motion_port[k], c, inv_track)
        for q in range(n_candidates):
            ds[q] += along * S[j, q]
            dt[q] += turn * S[j, q]
            dd[q] += across * S[j, q]
    for k in range(candidates.motion_port.shape[0]):
        q = candidates.motion_param[k]
        along, turn, across = shares_of(candidates.motion_port[k], candidates.motion[row, k], inv_track)
        ds[q] += along
        dt[q] += turn
        dd[q] += across
    for q in range(n_candidates):
        S[0, q] += ax * S[2, q] + cm * ds[q] - sm * dd[q] + 0.5 * ax * dt[q]
        S[1, q] += ay * S[2, q] + sm * ds[q] + cm * dd[q] + 0.5 * ay * dt[q]
        S[2, q] += dt[q]


@compiled
def _tally(u: Floats, information: Floats, g: Floats, nu: float, inv_s: float) -> None:
    """Add one scalar measurement to a block's u (K,) and upper triangle of I (K, K)."""
    n_candidates = g.shape[0]
    for i in range(n_candidates):
        gi = g[i] * inv_s
        u[i] += gi * nu
        if gi != 0.0:
            for j in range(i, n_candidates):
                information[i, j] += gi * g[j]


@compiled
def _absorb(S: Floats, v: Floats, g: Floats, inv_s: float) -> None:
    """S ← S − K g with the gain K = v/S of one scalar measurement."""
    for i in range(S.shape[0]):
        gain = v[i] * inv_s
        for q in range(S.shape[1]):
            S[i, q] -= gain * g[q]


@compiled
def _score(
    events: Events,
    columns: Columns,
    candidates: Columns,
    model: Model,
    x: Floats,
    P: Floats,
    block: Rows,
    u: Floats,
    information: Floats,
    cost: Floats,
    count: Ints,
    antenna: Floats,
) -> None:
    n = x.shape[0]
    n_candidates = u.shape[1]
    S = np.zeros((n, n_candidates))
    slopes = np.zeros((3, n_candidates))
    work = np.zeros((6, n))
    v = np.empty(n)
    w = np.empty(n)
    g = np.empty(n_candidates)
    g_n = np.empty(n_candidates)
    memory = np.zeros(2)
    memory[MEM_HEADING_T] = events.t_s[0]
    memory[MEM_FIX_T] = events.t_s[0]
    t_before = events.t_s[0]
    for i in range(events.t_s.shape[0]):
        t = events.t_s[i]
        b = block[i]
        for q in range(3, n):
            P[q, q] += model.walk[q] * (t - t_before)
        t_before = t
        right, left = events.right_rad[i], events.left_rad[i]
        right_clear, left_clear = events.right_clear_rad[i], events.left_clear_rad[i]
        _carry(S, x, right, left, right_clear, left_clear, i, columns, candidates, model.linear, slopes)
        move(
            x, P, work, right, left, right_clear, left_clear, events.loose_m2[i], i, columns, model.slip2, model.linear
        )

        h = events.heading_row[i]
        if h >= 0:
            if model.heading_coloured_var > 0.0:
                factor = math.exp(-(t - memory[MEM_HEADING_T]) / model.heading_tau_s)
                decay(x, P, 7, factor, model.heading_coloured_var)
                for q in range(n_candidates):
                    S[7, q] *= factor
            memory[MEM_HEADING_T] = t
            nu, s = expect_heading(x, P, v, events, columns, model.use_offset, h)
            if nu * nu <= model.heading_gate * s:
                for q in range(n_candidates):
                    g[q] = S[2, q] + S[7, q] + (S[6, q] if model.use_offset else 0.0)
                for k in range(columns.heading_param.shape[0]):
                    j = BASE_STATES + columns.heading_param[k]
                    for q in range(n_candidates):
                        g[q] += columns.heading[h, k] * S[j, q]
                for k in range(candidates.heading_param.shape[0]):
                    g[candidates.heading_param[k]] += candidates.heading[h, k]
                inv_s = 1.0 / s
                _tally(u[b], information[b], g, nu, inv_s)
                cost[b] += nu * nu * inv_s
                count[b] += 1
                for q in range(n):
                    x[q] += v[q] * nu * inv_s
                downdate(P, v, inv_s)
                _absorb(S, v, g, inv_s)
                clamp(x, model.lower, model.upper)

        f = events.fix_row[i]
        if f >= 0:
            if model.fix_coloured_var > 0.0:
                factor = math.exp(-(t - memory[MEM_FIX_T]) / model.fix_tau_s)
                for state in (8, 9):
                    decay(x, P, state, factor, model.fix_coloured_var)
                    for q in range(n_candidates):
                        S[state, q] *= factor
            memory[MEM_FIX_T] = t
            nu_e, nu_n, see, snn, sen = expect_fix(x, P, v, w, events, columns, f, antenna)
            ratio = sen / see
            s_n = snn - sen * ratio
            rest_n = nu_n - ratio * nu_e
            if nu_e * nu_e / see + rest_n * rest_n / s_n <= model.fix_gate:
                _slope_of_fix(S, x, columns, candidates, f, g, g_n)
                for q in range(n_candidates):
                    g_n[q] -= ratio * g[q]
                for q in range(n):
                    w[q] -= ratio * v[q]
                inv_e, inv_n = 1.0 / see, 1.0 / s_n
                _tally(u[b], information[b], g, nu_e, inv_e)
                _tally(u[b], information[b], g_n, rest_n, inv_n)
                cost[b] += nu_e * nu_e * inv_e + rest_n * rest_n * inv_n
                count[b] += 2
                for q in range(n):
                    x[q] += v[q] * nu_e * inv_e + w[q] * rest_n * inv_n
                downdate(P, v, inv_e)
                downdate(P, w, inv_n)
                _absorb(S, v, g, inv_e)
                _absorb(S, w, g_n, inv_n)
                clamp(x, model.lower, model.upper)


@compiled
def _slope_of_fix(
    S: Floats, x: Floats, columns: Columns, candidates: Columns, f: int, g_e: Floats, g_n: Floats
) -> None:
    """Derivatives of the expected fix, east and north, by every candidate."""
    ct = math.cos(x[2])
    st = math.sin(x[2])
    arm_e, arm_n = 0.0, 0.0
    for k in range(columns.fix_param.shape[0]):
        if columns.fix_port[k] < 2:
            ce, cn = fix_row(columns.fix_port[k], columns.fix[f, k], ct, st)
            p = x[BASE_STATES + columns.fix_param[k]]
            arm_e += ce * p
            arm_n += cn * p
    for q in range(g_e.shape[0]):
        g_e[q] = S[0, q] + S[8, q] - arm_n * S[2, q]
        g_n[q] = S[1, q] + S[9, q] + arm_e * S[2, q]
    for k in range(columns.fix_param.shape[0]):
        ce, cn = fix_row(columns.fix_port[k], columns.fix[f, k], ct, st)
        j = BASE_STATES + columns.fix_param[k]
        for q in range(g_e.shape[0]):
            g_e[q] += ce * S[j, q]
            g_n[q] += cn * S[j, q]
    for k in range(candidates.fix_param.shape[0]):
        ce, cn = fix_row(candidates.fix_port[k], candidates.fix[f, k], ct, st)
        g_e[candidates.fix_param[k]] += ce
        g_n[candidates.fix_param[k]] += cn


def score(
    events: Events,
    columns: Columns,
    candidates: Columns,
    n_candidates: int,
    model: Model,
    x: Floats,
    P: Floats,
    block: Rows,
) -> Scores:
    """Score K candidates over blocks of events; x (n,) and P (n, n) are the filter's start and stay as they are.

    ``candidates`` are columns whose parameters count from 0 to K − 1; block (n,) numbers each event's block from 0.
    """
    blocks = int(block.max()) + 1
    u = np.zeros((blocks, n_candidates))
    information = np.zeros((blocks, n_candidates, n_candidates))
    cost = np.zeros(blocks)
    count = np.zeros(blocks, dtype=np.int64)
    antenna = np.zeros((events.fix_east_m.size, 2))
    _score(events, columns, candidates, model, x.copy(), P.copy(), block, u, information, cost, count, antenna)
    lower = np.tril_indices(n_candidates, -1)
    information[:, lower[0], lower[1]] = information[:, lower[1], lower[0]]
    return Scores(u, information, cost, count)
