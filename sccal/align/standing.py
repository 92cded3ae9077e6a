"""Stretches in which the wheels stand, and which measurements still say something there.

A robot that stands learns nothing about its wheels, and its sensors tell the same again and again: their errors last
for tens of seconds to minutes, a receiver may hold its position, a tracker its heading. Taken as independent, an hour
of such readings makes the noise look like nothing and outvotes the whole drive. So a standing robot keeps the first
moments of each stand, and then one reading in each doubling of the time since: an error that wanders on every time
scale alike (flicker noise, as of receivers and gyroscopes) gives about one new reading per octave.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Bools, Floats, Ints

Spans = tuple[tuple[float, float], ...]

CELL_S = 0.5
STAND_S = 2.0
"""A stand is no shorter: the wheels of a robot that turns round, shifts gears or brakes into a pivot rest for less."""
FIRST_S = 3.0
"""Of a stand in which all readings count: what a stop between two manoeuvres gives, and no more."""
DITHER_COUNTS = 1.5
"""A wheel that rests on the edge of a count shows two of them in turn."""
DITHER_M = 1e-3
"""And where counts are finer: an engine that idles and a hand on the robot turn a wheel by so much, a drive at any
speed above DITHER_M / STAND_S = 0.5 mm/s by more."""


def dither_rad(wheel_radius_m: float, ticks_per_rev: float | None) -> float:
    """How far a standing wheel may seem to turn to and fro."""
    count = 0.0 if not ticks_per_rev else 2.0 * np.pi / ticks_per_rev
    return max(DITHER_COUNTS * count, DITHER_M / wheel_radius_m)


def standing_spans(t_s: Floats, right_rad: Floats, left_rad: Floats, loose: Bools, most_rad: float) -> Spans:
    """Stretches of STAND_S and more in which neither wheel leaves a band of most_rad within any STAND_S.

    From cumulative angles (n,) at increasing times; where the travel is loose (n,) the wheels are taken to move. The
    ends are known to CELL_S, and lie within the stand.
    """
    count = int((t_s[-1] - t_s[0]) / CELL_S) if t_s.size > 1 else 0
    window = round(STAND_S / CELL_S)
    if count < window:
        return ()
    edge_s = t_s[0] + CELL_S * np.arange(count + 1)
    before = np.searchsorted(t_s, edge_s)
    still = np.ones(count - window + 1, dtype=np.bool_)
    for angle in (right_rad, left_rad):
        at_edge = np.interp(edge_s, t_s, angle)
        low, high = _extremes(angle, before, at_edge)
        most = np.lib.stride_tricks.sliding_window_view(high, window).max(axis=1)
        least = np.lib.stride_tricks.sliding_window_view(low, window).min(axis=1)
        still &= most - least <= most_rad
    unknown = np.diff(np.interp(edge_s, t_s, np.cumsum(loose))) > 0.0
    still &= np.convolve(unknown, np.ones(window), mode="valid") < 0.5
    stands = np.convolve(still, np.ones(window)) > 0.5
    change = np.flatnonzero(np.diff(np.concatenate(([False], stands, [False])).astype(np.int8)))
    return tuple((float(edge_s[a]), float(edge_s[b])) for a, b in zip(change[::2], change[1::2], strict=True))


def _extremes(angle: Floats, before: Ints, at_edge: Floats) -> tuple[Floats, Floats]:
    """Least and greatest angle in each cell (m,), from its samples and its two edges (m + 1,)."""
    low = np.minimum(at_edge[1:], at_edge[:-1])
    high = np.maximum(at_edge[1:], at_edge[:-1])
    filled = np.flatnonzero(np.diff(before) > 0)
    if filled.size:
        # Cells without samples have no rows in between, so a filled one ends where the next filled one begins.
        within = angle[: before[-1]]
        low[filled] = np.minimum(low[filled], np.minimum.reduceat(within, before[filled]))
        high[filled] = np.maximum(high[filled], np.maximum.reduceat(within, before[filled]))
    return low, high


def rows_in_stands(t_s: Floats, standing_s: Spans) -> tuple[Ints, Ints]:
    """Which of the increasing times (n,) lie in stands (k,), and in which one each of them (k,)."""
    if not standing_s:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    begin, end = np.array(standing_s).T
    first, last = np.searchsorted(t_s, begin), np.searchsorted(t_s, end, side="right")
    count = last - first
    stand = np.repeat(np.arange(count.size), count)
    return np.arange(stand.size) - (np.cumsum(count) - count)[stand] + first[stand], stand


def worth_taking(t_s: Floats, standing_s: Spans, first_s: float, *columns: Floats) -> Bools:
    """Which measurements (n,) in order of time say something that those before did not.

    All while the robot moves. While it stands those that differ from the one before in any of the columns (n,), if
    there are columns, and of these the ones in the first moments and then one in each doubling of the time since it
    stopped. first_s is where the part of interest begins: a stand before it counts from there.
    """
    taken = np.ones(t_s.size, dtype=np.bool_)
    rows, stand = rows_in_stands(t_s, standing_s)
    if rows.size == 0:
        return taken
    taken[rows] = False
    new = np.ones(rows.size, dtype=np.bool_)
    if columns:
        new[1:] = stand[1:] != stand[:-1]
        for column in columns:
            new[1:] |= column[rows[1:]] != column[rows[:-1]]
    rows, stand = rows[new], stand[new]
    since_s = t_s[rows] - np.maximum(np.array([begin for begin, _ in standing_s]), first_s)[stand]
    octave = np.floor(np.log2(np.maximum(since_s / FIRST_S, 0.5)))
    first = np.concatenate(([True], (np.diff(octave) != 0) | (np.diff(stand) != 0)))
    taken[rows[first | (octave < 0)]] = True
    return taken
