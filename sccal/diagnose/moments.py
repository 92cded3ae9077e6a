"""What lives in one moment or at one place: steps and local fields, each tried by a pass of the filter itself.

All evidence for a jump lies around its moment, so blocks of time cannot vote on it, and the filter's gates throw the
first measurements after it away, so that sensitivities cannot see it either. Here every suspected moment and place is
put into the filter as a free parameter, and the likelihood says how much better the run becomes. Suspects are where the
innovations are large together, and a grid. Gates are soft: an outlier can win nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sccal.align import Timeline, build_timeline
from sccal.arrays import Bools, Floats
from sccal.calibration.extension import Free, FreeEffects, view_run
from sccal.diagnose.model import Model
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect
from sccal.effects.view import DriveView
from sccal.filter.columns import Placed, kernel_columns
from sccal.filter.iterate import At, RunProblem
from sccal.filter.layout import BASE_STATES

HEADING_HZ, FIX_HZ, WHEEL_HZ, OUTPUT_HZ = 2.0, 1.0, 5.0, 1.0
WINDOW_S = 4.0
SUSPECTS = 6
GRID = 14
BESIDE_S = (0.0, 0.7, 1.5)
"""A jump begins within a second or so of where its window does."""
APART_S = 12.0
EDGE_S = 20.0
"""Nothing is looked for so near to the ends: a step there is a start."""
ZOOMS, POINTS = 3, 7
ANY_SIZE = 5.0
"""Factor on the priors: a jump that the filter thinks impossible would be taken for outliers."""
RADII_M = (1.5, 3.0, 6.0)
PLACE_RADII = 1.0
LOOKED_ELSEWHERE_NATS = 10.0
"""Price of having tried hundreds of moments, and of the moment itself."""
ORDINARY = 3.0
"""A find must stand out so many times above what any other moment of the run gains."""


@dataclass(frozen=True)
class Moment:
    """An effect with its moment or place, as found in one run."""

    run: int
    free: Free
    values: Floats
    """Of its free parameters, file units."""
    sigmas: Floats
    gain_nats: float
    """In log-likelihood, less the price of the search."""
    t: float
    """Size over its error, the moment or place as found."""
    shape_sigmas: Mapping[str, float] = field(default_factory=dict)
    """Of the place and its size; a moment is known to the reading."""

    @property
    def size(self) -> float:
        """Largest parameter in units of the smallest size that matters."""
        least = np.array([one.matters for one in self.free.parameters])
        return float(np.max(np.abs(self.values) / np.maximum(least, 1e-12)))


class _Scan:
    """One run, thinned, with its model's columns ready, so that a trial costs one pass."""

    def __init__(self, problem: RunProblem, at: At, timeline: Timeline | None = None) -> None:
        if timeline is None:
            timeline = build_timeline(problem.aligned, OUTPUT_HZ, HEADING_HZ, FIX_HZ, wheel_rate_hz=WHEEL_HZ)
        soft = replace(problem.options, soft_gate=True)
        self.problem = replace(problem, timeline=timeline, options=soft)
        self.at = at
        self.clear = self.problem.clear_steps(at.constants)
        self.view: DriveView = view_run(self.problem, at, self.clear)
        extension = problem.extension
        self.effects = extension.effects if isinstance(extension, FreeEffects) else ()
        self.placed: list[Placed] = FreeEffects(self.effects).placed(self.view, at.values) if self.effects else []
        self.base_nll, self.suspicious = self._base()

    def _base(self) -> tuple[float, tuple[tuple[Floats, Floats], tuple[Floats, Floats]]]:
        columns = kernel_columns(self.placed, self.problem.timeline)
        found = self.problem.begun(self.at, True, self.clear, columns).finish()
        fix_t = self.problem.aligned.fix_t_s[self.problem.timeline.fix_index]
        heading_t = self.problem.aligned.heading_t_s[self.problem.timeline.heading_index]
        heading = found.heading_nu_rad**2 / found.heading_var_rad2
        fix = (found.fix_nu_m**2 / found.fix_var_m2[:, :2]).sum(axis=1)
        return found.nll_heading + found.nll_fix, ((heading_t, heading), (fix_t, fix))

    def trial(self, effect: Effect, shapes: Mapping[str, float]) -> tuple[float, Floats, Floats]:
        """Gain in nats, values and sigmas of the effect's free parameters with its shapes as given."""
        free = Free(effect, dict(shapes), ANY_SIZE)
        extension = FreeEffects((*self.effects, free))
        count = len(free.parameters)
        first = self.at.values.size
        placed = self.placed + free.placed(self.view, [0.0] * count, first)
        problem = replace(self.problem, extension=extension)
        at = At(self.at.constants, np.concatenate((self.at.values, np.zeros(count))), self.at.path)
        columns = kernel_columns(placed, problem.timeline)
        found = problem.begun(at, True, self.clear, columns).finish()
        here = slice(BASE_STATES + first, BASE_STATES + first + count)
        sigmas = np.sqrt(np.maximum(np.diag(found.final_covariance)[here], 1e-30))
        gain = self.base_nll - found.nll_heading - found.nll_fix
        return (gain if np.isfinite(gain) else -np.inf), found.final_state[here].copy(), sigmas

    def best(self, effect: Effect, tries: Sequence[Mapping[str, float]]) -> tuple[Mapping[str, float], Floats]:
        """The most likely of some shapes, and the gains of all."""
        gains = np.array([self.trial(effect, shapes)[0] for shapes in tries])
        return tries[int(np.argmax(gains))], gains


def find_moments(model: Model, run: int, known: Sequence[str]) -> list[Moment]:
    """Every effect of a moment or a place that stands out in one run, the largest gain first."""
    problem = model.problems[run]
    start_s, end_s = problem.aligned.span_s
    if end_s - start_s < 4.0 * EDGE_S:
        return []
    scan = _Scan(problem, model.at(run))
    grid = np.linspace(EDGE_S, end_s - start_s - EDGE_S, GRID)
    heading_s, fix_s = (_peaks(*one, start_s, end_s) for one in scan.suspicious)
    found: list[Moment] = []
    for name, suspects in (("heading_step", heading_s), ("base_shift", fix_s), ("radius_step", np.zeros(0))):
        if name not in known:
            found += _search_time(scan, problem, run, CATALOGUE[name], suspects, grid)
    if "local_field" not in known:
        found += _search_place(scan, run, CATALOGUE["local_field"], heading_s, grid)
    return sorted(found, key=lambda one: -one.gain_nats)


def _search_time(
    scan: _Scan, whole: RunProblem, run: int, effect: Effect, suspects: Floats, grid: Floats
) -> list[Moment]:
    around = (suspects[:, None] + np.array(BESIDE_S)).ravel()
    tries = np.concatenate((around, grid))
    best, gains = scan.best(effect, [{"at_s": float(s)} for s in tries])
    ordinary = _ordinary(gains[around.size :])
    step = float(grid[1] - grid[0]) if not np.isin(best["at_s"], around) else WINDOW_S
    limit = (float(grid[0]), float(grid[-1]))
    for _ in range(ZOOMS):
        nearby = np.clip(best["at_s"] + step * np.linspace(-1.0, 1.0, POINTS), *limit)
        best, _ = scan.best(effect, [{"at_s": float(s)} for s in nearby])
        step *= 2.0 / (POINTS - 1)
    found = _moment(scan, run, effect, best, ordinary)
    return [_settled(whole, one, scan) for one in found]


def _settled(whole: RunProblem, rough: Moment, scan: _Scan) -> Moment:
    """The moment to the reading: a parameter that is free one reading early is fitted to that reading."""
    timeline = whole.timeline
    index = timeline.heading_index if rough.free.effect.name == "heading_step" else timeline.fix_index
    of = whole.aligned.heading_t_s if rough.free.effect.name == "heading_step" else whole.aligned.fix_t_s
    t_s = of[index] - whole.aligned.span_s[0]
    near = t_s[np.abs(t_s - rough.free.shapes["at_s"]) < 2.0 / FIX_HZ]
    if near.size < 2:
        return rough
    fine = _Scan(whole, scan.at, timeline)
    between = 0.5 * (near[1:] + near[:-1])
    best, _ = fine.best(rough.free.effect, [{"at_s": float(s)} for s in between[:: max(between.size // 24, 1)]])
    _, values, sigmas = fine.trial(rough.free.effect, best)
    t = float(np.max(np.abs(values) / sigmas))
    return replace(rough, free=replace(rough.free, shapes=dict(best)), values=values, sigmas=sigmas, t=t)


def _search_place(scan: _Scan, run: int, effect: Effect, suspects: Floats, grid: Floats) -> list[Moment]:
    seen = scan.view.headings
    start_s = scan.problem.aligned.span_s[0]

    def at(since_s: float, radius_m: float) -> dict[str, float]:
        return {
            "east_m": float(np.interp(start_s + since_s, seen.t_s, seen.east_m)),
            "north_m": float(np.interp(start_s + since_s, seen.t_s, seen.north_m)),
            "radius_m": radius_m,
        }

    tries = [at(float(s), radius) for s in suspects for radius in RADII_M]
    _, usual = scan.best(effect, [at(float(s), RADII_M[1]) for s in grid])
    if not tries:
        return []
    best, _ = scan.best(effect, tries)
    step = 1.0
    for _ in range(2 * ZOOMS):
        before = best
        for name in ("east_m", "north_m"):
            size = step * before["radius_m"]
            best, _ = scan.best(effect, [{**best, name: best[name] + size * k} for k in (-1.0, -0.5, 0.0, 0.5, 1.0)])
        best, _ = scan.best(effect, [{**best, "radius_m": best["radius_m"] * k} for k in (0.7, 0.85, 1.0, 1.2, 1.4)])
        if best == before:
            step *= 0.5
    return [_with_place_errors(scan, one) for one in _moment(scan, run, effect, best, _ordinary(usual))]


def _with_place_errors(scan: _Scan, found: Moment) -> Moment:
    """Sigmas of the place and its size from the curvature of the likelihood, and what they do to the effect's size.

    A robot that passes a place once on a straight line sees neither on which side it lies nor how far off: a weak field
    nearby and a strong one further away are the same to it.
    """
    names = ("east_m", "north_m", "radius_m")
    radius = found.free.shapes["radius_m"]
    steps = np.array([0.3, 0.3, 0.2]) * radius

    def at(offset: Floats) -> tuple[float, Floats]:
        shapes = {name: found.free.shapes[name] + float(d) for name, d in zip(names, offset, strict=True)}
        gain, values, _ = scan.trial(found.free.effect, shapes)
        return gain, values

    units = np.diag(steps)
    here, _ = at(np.zeros(3))
    curvature = np.zeros((3, 3))
    slopes = np.zeros((3, found.values.size))
    for i in range(3):
        (up, more), (down, less) = at(units[i]), at(-units[i])
        curvature[i, i] = -(up - 2.0 * here + down) / steps[i] ** 2
        slopes[i] = (more - less) / (2.0 * steps[i])
        for j in range(i):
            crossed = [at(a * units[i] + b * units[j])[0] * a * b for a in (1.0, -1.0) for b in (1.0, -1.0)]
            curvature[i, j] = curvature[j, i] = -sum(crossed) / (4.0 * steps[i] * steps[j])
    # Known no better than to a few radii in any direction, which also keeps a flat or saddled likelihood in hand.
    values, vectors = np.linalg.eigh(curvature)
    least = 1.0 / (PLACE_RADII * radius) ** 2
    covariance = vectors @ np.diag(1.0 / np.maximum(values, least)) @ vectors.T
    sigmas = np.sqrt(found.sigmas**2 + np.einsum("ik,ij,jk->k", slopes, covariance, slopes))
    of_place = {name: float(sigma) for name, sigma in zip(names, np.sqrt(np.diag(covariance)), strict=True)}
    return replace(found, sigmas=sigmas, shape_sigmas=of_place)


def _moment(scan: _Scan, run: int, effect: Effect, shapes: Mapping[str, float], ordinary: float) -> list[Moment]:
    gain, values, sigmas = scan.trial(effect, shapes)
    gain -= LOOKED_ELSEWHERE_NATS + ORDINARY * ordinary
    t = float(np.max(np.abs(values) / sigmas))
    return [Moment(run, Free(effect, dict(shapes), ANY_SIZE), values, sigmas, gain, t)] if gain > 0.0 else []


def _ordinary(gains: Floats) -> float:
    """What an arbitrary moment gains in this run: nothing, where the noise is what the filter takes it for."""
    return float(max(np.quantile(gains, 0.2), 0.0))


def _peaks(t_s: Floats, squared: Floats, start_s: float, end_s: float) -> Floats:
    """Times since the start at which innovations are large together, the largest first; single outliers apart."""
    if t_s.size < 10:
        return np.zeros(0)
    inside: Bools = (t_s > start_s + EDGE_S) & (t_s < end_s - EDGE_S)
    edges = np.arange(start_s + EDGE_S, end_s - EDGE_S, 0.5 * WINDOW_S)
    values = np.minimum(np.sqrt(squared), 30.0)
    scores = []
    for edge in edges:
        here = values[inside & (t_s >= edge) & (t_s < edge + WINDOW_S)]
        scores.append(float(np.median(here)) if here.size >= 3 else 0.0)
    order = np.argsort(scores)[::-1]
    chosen: list[float] = []
    for k in order:
        # The jump stands where the window begins to be bad: about its largest innovation.
        here = inside & (t_s >= edges[k]) & (t_s < edges[k] + WINDOW_S)
        if not here.any():
            continue
        at = float(t_s[here][int(np.argmax(values[here]))]) - start_s - 0.25
        if all(abs(at - other) > APART_S for other in chosen):
            chosen.append(at)
        if len(chosen) == SUSPECTS:
            break
    return np.array(chosen)
