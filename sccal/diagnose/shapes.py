"""What has a searched shape: a moment, a place, a time constant, a threshold. Each is tried by the filter itself.

All evidence for a jump lies around its moment, and the soft weights throw the first measurements after it away, so that
linear evidence cannot see it. Here every suspected moment and place is put into the filter as a free parameter beside
the model found so far, and the likelihood says how much better the run becomes. Suspects are where the innovations are
large together, and a grid. An outlier can win nothing, since measurements are weighed softly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np

from sccal.align import Timeline, build_timeline
from sccal.arrays import Bools, Floats
from sccal.diagnose.criteria import ALIKE_NATS, LEAST_NATS, SEARCH_NATS, SEARCH_T
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect
from sccal.evidence.candidates import Candidates
from sccal.evidence.extension import Free, FreeEffects, plain_form, view_run
from sccal.evidence.model import Accepted, Model
from sccal.evidence.parallel import each_apart
from sccal.evidence.posterior import WIDEST
from sccal.filter.forward import ForwardPass
from sccal.filter.iterate import At, RunProblem, whole_nll
from sccal.filter.layout import BASE_STATES
from sccal.filter.noise import at_once

HEADING_HZ, FIX_HZ, WHEEL_HZ, OUTPUT_HZ = 2.0, 1.0, 5.0, 1.0
MOST_SECONDS = 1200.0
"""A longer run is looked at in proportion more coarsely: a jump that matters there is one of minutes."""
WINDOW_S = 4.0
SUSPECTS = 6
GRID = 24
BESIDE_S = (0.0, 0.7, 1.5)
"""A jump begins within a second or so of where its window does."""
BEFORE_S = (0.0, -3.0, -6.0, -10.0)
"""What changes in the motion shows in the fixes some metres later."""
APART_S = 12.0
EDGE_S = 20.0
"""Nothing is looked for so near to the ends: a step there is a start."""
ZOOMS, POINTS = 3, 7
HOPEFUL_NATS = 0.25 * (SEARCH_NATS + LEAST_NATS)
"""What a moment or place must gain before it is looked at closely: a window beside it holds more than half of all."""
RADII_M = (1.5, 3.0, 6.0)
PLACE_RADII = 1.0
AROUND = (0.5, 0.7, 0.85, 1.0, 1.2, 1.4, 2.0)
LEAST_TAU_SHARE = 0.02


@dataclass(frozen=True)
class Found:
    """An effect with its moment or place, as found in one run."""

    run: int
    free: Free
    values: Floats
    """Of its free parameters, file units."""
    sigmas: Floats
    gain_nats: float
    """In log-likelihood, less the price of the search."""
    shape_sigmas: Mapping[str, float] = field(default_factory=dict)
    """Of the place and its size; a moment is known to the reading."""

    @property
    def t(self) -> float:
        """Size over its error, the moment or place as found."""
        return float(np.max(np.abs(self.values) / self.sigmas))

    @property
    def size(self) -> float:
        """Largest parameter in units of the smallest size that matters."""
        least = np.array([one.matters for one in self.free.parameters])
        return float(np.max(np.abs(self.values) / np.maximum(least, 1e-12)))

    @property
    def stands_out(self) -> bool:
        """Whether it is likely, sure and large enough to compete."""
        return self.gain_nats >= LEAST_NATS and self.t >= SEARCH_T and self.size >= 1.0

    @property
    def accepted(self) -> Accepted:
        """As it enters a model."""
        return Accepted(self.free, self.run)


class Scan:
    """One run, thinned, under a model's noise, so that a trial of one more effect costs one pass."""

    def __init__(self, problem: RunProblem, at: At, timeline: Timeline | None = None) -> None:
        if timeline is None:
            first, last = problem.aligned.span_s
            slower = max(1.0, (last - first) / MOST_SECONDS)
            timeline = build_timeline(
                problem.aligned, OUTPUT_HZ, HEADING_HZ / slower, FIX_HZ / slower, wheel_rate_hz=WHEEL_HZ / slower
            )
        self.problem = replace(problem, timeline=timeline)
        self.at = at
        self.clear = self.problem.clear_steps(at.constants)
        self.view = view_run(self.problem, at, self.clear)
        extension = problem.extension
        self.effects = extension.effects if isinstance(extension, FreeEffects) else ()
        self.laid = FreeEffects(self.effects).laid(self.view, at.values)
        self.base_nll, self.base = self._pass(self.problem, at)

    def _pass(self, problem: RunProblem, at: At) -> tuple[float, ForwardPass]:
        extension = problem.extension
        columns = None
        if isinstance(extension, FreeEffects):
            columns = extension.columns_in(self.view, at.values, problem.timeline, self.laid)
        found = problem.passed(at, problem.laid_out(at, self.clear, columns), with_sigmas=False)
        return whole_nll(problem, at, found), found

    @property
    def suspicious(self) -> dict[str, tuple[Floats, Floats]]:
        """Times and squared, normalised innovations, by stream."""
        timeline, aligned, found = self.problem.timeline, self.problem.aligned, self.base
        heading = found.heading_nu_rad**2 / found.heading_var_rad2
        fix = (found.fix_nu_m**2 / found.fix_var_m2[:, :2]).sum(axis=1)
        return {
            "headings": (aligned.heading_t_s[timeline.heading_index], heading),
            "fixes": (aligned.fix_t_s[timeline.fix_index], fix),
            "motion": (aligned.fix_t_s[timeline.fix_index], fix),
        }

    def trial(
        self, effect: Effect, shapes: Mapping[str, float], prior_scale: float = WIDEST, around: Floats | None = None
    ) -> tuple[float, Floats, Floats]:
        """Gain in nats, values and sigmas of the effect's free parameters with its shapes as given.

        ``around`` are values (m,) at which an effect that is not linear is taken; zero where nothing is known.
        """
        free = Free(effect, dict(shapes), prior_scale)
        count, first = len(free.parameters), self.at.values.size
        around = np.zeros(count) if around is None else around
        problem = replace(self.problem, extension=FreeEffects((*self.effects, free)))
        at = At(self.at.constants, np.concatenate((self.at.values, around)), self.at.path)
        nll, found = self._pass(problem, at)
        here = slice(BASE_STATES + first, BASE_STATES + first + count)
        sigmas = np.sqrt(np.maximum(np.diag(found.final_covariance)[here], 1e-30))
        gain = self.base_nll - nll
        return (gain if np.isfinite(gain) else -np.inf), found.final_state[here].copy(), sigmas

    def each_alone(self, effects: Sequence[Effect], shapes: Mapping[str, float]) -> list[tuple[float, Floats, Floats]]:
        """The same for several effects with these shapes, each as if the others were not there, by one pass.

        With all of them free, one alone is what is left where the others are zero: their density at zero before and
        after the data is the ratio of the evidence without and with them (Dickey 1971), and the rest of the posterior
        follows from the condition.
        """
        new = [Free(effect, dict(shapes), WIDEST) for effect in effects]
        first = self.at.values.size
        extension = FreeEffects((*self.effects, *new))
        problem = replace(self.problem, extension=extension)
        nll, found = self._pass(problem, At(self.at.constants, self._with_zeros(extension), self.at.path))
        here = slice(BASE_STATES + first, BASE_STATES + extension.prior_sigmas.size)
        prior = extension.prior_sigmas[first:]
        mean = found.final_state[here] / prior
        covariance = found.final_covariance[here, here] / np.outer(prior, prior)
        ends = np.cumsum([0, *(len(one.parameters) for one in new)])
        alone = []
        for begin, end in pairwise(ends.tolist()):
            one = np.zeros(prior.size, dtype=np.bool_)
            one[begin:end] = True
            lost, left, spread = _given_zero(mean, covariance, one)
            gain = self.base_nll - nll + lost
            values, sigmas = left * prior[one], np.sqrt(np.maximum(np.diag(spread), 1e-30)) * prior[one]
            alone.append((gain if np.isfinite(gain) else -np.inf, values, sigmas))
        return alone

    def _with_zeros(self, extension: FreeEffects) -> Floats:
        more = extension.prior_sigmas.size - self.at.values.size
        return np.concatenate((self.at.values, np.zeros(more)))

    def best(self, effect: Effect, tries: Sequence[Mapping[str, float]]) -> tuple[Mapping[str, float], Floats]:
        """The most likely of some shapes, and the gains of all."""
        with at_once() as map_at_once:
            gains = np.array(list(map_at_once(lambda shapes: self.trial(effect, shapes)[0], list(tries))))
        return tries[int(np.argmax(gains))], gains


def _given_zero(mean: Floats, covariance: Floats, kept: Bools) -> tuple[float, Floats, Floats]:
    """What the evidence gains where all but the kept of some parameters (k,) are zero, and the kept ones' posterior.

    Parameters in units of their priors' sigmas: before the data each is N(0, 1).
    """
    rest = ~kept
    if not rest.any():
        return 0.0, mean, covariance
    block, across = covariance[np.ix_(rest, rest)], covariance[np.ix_(kept, rest)]
    weights = np.linalg.solve(block, mean[rest])
    lost = -0.5 * float(mean[rest] @ weights) - 0.5 * float(np.linalg.slogdet(block)[1])
    return (
        lost,
        mean[kept] - across @ weights,
        covariance[np.ix_(kept, kept)] - across @ np.linalg.solve(block, across.T),
    )


def find_moments(model: Model, known: Sequence[str]) -> list[Found]:
    """Every effect of a moment or a place that stands out in some run and is not known, the largest gain first.

    Roughly: see ``settled``.
    """
    tasks = [(run, problem, model.at(run)) for run, problem in enumerate(model.problems)]
    of_runs = each_apart(partial(_moments_of_run, known), tasks)
    return sorted((one for several in of_runs for one in several), key=lambda one: -one.gain_nats)


def _moments_of_run(known: Sequence[str], task: tuple[int, RunProblem, At]) -> list[Found]:
    run, problem, at = task
    start_s, end_s = problem.aligned.span_s
    if end_s - start_s < 4.0 * EDGE_S:
        return []
    scan = Scan(problem, at)
    grid = np.linspace(EDGE_S, end_s - start_s - EDGE_S, GRID)
    found: list[Found] = []
    for stream, innovations in scan.suspicious.items():
        suspects = _peaks(*innovations, start_s, end_s)
        here = [one for one in CATALOGUE.values() if one.suspect_stream == stream and one.name not in known]
        found += _search_time(scan, run, [one for one in here if one.search == "moment"], suspects, grid)
        for effect in here:
            if effect.search == "place":
                found += _search_place(scan, run, effect, suspects, grid)
    return [one for one in found if one.stands_out]


def settled(model: Model, rough: Found) -> Found:
    """A moment to the reading, a place with its errors."""
    problem, at = model.problems[rough.run], model.at(rough.run)
    if rough.free.effect.search == "moment":
        return _to_the_reading(problem, at, rough)
    return _with_place_errors(Scan(problem, at), rough)


def best_forms(model: Model, candidates: Candidates, kept: Sequence[Accepted]) -> list[Accepted]:
    """Every candidate in one form: as it is kept, else as it alone beside the model makes the runs most likely.

    Where no form is clearly likelier than its first it keeps that. Nats of runs that contradict their noise count so
    much less.
    """
    alike = ALIKE_NATS * max(model.fit.misfit, 1.0)
    mine = {one.free.effect.name: one for one in kept if one.run is None}
    asked = {name: forms for name, forms in candidates.forms.items() if len(forms) > 1 and name not in mine}
    tries = [_Try(replace(free, prior_scale=1.0)) for forms in asked.values() for free in forms]
    ends = np.cumsum([len(forms) for forms in asked.values()])[:-1]
    tasks = [(problem, model.at(run), tries) for run, problem in enumerate(model.problems)]
    gains = np.split(_gains(tasks), ends) if asked else []
    best = {name: forms[0] for name, forms in candidates.forms.items()}
    for (name, forms), of_forms in zip(asked.items(), gains, strict=True):
        if of_forms.max() - of_forms[0] > alike:
            best[name] = forms[int(np.argmax(of_forms))]
    return [mine.get(name, Accepted(free)) for name, free in best.items()]


@dataclass(frozen=True)
class _Try:
    """One more effect in a run's filter, and the values (m,) around which it is taken."""

    free: Free
    around: Floats | None = None


_Tries = tuple[RunProblem, At, Sequence[_Try]]


def _gains(tasks: Sequence[_Tries]) -> Floats:
    """What each of n tries gains in all runs together, nats (n,)."""
    return np.asarray(np.sum(each_apart(_gains_in_run, tasks), axis=0))


def _gains_in_run(task: _Tries) -> Floats:
    problem, at, tries = task
    scan = Scan(problem, at)

    def gain(one: _Try) -> float:
        return scan.trial(one.free.effect, one.free.shapes, one.free.prior_scale, one.around)[0]

    with at_once() as map_at_once:
        return np.array(list(map_at_once(gain, tries)))


def refined(model: Model, accepted: Accepted) -> tuple[Accepted, dict[str, float]]:
    """An effect of the model with its shapes where the likelihood of all runs is largest, and their sigmas.

    Where that is not clearly likelier than its plain form the shapes are those of that.
    """
    runs = [_without(model, run, accepted) for run in range(len(model.problems))]
    shapes = dict(accepted.free.shapes)
    bounds = {one.name: (one.lower, one.upper) for one in accepted.free.effect.parameters if one.shape}
    names = [(accepted.key, one.name) for one in accepted.free.parameters]
    known = [model.values(run) for run in range(len(runs))]
    around = [np.array([values[name] for name in names]) for values in known]

    def gains_at(several: Sequence[Mapping[str, float]]) -> Floats:
        forms = [replace(accepted.free, shapes=tried) for tried in several]
        pairs = zip(runs, around, strict=True)
        return _gains([(*run, [_Try(free, values) for free in forms]) for run, values in pairs])

    sigmas: dict[str, float] = {}
    for name, (low, high) in bounds.items():
        least = LEAST_TAU_SHARE * high
        reach = 1.0
        for _ in range(ZOOMS):
            middle = max(shapes[name], least)
            points = np.unique(np.clip([shapes[name], low, *(middle * np.array(AROUND) ** reach)], low, high))
            gains = gains_at([{**shapes, name: float(point)} for point in points])
            shapes[name] = float(points[int(np.argmax(gains))])
            reach *= 0.4
        sigmas[name] = shape_sigma(points, gains)
    plain = plain_form(accepted.free.effect)
    if plain is not None:
        here, there = gains_at([shapes, plain.shapes])
        if here - there <= ALIKE_NATS * max(model.fit.misfit, 1.0):
            shapes = dict(plain.shapes)
    return replace(accepted, free=replace(accepted.free, shapes=shapes)), sigmas


def shape_sigma(points: Floats, gains: Floats) -> float:
    """Sigma of a shape from the parabola through the gains (n,) about the best of some points (n,), sorted.

    Where too few lie near the top, from how far it falls to its neighbours, the flatter side: at d from the top a
    parabola has fallen by d²/2σ². nan where the gains have no top.
    """
    best = int(np.argmax(gains))
    near = gains > gains[best] - 12.0
    if near.sum() >= 3:
        curvature = float(np.polyfit(points[near] - points[best], gains[near], 2)[0])
        return 1.0 / float(np.sqrt(-2.0 * curvature)) if curvature < 0.0 else float("nan")
    beside = [k for k in (best - 1, best + 1) if 0 <= k < points.size and np.isfinite(gains[k])]
    falls = [abs(points[k] - points[best]) / np.sqrt(2.0 * max(gains[best] - gains[k], 1e-9)) for k in beside]
    return float(max(falls, default=float("nan")))


def _without(model: Model, run: int, accepted: Accepted) -> tuple[RunProblem, At]:
    """One run with an effect of the model taken out."""
    problem, at = model.problems[run], model.at(run)
    assert isinstance(problem.extension, FreeEffects)
    keep = np.array([free.key != accepted.key for free in problem.extension.effects for _ in free.parameters])
    rest = tuple(free for free in problem.extension.effects if free.key != accepted.key)
    extension = FreeEffects(rest) if rest else None
    return replace(problem, extension=extension), At(at.constants, at.values[keep], at.path)


def _search_time(scan: Scan, run: int, effects: Sequence[Effect], suspects: Floats, grid: Floats) -> list[Found]:
    """Effects that show in the same innovations, all at the same moments."""
    if not effects:
        return []
    beside = BEFORE_S if effects[0].suspect_stream == "motion" else BESIDE_S
    around = np.clip((suspects[:, None] + np.array(beside)).ravel(), grid[0], grid[-1])
    tried = np.concatenate((around, grid))

    def gains_at(some_s: Floats) -> Floats:
        with at_once() as map_at_once:
            found = map_at_once(lambda at_s: scan.each_alone(effects, {"at_s": at_s}), some_s.tolist())
            return np.array([[gain for gain, _, _ in several] for several in found])

    gains = gains_at(tried)
    ordinary = [_ordinary(of_one) for of_one in gains[around.size :].T]
    if np.max(gains - ordinary) < HOPEFUL_NATS:
        return []
    best_s = float(tried[int(np.argmax(gains.max(axis=1)))])
    step = float(grid[1] - grid[0]) if best_s not in around else WINDOW_S
    for _ in range(ZOOMS):
        nearby = np.clip(best_s + step * np.linspace(-1.0, 1.0, POINTS), grid[0], grid[-1])
        tried, gains = np.concatenate((tried, nearby)), np.vstack((gains, gains_at(nearby)))
        best_s = float(tried[int(np.argmax(gains.max(axis=1)))])
        step *= 2.0 / (POINTS - 1)
    found = []
    for effect, of_one, usual in zip(effects, gains.T, ordinary, strict=True):
        found += _found(scan, run, effect, {"at_s": float(tried[int(np.argmax(of_one))])}, usual)
    return found


def _to_the_reading(problem: RunProblem, at: At, rough: Found) -> Found:
    """The moment to the reading: a parameter that is free one reading early is fitted to that reading."""
    timeline = problem.timeline
    headings = rough.free.effect.suspect_stream == "headings"
    index = timeline.heading_index if headings else timeline.fix_index
    of = problem.aligned.heading_t_s if headings else problem.aligned.fix_t_s
    t_s = of[index] - problem.aligned.span_s[0]
    near = t_s[np.abs(t_s - rough.free.shapes["at_s"]) < 2.0 / FIX_HZ]
    if near.size < 2:
        return rough
    fine = Scan(problem, at, timeline)
    between = 0.5 * (near[1:] + near[:-1])
    best, _ = fine.best(rough.free.effect, [{"at_s": float(s)} for s in between[:: max(between.size // 24, 1)]])
    _, values, sigmas = fine.trial(rough.free.effect, best)
    return replace(rough, free=replace(rough.free, shapes=dict(best)), values=values, sigmas=sigmas)


def _search_place(scan: Scan, run: int, effect: Effect, suspects: Floats, grid: Floats) -> list[Found]:
    seen = scan.view.headings
    start_s = scan.problem.aligned.span_s[0]

    def at(since_s: float, radius_m: float) -> dict[str, float]:
        return {
            "east_m": float(np.interp(start_s + since_s, seen.t_s, seen.east_m)),
            "north_m": float(np.interp(start_s + since_s, seen.t_s, seen.north_m)),
            "radius_m": radius_m,
        }

    anywhere = [at(float(s), RADII_M[1]) for s in grid]
    _, usual = scan.best(effect, anywhere)
    tries = [at(float(s), radius) for s in suspects for radius in RADII_M]
    best, gains = scan.best(effect, [*tries, anywhere[int(np.argmax(usual))]])
    if gains.max() - _ordinary(usual) < HOPEFUL_NATS:
        return []
    step = 1.0
    for _ in range(2 * ZOOMS):
        before = best
        for name in ("east_m", "north_m"):
            size = step * before["radius_m"]
            best, _ = scan.best(effect, [{**best, name: best[name] + size * k} for k in (-1.0, -0.5, 0.0, 0.5, 1.0)])
        best, _ = scan.best(effect, [{**best, "radius_m": best["radius_m"] * k} for k in (0.7, 0.85, 1.0, 1.2, 1.4)])
        if best == before:
            step *= 0.5
    return _found(scan, run, effect, best, _ordinary(usual))


def _with_place_errors(scan: Scan, found: Found) -> Found:
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


def _found(scan: Scan, run: int, effect: Effect, shapes: Mapping[str, float], ordinary: float) -> list[Found]:
    gain, values, sigmas = scan.trial(effect, shapes)
    gain -= SEARCH_NATS + ordinary
    return [Found(run, Free(effect, dict(shapes), WIDEST), values, sigmas, gain)] if gain > 0.0 else []


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
