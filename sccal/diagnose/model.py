"""The runs with the effects accepted so far: their noise, the joint fit, and where each run stands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sccal.align import Aligned, Timeline, build_timeline
from sccal.calibration.extension import Free, FreeEffects
from sccal.calibration.joint import JointFit, fit_jointly
from sccal.diagnose.parallel import each
from sccal.effects.catalogue import effect_named
from sccal.filter.forward import ForwardPass, Noise
from sccal.filter.iterate import At, RunProblem, iterate
from sccal.filter.noise import estimate_noise
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start, find_start

OUTPUT_RATE_HZ = 5.0
WHEEL_RATE_HZ = 20.0
ROUNDS = 6
PATH_HEADING_HZ, PATH_FIX_HZ = 2.0, 1.0
PATH_HEADING_RAD = float(np.radians(0.2))
PATH_FIX_M, PATH_SLIP = 2.0, 0.01
PATH_ROUNDS = 6
PATH_GATE_SIGMAS = 8.0
TRANSPORT = Free(effect_named("gnss_latency"), prior_scale=0.1)
"""Time that every line of a receiver is under way: about 20 ms that no log can show."""
FROZEN = 1e-6
"""Factor on a prior that holds an effect where it is."""
STILL = 1e-5
"""Level of a noise that is switched off."""

NoiseOf = Callable[[Aligned, Start, FreeEffects | None, At | None], Noise]


@dataclass(frozen=True)
class Regime:
    """How the measurements are trusted."""

    name: str
    heading_rate_hz: float
    fix_rate_hz: float
    options: FilterOptions
    noise_of: NoiseOf
    with_transport: bool
    """Whether the time that lines take to arrive is in the model."""

    def timeline(self, aligned: Aligned) -> Timeline:
        """Events of a run."""
        return build_timeline(
            aligned, OUTPUT_RATE_HZ, self.heading_rate_hz, self.fix_rate_hz, wheel_rate_hz=WHEEL_RATE_HZ
        )


def fine_regime(options: FilterOptions, heading_rate_hz: float) -> Regime:
    """Noise as the innovations' likelihood has it."""

    def noise_of(aligned: Aligned, start: Start, extension: FreeEffects | None, first: At | None) -> Noise:
        return estimate_noise(aligned, start, options, heading_rate_hz, extension, first)

    return Regime("fine", heading_rate_hz, 5.0, options, noise_of, True)


def path_regime(options: FilterOptions) -> Regime:
    """All misfit taken as white, at the level at which it is found: the whole path counts, no part of it in detail.

    Innovations from one reading to the next make a filter that lacks a large effect take it for slow errors of the
    sensors. Here nothing may wander: fixes and wheels are trusted as far as the path, laid out along the heading, meets
    them, and what is left over stays visible.
    """
    wide = replace(options, gate_sigmas=max(options.gate_sigmas, PATH_GATE_SIGMAS))

    def noise_of(aligned: Aligned, start: Start, extension: FreeEffects | None, first: At | None) -> Noise:
        timeline = build_timeline(aligned, OUTPUT_RATE_HZ, PATH_HEADING_HZ, PATH_FIX_HZ, wheel_rate_hz=WHEEL_RATE_HZ)
        stated_m = float(np.median(np.sqrt(aligned.fix_var_east_m2[aligned.fix_leading])))
        fix_m, slip, at = PATH_FIX_M, PATH_SLIP, first
        for _ in range(PATH_ROUNDS):
            noise = Noise(PATH_HEADING_RAD, STILL, 20.0, fix_m / stated_m, STILL, 40.0, slip, "path", {}, stated_m)
            problem = RunProblem(aligned, timeline, start, noise, wide, extension)
            values, found = iterate(problem, problem.at_centre() if at is None else at, 3)
            at = At(Constants.of(values), values[4:], found)
            fix_nis = float(np.mean(found.fix_nu_m**2 / found.fix_var_m2[:, :2]))
            heading_nis = float(np.mean(found.heading_nu_rad**2 / found.heading_var_rad2))
            fix_m = float(np.clip(fix_m * np.sqrt(fix_nis), stated_m, 50.0))
            slip = float(np.clip(slip * np.sqrt(heading_nis), 0.001, 0.2))
        return noise

    return Regime("path", PATH_HEADING_HZ, PATH_FIX_HZ, wide, noise_of, False)


@dataclass(frozen=True)
class Accepted:
    """An effect in the model; ``run`` where it belongs to one run alone (a step, a place)."""

    free: Free
    run: int | None = None


@dataclass(frozen=True)
class Model:
    """Some runs, the accepted effects, and the fit."""

    regime: Regime
    accepted: tuple[Accepted, ...]
    problems: tuple[RunProblem, ...]
    fit: JointFit

    def at(self, run: int) -> At:
        """Where a run's passes start and linearise."""
        theta = self.fit.each[run]
        return At(Constants.of(theta), theta[3:], self.fit.runs[run].path)

    def path(self, run: int) -> ForwardPass:
        """The last pass over a run."""
        return self.fit.runs[run].path


def extension_of(regime: Regime, accepted: Sequence[Accepted], run: int) -> FreeEffects | None:
    """The accepted effects that a run has: the vehicle's first, so that every run holds them in the same places.

    Where details count, a latency of some 20 ms is always among them: lines take that long to arrive.
    """
    mine = [one for one in accepted if one.run is None or one.run == run]
    if regime.with_transport and not any(one.free.effect.name == TRANSPORT.effect.name for one in mine):
        mine.append(Accepted(TRANSPORT))

    def own(one: Accepted) -> int:
        scopes = {parameter.scope for parameter in one.free.parameters}
        return 0 if scopes == {"vehicle"} else 1 if one.run is None else 2

    return FreeEffects(tuple(one.free for one in sorted(mine, key=own))) if mine else None


def first_model(runs: Sequence[Aligned], regime: Regime) -> Model:
    """The paper's model alone; the time that lines take stays out where it would have to be more than that."""
    model = _bare(runs, regime)
    if regime.with_transport and _largest_transport(model) > TRANSPORT.parameters[0].matters:
        # With what makes it large in the model, it will be small again.
        return replace(_bare(runs, replace(regime, with_transport=False)), regime=regime)
    return model


def _largest_transport(model: Model) -> float:
    name = TRANSPORT.effect.name
    return max(
        abs(float(theta[3 + place]))
        for problem, theta in zip(model.problems, model.fit.each, strict=True)
        for place, one in enumerate(names_of(problem))
        if one[0] == name
    )


def _bare(runs: Sequence[Aligned], regime: Regime) -> Model:
    def prepared(aligned: Aligned) -> tuple[RunProblem, At]:
        start = find_start(aligned)
        extension = extension_of(regime, (), 0)
        noise = regime.noise_of(aligned, start, extension, None)
        problem = RunProblem(aligned, regime.timeline(aligned), start, noise, regime.options, extension)
        values, found = iterate(problem, problem.at_centre())
        return problem, At(Constants.of(values), values[4:], found)

    ready = each(prepared, runs)
    problems = [problem for problem, _ in ready]
    return Model(regime, (), tuple(problems), fit_jointly(problems, [first for _, first in ready], ROUNDS))


def refitted(model: Model, accepted: Sequence[Accepted], hints: dict[str, np.ndarray], new_noise: bool = True) -> Model:
    """The same runs with other effects, noise and fit anew; hints are first values (m,) of effects not yet in."""

    def prepared(k: int) -> tuple[RunProblem, At]:
        before = model.problems[k]
        extension = extension_of(model.regime, accepted, k)
        first = _carried(model, k, extension, hints)
        problem = replace(before, extension=extension)
        if new_noise:
            # Two rounds bring the effect's values near, so that the noise is not asked to explain what it does.
            values, found = iterate(problem, first, 3)
            near = At(Constants.of(values), values[4:], found)
            problem = replace(problem, noise=model.regime.noise_of(before.aligned, before.start, extension, near))
        return problem, first

    ready = each(prepared, range(len(model.problems)))
    problems = [problem for problem, _ in ready]
    fit = fit_jointly(problems, [first for _, first in ready], ROUNDS)
    return Model(model.regime, tuple(accepted), tuple(problems), fit)


def _carried(model: Model, run: int, extension: FreeEffects | None, hints: dict[str, np.ndarray]) -> At:
    """Start of a run's fit: what is known of it already, the new effects at their hints."""
    at = model.at(run)
    if extension is None:
        return At(at.constants, np.zeros(0), at.path)
    before = model.problems[run].extension
    known = {}
    if isinstance(before, FreeEffects):
        known = {(e.name, one.name): v for (e, one), v in zip(before.parameters, at.values, strict=True)}
    values = []
    for free in extension.effects:
        hint = hints.get(free.effect.name, np.zeros(len(free.parameters)))
        values += [
            float(known.get((free.effect.name, one.name), h)) for one, h in zip(free.parameters, hint, strict=True)
        ]
    return At(at.constants, np.array(values), at.path)


def names_of(problem: RunProblem) -> list[tuple[str, str]]:
    """Effect and parameter of everything that the filter holds beyond the paper's constants, in its order."""
    extension = problem.extension
    return [(e.name, one.name) for e, one in extension.parameters] if isinstance(extension, FreeEffects) else []


def without_transport(problem: RunProblem, at: At) -> tuple[RunProblem, At]:
    """The problem with the time that lines take held at zero."""
    extension = problem.extension
    if not isinstance(extension, FreeEffects) or TRANSPORT not in extension.effects:
        return problem, at
    effects = tuple(replace(free, prior_scale=FROZEN) if free == TRANSPORT else free for free in extension.effects)
    held = np.array([name[0] == TRANSPORT.effect.name for name in names_of(problem)])
    frozen = replace(problem, extension=FreeEffects(effects))
    return frozen, At(at.constants, np.where(held, 0.0, at.values), at.path)
