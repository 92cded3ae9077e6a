"""How noisy this log is: levels and correlation times that make its innovations most likely.

White, hand-set sigmas make a filter far too sure: the error of an AHRS stays for 10 to 30 s, that of a fix for minutes.
The levels (see sccal.filter.levels) maximise the likelihood of the innovations (Schweppe 1965) of the filter itself,
which marginalises constants and effects, over a stretch of the run in which the robot moves.

The likelihood has several hills: a heading that wanders, fixes that wander and wheels that slip can each carry the
blame for the same errors. So it is looked at all over the prior first, at points that leave no large hole (the additive
recurrence of Roberts 2018, which generalises the golden ratio), and climbed from the best of them, one after another,
until two climbs have ended together. Thinned measurements show the hill; all of them then settle where its top is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import Enum
from typing import Protocol, TypeVar

import numba
import numpy as np
from scipy.special import ndtri

from sccal.align import Aligned, Timeline, build_timeline
from sccal.align.accuracy import table_sigma_m
from sccal.arrays import Bools, Floats
from sccal.filter.iterate import At, Extension, RunProblem, iterate, whole_nll
from sccal.filter.levels import Levels, Noise
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start, coarse_constants

STRETCH_S = 480.0
"""So much of a run shows seven numbers; more of it costs more and shows little more."""
COARSE_HZ = (2.0, 1.0, 5.0)
"""Headings, fixes and wheels of the thinned log."""
PATH_HZ = 2.0
"""Of the path, along which effects of the heading are laid out."""
FINE_FIX_HZ, FINE_WHEEL_HZ = 5.0, 10.0
POINTS = 64
SPREAD = 1.4
"""Of the points, in widths of the prior: they reach into its tails, where the odd log is."""
MOST_CLIMBS = 4
TOGETHER_NATS = 1.0
"""Ends of two climbs that are nearer than this are one."""
ROUNDS = 3
DIFFERENCE, CURVATURE_STEP = 0.01, 0.05
"""Steps of the finite differences in the logarithms: below what any level is known to."""
LEAST_CURVATURE = 0.25
"""That of a prior of width two, the widest in the table."""
MOST_STEPS, LONGEST_STEP, SETTLED_NATS = 25, 1.5, 0.1
SHARES = (1.0, 0.5, 0.2, 0.05)
"""Of a step, tried at once."""
MISFIT = "misfit"
"""Where a noise comes from, that of misfit_noise."""
MISFIT_HZ, MISFIT_PATH_HZ = (2.0, 1.0, 20.0), 5.0
MISFIT_HEADING_RAD = float(np.radians(0.2))
MISFIT_FIX_M, MISFIT_SLIP, MISFIT_ROUNDS = 2.0, 0.01, 6
STILL = 1e-5
"""Level of a noise that is switched off."""
NORMAL_MAD = 1.4826
DEFAULT_COLOURED_TAU_S = 30.0


class Reach(Enum):
    """How many points of the prior a search looks at before it climbs."""

    WIDE = POINTS
    FEW = 24
    """Where a noise near the right one is known, but another hill may have become the higher one."""
    ROUGH = 23
    """The same on the thinned log alone: beside many candidates, whose refit has a search of its own."""
    NEAR = 0
    """Where the noise can only move a little: one climb from what is known."""
    LOOK = -1
    """The same on the thinned log alone, for a quick look."""


@dataclass(frozen=True)
class End:
    """Where a climb ended: its cost, the levels' logarithms, and the constants and effects fitted to them."""

    cost: float
    logs: Floats
    at: At
    inverse: Floats
    """Of the curvature there, as far as the climb found it: where another climb may begin."""


def estimate_noise(
    aligned: Aligned,
    start: Start,
    options: FilterOptions,
    heading_rate_hz: float,
    extension: Extension | None = None,
    first: At | None = None,
    near: Sequence[Noise] = (),
    reach: Reach = Reach.WIDE,
) -> tuple[Noise, At]:
    """The log's own noise, given the effects in ``extension``.

    Parameters
    ----------
    aligned, start
        The run and where it begins.
    options
        Priors of the constants; measurements are weighed softly whatever they say.
    heading_rate_hz
        Readings beyond this rate are left out.
    extension
        Effects that are free beside the noise, so that it need not explain what they do; None for none.
    first
        Constants and effects known already, to linearise at.
    near
        Noises known already, as further points to start from.
    reach
        How much of the prior is looked at before climbing.

    Returns
    -------
    tuple[Noise, At]
        The most likely levels, with how far the two best climbs end apart, and constants and effects as they came out
        beside them over the stretch that was looked at.
    """
    search = Search(aligned, start, replace(options, soft_gate=True), extension)
    coarse, fine = search.timelines(heading_rate_hz)
    rough = first or search.problem(coarse, search.levels.centre).at_centre(coarse_constants(aligned, start))
    known = [search.levels.logs(one) for one in near]
    if reach in (Reach.NEAR, Reach.LOOK):
        found = search.climbed(fine if reach is Reach.NEAR else coarse, known[0], rough)
        return search.noise(found.logs), found.at
    best, apart = search.top(coarse, known, rough, reach)
    if reach is Reach.ROUGH:
        return replace(search.noise(best.logs), apart_nats=apart), best.at
    found = search.climbed(fine, best.logs, best.at, best.inverse)
    return replace(search.noise(found.logs), apart_nats=apart), found.at


def misfit_noise(
    aligned: Aligned, start: Start, options: FilterOptions, extension: Extension | None = None, first: At | None = None
) -> tuple[Noise, At]:
    """The noise of a log whose details are not to be trusted: all misfit white, at the level at which it is found.

    Nothing wanders. Fixes, one a second, and wheels are trusted as far as the whole path, laid out along the heading,
    meets them, so that what the model lacks stays visible as misfit of the path instead of passing for slow errors.
    """
    timeline = misfit_timeline(aligned)
    stated_m = float(np.median(np.sqrt(aligned.fix_var_east_m2[aligned.fix_leading])))
    fix_m, slip, at = MISFIT_FIX_M, MISFIT_SLIP, first
    for _ in range(MISFIT_ROUNDS):
        noise = Noise(MISFIT_HEADING_RAD, STILL, 20.0, fix_m / stated_m, STILL, 40.0, slip, MISFIT, {}, stated_m)
        problem = RunProblem(aligned, timeline, start, noise, replace(options, soft_gate=True), extension)
        values, found = iterate(problem, problem.at_centre() if at is None else at, 3, with_sigmas=False)
        at = At(Constants.of(values), values[4:], found)
        fix_nis = float(np.mean(found.fix_nu_m**2 / found.fix_var_m2[:, :2]))
        heading_nis = float(np.mean(found.heading_nu_rad**2 / found.heading_var_rad2))
        fix_m = float(np.clip(fix_m * np.sqrt(fix_nis), stated_m, 50.0))
        slip = float(np.clip(slip * np.sqrt(heading_nis), 0.001, 0.2))
    assert at is not None
    return noise, at


def misfit_timeline(aligned: Aligned) -> Timeline:
    """The events under that noise."""
    heading_hz, fix_hz, wheel_hz = MISFIT_HZ
    return build_timeline(aligned, MISFIT_PATH_HZ, heading_hz, fix_hz, wheel_rate_hz=wheel_hz)


class Search:
    """Negative log-posterior of the noise levels' logarithms for one run, and the way to its least."""

    def __init__(
        self, aligned: Aligned, start: Start, options: FilterOptions, extension: Extension | None = None
    ) -> None:
        self.aligned, self.start, self.options, self.extension = aligned, start, options, extension
        self.fix_sigma_m = float(np.median(np.sqrt(aligned.fix_var_east_m2[aligned.fix_leading])))
        self.levels = Levels.of(self.fix_sigma_m, aligned.yaw_floor_rad, options.with_offset)
        self.others = _other_scales(aligned, start)

    def timelines(self, heading_rate_hz: float) -> tuple[Timeline, Timeline]:
        """The thinned log and the full one, over the stretch that shows the noise."""
        begin = self.aligned.span_s[0]
        still = self.start.moving_from_s - begin
        stretch = (begin, (self.start.moving_from_s if still > 0.25 * STRETCH_S else begin) + STRETCH_S)
        heading_hz, fix_hz, wheel_hz = COARSE_HZ
        path_hz = PATH_HZ if self.extension is not None else 0.01
        coarse = build_timeline(self.aligned, path_hz, min(heading_hz, heading_rate_hz), fix_hz, stretch, wheel_hz)
        return coarse, build_timeline(self.aligned, path_hz, heading_rate_hz, FINE_FIX_HZ, stretch, FINE_WHEEL_HZ)

    def noise(self, logs: Floats) -> Noise:
        """The levels as the filter takes them."""
        return replace(self.levels.noise(logs), other_fix_scale=self.others, fix_stated_m=self.fix_sigma_m)

    def problem(self, timeline: Timeline, logs: Floats) -> RunProblem:
        """The run under some noise."""
        return RunProblem(self.aligned, timeline, self.start, self.noise(logs), self.options, self.extension)

    def points(self) -> list[Floats]:
        """Low-discrepancy points all over the prior."""
        levels = self.levels
        ratio = _generalised_golden_ratio(levels.centre.size)
        alpha = ratio ** -np.arange(1.0, levels.centre.size + 1.0)
        unit = np.modf(0.5 + np.outer(np.arange(1.0, POINTS + 1.0), alpha))[0]
        spread = levels.centre + SPREAD * levels.width * ndtri(np.clip(unit, 1e-3, 1.0 - 1e-3))
        return list(np.clip(spread, levels.low, levels.high))

    def top(self, timeline: Timeline, near: Sequence[Floats], at: At, reach: Reach) -> tuple[End, float]:
        """The best end of several climbs, and by how much the next best is worse (nats)."""
        points = [*near, self.levels.centre, *self.points()[: reach.value]]
        with at_once() as map_at_once:
            costs = np.array(list(map_at_once(self._cost_at(timeline, points[0], at), points)))
        ends: list[End] = []
        for place in np.argsort(costs)[:MOST_CLIMBS]:
            ends.append(self.climbed(timeline, points[int(place)], at))
            ends.sort(key=lambda end: end.cost)
            if len(ends) > 1 and ends[1].cost - ends[0].cost < TOGETHER_NATS:
                break
        return ends[0], ends[1].cost - ends[0].cost

    def climbed(self, timeline: Timeline, logs: Floats, at: At, inverse: Floats | None = None) -> End:
        """From a point to the top of its hill: levels and constants in turns."""
        cost, at = self.settled(timeline, logs, at)
        for _ in range(ROUNDS):
            climbed, inverse = self._climb(timeline, logs, at, inverse)
            before = cost
            settled, there = self.settled(timeline, climbed, at)
            if settled < cost:
                cost, logs, at = settled, climbed, there
            if cost > before - 0.5 * TOGETHER_NATS:
                break
        assert inverse is not None
        return End(cost, logs, at, inverse)

    def settled(self, timeline: Timeline, logs: Floats, at: At) -> tuple[float, At]:
        """Cost at given noise with the constants fitted to it, and these."""
        problem = self.problem(timeline, logs)
        mode, found = iterate(problem, at, max_rounds=2, with_sigmas=False)
        fitted = At(Constants.of(mode), mode[4:], found if problem.extra else None)
        candidates = (at, fitted)
        costs = [self.cost(timeline, logs, one) for one in candidates]
        better = int(np.argmin(costs))
        return costs[better], candidates[better]

    def cost(self, timeline: Timeline, logs: Floats, at: At) -> float:
        """Negative log-posterior of some levels, the constants and effects marginalised about where they are."""
        return self._cost_at(timeline, logs, at)(logs)

    def _climb(self, timeline: Timeline, logs: Floats, at: At, inverse: Floats | None) -> tuple[Floats, Floats]:
        """The most likely levels from a point, the linearisation fixed, and the inverse curvature there."""
        free = self.levels.free
        cost_of = self._cost_at(timeline, logs, at)
        with at_once() as map_at_once:

            def costs(points: Sequence[Floats]) -> Floats:
                return np.array(list(map_at_once(lambda point: cost_of(_with(logs, free, point)), list(points))))

            found, inverse = descend(costs, logs[free], self.levels.low[free], self.levels.high[free], inverse)
        return _with(logs, free, found), inverse

    def _cost_at(self, timeline: Timeline, logs: Floats, at: At) -> Callable[[Floats], float]:
        """Cost of any levels, the linearisation and all that depends on it computed once."""
        problem = self.problem(timeline, logs)
        clear = problem.clear_steps(at.constants)
        columns = problem.columns(at, clear)
        start = problem.start_given(columns, at.values)

        def cost(level: Floats) -> float:
            problem = self.problem(timeline, level)
            found = problem.passed(at, clear, columns, start, with_sigmas=False)
            value = whole_nll(problem, at, found) + self.levels.price(level)
            return value if np.isfinite(value) else 1e12

        return cost


def descend(
    costs: Callable[[Sequence[Floats]], Floats],
    start: Floats,
    low: Floats,
    high: Floats,
    inverse: Floats | None = None,
) -> tuple[Floats, Floats]:
    """The least of a smooth function within bounds, by a quasi-Newton method (BFGS; Nocedal and Wright 2006, 6.1).

    Parameters
    ----------
    costs
        Evaluates several points (k,) at once, which is what several cores are good for.
    start, low, high
        (k,) where to begin, and the bounds.
    inverse
        (k, k) inverse curvature near the start, where one is known. Without it second differences along the axes begin
        the matrix: levels that thousands of readings show and levels that the prior holds differ by a factor of a
        thousand.

    Returns
    -------
    tuple
        The point (k,), and the inverse curvature there as far as it was found.
    """
    here = np.clip(start, low, high)
    cost, slope, fresh = np.inf, np.zeros(start.size), False
    if inverse is not None:
        cost, slope = _slope(costs, here, high)
    for _ in range(MOST_STEPS):
        if inverse is None:
            here, cost, slope, inverse = _curved(costs, here, low, high)
            fresh = True
        held = ((here <= low) & (slope > 0.0)) | ((here >= high) & (slope < 0.0))
        step = np.where(held, 0.0, -inverse @ np.where(held, 0.0, slope))
        step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-12))
        if -float(slope @ step) < SETTLED_NATS:
            break
        points = [np.clip(here + share * step, low, high) for share in SHARES]
        tried = costs(points)
        best = int(np.argmin(tried))
        if not tried[best] < cost:
            if fresh:
                break
            inverse = None  # it promises what the function does not hold: by differences anew
            continue
        moved, before = points[best] - here, slope
        here, fresh = points[best], False
        cost, slope = _slope(costs, here, high, float(tried[best]))
        turned = slope - before
        bend = float(turned @ moved)
        if bend > 1e-10:
            left = np.eye(start.size) - np.outer(moved, turned) / bend
            inverse = left @ inverse @ left.T + np.outer(moved, moved) / bend
    if inverse is None:
        inverse = np.eye(start.size)
    return here, inverse


def _slope(
    costs: Callable[[Sequence[Floats]], Floats], here: Floats, high: Floats, cost: float | None = None
) -> tuple[float, Floats]:
    """Cost at a point (k,) and its derivatives (k,), by differences to the side where there is room."""
    signs = np.where(here + DIFFERENCE > high, -DIFFERENCE, DIFFERENCE)
    beside = [here + sign * one for sign, one in zip(signs, np.eye(here.size), strict=True)]
    found = costs(beside if cost is not None else [here, *beside])
    if cost is None:
        cost, found = float(found[0]), found[1:]
    return cost, (found - cost) / signs


def _curved(
    costs: Callable[[Sequence[Floats]], Floats], start: Floats, low: Floats, high: Floats
) -> tuple[Floats, float, Floats, Floats]:
    """A point inside the bounds, its cost, derivatives (k,) and the inverse (k, k) of its curvatures along the axes."""
    k, h = start.size, CURVATURE_STEP
    here = np.clip(start, low + h, high - h)
    steps = h * np.eye(k)
    found = costs([here, *(here + steps), *(here - steps)])
    cost, up, down = float(found[0]), found[1 : k + 1], found[k + 1 :]
    second = np.maximum((up - 2.0 * cost + down) / h**2, LEAST_CURVATURE)
    return here, cost, (up - down) / (2.0 * h), np.diag(1.0 / second)


def _generalised_golden_ratio(dimensions: int) -> float:
    """The positive root of x^(d+1) = x + 1."""
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (dimensions + 1.0))
    return ratio


Item = TypeVar("Item")
Result = TypeVar("Result")


class MapAtOnce(Protocol):
    """``map`` for functions that leave the interpreter free most of the time."""

    def __call__(self, function: Callable[[Item], Result], items: Iterable[Item], /) -> Iterable[Result]: ...


@contextmanager
def at_once() -> Iterator[MapAtOnce]:
    """A ``map`` whose calls share the cores that this process may use; in processes of their own they have one."""
    cores = min(numba.get_num_threads(), 4)
    if cores < 2:
        yield map
        return
    with ThreadPoolExecutor(max_workers=cores) as pool:
        yield pool.map


def _with(logs: Floats, chosen: Bools, part: Floats) -> Floats:
    """The levels with the chosen ones replaced."""
    level = logs.copy()
    level[chosen] = part
    return level


def _white_level_m(aligned: Aligned, start: Start, rows: Bools) -> float:
    """White part of the fix error (m per axis) from second differences against the wheels; NaN where too few.

    Second differences of fix minus path cancel the slow errors; of white noise they have 6 times its variance.
    """
    index = np.flatnonzero(rows)
    if index.size < 8:
        return float("nan")
    t_s = aligned.fix_t_s[index]
    turn = start.wheel_scale * np.exp(-1j * start.offset_rad)
    path = turn * np.interp(t_s, aligned.wheel_t_s, aligned.path_along_yaw)
    second = np.diff(aligned.fix_east_m[index] + 1j * aligned.fix_north_m[index] - path, n=2)
    regular = second[t_s[2:] - t_s[:-2] < 2.5 * float(np.median(t_s[2:] - t_s[:-2]))]
    parts = np.concatenate((regular.real, regular.imag))
    return NORMAL_MAD * float(np.median(np.abs(parts))) / math.sqrt(6.0)


def _other_scales(aligned: Aligned, start: Start) -> dict[int, float]:
    """Factors for the qualities that do not lead: too few fixes to fit a correlated part, so it is priced in.

    Their white part is measured; what the table's sigma holds beyond it is taken as correlated over 30 s, and its
    variance multiplied by the number of fixes that share it.
    """
    scales: dict[int, float] = {}
    leading = aligned.fix_quality[aligned.fix_leading]
    for code in np.unique(aligned.fix_quality):
        if leading.size and code == leading[0]:
            continue
        rows = aligned.fix_quality == code
        stated = float(np.median(np.sqrt(aligned.fix_var_east_m2[rows])))
        table = float(table_sigma_m(np.array([code]))[0])
        white = _white_level_m(aligned, start, rows)
        white = stated if not np.isfinite(white) else white
        coloured2 = max(max(table, stated) ** 2 - white**2, 0.0)
        interval = float(np.median(np.diff(aligned.fix_t_s[rows]))) if rows.sum() > 1 else DEFAULT_COLOURED_TAU_S
        shared = max(1.0, 2.0 * DEFAULT_COLOURED_TAU_S / max(interval, 0.02))
        scales[int(code)] = float(np.sqrt(white**2 + coloured2 * shared)) / stated
    return scales
