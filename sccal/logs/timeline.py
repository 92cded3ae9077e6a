"""Time order: strictly increasing stamps out of what loggers write.

Duplicates keep the first row. Rows swapped by buffering (at most 0.5 s back) are sorted. Stamps that jump away and
come back are bad stamps and dropped. Where a clock steps back and goes on, rows are dropped until time passes the
maximum seen before. Where the clock leaps by more than a day, the longer part is kept.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import DataError
from sccal.logs.limits import TIME_LIMIT_S
from sccal.logs.streams import Notice

SWAP_LIMIT_S = 0.5
"""Rows this much behind the latest are taken as swapped by buffering, not as a clock step."""
LEAP_LIMIT_S = 86400.0
"""No run holds a pause this long: the clock was set, or the stamp is garbage."""
LEAST_SHARE = 0.5
"""With fewer rows left in order, nobody knows which of them tell the truth."""
FEW_ROWS = 20
_LOOK_BACK_SEGMENTS = 400


def order_in_time(t_s: Floats, line: Ints, source: str) -> tuple[Ints, tuple[Notice, ...]]:
    """Row indices (m <= n) that make finite stamps ``t_s`` (n) strictly increasing, and what was done for it."""
    order = np.arange(t_s.size, dtype=np.int64)
    possible: Bools = np.abs(t_s) <= TIME_LIMIT_S
    if not possible.all():
        return _without_impossible(t_s, possible, line, source)
    steps_s = np.diff(t_s)
    notices: list[Notice] = []
    if t_s.size == 0:
        return order, ()
    if (steps_s <= 0).any():
        order = _without_steps_back(t_s, line, source, notices)
        order = _sorted_swaps(t_s, order, line, source, notices)
    order = _without_leaps(t_s, order, line, source, notices)
    if order.size < LEAST_SHARE * t_s.size and t_s.size > FEW_ROWS and order.size < LEAST_SHARE * np.unique(t_s).size:
        why = "; ".join(str(notice) for notice in notices)
        raise DataError(f"{source}: {t_s.size - order.size} of {t_s.size} rows are out of order in time: {why}")
    return order, tuple(notices)


def _without_impossible(t_s: Floats, possible: Bools, line: Ints, source: str) -> tuple[Ints, tuple[Notice, ...]]:
    first = int(np.flatnonzero(~possible)[0])
    what = f"rows with bad stamps dropped (t = {t_s[first]:.6g} s, beyond {TIME_LIMIT_S:g})"
    notice = Notice(source, what, int((~possible).sum()), f"line {line[first]}", "warning")
    rows = np.flatnonzero(possible)
    if rows.size < LEAST_SHARE * t_s.size:
        raise DataError(f"{notice}; t must be seconds, not milliseconds or nanoseconds")
    order, notices = order_in_time(t_s[rows], line[rows], source)
    return rows[order], (notice, *notices)


def _without_steps_back(t_s: Floats, line: Ints, source: str, notices: list[Notice]) -> Ints:
    """The most rows that form one timeline, as stretches without jumps of which later ones may lose their start."""
    steps_s = np.diff(t_s)
    forward = steps_s[steps_s > 0]
    usual_s = float(np.median(forward)) if forward.size else 0.0
    jump = (steps_s < -SWAP_LIMIT_S) | (steps_s > max(SWAP_LIMIT_S, 10 * usual_s))
    starts = np.concatenate(([0], np.flatnonzero(jump) + 1, [t_s.size]))
    stretches = [np.sort(t_s[a:b]) for a, b in pairwise(starts.tolist())]
    first = np.array([stretch[0] for stretch in stretches])
    last = np.array([stretch[-1] for stretch in stretches])
    rows = np.diff(starts)
    kept = rows.astype(np.int64)
    parent = np.full(rows.size, -1, dtype=np.int64)
    for j in range(1, rows.size):
        i = np.arange(max(0, j - _LOOK_BACK_SEGMENTS), j)
        gained = rows[j] - np.where(
            last[i] < first[j], 0, np.searchsorted(stretches[j], np.maximum(last[i], first[j]), side="right")
        )
        total = np.where(gained > 0, kept[i] + gained, 0)
        best = int(total.size - 1 - np.argmax(total[::-1]))
        if total[best] > kept[j]:
            kept[j], parent[j] = total[best], i[best]

    keep = np.zeros(t_s.size, dtype=np.bool_)
    j = int(np.argmax(kept))
    while j >= 0:
        own = slice(starts[j], starts[j + 1])
        keep[own] = t_s[own] > last[parent[j]] if parent[j] >= 0 else True
        j = int(parent[j])
    keep &= np.maximum.accumulate(np.where(keep, t_s, -np.inf)) - t_s <= SWAP_LIMIT_S
    _tell_dropped(t_s, keep, line, source, notices)
    return np.flatnonzero(keep)


def _tell_dropped(t_s: Floats, keep: Bools, line: Ints, source: str, notices: list[Notice]) -> None:
    """Tell rows behind a clock step from single bad stamps: the latter fit neither side's time."""
    dropped = np.flatnonzero(~keep)
    if dropped.size == 0:
        return
    before = np.maximum.accumulate(np.where(keep, t_s, -np.inf))
    after = np.minimum.accumulate(np.where(keep, t_s, np.inf)[::-1])[::-1]
    behind = (t_s[dropped] <= before[dropped]) & np.isfinite(before[dropped])
    run_starts = np.concatenate(([0], np.flatnonzero(np.diff(dropped) > 1) + 1))
    run_of = np.repeat(np.arange(run_starts.size), np.diff(np.concatenate((run_starts, [dropped.size]))))
    run_rows = np.bincount(run_of)[run_of]
    stepped = behind & (run_rows > 3)
    equal = behind & (t_s[dropped] == before[dropped]) & ~stepped
    for chosen, what in (
        (stepped, "rows dropped because the clock stepped back"),
        (~stepped & ~equal, "rows with bad stamps dropped"),
    ):
        rows = dropped[chosen]
        if rows.size:
            row = rows[0]
            bound_s = before[row] if t_s[row] <= before[row] else after[row]
            detail = (
                f" (t = {t_s[row]:.3f} s beside {bound_s:.3f} s)"
                if np.isfinite(bound_s)
                else f" (t = {t_s[row]:.3f} s)"
            )
            doubt = ""
            if what.endswith("back"):
                detail = f" by {before[row] - t_s[row]:.3f} s"
                doubt = f"the clock of {source} stepped back{detail}"
            notices.append(Notice(source, what + detail, int(rows.size), f"line {line[row]}", "warning", doubt))
    if equal.any():
        rows = dropped[equal]
        notices.append(Notice(source, "rows with a time seen before dropped", int(rows.size), f"line {line[rows[0]]}"))


def _sorted_swaps(t_s: Floats, order: Ints, line: Ints, source: str, notices: list[Notice]) -> Ints:
    swapped = np.flatnonzero(np.diff(t_s[order]) < 0)
    if swapped.size:
        where = f"line {line[order[swapped[0] + 1]]}"
        notices.append(Notice(source, "rows out of order by 0.5 s or less sorted", int(swapped.size), where))
        order = order[np.argsort(t_s[order], kind="stable")]
    repeated = np.flatnonzero(np.diff(t_s[order]) == 0) + 1
    if repeated.size:
        where = f"line {line[order[repeated[0]]]}"
        many = repeated.size > 0.1 * t_s.size
        what = "rows with a time seen before dropped"
        notices.append(Notice(source, what, int(repeated.size), where, "warning" if many else "info"))
        order = np.delete(order, repeated)
    return order


def _without_leaps(t_s: Floats, order: Ints, line: Ints, source: str, notices: list[Notice]) -> Ints:
    leaps = np.flatnonzero(np.diff(t_s[order]) > LEAP_LIMIT_S) + 1
    if leaps.size == 0:
        return order
    parts = np.split(order, leaps)
    longest = max(parts, key=len)
    lost = [int(part[0]) for part in parts if part is not longest]
    what = f"rows dropped because their times are more than a day from the others (t = {t_s[lost[0]]:.0f} s)"
    notices.append(Notice(source, what, int(order.size - longest.size), f"line {line[min(lost)]}", "warning"))
    return longest
