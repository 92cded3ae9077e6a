"""Which column is the heading: it turns as the wheels turn, and in its unit as far as the path of the fixes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sccal.align.signs import Slope, slope_through_origin
from sccal.arrays import Floats
from sccal.logs.mapping import ANGLE_UNITS
from sccal.logs.messages.heading import euler
from sccal.logs.streams import Convention
from sccal.logs.yaw_values import turn_of
from sccal.propose import words
from sccal.propose.motion import turns
from sccal.propose.places import Places
from sccal.propose.tables import Folder, Logged
from sccal.propose.wheels import Wheels

LEAST_CORRELATION = 0.8
"""Of the turning in seconds: an AHRS follows the wheels with 0.95 and more, a course is lost in turns on the spot."""
_AS_GOOD = 0.02
"""Headings whose correlations differ by less are as good as one another."""
_SLOPE = (0.6, 1.6)
"""Of the turning on that of the fixes' course: units differ by factors of ten, tracks that skid by a half."""
_TRACKS_M = (0.06, 6.0)
"""From a toy's track to a harvester's: radians and degrees lie further apart than this range is wide."""
_NORM = 0.02
"""A quaternion's norm is 1, to what four decimals of its parts round."""
_STEP_S = 1.0


@dataclass(frozen=True)
class Heading:
    """A column, or four, taken for the heading."""

    table: Logged
    columns: tuple[str, ...]
    unit: str
    """Empty for a quaternion."""
    convention: Convention
    t_s: Floats
    yaw_rad: Floats
    """(n) As written, unwrapped."""
    correlation: float
    why: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    unit_shown: bool = True
    """Whether the path of the fixes shows the unit."""

    @property
    def label(self) -> str:
        """For messages."""
        return f"{self.table.name}: {', '.join(words.called(name) for name in self.columns)}"


def heading_in(
    folder: Folder, places: Places, wheels: Wheels, besides: frozenset[tuple[str, str]]
) -> tuple[Heading | None, tuple[str, ...]]:
    """The heading that goes best with the wheels, and others that would do as well; ``besides`` are columns in use."""
    found = [one for table in folder.tables for one in _of_table(table, places, wheels, besides)]
    if not found:
        return None, ()
    most = max(abs(one.correlation) for one in found)
    good = [one for one in found if abs(one.correlation) > most - _AS_GOOD]
    best = max(good, key=lambda one: (_trust(one, places), abs(one.correlation)))
    return best, tuple(one.label for one in good if one is not best)


def _trust(one: Heading, places: Places) -> tuple[bool, bool, bool]:
    """What a receiver calls a heading is often its course, and what a filter makes is made of the wheels."""
    names = one.columns
    return (
        not any(words.has(name, words.COURSE) or words.has(name, words.DERIVED) for name in names),
        one.table.name != places.file or len(names) > 1,
        any(words.has(name, words.HEADING) for name in names) or len(names) > 1,
    )


def _of_table(table: Logged, places: Places, wheels: Wheels, besides: frozenset[tuple[str, str]]) -> Iterator[Heading]:
    names = [name for name in table.numbers if (table.name, name) not in besides]
    four = _quaternion(table, names)
    for columns in four:
        t_s, *parts = table.pair(*columns)
        yaw, _, _ = euler(*parts)
        yield from _judged(table, columns, "", t_s, np.unwrap(yaw), places, wheels)
    for name in names:
        if any(name in columns for columns in four) or words.has(name, words.COURSE):
            continue
        t_s, values = table.pair(name)
        if t_s.size > 2 and np.ptp(values) > 0:
            for unit in _units(values):
                size = ANGLE_UNITS[unit]
                yaw = np.unwrap(size * values)
                yield from _judged(table, (name,), unit, t_s, yaw, places, wheels)


def _quaternion(table: Logged, names: list[str]) -> list[tuple[str, ...]]:
    """Four columns of norm 1 whose names differ in x, y, z and w, or in numbers: w first and w last are tried."""
    by_stem: dict[tuple[str, ...], dict[str, str]] = {}
    for name in names:
        last = name.lower()[-1:]
        if last in "xyzw0123" and name[:-1]:
            by_stem.setdefault((*words.parts(name[:-1]), "#" if last.isdigit() else ""), {})[last] = name
    found: list[tuple[str, ...]] = []
    for parts in by_stem.values():
        orders = ("xyzw",) if set(parts) == set("xyzw") else ("1230", "0123") if set(parts) == set("0123") else ()
        columns = [tuple(parts[axis] for axis in order) for order in orders]
        found += [four for four in columns if _has_norm_one(table, four)]
    return found


def _has_norm_one(table: Logged, four: tuple[str, ...]) -> bool:
    _, *parts = table.pair(*four)
    norm = np.sqrt(sum(part * part for part in parts))
    return bool(norm.size > 2 and abs(float(np.median(norm)) - 1.0) < _NORM)


def _units(values: Floats) -> tuple[str, ...]:
    """By where it begins again; where it never does, all that its range allows."""
    turn = turn_of(values)
    if turn is not None:
        known = {math.tau / size: unit for unit, size in ANGLE_UNITS.items()}
        near = min(known, key=lambda size: abs(math.log(size / turn)))
        return (known[near],) if abs(near - turn) < 0.01 * turn else ()
    return ("deg", "rad")


def _judged(
    table: Logged, columns: tuple[str, ...], unit: str, t_s: Floats, yaw: Floats, places: Places, wheels: Wheels
) -> Iterator[Heading]:
    """The heading, if it turns with the wheels and, in this unit, as far as the path of the fixes."""
    turning = _with_wheels(t_s, yaw, wheels)
    if abs(turning.correlation) < LEAST_CORRELATION or not turning.clear:
        return
    if not _TRACKS_M[0] < wheels.m_per_unit / abs(turning.value) < _TRACKS_M[1]:
        return
    course = turns(places.path, t_s, yaw, wheels.t_s, wheels.left_sum + wheels.right_sum)
    factor = 1.0 / course.value if course.clear and course.value else 0.0
    if course.clear and not _SLOPE[0] < abs(factor) < _SLOPE[1]:
        return
    clockwise = turning.value < 0
    name = ", ".join(words.called(one) for one in columns)
    what = f"{name} is the heading" if unit else f"{name} are the heading's quaternion"
    size = f", in {unit}" if unit else ""
    how = f" and {abs(factor):.2f} times as far as the path of the fixes" if course.clear else ""
    why = f"{what}{size}: it turns with the wheels (correlation {abs(turning.correlation):.3f}){how}"
    sense = f"it {'falls' if clockwise else 'rises'} when the robot turns left, so convention = "
    sense += '"ned" (clockwise, a compass)' if clockwise else '"enu" (counter-clockwise)'
    doubts = []
    wanted = {"deg", "rad"} & {part for one in columns for part in words.parts(one)}
    if unit and wanted and unit not in wanted:
        doubts.append(f"{name} says {' '.join(wanted)} in its name and holds {unit}")
    yield Heading(
        *(
            table,
            columns,
            unit,
            "ned" if clockwise else "enu",
            t_s,
            yaw,
            turning.correlation,
            (why, sense),
            tuple(doubts),
            course.clear or not unit,
        )
    )


def _with_wheels(t_s: Floats, yaw: Floats, wheels: Wheels) -> Slope:
    """Turning of the yaw on the wheels' difference, second by second."""
    grid = np.arange(max(t_s[0], wheels.t_s[0]), min(t_s[-1], wheels.t_s[-1]), _STEP_S)
    if grid.size < 3:
        return Slope(0.0, 0.0, 0)
    apart = np.diff(np.interp(grid, wheels.t_s, wheels.right_sum - wheels.left_sum))
    return slope_through_origin(apart, np.diff(np.interp(grid, t_s, yaw)))
