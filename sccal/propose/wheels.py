"""Which columns hold the two wheels: their mean goes with the way of the fixes, and their difference with its turns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from sccal.align.signs import Slope
from sccal.arrays import Floats
from sccal.propose import words
from sccal.propose.motion import Moved, moved_by, share_explained, summed, turns, unwrapped
from sccal.propose.places import Places, moved_in_time
from sccal.propose.tables import Folder, Logged

LEAST_EXPLAINED = 0.8
"""Of the variance of the fixes' displacements: counters of wheels explain 0.95 and more on any ground, while a voltage
or a current, which go with the speed too, stay below a half."""
CLEARLY_BETTER = 0.03
"""By so much of that share one reading of a column must be better than another to be taken for it."""
_ONE_WAY = 0.8
"""Of all travel: robots go forwards for most of the way, or their log is told apart by nothing else."""
_MOST_COLUMNS = 24
_APART_S = 60.0
"""By so much two loggers of one drive are started apart."""
_RADII_M = (0.01, 1.5)
"""Of wheels and sprockets: from a toy's to a tractor's."""
_NEAR_ONE = (0.75, 1.33)
"""Metres per metre: wheels differ from what their logger takes them for by less than a third, or align refuses."""
_COARSE_M = 0.0015
"""A whole number per second that stands for so little is a rate of ticks: 1 rpm of the smallest wheel is 1 mm/s."""


@dataclass(frozen=True)
class Wheels:
    """A pair of columns taken for the wheels."""

    table: Logged
    left: str
    right: str
    is_rate: bool
    explained: float
    m_per_unit: float
    t_s: Floats
    left_sum: Floats
    """(n) Cumulative, forward positive."""
    right_sum: Floats
    sided: bool
    reversed: tuple[bool, bool] = (False, False)
    why: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    course: Slope = field(default_factory=lambda: Slope(0.0, 0.0, 0))
    """Of the turns of the fixes' path on the difference right − left; not clear where the names alone say the sides."""


def wheels_in(
    folder: Folder, places: Places, besides: frozenset[tuple[str, str]]
) -> tuple[Wheels | None, tuple[str, ...]]:
    """The pair that goes best with the fixes, and others that do too; ``besides`` are columns (file, name) in use."""
    moved = moved_by(places.path)
    found = [one for table in folder.tables for one in _of_table(table, moved, besides)]
    if not found:
        return None, ()
    best = max(found, key=lambda one: (one.sided, _rank(one)))
    like = [one for one in found if one.sided == best.sided and (one.left, one.right) != (best.left, best.right)]
    others = tuple(f"{one.table.name}: {words.called(one.left)}, {words.called(one.right)}" for one in like[:4])
    return _with_sides(_with_signs(best, moved), places), others


def clock_of_wheels(folder: Folder, places: Places) -> Places | None:
    """The fixes moved to the clock of wheels that share no time with them; None where no columns' names say wheels.

    Both logs are taken to begin together, within what people need to start two of them; the way that both go says the
    rest. A calibration finds the exact offset by itself.
    """
    best: tuple[float, float, str] = (LEAST_EXPLAINED, 0.0, "")
    for table in folder.tables:
        begin_s, end_s = float(places.path.t_s[0]), float(places.path.t_s[-1])
        if table.name == places.file or (table.t_s[-1] > begin_s and table.t_s[0] < end_s):
            continue
        for left, right in _sided_pairs(list(table.numbers)):
            together_s = float(table.t_s[0]) - begin_s
            for by_s in together_s + np.arange(-_APART_S, _APART_S, 0.5):
                moved = moved_by(replace(places.path, t_s=places.path.t_s + by_s))
                explained = max((one.explained for one in _read_best(table, left, right, moved)), default=0.0)
                best = max(best, (explained, float(by_s), table.name))
    if not best[2]:
        return None
    doubt = (
        f"{places.file} and {best[2]} have clocks of their own, {best[1]:.1f} s apart by the motion: a calibration "
        "finds it again, but times of one clock are better"
    )
    return moved_in_time(places, best[1], doubt)


def _rank(one: Wheels) -> tuple[int, bool]:
    """By what is explained in steps of CLEARLY_BETTER; counters before rates, which say nothing between their rows."""
    return round(one.explained / CLEARLY_BETTER), not one.is_rate


def _of_table(table: Logged, moved: Moved, besides: frozenset[tuple[str, str]]) -> Iterator[Wheels]:
    names = [name for name in table.numbers if (table.name, name) not in besides and _varies(table.numbers[name])]
    named = list(_sided_pairs(names))
    good = [one for pair in named for one in _read_best(table, *pair, moved)]
    if not good:
        few = names[:_MOST_COLUMNS]
        unsided = [pair for pair in combinations(few, 2) if pair not in named]
        good = [one for pair in unsided for one in _read_best(table, *pair, moved)]
        good = [one for one in good if _are_alike(one)]
    yield from good


def _sided_pairs(names: list[str]) -> Iterator[tuple[str, str]]:
    """Names that differ only in the word for the side."""
    lefts = {rest: name for name in names for side, rest in [words.side_of(name)] if side == "left"}
    rights = {rest: name for name in names for side, rest in [words.side_of(name)] if side == "right"}
    yield from ((lefts[rest], rights[rest]) for rest in lefts if rest in rights)


def _varies(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 1 and float(np.ptp(known)) > 0.0


def _are_alike(one: Wheels) -> bool:
    """Whether two columns without sides count equally much, and not the same: a distance may stand there twice."""
    left, right = np.ptp(one.left_sum), np.ptp(one.right_sum)
    apart = np.abs(one.right_sum - one.left_sum - (one.right_sum - one.left_sum)[0]).max()
    return bool(0.5 < left / max(right, 1e-12) < 2.0 and apart > 1e-6 * max(left, right))


def _read_best(table: Logged, left: str, right: str, moved: Moved) -> Iterator[Wheels]:
    """The pair as counters or as rates, whichever goes with the fixes; nothing where neither does."""
    t_s, a, b = table.pair(left, right)
    sided = words.side_of(left)[0] != ""
    found = []
    for is_rate in (False, True):
        left_sum, right_sum = (summed(t_s, unwrapped(one), is_rate) for one in (a, b))
        for sign in (1.0, -1.0):
            explained, slope = share_explained(moved, t_s, 0.5 * (left_sum + sign * right_sum), sided)
            found.append((explained, slope, is_rate, sign, left_sum, sign * right_sum))
    explained, slope, is_rate, sign, left_sum, right_sum = max(found, key=lambda one: one[0])
    if explained < LEAST_EXPLAINED:
        return
    one_reversed = (False, sign < 0)
    yield Wheels(
        table,
        left,
        right,
        is_rate,
        explained,
        slope,
        t_s,
        left_sum,
        right_sum,
        sided,
        one_reversed,
    )


def _with_signs(one: Wheels, moved: Moved) -> Wheels:
    """Forward positive: where one of the two counts backwards, it is the one that falls over most of the way."""
    falls = _net_share(one) < 0
    if one.reversed[1] and falls:
        one = replace(one, left_sum=-one.left_sum, right_sum=-one.right_sum, reversed=(True, False))
    kind = "rates" if one.is_rate else "counters"
    lows = [
        f"{words.called(name)} goes from {np.nanmin(column):.9g} to {np.nanmax(column):.9g}"
        for name in (one.left, one.right)
        for column in [one.table.numbers[name]]
    ]
    how = "their integrals follow" if one.is_rate else "their steps follow"
    why = (
        f"{words.called(one.left)} and {words.called(one.right)} are {kind} of the wheels: {how} the way of the fixes "
        f"({100 * one.explained:.0f} % of its variance); {', '.join(lows)}",
    )
    told = tuple(
        f"{words.called(name)} counts backwards: it falls while the other rises and the fixes move"
        for name, back in zip((one.left, one.right), one.reversed, strict=True)
        if back
    )
    return replace(one, why=(*why, *told))


def _net_share(one: Wheels) -> float:
    """Net travel of the mean, as a share of all its travel, with its sign."""
    steps = np.diff(0.5 * (one.left_sum + one.right_sum))
    way = float(np.abs(steps).sum())
    return float(steps.sum()) / way if way else 0.0


def _with_sides(one: Wheels, places: Places) -> Wheels:
    """Left and right by the turns of the fixes' path, whatever the names say."""
    difference = one.m_per_unit * (one.right_sum - one.left_sum)
    travel = one.left_sum + one.right_sum
    course = turns(places.path, one.t_s, difference, one.t_s, travel)
    if not course.clear:
        return replace(one, course=course)
    return with_course(one, course)


def with_course(one: Wheels, course: Slope) -> Wheels:
    """The pair with its sides as the turns of the fixes' path say: ``course`` is their slope on its difference."""
    net = _net_share(one)
    told_by = f"{words.called(one.right)} − {words.called(one.left)} rises when the path of the fixes turns"
    if course.value > 0:
        why = f"{words.called(one.left)} is the left wheel: {told_by} left (correlation {course.correlation:+.2f})"
        doubts = one.doubts
        if net < -_ONE_WAY:
            doubts = (
                *doubts,
                "both wheels go backwards for most of the way: if the robot did not, both are reversed and exchanged",
            )
        return replace(one, why=(*one.why, why), doubts=doubts, course=course)
    told = f"{told_by} right (correlation {course.correlation:+.2f})"
    if net < 0:
        why = f"both count backwards: they fall over most of the way, and {told}"
        flipped = (not one.reversed[0], not one.reversed[1])
        one = replace(one, left_sum=-one.left_sum, right_sum=-one.right_sum, reversed=flipped)
    else:
        why = f"{words.called(one.right)} is the left wheel{', whatever its name says' if one.sided else ''}: {told}"
        one = replace(
            one,
            left=one.right,
            right=one.left,
            left_sum=one.right_sum,
            right_sum=one.left_sum,
            reversed=one.reversed[::-1],
        )
    doubts = one.doubts
    if one.sided and net >= 0:
        told = f"{words.called(one.left)} is taken for the left wheel against its name: look at a map of the fixes"
        doubts = (*doubts, told)
    return replace(
        one, why=(*one.why, why), doubts=doubts, course=Slope(-course.value, -course.correlation, course.windows)
    )


@dataclass(frozen=True)
class WheelUnit:
    """The unit of the wheels' columns, and what a turn of the wheel is in it."""

    unit: str
    radius_m: float
    """Nominal."""
    ticks_per_rev: float | None
    why: tuple[str, ...]
    doubts: tuple[str, ...] = ()


PLACEHOLDER_RADIUS_M = 0.1
"""Where nothing says how large a wheel is: a round number between the small robots' and the large ones'. Only its
product with the counts per turn meets the data."""


def unit_of(one: Wheels, radius_m: float | None, ticks_per_turn: float | None) -> WheelUnit:
    """The unit by the size of a step, and by the name where sizes leave a choice."""
    if one.is_rate:
        return _rate_unit(one, radius_m, ticks_per_turn)
    return _count_unit(one, radius_m, ticks_per_turn)


def _count_unit(one: Wheels, radius_m: float | None, ticks_per_turn: float | None) -> WheelUnit:
    m = one.m_per_unit
    named = {part for name in (one.left, one.right) for part in words.parts(name)}
    per = f"one is {m:.5g} m of way"
    if _is_whole(one) or ticks_per_turn is not None:
        return _in_ticks(m, "ticks", radius_m, ticks_per_turn, f"whole numbers, {per}")
    told_rad = radius_m is not None and _NEAR_ONE[0] < m / radius_m < _NEAR_ONE[1]
    if _NEAR_ONE[0] < m < _NEAR_ONE[1] and not told_rad:
        return _in_metres("m", radius_m, f"{per}: metres", "rad" in named)
    if _RADII_M[0] < m < _RADII_M[1]:
        why = f"the wheels' columns are radians: {per}, which is the radius of a wheel"
        doubts = (
            ()
            if "rad" in named or radius_m
            else (
                "radians are taken, as no name says so: a wheel of "
                f"{m:.3g} m; if they are another unit, give --ticks-per-turn (of that unit)",
            )
        )
        return WheelUnit("rad", _rounded(m), None, (why,), doubts)
    return _in_ticks(m, "ticks", radius_m, ticks_per_turn, f"no whole numbers, {per}: neither metres nor radians")


def _rate_unit(one: Wheels, radius_m: float | None, ticks_per_turn: float | None) -> WheelUnit:
    m = one.m_per_unit
    named = {part for name in (one.left, one.right) for part in words.parts(name)}
    per = f"one, over a second, is {m:.5g} m of way"
    if ticks_per_turn is not None or (_is_whole(one) and m < _COARSE_M):
        return _in_ticks(m, "ticks/s", radius_m, ticks_per_turn, per)
    fits = {"rpm": m * 60.0 / (2.0 * np.pi), "rad/s": m}
    fits = {unit: radius for unit, radius in fits.items() if _RADII_M[0] < radius < _RADII_M[1]}
    told_rad = radius_m is not None and _NEAR_ONE[0] < m / radius_m < _NEAR_ONE[1]
    if _NEAR_ONE[0] < m < _NEAR_ONE[1] and not told_rad:
        return _in_metres("m/s", radius_m, f"{per}: metres per second", bool(named & {"rad", "rads"}))
    if not fits:
        return _in_ticks(m, "ticks/s", radius_m, ticks_per_turn, f"{per}: neither m/s, rpm nor rad/s")
    called = next((unit for unit in fits if unit.split("/")[0] in named), "")
    if not called and named & {"rads", "radps", "omega", "w"} and "rad/s" in fits:
        called = "rad/s"
    if radius_m is not None:
        unit = min(fits, key=lambda name: abs(np.log(fits[name] / radius_m)))
        return WheelUnit(
            unit, radius_m, None, (f"the wheels' columns are {unit}: {per}, as wheels of {radius_m:g} m do",)
        )
    unit = called or max(fits, key=lambda name: -abs(np.log(fits[name] / PLACEHOLDER_RADIUS_M)))
    why = f"the wheels' columns are {unit}: {per}, so a wheel of {fits[unit]:.3g} m"
    others = [f"{name} (a wheel of {size:.3g} m)" for name, size in fits.items() if name != unit]
    doubt = (
        f"no name says the unit of the wheels: {unit} is taken, {' or '.join(others)} would fit too: give --radius-m"
    )
    return WheelUnit(unit, _rounded(fits[unit]), None, (why,), () if called or not others else (doubt,))


def _in_metres(unit: str, radius_m: float | None, why: str, called_rad: bool) -> WheelUnit:
    used = radius_m or PLACEHOLDER_RADIUS_M
    doubt = (
        f"the log says metres and no wheel radius: {used:g} m stands in for it, and what is calibrated is how many "
        "metres the log's metre is, times that; give --radius-m from the tape measure"
    )
    doubts = () if radius_m else (doubt,)
    if called_rad:
        doubts = (
            *doubts,
            "the wheels' names say rad: were it so, the wheels would have a radius of a metre; give --radius-m",
        )
    return WheelUnit(unit, used, None, (f"the wheels' columns are {unit}: {why}",), doubts)


def _in_ticks(m: float, unit: str, radius_m: float | None, ticks_per_turn: float | None, why: str) -> WheelUnit:
    """Metres per tick is all that a log shows: radius and ticks per turn only together."""
    told = f"the wheels' columns are {unit}: {why}"
    if ticks_per_turn is not None:
        radius = radius_m or _rounded(m * ticks_per_turn / (2.0 * np.pi))
        how = f"{ticks_per_turn:g} ticks per turn as told, so a wheel of {m * ticks_per_turn / (2.0 * np.pi):.4g} m"
        return WheelUnit(unit, radius, ticks_per_turn, (told, how))
    used = radius_m or PLACEHOLDER_RADIUS_M
    ticks = float(f"{2.0 * np.pi * used / m:.4g}")
    if radius_m is not None:
        return WheelUnit(unit, used, ticks, (told, f"a wheel of {used:g} m as told, so {ticks:g} ticks per turn"))
    doubt = (
        f"ticks per turn and wheel radius cannot be told apart by any log, only {m:.5g} m per tick: radius {used:g} m "
        f"and {ticks:g} ticks per turn stand in for them. Give --ticks-per-turn (data sheet, times the gear) or "
        "--radius-m (tape measure), and the radii are the wheels' own"
    )
    return WheelUnit(unit, used, ticks, (told,), (doubt,))


def _is_whole(one: Wheels) -> bool:
    return all((column == np.round(column)).all() for column in one.table.pair(one.left, one.right)[1:])


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
