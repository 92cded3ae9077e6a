"""Windows of a run: ``60:120`` on a command line, and where that lies on the log's own clock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import UsageError

Window = tuple[float, float]


def parse_window(text: str) -> Window:
    """``60:120`` as numbers. Raises UsageError."""
    begin, colon, end = text.partition(":")
    try:
        window = (float(begin), float(end))
    except ValueError:
        window = (np.nan, np.nan)
    if not colon or not np.isfinite(window).all() or not window[0] < window[1]:
        raise UsageError(f"window {text!r}: give start and end in seconds, such as 60:120")
    return window


def within(t_s: Floats, windows_s: Sequence[Window]) -> Bools:
    """(n,) True inside any of the windows, ends included."""
    inside = np.zeros(t_s.size, dtype=np.bool_)
    for begin, end in windows_s:
        inside |= (t_s >= begin) & (t_s <= end)
    return inside


def windows_on_clock(windows_s: Sequence[Window], span_s: tuple[float, float]) -> list[Window]:
    """Windows in the log's own time: as given where both ends lie in the run, else counted from its start.

    Raises UsageError where a window is empty or lies outside the run.
    """
    first, last = span_s
    found = []
    for begin, end in windows_s:
        if not begin < end:
            raise UsageError(f"window {begin:g}:{end:g}: the end must be after the start")
        shift = 0.0 if first <= begin and end <= last else first
        if shift + begin >= last or shift + end <= first:
            raise UsageError(f"window {begin:g}:{end:g} lies outside the run, which lasts {last - first:.1f} s")
        found.append((begin + shift, end + shift))
    return found
