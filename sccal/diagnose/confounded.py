"""Sigmas that own up to what else could be there.

A filter that is told of one effect knows its size by white theory, as if nothing else in the catalogue existed. Here
every other effect is given its whole prior beside the found ones, and the blocks' scatter is counted: a lever arm that
one run of left turns alone cannot tell from scrubbing tyres gets the sigma that this leaves it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sccal.arrays import Floats
from sccal.calibration.extension import Free, FreeEffects, view_run
from sccal.diagnose.evidence import Evidence, gather_columns, prior_sigmas, rows_of
from sccal.diagnose.model import FROZEN, Model, names_of
from sccal.diagnose.pool import Pool
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect
from sccal.filter.columns import Placed, kernel_columns
from sccal.filter.iterate import At, RunProblem


def linear_effects() -> tuple[Effect, ...]:
    """The catalogue's effects without a moment or a place."""
    return tuple(e for e in CATALOGUE.values() if not any(one.shape for one in e.parameters))


def confounded_sigmas(model: Model) -> dict[tuple[str, str], Floats]:
    """Sigmas of the found effects, by effect and parameter: one value, or one per run where it is a run's."""
    found = [one.free.effect for one in model.accepted if not one.free.shapes]
    return sigmas_beside_all([(p, model.at(k)) for k, p in enumerate(model.problems)], found)


def sigmas_beside_all(runs: Sequence[tuple[RunProblem, At]], found: Sequence[Effect]) -> dict[tuple[str, str], Floats]:
    """The same for effects that are free in some problems, each with where it was linearised at last."""
    names = {effect.name for effect in found}
    beside = [effect for effect in linear_effects() if effect.name not in names]
    everything = (*found, *beside)
    pool = Pool([_evidence(problem, at, everything) for problem, at in runs], everything)
    sigma = pool.everything_free()
    sigmas: dict[tuple[str, str], Floats] = {}
    for effect in found:
        for place, parameter in zip(pool.local[effect.name], Free(effect).parameters, strict=True):
            copies = np.flatnonzero(pool.owner == place)
            sigmas[effect.name, parameter.name] = sigma[copies] * pool.sigma[place]
    return sigmas


def _evidence(problem: RunProblem, at: At, effects: Sequence[Effect]) -> Evidence:
    """Score effects on a run whose own ones are frozen at what they came out at."""
    extension = problem.extension
    here = problem
    if isinstance(extension, FreeEffects):
        frozen = FreeEffects(tuple(replace(free, prior_scale=FROZEN) for free in extension.effects))
        here = replace(problem, extension=frozen)
    clear = problem.clear_steps(at.constants)
    view = view_run(problem, at, clear)
    known = dict(zip(names_of(problem), at.values.tolist(), strict=True))
    placed: list[Placed] = []
    for effect, rows in zip(effects, rows_of(effects).values(), strict=True):
        values = [known.get((effect.name, one.name), 0.0) for one in Free(effect).parameters]
        placed += Free(effect).placed(view, values, int(rows[0]))
    return gather_columns(here, at, clear, kernel_columns(placed, problem.timeline), prior_sigmas(effects))
