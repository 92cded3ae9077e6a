"""How noisy this log is: levels and correlation times that make its innovations most likely.

White, hand-set sigmas make a filter far too sure: the error of an AHRS stays for 10 to 30 s, that of a fix for minutes.
The heading error and the fix error are each white noise plus a first-order Gauss-Markov process; each wheel's slip is a
random walk along the distance. The seven numbers maximise the likelihood of the innovations (Schweppe 1965) of the
filter itself over a stretch of the run, with wide log-normal priors that only matter where the log says nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import product

import numba
import numpy as np
from scipy.optimize import Bounds, minimize

from sccal.align import Aligned, Timeline, build_timeline
from sccal.align.accuracy import table_sigma_m
from sccal.arrays import Bools, Floats
from sccal.filter.forward import Noise
from sccal.filter.iterate import At, Extension, RunProblem, iterate
from sccal.filter.layout import Columns
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start, coarse_constants

STRETCH_S = 480.0
WHEEL_RATE_HZ = 20.0
FIX_RATE_HZ = 5.0
MAX_CLIMBS = 3
WORTH_ANOTHER_CLIMB = 5.0
SETTLED_HILLS = 3
WANDERS = 3.0
CLOSE_TOPS = 20.0
"""Nats within which a thinned log does not decide between two tops."""
SAME_SLIP = 0.1
FAST = (0, 3, 4, 6)
"""White heading, both levels of the fixes and slip, among Noise's fields: what a thinned log shows least well."""
DIFFERENCE = 0.02
REACH = 2.5
"""Of one climb, in logarithms: a factor of twelve."""
NORMAL_MAD = 1.4826
DEFAULT_COLOURED_TAU_S = 30.0


@dataclass(frozen=True)
class _Scale:
    """Prior of the logarithm of one level: its centre, its width, and hard limits."""

    centre: float
    width: float
    low: float
    high: float


def _scales(fix_sigma_m: float) -> tuple[_Scale, ...]:
    """In the order of Noise's first seven fields; fix_sigma_m is the leading quality's typical sigma."""
    return (
        _Scale(np.radians(0.2), 1.5, np.radians(0.005), np.radians(30.0)),
        _Scale(np.radians(0.7), 1.2, np.radians(0.005), np.radians(60.0)),
        _Scale(25.0, 0.8, 1.0, 300.0),
        _Scale(1.0, 2.0, 0.001, 1000.0),
        _Scale(fix_sigma_m, 1.5, 1e-4, 100.0),
        _Scale(40.0, 0.5, 2.0, 600.0),
        _Scale(0.005, 1.5, 2e-4, 1.0),
    )


def estimate_noise(
    aligned: Aligned,
    start: Start,
    options: FilterOptions,
    heading_rate_hz: float,
    extension: Extension | None = None,
    first: At | None = None,
) -> Noise:
    """The log's own noise: first rough constants under assumed noise, then the noise given them.

    ``first`` are constants and effects known already, to start from instead.

    A coarse search over thinned measurements finds the right hill (a correlated fix error and a slipping wheel can
    both carry the blame); a fine one over all of them then settles what their number changes: white levels and slip.
    """
    soft = replace(options, soft_gate=True)
    likelihood = _Likelihood(aligned, start, soft, extension)
    begin = aligned.span_s[0]
    still = start.moving_from_s - begin
    stretch = (begin, (start.moving_from_s if still > 0.25 * STRETCH_S else begin) + STRETCH_S)
    coarse = build_timeline(aligned, 0.01, 2.0, 1.0, stretch, 5.0)
    fine = build_timeline(aligned, 0.01, heading_rate_hz, FIX_RATE_HZ, stretch, WHEEL_RATE_HZ)

    rough = first
    if rough is None:
        rough = likelihood.problem(coarse, likelihood.centre).at_centre(coarse_constants(aligned, start))
    ordered = likelihood.best_of(coarse, likelihood.hills(), rough)
    cost, level, at = likelihood.climbed(coarse, ordered[:SETTLED_HILLS], rough)
    if first is not None or not likelihood.wanders(level):
        return likelihood.noise(likelihood.climb_smoothly(fine, level, at))
    # Where the model lacks something, a thinned log hardly tells a heading that wanders from wheels that slip; all its
    # measurements do.
    far = [hill for hill in ordered if abs(hill[6] - ordered[0][6]) > SAME_SLIP]
    tops = [(cost, level, at), likelihood.climbed(coarse, far[:SETTLED_HILLS], rough)]
    least = min(cost for cost, _, _ in tops)
    ends = []
    for cost, level, at in tops:
        if cost < least + CLOSE_TOPS:
            end = likelihood.climb_smoothly(fine, level, at)
            ends.append((likelihood.settled(fine, end, at)[0], end))
    return likelihood.noise(min(ends, key=lambda one: one[0])[1])


@dataclass(frozen=True)
class _Remembering(RunProblem):
    """Clear steps depend on the timeline and the ratio of the radii only, and the search comes back to both."""

    known_steps: dict[tuple[int, float], tuple[Floats, Floats]] = field(default_factory=dict)

    def clear_steps(self, constants: Constants) -> tuple[Floats, Floats]:
        key = (id(self.timeline), constants.radius_right_m / constants.radius_left_m)
        if key not in self.known_steps:
            self.known_steps[key] = super().clear_steps(constants)
        return self.known_steps[key]


class _Likelihood:
    """Negative log-posterior of the noise levels' logarithms for one run."""

    def __init__(
        self, aligned: Aligned, start: Start, options: FilterOptions, extension: Extension | None = None
    ) -> None:
        self.aligned, self.start, self.options, self.extension = aligned, start, options, extension
        self.fix_sigma_m = float(np.median(np.sqrt(aligned.fix_var_east_m2[aligned.fix_leading])))
        scales = _scales(self.fix_sigma_m)
        self.centre = np.log([s.centre for s in scales])
        self.width = np.array([s.width for s in scales])
        self.low = np.log([s.low for s in scales])
        self.high = np.log([s.high for s in scales])
        self.free = np.ones(self.centre.size, dtype=bool)
        if not options.with_offset:
            self.free[[1, 2]] = False
        self.others = _other_scales(aligned, start)
        self.known_steps: dict[tuple[int, float], tuple[Floats, Floats]] = {}

    def noise(self, logs: Floats) -> Noise:
        white, coloured, tau, scale, fix_coloured, fix_tau, slip = (float(v) for v in np.exp(logs))
        return Noise(
            white, coloured, tau, scale, fix_coloured, fix_tau, slip, "estimated", self.others, self.fix_sigma_m
        )

    def hills(self) -> list[Floats]:
        """Starting points: who may carry the blame for what white noise does not explain."""
        white = _white_level_m(self.aligned, self.start, self.aligned.fix_leading)
        white = max(white if np.isfinite(white) else self.fix_sigma_m, 1e-4)
        points = []
        for coloured, slip, heading_rad in product((0.1, 1.0, 5.0, 25.0), (0.002, 0.01), np.radians((0.5, 5.0))):
            point = self.centre.copy()
            point[1] = np.log(heading_rad)
            point[3] = np.log(white / self.fix_sigma_m)
            point[4] = np.log(coloured * white)
            point[6] = np.log(slip)
            points.append(np.clip(point, self.low, self.high))
        return points

    def problem(self, timeline: Timeline, logs: Floats) -> RunProblem:
        return _Remembering(
            self.aligned, timeline, self.start, self.noise(logs), self.options, self.extension, self.known_steps
        )

    def cost(
        self, problem: RunProblem, logs: Floats, at: At, clear: tuple[Floats, Floats], columns: Columns | None = None
    ) -> float:
        found = problem.begun(at, True, clear, columns).finish()
        prior = 0.5 * float((((logs - self.centre) / self.width)[self.free] ** 2).sum())
        value = found.nll_heading + found.nll_fix + prior
        return value if np.isfinite(value) else 1e12

    def settled(self, timeline: Timeline, logs: Floats, at: At) -> tuple[float, At]:
        """Cost at given noise with the constants fitted to it, and these."""
        problem = self.problem(timeline, logs)
        mode, found = iterate(problem, at, max_rounds=2)
        fitted = At(Constants.of(mode), mode[4:], found if problem.extra else None)
        candidates = (at, fitted)
        costs = [self.cost(problem, logs, one, problem.clear_steps(one.constants)) for one in candidates]
        better = int(np.argmin(costs))
        return costs[better], candidates[better]

    def best_of(self, timeline: Timeline, points: list[Floats], at: At) -> list[Floats]:
        """The points in order of their cost at the given constants."""
        cost = self._cost_at(timeline, points[0], at)
        return sorted(points, key=cost)

    def wanders(self, logs: Floats) -> bool:
        """Whether the fixes err slowly by more than receivers do: the path is not what the model says."""
        return bool(logs[4] > np.log(WANDERS * self.fix_sigma_m))

    def climbed(self, timeline: Timeline, hills: list[Floats], at: At) -> tuple[float, Floats, At]:
        """From the best of the hills to the top: cost, levels, and the constants fitted to them."""
        settled = [(self.settled(timeline, hill, at), hill) for hill in hills]
        (cost, at), level = min(settled, key=lambda one: one[0][0])
        for _ in range(MAX_CLIMBS):
            level = self.climb(timeline, level, at)
            before = cost
            cost, at = self.settled(timeline, level, at)
            if cost > before - WORTH_ANOTHER_CLIMB:
                break
        return cost, level, at

    def climb(self, timeline: Timeline, logs: Floats, at: At) -> Floats:
        """The most likely levels from a far starting point, the constants' linearisation fixed (Powell)."""
        whole = self._cost_at(timeline, logs, at)
        start = logs[self.free]
        # Its line searches look at the whole range between the bounds, which far away holds other hills.
        near = Bounds(np.maximum(self.low[self.free], start - REACH), np.minimum(self.high[self.free], start + REACH))

        def cost(part: Floats) -> float:
            return whole(_with(logs, self.free, part))

        options = {"maxfev": 250, "xtol": 0.1, "ftol": 1e-4}
        found = minimize(cost, start, method="Powell", bounds=near, options=options)
        return _with(logs, self.free, found.x) if found.fun < cost(start) else logs

    def climb_smoothly(self, timeline: Timeline, logs: Floats, at: At) -> Floats:
        """The fast levels from a near point (L-BFGS-B). The kernel frees the GIL, so differences share the cores."""
        fast = np.isin(np.arange(logs.size), FAST)
        whole = self._cost_at(timeline, logs, at)
        options = {"maxiter": 5, "maxls": 5, "ftol": 1e-6}
        limits = Bounds(self.low[fast], self.high[fast])
        with at_once() as map_at_once:

            def cost_and_slope(part: Floats) -> tuple[float, Floats]:
                points = [part, *(part + DIFFERENCE * unit for unit in np.eye(part.size))]
                here, *beside = map_at_once(lambda point: whole(_with(logs, fast, point)), points)
                return here, (np.array(beside) - here) / DIFFERENCE

            found = minimize(cost_and_slope, logs[fast], jac=True, method="L-BFGS-B", bounds=limits, options=options)
        return _with(logs, fast, found.x)

    def _cost_at(self, timeline: Timeline, logs: Floats, at: At) -> Callable[[Floats], float]:
        """Cost of any levels, the linearisation and all that depends on it computed once."""
        problem = self.problem(timeline, logs)
        clear = problem.clear_steps(at.constants)
        columns = problem.columns(at, clear)

        def cost(level: Floats) -> float:
            return self.cost(self.problem(timeline, level), level, at, clear, columns)

        return cost


@contextmanager
def at_once() -> Iterator[Callable[[Callable[[Floats], float], list[Floats]], Iterable[float]]]:
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
