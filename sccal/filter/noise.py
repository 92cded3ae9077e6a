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
from sccal.filter.forward import ForwardPass
from sccal.filter.iterate import At, Extension, LaidOut, RunProblem, iterate, whole_nll
from sccal.filter.levels import Levels
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start, coarse_constants
from sccal.results.noise import Noise

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
DIFFERENCE = 1e-3
"""Step of the finite differences in the logarithms: far below what any level is known to."""
MOST_STEPS, LONGEST_STEP, SETTLED_NATS = 25, 1.5, 0.2
SHARES = (0.5, 0.2, 0.05)
"""Of a step, tried at once where the whole of it brings less than ENOUGH of what it promised."""
ENOUGH = 0.1
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
    rough = first or search.problem(coarse, search.levels.centre).at_first(coarse_constants(aligned, start))
    known = [search.levels.logs(one) for one in near]
    if reach in (Reach.NEAR, Reach.LOOK):
        found = search.climbed(fine if reach is Reach.NEAR else coarse, known[0], rough)
        return search.noise(found.logs), found.at
    best, apart = search.top(coarse, known, rough, reach)
    if reach is Reach.ROUGH:
        return replace(search.noise(best.logs), apart_nats=apart), best.at
    found = search.climbed(fine, best.logs, best.at)
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
        values, found = iterate(problem, problem.at_first() if at is None else at, 3, with_sigmas=False)
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
            costs = np.array(list(map_at_once(self.about(timeline, at).cost, points)))
        ends: list[End] = []
        for place in np.argsort(costs)[:MOST_CLIMBS]:
            ends.append(self.climbed(timeline, points[int(place)], at))
            ends.sort(key=lambda end: end.cost)
            if len(ends) > 1 and ends[1].cost - ends[0].cost < TOGETHER_NATS:
                break
        return ends[0], ends[1].cost - ends[0].cost

    def climbed(self, timeline: Timeline, logs: Floats, at: At) -> End:
        """From a point to the top of its hill: levels and constants in turns."""
        cost, here = self.settled(logs, self.about(timeline, at))
        for _ in range(ROUNDS):
            climbed = self._climb(here, logs)
            before = cost
            settled, there = self.settled(climbed, here)
            if settled < cost:
                cost, logs, here = settled, climbed, there
            if cost > before - 0.5 * TOGETHER_NATS:
                break
        return End(cost, logs, here.at)

    def about(self, timeline: Timeline, at: At) -> About:
        """What any levels cost where the constants and effects are these."""
        return About(self, timeline, at, self.problem(timeline, self.levels.centre).laid_out(at))

    def settled(self, logs: Floats, here: About) -> tuple[float, About]:
        """Cost at given noise with the constants fitted to it, and about where these are."""
        problem = self.problem(here.timeline, logs)
        mode, found = iterate(problem, here.at, max_rounds=2, with_sigmas=False)
        fitted = self.about(here.timeline, At(Constants.of(mode), mode[4:], found if problem.extra else None))
        candidates = (here, fitted)
        costs = [one.cost(logs) for one in candidates]
        better = int(np.argmin(costs))
        return costs[better], candidates[better]

    def _climb(self, here: About, logs: Floats) -> Floats:
        """The most likely levels from a point, the linearisation fixed."""
        free = self.levels.free
        with at_once() as map_at_once:

            def look(points: Sequence[Floats]) -> list[Look]:
                return list(map_at_once(lambda point: here.look(_with(logs, free, point)), list(points)))

            found = descend(look, logs[free], self.levels.low[free], self.levels.high[free])
        return _with(logs, free, found)


@dataclass(frozen=True)
class About:
    """One linearisation: what any levels cost there, all that depends on it computed once."""

    search: Search
    timeline: Timeline
    at: At
    laid: LaidOut

    def cost(self, logs: Floats) -> float:
        """Negative log-posterior of some levels, the constants and effects marginalised about where they are."""
        return self.look(logs).cost

    def look(self, logs: Floats) -> Look:
        """The same, with what its curvature follows from."""
        problem = self.search.problem(self.timeline, logs)
        found = problem.passed(self.at, self.laid, with_sigmas=False)
        cost = whole_nll(problem, self.at, found) + self.search.levels.price(logs)
        if not np.isfinite(cost):
            return Look(1e12, np.zeros(0))
        levels = self.search.levels
        prior = ((logs - levels.centre) / levels.width)[levels.free]
        return Look(cost, np.concatenate((prior, signs_of(found))))


@dataclass(frozen=True)
class Look:
    """What a point costs, and quantities (n,) in whose changes, squared and added up, its curvature shows."""

    cost: float
    signs: Floats


def signs_of(found: ForwardPass) -> Floats:
    """Standardised innovations and half the logarithms of their variances (n,); NaN for outliers.

    For innovations ν with variances s the expected curvature of the negative log-likelihood is ½ (∂s/s)² + (∂ν)²/s,
    added up (Fisher's information; Schweppe 1965), and that is the expectation of (∂(ν/√s))² + (½ ∂ log s)².
    """
    see, snn, sen = found.fix_var_m2.T
    rest = snn - sen**2 / see
    rest_nu = found.fix_nu_m[:, 1] - sen / see * found.fix_nu_m[:, 0]
    nu = np.concatenate((found.heading_nu_rad, found.fix_nu_m[:, 0], rest_nu))
    var = np.concatenate((found.heading_var_rad2, see, rest))
    taken = np.concatenate((found.heading_accepted, found.fix_accepted, found.fix_accepted))
    signs = np.concatenate((nu / np.sqrt(var), 0.5 * np.log(var)))
    return np.where(np.concatenate((taken, taken)), signs, np.nan)


def descend(look: Callable[[Sequence[Floats]], list[Look]], start: Floats, low: Floats, high: Floats) -> Floats:
    """The least of a negative log-posterior within bounds, by Fisher's scoring.

    Parameters
    ----------
    look
        Looks at several points (k,) at once, which is what several cores are good for.
    start, low, high
        (k,) where to begin, and the bounds.

    Returns
    -------
    Floats
        The point (k,).
    """
    here = np.clip(start, low, high)
    cost, slope, curvature = _around(look, here, high)
    longest, before = np.full(here.size, LONGEST_STEP), np.zeros(here.size)
    for _ in range(MOST_STEPS):
        step = _step(here, slope, curvature, low, high, longest)
        promised = -float(slope @ step)
        if promised < SETTLED_NATS:
            break
        # The whole step and what is around its end at once: mostly it is the right one.
        there = np.clip(here + step, low, high)
        reached, *around = _around(look, there, high)
        if not reached < cost - ENOUGH * promised:
            points = [np.clip(here + share * step, low, high) for share in SHARES]
            tried = [one.cost for one in look(points)]
            best = int(np.argmin(tried))
            if tried[best] < min(cost, reached):
                there = points[best]
                reached, *around = _around(look, there, high)
            elif not reached < cost:
                break
        # A level that goes to and fro is one whose curvature grows on the way: in shorter steps.
        moved = there - here
        longest = np.where(moved * before < 0.0, 0.4 * np.abs(before), np.minimum(2.0 * longest, LONGEST_STEP))
        here, before, cost, (slope, curvature) = there, moved, reached, around
    return here


def _step(here: Floats, slope: Floats, curvature: Floats, low: Floats, high: Floats, longest: Floats) -> Floats:
    """The way (k,) to where a parabola has its least within the bounds and so far at most.

    By active sets: what would leave the box is held at its side, and let go again where the rest of the way turns it.
    """
    least, most = np.maximum(low - here, -longest), np.minimum(high - here, longest)
    step, held = np.zeros(here.size), np.zeros(here.size, dtype=np.bool_)
    for _ in range(10 * here.size):
        free = ~held
        wanted = step.copy()
        rest = slope[free] + curvature[np.ix_(free, held)] @ step[held]
        wanted[free] = -np.linalg.solve(curvature[np.ix_(free, free)], rest)
        away = wanted - step
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(away > 0.0, (most - step) / away, np.where(away < 0.0, (least - step) / away, np.inf))
        nearest = int(np.argmin(room))
        if room[nearest] < 1.0:
            step = np.clip(step + max(room[nearest], 0.0) * away, least, most)
            held[nearest] = True
            continue
        step = wanted
        pull = slope + curvature @ step
        inward = np.where(held, np.where(step >= most, pull, -pull), 0.0)
        if inward.max() <= 1e-9 * max(1.0, float(np.abs(slope).max())):
            break
        held[int(np.argmax(inward))] = False
    return step


def _around(look: Callable[[Sequence[Floats]], list[Look]], here: Floats, high: Floats) -> tuple[float, Floats, Floats]:
    """Cost at a point (k,), its derivatives (k,) and its curvature (k, k), by differences to where there is room."""
    beside = np.where(here + DIFFERENCE > high, -DIFFERENCE, DIFFERENCE)
    middle, *others = look([here, *(here + np.diag(beside))])
    slope = np.array([one.cost - middle.cost for one in others]) / beside
    if any(one.signs.size != middle.signs.size for one in others) or not middle.signs.size:
        return middle.cost, slope, np.eye(here.size)
    turned = np.nan_to_num(np.array([one.signs - middle.signs for one in others]) / beside[:, None])
    curvature = turned @ turned.T
    return middle.cost, slope - 0.5 * beside * np.diag(curvature), curvature


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
