"""Some runs with the effects that are in the model: their noise, the joint fit, and where each run stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial

import numpy as np

from sccal.align import Aligned, Timeline, build_timeline
from sccal.arrays import Floats
from sccal.effects.view import DriveView
from sccal.evidence.extension import Free, FreeEffects, name_in, view_run
from sccal.evidence.joint import JointFit, fit_jointly, names_of
from sccal.evidence.parallel import each_apart
from sccal.filter.forward import ForwardPass
from sccal.filter.iterate import At, Extension, RunProblem, iterate, likeliest
from sccal.filter.noise import (
    COARSE_HZ,
    MISFIT,
    PATH_HZ,
    Reach,
    estimate_noise,
    misfit_noise,
    misfit_timeline,
)
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, find_start
from sccal.results.noise import Noise

OUTPUT_RATE_HZ = 5.0
FIX_RATE_HZ = 5.0
WHEEL_RATE_HZ = 20.0
ROUNDS = 6
ROUNDS_BEFORE = 2


CONTRADICTED = 3.0
"""χ² per degree of freedom of the stretches' scores from which on a log contradicts its own noise. Effect-free
simulated logs have 0.6 to 0.9, the measured ones 6 (Husky) and 25 (van)."""


class Trust(Enum):
    """How far the details of the measurements are trusted."""

    DETAIL = "detail"
    """Noise as the innovations have it, from one reading to the next."""
    PATH = "path"
    """Nothing wanders: all misfit is white, and the whole path counts (see sccal.filter.noise.misfit_noise)."""


def trust_in(noise: Noise) -> Trust:
    """The trust under which a noise was estimated."""
    return Trust.PATH if noise.source == MISFIT else Trust.DETAIL


@dataclass(frozen=True)
class Accepted:
    """An effect in the model; ``run`` where it belongs to one run alone (a step, a place)."""

    free: Free
    run: int | None = None

    @property
    def key(self) -> str:
        """The effect with its shapes."""
        return self.free.key


@dataclass(frozen=True)
class Model:
    """Some runs, the accepted effects, and the fit."""

    accepted: tuple[Accepted, ...]
    problems: tuple[RunProblem, ...]
    fit: JointFit
    heading_rate_hz: float

    @property
    def trust(self) -> Trust:
        """How far its noise trusts the details."""
        return trust_in(self.problems[0].noise)

    @property
    def nll(self) -> float:
        """Negative log-likelihood of all runs, constants and effects marginalised."""
        return self.fit.nll

    def at(self, run: int) -> At:
        """Where a run's passes start and linearise."""
        theta = self.fit.each[run]
        return At(Constants.of(theta), theta[3:], self.fit.runs[run].path)

    def path(self, run: int) -> ForwardPass:
        """The last pass over a run."""
        return self.fit.runs[run].path

    def view(self, run: int) -> DriveView:
        """A run as columns see it."""
        problem, at = self.problems[run], self.at(run)
        return view_run(problem, at, problem.clear_steps(at.constants))

    def values(self, run: int) -> dict[tuple[str, str], float]:
        """What a run holds of every effect's parameters."""
        return dict(zip(names_of(self.problems[run]), self.fit.each[run][3:].tolist(), strict=True))


def timeline_of(aligned: Aligned, heading_rate_hz: float, trust: Trust) -> Timeline:
    """Events for a diagnosis: what its slowest candidate needs, and no more."""
    if trust is Trust.PATH:
        return misfit_timeline(aligned)
    return build_timeline(aligned, OUTPUT_RATE_HZ, heading_rate_hz, FIX_RATE_HZ, wheel_rate_hz=WHEEL_RATE_HZ)


def thinned_timeline_of(aligned: Aligned) -> Timeline:
    """Events for a quick look."""
    heading_hz, fix_hz, wheel_hz = COARSE_HZ
    return build_timeline(aligned, PATH_HZ, heading_hz, fix_hz, wheel_rate_hz=wheel_hz)


def model_of(
    problems: Sequence[RunProblem], starts: Sequence[At], heading_rate_hz: float, thinned: bool = False
) -> Model:
    """Runs whose noise and effects are known, fitted together from where each stands.

    The events are those of a diagnosis, or the few of a quick look.
    """
    trust = trust_in(problems[0].noise)
    ready = [
        replace(
            problem,
            timeline=thinned_timeline_of(problem.aligned)
            if thinned
            else timeline_of(problem.aligned, heading_rate_hz, trust),
            options=replace(problem.options, soft_gate=True),
        )
        for problem in problems
    ]
    held: dict[str, list[tuple[Free, int]]] = {}
    for run, problem in enumerate(ready):
        if isinstance(problem.extension, FreeEffects):
            for free in problem.extension.effects:
                held.setdefault(free.key, []).append((free, run))
    everywhere: list[Accepted] = []
    for some in held.values():
        if len(some) == len(ready):
            everywhere.append(Accepted(some[0][0]))
        else:
            everywhere += [Accepted(free, run) for free, run in some]
    fit = fit_jointly(ready, starts, ROUNDS, with_stretches=True)
    return Model(tuple(everywhere), tuple(ready), fit, heading_rate_hz)


def extension_of(accepted: Sequence[Accepted], run: int) -> FreeEffects | None:
    """The accepted effects that a run has."""
    mine = tuple(one.free for one in accepted if one.run is None or one.run == run)
    return FreeEffects(mine) if mine else None


def bare_model(
    runs: Sequence[Aligned], options: FilterOptions, heading_rate_hz: float, trust: Trust = Trust.DETAIL
) -> Model:
    """The paper's model alone, its noise searched for over the whole prior.

    Raises:
        DataError: where a run hardly moves.
    """
    ready = each_apart(partial(_prepared_bare, options, heading_rate_hz, trust), runs)
    problems = [problem for problem, _ in ready]
    fit = fit_jointly(problems, [first for _, first in ready], ROUNDS, with_stretches=True)
    return Model((), tuple(problems), fit, heading_rate_hz)


def _prepared_bare(
    options: FilterOptions, heading_rate_hz: float, trust: Trust, aligned: Aligned
) -> tuple[RunProblem, At]:
    start = find_start(aligned)
    if trust is Trust.PATH:
        noise, _ = misfit_noise(aligned, start, options)
    else:
        noise, _ = estimate_noise(aligned, start, options, heading_rate_hz)
    timeline = timeline_of(aligned, heading_rate_hz, trust)
    problem = RunProblem(aligned, timeline, start, noise, replace(options, soft_gate=True))
    values, found = iterate(problem, problem.at_centre())
    return problem, At(Constants.of(values), values[4:], found)


def refitted(
    model: Model,
    accepted: Sequence[Accepted],
    starts: Sequence[At] = (),
    reach: Reach | None = Reach.NEAR,
    noises: Sequence[Noise] = (),
    rounds: int = ROUNDS,
) -> Model:
    """The same runs with other effects.

    Parameters
    ----------
    model
        Where the fit starts.
    accepted
        The effects to be in the model.
    starts
        Per run, where its fit may start too; otherwise where ``model`` stands, what is not in it yet at zero.
    reach
        How widely the noise is searched for; None keeps the noise.
    noises
        Per run, a noise to take instead of the model's.
    rounds
        Passes over every run at most.
    """

    tasks = []
    for k, before in enumerate(model.problems):
        extension = extension_of(accepted, k)
        problem = replace(before, extension=extension, noise=noises[k] if noises else before.noise)
        several = [_carried(model, k, extension), *starts[k : k + 1]]
        if _has_antenna(extension) and not _has_antenna(before.extension):
            several.append(problem.with_antenna(several[0]))
        tasks.append(_Refit(problem, before.noise, tuple(several)))
    ready = each_apart(partial(_prepared, reach, model.trust, model.heading_rate_hz), tasks)
    problems = [replace(task.problem, noise=noise) for task, (noise, _) in zip(tasks, ready, strict=True)]
    fit = fit_jointly(problems, [first for _, first in ready], rounds, with_stretches=True)
    return Model(tuple(accepted), tuple(problems), fit, model.heading_rate_hz)


def _has_antenna(extension: Extension | None) -> bool:
    return extension is not None and extension.antenna is not None


@dataclass(frozen=True)
class _Refit:
    """One run with other effects, and what is known of it."""

    problem: RunProblem
    """Under a noise to start from."""
    noise_before: Noise
    starts: tuple[At, ...]
    """Where its fit may start."""


def _prepared(reach: Reach | None, trust: Trust, heading_rate_hz: float, task: _Refit) -> tuple[Noise, At]:
    """A run's noise, and where its fit starts."""
    problem = task.problem
    first = likeliest(problem, task.starts)
    if reach is None:
        return problem.noise, first
    # Under the noise of a model that lacks the effects they come near, so that the search starts from there.
    values, found = iterate(problem, first, ROUNDS_BEFORE, with_sigmas=False)
    first = At(Constants.of(values), values[4:], found)
    run = problem.aligned, problem.start, problem.options
    if trust is Trust.PATH:
        noise, settled = misfit_noise(*run, problem.extension, first)
    else:
        near = [problem.noise, task.noise_before]
        noise, settled = estimate_noise(*run, heading_rate_hz, problem.extension, first, near, reach)
    # The path over the whole run: the search saw a stretch of it.
    return noise, At(settled.constants, settled.values, first.path)


def _carried(model: Model, run: int, extension: FreeEffects | None) -> At:
    """Start of a run's fit: what is known of it already."""
    at = model.at(run)
    if extension is None:
        return At(at.constants, np.zeros(0))
    known = model.values(run)
    # Another form of an effect starts where the one before it stands.
    of_name = {(name_in(key), name): value for (key, name), value in known.items()}
    wanted = [(free, one.name) for free in extension.effects for one in free.parameters]
    values: Floats = np.array(
        [known.get((free.key, name), of_name.get((free.effect.name, name), 0.0)) for free, name in wanted]
    )
    return At(at.constants, values, at.path)
