"""Rows that were stamped in bursts, or whose stamps have lost their fractions, spread evenly again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.logs.streams import Notice

_BURST_SHARE = 0.3
_LEAST_NEW = 0.2
_FEWEST_REPEATS = 10


def spread_bursts(t: Floats, values: Sequence[Floats], line: Ints, source: str, notices: list[Notice]) -> Floats:
    """Times (n) of rows that were stamped in bursts, spread evenly over the time since the burst before.

    Whole seconds have lost their fraction: their rows are spread over the second that follows. Rows whose ``values``
    (each (n)) are the same too were only written twice, and are left for who drops those.
    """
    begins = np.concatenate(([True], np.diff(t) != 0))
    repeats = int((~begins).sum())
    if repeats < max(_FEWEST_REPEATS, _BURST_SHARE * t.size) or (np.diff(t) < 0).any():
        return t
    differs = np.any([np.diff(column) != 0 for column in values], axis=0)
    if (differs & ~begins[1:]).sum() < _LEAST_NEW * repeats:
        return t
    number = np.cumsum(begins) - 1
    stamp, size = t[begins], np.bincount(number)
    if stamp.size < 3:
        return t
    place = np.arange(t.size) - np.flatnonzero(begins)[number]
    usual_s, usual = float(np.median(np.diff(stamp))), float(np.median(size))
    cut = bool((stamp == np.floor(stamp)).all())
    gap_s = np.minimum(np.diff(stamp), usual_s)
    where = f"line {line[np.flatnonzero(~begins)[0]]}"
    how = "whole seconds that lost their fraction, spread over the second" if cut else "bursts of rows with one time"
    notices.append(Notice(source, f"rows in {how}, {usual:.0f} a time: spread evenly", t.size, where, "warning"))
    if cut:
        room = np.append(gap_s, usual_s)
        lead = np.where(np.arange(stamp.size) == 0, np.maximum(usual - size, 0.0), 0.0)
        late: Floats = room[number] * (lead[number] + place) / np.maximum(lead + size, 1.0)[number]
        return t + late
    room = np.concatenate(([usual_s * min(1.0, size[0] / usual)], gap_s))
    early: Floats = room[number] * (1.0 - (place + 1.0) / size[number])
    return t - early
