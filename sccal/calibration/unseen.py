"""What these data cannot show: an antenna off the middle and late fixes, if fixes are coarse or the drive is plain.

Nothing is estimated here. One pass with these effects free tells the standard deviation that an estimate would have.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sccal.align import Timeline, build_timeline
from sccal.arrays import Floats
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect
from sccal.evidence.extension import Free, FreeEffects
from sccal.filter.iterate import At, RunProblem
from sccal.filter.start import Constants
from sccal.results.calibration import Unseen

FIRST_LOOK_S = 600.0
STANDS_OUT = 6.75
"""Sigmas at which a parameter that nobody asked for is beyond doubt: those of a finding, and half as much again."""


def unseen_parameters(problem: RunProblem, values: Floats) -> tuple[Unseen, ...]:
    """Parameters that every robot has some of, and that would have to be larger than their priors to be seen.

    ``values`` (4 + m,) are those found. What the filter estimates already is left out: it has a status of its own.
    """
    extension = problem.extension
    free = {effect.name for effect, _ in extension.parameters} if isinstance(extension, FreeEffects) else set()
    asked = [effect for effect in CATALOGUE.values() if effect.on_every_robot and effect.name not in free]
    if not asked:
        return ()
    first, last = problem.aligned.span_s
    length = FIRST_LOOK_S
    while True:
        until = min(first + length, last)
        part = replace(problem, timeline=_part(problem, (first, until)))
        unseen = _unseen(asked, _sigmas(part, values, asked))
        # What a part of the run shows, all of it shows.
        if not unseen or until >= last:
            return unseen
        length = np.inf


def _part(problem: RunProblem, between_s: tuple[float, float]) -> Timeline:
    """The events between two times, with no outputs but at the start."""
    if between_s == problem.aligned.span_s:
        return problem.timeline
    return build_timeline(problem.aligned, output_rate_hz=0.01, between_s=between_s)


def _unseen(asked: list[Effect], sigmas: Floats) -> tuple[Unseen, ...]:
    found, place = [], iter(sigmas.tolist())
    for effect in asked:
        for one in Free(effect).parameters:
            sigma = next(place)
            smallest = one.matters + STANDS_OUT * sigma
            if smallest > one.prior_sigma:
                found.append(Unseen(effect.name, effect.title, one.name, one.unit, sigma, smallest))
    return tuple(found)


def _sigmas(problem: RunProblem, values: Floats, asked: list[Effect]) -> Floats:
    """Posterior standard deviations (k,) of the asked effects' parameters, all of them free beside the model."""
    known = problem.extension.effects if isinstance(problem.extension, FreeEffects) else ()
    extension = FreeEffects((*known, *(Free(effect) for effect in asked)))
    whole = replace(problem, extension=extension)
    count = len(extension.parameters) - (values.size - 4)
    at = At(Constants.of(values), np.concatenate((values[4:], np.zeros(count))))
    run = whole.begun(at, True, with_sigmas=False)
    run.run_to()
    return np.asarray(np.sqrt(np.diag(run.belief.params)[-count:]))
