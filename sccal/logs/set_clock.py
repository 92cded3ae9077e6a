"""Clocks that are set, wrap or begin again while they are logged: one rule for tables and receive times.

A clock that counts in a register of 16 or 32 bits, or from midnight, falls back by a size that is known exactly; one
that is set to another day or hour moves by whole ones. The times are then carried on as if nothing had happened, by the
same amount in every stream. A leap forward by more than a day of any other size is a clock that was set when the time
became known: what lies before is moved by what one usual step leaves of the leap. A fall of any other size is left to
those who drop rows: whether a clock began again or two logs were joined in the wrong order, it does not say.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.logs.streams import ClockStep, Notice

DAY_S, HOUR_S = 86400.0, 3600.0
WRAPS_S = {
    65.536: "16 bits of milliseconds",
    4294.967296: "32 bits of microseconds",
    4294967.296: "32 bits of milliseconds",
}
_FALL_S = 30.0
_WITHIN_S = 1.0
_FEWEST_ROWS = 10
"""Fewer rows between two steps are bad stamps, and no clock that was set."""
_MOST_STEPS = 200
_SAME_S = 2.0


def carried_on(t_s: Floats, line: Ints, source: str, notices: list[Notice]) -> tuple[Floats, tuple[ClockStep, ...]]:
    """Times (n) in the order of the file, without the steps of their clock; NaN where there is none.

    And the steps of which nobody knows the exact size.
    """
    rows = np.flatnonzero(np.isfinite(t_s))
    if rows.size < 2 * _FEWEST_ROWS or not _odd(np.diff(t_s[rows])).any():
        return t_s, ()
    rows = _without_short_parts(t_s, rows)
    steps_s = np.diff(t_s[rows])
    borders = np.flatnonzero(_odd(steps_s))
    if not 0 < borders.size <= _MOST_STEPS:
        return t_s, ()
    usual_s = float(np.median(steps_s[steps_s > 0])) if (steps_s > 0).any() else 0.0
    moved = t_s.copy()
    unsure = []
    for border in borders.tolist():
        size_s, why = _size_of(float(steps_s[border]) - usual_s, usual_s)
        if not why:
            continue
        first = int(rows[border + 1])
        if size_s < 0:
            moved[first:] -= size_s
        else:
            moved[:first] += size_s
        if why == _SET:
            unsure.append((first, size_s))
        which = (
            f"times after it moved by {-size_s:+.6g} s" if size_s < 0 else f"times before it moved by {size_s:+.6g} s"
        )
        notices.append(Notice(source, f"step of the clock ({why}): {which}", 1, f"line {line[first]}", "warning"))
    return moved, tuple(ClockStep(float(moved[first]), size_s) for first, size_s in unsure)


_SET = "it was set"


def _odd(steps_s: Floats) -> np.ndarray:
    return (steps_s < -_FALL_S) | (steps_s > DAY_S)


def _without_short_parts(t_s: Floats, rows: Ints) -> Ints:
    """The rows without those between two steps that are too few to be a clock's."""
    edges = np.concatenate(([0], np.flatnonzero(_odd(np.diff(t_s[rows]))) + 1, [rows.size]))
    sizes = np.diff(edges)
    return rows[np.repeat(sizes >= _FEWEST_ROWS, sizes)]


def _size_of(size_s: float, usual_s: float) -> tuple[float, str]:
    """The exact size of a step and what it is; nothing where it is of no known kind."""
    within_s = max(_WITHIN_S, 2.0 * usual_s)
    for period_s, name in WRAPS_S.items():
        if abs(size_s + period_s) <= within_s:
            return -period_s, f"it wraps at {name}"
    days, hours = round(size_s / DAY_S), round(size_s / HOUR_S)
    if days and abs(size_s - days * DAY_S) <= within_s:
        return days * DAY_S, "midnight" if days == -1 else f"it was set by {days:+d} days"
    if size_s < 0 and 0 < -hours <= 24 and abs(size_s - hours * HOUR_S) <= within_s:
        return hours * HOUR_S, f"it was set back by {-hours} h"
    return (size_s, _SET) if size_s > DAY_S else (0.0, "")


def like_the_wheels(t_s: Floats, own: tuple[ClockStep, ...], wheels: tuple[ClockStep, ...]) -> Floats:
    """Times (n) whose clock's steps, known to a usual step only, are those of the wheels, whose rows are denser."""
    if len(own) != len(wheels):
        return t_s
    for mine, theirs in zip(own, wheels, strict=True):
        away_s = theirs.size_s - mine.size_s
        if abs(away_s) <= _SAME_S:
            t_s = np.where(t_s < mine.at_s, t_s + away_s, t_s)
    return t_s
