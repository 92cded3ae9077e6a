"""Do the streams move together? Shifted clocks and frozen sensors show as stretches in which they do not.

A stream that lags by seconds, or repeats one value, is absorbed by noise and parameters and gives wrong results that
look consistent. Here each pair is compared directly: turning of yaw against turning of the wheels, second by second,
and how far the fixes move in two seconds against how far the wheels do. Noise is not disagreement: how far both differ
is measured by what the log itself shows, single outliers are left out, and a stretch counts only where one stream
stands while the other moves, or where a shift in time would bring them together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sccal.align.counters import reverse_notices, spinning_notices
from sccal.align.path import laid_out
from sccal.align.proportions import proportion_doubts, wheel_turn
from sccal.align.reasons import why_apart
from sccal.align.scale import increments_correlation
from sccal.align.signs import slope_through_origin
from sccal.arrays import Bools, Complexes, Floats, Ints
from sccal.errors import DataError
from sccal.logs.names import ENCODER_FILE
from sccal.logs.streams import Notice

if TYPE_CHECKING:
    from sccal.align.aligned import Aligned

CHUNK_S = 60.0
CLEAR_TURN_RAD = np.radians(4.0)
ENOUGH_TURN_RAD = np.radians(120.0)
TOGETHER = 0.6
INCREMENTS = 0.9
MOVE_WINDOW_S = 2.0
CELL_S = 1.0
PATH_RATE_HZ = 20.0
CLEAR_SIGMAS = 5.0
SCALE_ERROR = 0.08
"""Of a displacement: radii, slip and a heading's error may be off by so much in a window."""
LEAST_SPREAD_M = 0.02
FEWEST_MOVES = 10
APART_S = 6.0
STUCK_S = 10.0
LONGEST_WINDOW_S = 8.0
SCALES = (0.5, 2.0)
LONGEST_ARM = 3.0
"""In track widths."""
STANDING_SHARE = 0.2
MOSTLY = 0.5
BETTER = 3.0
"""Another lag must bring the cost down by this factor to say that a stream is shifted."""
LAGS_S = np.arange(1.0, 15.1, 0.5)


def check_agreement(aligned: Aligned) -> list[Notice]:
    """Doubts about stretches in which the streams do not move together; DataError where yaw and wheels never do."""
    found = [*_yaw_against_wheels(aligned), *_fixes_against_wheels(aligned)]
    return [*found, *proportion_doubts(aligned), *reverse_notices(aligned), *spinning_notices(aligned)]


def _chunks(t_s: Floats) -> list[Ints]:
    """Rows of each stretch of about CHUNK_S."""
    if t_s.size == 0:
        return []
    number = ((t_s - t_s[0]) // CHUNK_S).astype(np.int64)
    return [np.flatnonzero(number == k) for k in np.unique(number)]


def _sampled(t_s: Floats, sample_t_s: Floats) -> Bools:
    """Between which of the times (n,) a stream has samples (n − 1,); inside a gap it only seems to move evenly."""
    return np.asarray(np.diff(np.interp(t_s, sample_t_s, np.arange(sample_t_s.size))) > 0.5)


def _yaw_against_wheels(aligned: Aligned) -> list[Notice]:
    start, end = aligned.span_s
    t_s = np.arange(start, min(end, aligned.heading_t_s[-1]))
    wheels = np.diff(wheel_turn(aligned, t_s))
    yaw = np.diff(np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad))
    watched = _sampled(t_s, aligned.heading_t_s) & _sampled(t_s, aligned.wheel_t_s)
    clear = watched & ((np.abs(wheels) > CLEAR_TURN_RAD) | (np.abs(yaw) > CLEAR_TURN_RAD))
    apart: list[float] = []
    judged = 0
    for rows in _chunks(t_s[:-1]):
        rows = rows[clear[rows]]
        if np.abs(wheels[rows]).sum() + np.abs(yaw[rows]).sum() < 2.0 * ENOUGH_TURN_RAD:
            continue
        judged += 1
        if slope_through_origin(wheels[rows], yaw[rows]).correlation < TOGETHER:
            apart.append(float(t_s[rows[0]]))
    if not apart:
        return []
    advice = why_apart(aligned, t_s, wheels, yaw, watched)
    if len(apart) == judged and judged > 1:
        correlation = slope_through_origin(wheels[clear], yaw[clear]).correlation
        if abs(increments_correlation(aligned, t_s, yaw)) > INCREMENTS:
            raise DataError(
                f"{ENCODER_FILE}: the counts themselves go with the turning of {aligned.heading_source}, and not their "
                "steps: they are increments since the row before, not cumulative; write their running sum"
            )
        raise DataError(
            f"{aligned.heading_source} and {ENCODER_FILE} do not turn together (correlation {correlation:+.2f} over "
            f"{int(clear.sum())} s of turning): {advice}"
        )
    what = f"stretches of {CHUNK_S:.0f} s in which yaw and wheels do not turn together: {advice}"
    doubt = f"yaw and wheels do not turn together in {len(apart)} of {judged} minutes with turns"
    return [Notice(aligned.heading_source, what, len(apart), f"t = {apart[0]:.0f} s", "warning", doubt)]


def _fixes_against_wheels(aligned: Aligned) -> list[Notice]:
    rows = np.flatnonzero(aligned.fix_leading)
    fix_t_s = aligned.fix_t_s[rows]
    fixes = aligned.fix_east_m[rows] + 1j * aligned.fix_north_m[rows]
    if rows.size < FEWEST_MOVES or np.ptp(fix_t_s) < FEWEST_MOVES * MOVE_WINDOW_S:
        return []
    wheel_t_s, antenna = _antenna_path(aligned, fixes, fix_t_s)
    path = np.interp(fix_t_s, wheel_t_s, antenna)
    left = fixes - path
    window_s = _window_s(antenna, wheel_t_s, left, fix_t_s)
    t_s = np.arange(fix_t_s[0], fix_t_s[-1], window_s)

    def by_wheels(lag_s: float) -> Floats:
        return np.asarray(np.abs(np.diff(np.interp(t_s + lag_s, wheel_t_s, antenna))))

    moved = by_wheels(0.0)
    by_fixes = np.abs(np.diff(np.interp(t_s, wheel_t_s, antenna) + _settled(left, fix_t_s, t_s)))
    watched = _sampled(t_s, fix_t_s) & _sampled(t_s, aligned.wheel_t_s)
    chunks = [part[watched[part]] for part in _chunks(t_s[:-1])]
    chunks = [part for part in chunks if part.size * window_s > 0.5 * CHUNK_S]
    sigma = _spread(by_fixes - moved, left, fix_t_s, t_s, chunks)
    sigma = np.hypot(sigma, SCALE_ERROR * np.maximum(moved, by_fixes))
    shifted = np.array([by_wheels(lag_s) for lag_s in (*-LAGS_S, *LAGS_S)])
    few_apart, few_stuck = (max(2, round(seconds / window_s)) for seconds in (APART_S, STUCK_S))
    apart: list[float] = []
    judged = 0
    for part in chunks:
        if (np.maximum(moved, by_fixes)[part] > CLEAR_SIGMAS * sigma[part]).sum() < few_apart:
            continue
        judged += 1
        off = (by_fixes[part] - moved[part]) / sigma[part]
        bad = np.abs(off) > CLEAR_SIGMAS
        one_stands = bad & (np.minimum(by_fixes, moved)[part] < STANDING_SHARE * np.maximum(by_fixes, moved)[part])
        cost = float(np.minimum(off**2, CLEAR_SIGMAS**2).sum())
        others = (by_fixes[part] - shifted[:, part]) / sigma[part]
        best = float(np.minimum(others**2, CLEAR_SIGMAS**2).sum(axis=1).min())
        lagging = bad.sum() >= few_apart and cost > BETTER * best + CLEAR_SIGMAS**2
        stuck = _longest(one_stands) >= few_stuck
        if lagging or stuck or np.mean(bad) > MOSTLY:
            apart.append(float(t_s[part[0]]))
    if not apart:
        return []
    what = (
        f"stretches of {CHUNK_S:.0f} s in which fixes and wheels do not speed up and slow down together: one of the "
        "streams is shifted in time, or frozen"
    )
    doubt = f"fixes and wheels do not move together in {len(apart)} of {judged} minutes with motion"
    return [Notice("gnss", what, len(apart), f"t = {apart[0]:.0f} s", "warning", doubt)]


def _antenna_path(aligned: Aligned, fixes: Complexes, t_s: Floats) -> tuple[Floats, Complexes]:
    """Where wheels and yaw take the antenna, times (n,) and places (n,), turned and scaled as the fixes want it.

    From displacements over MOVE_WINDOW_S, robustly, so that neither drift nor a bad stretch matters.
    """
    every = max(1, round(1.0 / (PATH_RATE_HZ * max(float(np.median(np.diff(aligned.wheel_t_s))), 1e-6))))
    wheel_t_s = aligned.wheel_t_s[::every]
    yaw = np.interp(wheel_t_s, aligned.heading_t_s, aligned.yaw_rad)
    columns = (laid_out(aligned.travel_m[::every], yaw), np.exp(1j * yaw))
    at_fixes = np.column_stack([np.interp(t_s, wheel_t_s, column) for column in columns])
    later = np.searchsorted(t_s, t_s + MOVE_WINDOW_S)
    first = np.flatnonzero(later < t_s.size)
    x, y = at_fixes[later[first]] - at_fixes[first], fixes[later[first]] - fixes[first]
    weight = np.ones(first.size)
    small = 1e-6 * np.eye(2)
    for _ in range(5):
        weighted = (weight[:, None] * x).conj().T
        normal, right = weighted @ x, weighted @ y
        solution = np.linalg.solve(normal + small * max(float(np.trace(normal).real), 1e-9), right)
        off = np.abs(y - x[:, 0] * solution[0] - x[:, 1] * solution[1])
        weight = 1.0 / np.maximum(off / max(float(np.median(off)), 1e-3), 1.0)
    if not SCALES[0] < abs(solution[0]) < SCALES[1] or abs(solution[1]) > LONGEST_ARM * aligned.vehicle.track_m:
        solution = np.array([1.0, 0.0], dtype=complex)
    return wheel_t_s, columns[0] * solution[0] + columns[1] * solution[1]


def _window_s(antenna: Complexes, wheel_t_s: Floats, left: Complexes, fix_t_s: Floats) -> float:
    """Long enough that a displacement stands out from the noise of the fixes."""
    speed = float(np.abs(np.diff(antenna)).sum()) / max(float(np.ptp(wheel_t_s)), 1e-9)
    per_cell = max(1.0, left.size * CELL_S / max(float(np.ptp(fix_t_s)), CELL_S))
    noise = float(np.median(np.abs(np.diff(left)))) * np.sqrt(1.6 / per_cell)
    return float(np.clip(2.0 * CLEAR_SIGMAS * noise / max(speed, 1e-3), MOVE_WINDOW_S, LONGEST_WINDOW_S))


def _settled(left: Complexes, fix_t_s: Floats, t_s: Floats) -> Complexes:
    """Medians of what the path leaves of the fixes, over CELL_S around each time: single outliers are gone."""
    number = np.floor((fix_t_s - fix_t_s[0]) / CELL_S).astype(np.int64)
    starts = np.flatnonzero(np.concatenate(([True], np.diff(number) > 0)))
    count = np.diff(np.append(starts, fix_t_s.size))
    lower, upper = starts + (count - 1) // 2, starts + count // 2

    def medians(values: Floats) -> Floats:
        ordered = values[np.lexsort((values, number))]
        return np.asarray(0.5 * (ordered[lower] + ordered[upper]))

    at = np.add.reduceat(fix_t_s, starts) / count
    return np.asarray(np.interp(t_s, at, medians(left.real) + 1j * medians(left.imag)))


def _spread(off_m: Floats, left: Complexes, fix_t_s: Floats, t_s: Floats, chunks: list[Ints]) -> Floats:
    """Noise of the difference of the two displacements in each window (n,): the run's usual one, or the chunk's."""
    usual = [float(np.quantile(np.abs(off_m[part]), 0.68)) for part in chunks]
    spread = np.full(off_m.size, max(float(np.quantile(usual, 0.25)) if usual else 0.0, LEAST_SPREAD_M))
    steps = np.abs(np.diff(left))
    for part in chunks:
        inside = slice(*np.searchsorted(fix_t_s, (t_s[part[0]], t_s[part[-1]])))
        some = steps[inside]
        if some.size:
            per_cell = max(1.0, some.size * CELL_S / CHUNK_S)
            of_steps = 1.4 * float(np.quantile(some, 0.3))
            spread[part] = np.maximum(spread[part], of_steps * np.sqrt(1.6 / per_cell))
    return spread


def _longest(flags: Bools) -> int:
    """Length of the longest stretch of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    return int((edges[1::2] - edges[::2]).max(initial=0))
