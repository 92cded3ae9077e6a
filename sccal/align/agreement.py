"""Do the streams move together? Shifted clocks and frozen sensors show as stretches in which they do not.

A stream that lags by seconds, or repeats one value, is absorbed by noise and parameters and gives wrong results that
look consistent. Here each pair is compared directly: turning of yaw against turning of the wheels, second by second,
and displacement of the fixes against the path that the wheels draw along the yaw.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sccal.align.signs import slope_through_origin, wheel_turn
from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.logs.streams import Notice

if TYPE_CHECKING:
    from sccal.align.aligned import Aligned

CHUNK_S = 60.0
CLEAR_TURN_RAD = np.radians(4.0)
ENOUGH_TURN_RAD = np.radians(120.0)
TOGETHER = 0.6
MOVE_WINDOW_S = 2.0
CLEAR_SIGMAS = 6.0
FEWEST_MOVES = 10


def check_agreement(aligned: Aligned) -> list[Notice]:
    """Doubts about stretches in which the streams do not move together; DataError where yaw and wheels never do."""
    return [*_yaw_against_wheels(aligned), *_fixes_against_wheels(aligned)]


def _chunks(t_s: Floats) -> list[np.ndarray]:
    """Rows of each stretch of about CHUNK_S."""
    if t_s.size == 0:
        return []
    number = ((t_s - t_s[0]) // CHUNK_S).astype(np.int64)
    return [np.flatnonzero(number == k) for k in np.unique(number)]


def _yaw_against_wheels(aligned: Aligned) -> list[Notice]:
    start, end = aligned.span_s
    t_s = np.arange(start, min(end, aligned.heading_t_s[-1]))
    wheels = np.diff(wheel_turn(aligned, t_s))
    yaw = np.diff(np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad))
    watched = np.diff(np.interp(t_s, aligned.heading_t_s, np.arange(aligned.heading_t_s.size))) > 0.5
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
    advice = "one of the streams is shifted in time, or frozen"
    if len(apart) == judged and judged > 1:
        correlation = slope_through_origin(wheels[clear], yaw[clear]).correlation
        raise DataError(
            f"{aligned.heading_source} and encoder.csv do not turn together (correlation {correlation:+.2f} over "
            f"{int(clear.sum())} s of turning): {advice}"
        )
    what = f"stretches of {CHUNK_S:.0f} s in which yaw and wheels do not turn together: {advice}"
    doubt = f"yaw and wheels do not turn together in {len(apart)} of {judged} minutes with turns"
    return [Notice(aligned.heading_source, what, len(apart), f"t = {apart[0]:.0f} s", "warning", doubt)]


def _fixes_against_wheels(aligned: Aligned) -> list[Notice]:
    rows = np.flatnonzero(aligned.fix_leading)
    t_s = np.arange(aligned.fix_t_s[rows[0]], aligned.fix_t_s[rows[-1]], MOVE_WINDOW_S)
    if t_s.size < FEWEST_MOVES:
        return []
    by_wheels = np.abs(np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.path_along_yaw)))
    fixes = aligned.fix_east_m[rows] + 1j * aligned.fix_north_m[rows]
    by_fixes = np.abs(np.diff(np.interp(t_s, aligned.fix_t_s[rows], fixes)))
    watched = np.diff(np.interp(t_s, aligned.fix_t_s[rows], np.arange(rows.size))) > 0.5
    sigma = float(np.median(np.sqrt(aligned.fix_var_east_m2[rows] + aligned.fix_var_north_m2[rows])))
    apart: list[float] = []
    judged = 0
    for part in _chunks(t_s[:-1]):
        part = part[watched[part]]
        if part.size < FEWEST_MOVES or np.std(by_wheels[part]) < max(
            CLEAR_SIGMAS * sigma, 0.1 * np.mean(by_wheels[part])
        ):
            continue
        judged += 1
        if np.std(by_fixes[part]) == 0 or np.corrcoef(by_wheels[part], by_fixes[part])[0, 1] < TOGETHER:
            apart.append(float(t_s[part[0]]))
    if not apart:
        return []
    what = (
        f"stretches of {CHUNK_S:.0f} s in which fixes and wheels do not speed up and slow down together: one of the "
        "streams is shifted in time, or frozen"
    )
    doubt = f"fixes and wheels do not move together in {len(apart)} of {judged} minutes with changes of speed"
    return [Notice("gnss", what, len(apart), f"t = {apart[0]:.0f} s", "warning", doubt)]
