"""What these data cannot show: an antenna off the middle and late fixes, if fixes are coarse or the drive is plain.

Nothing is estimated here. One pass carries the filter's sensitivity to each parameter held at zero; the information it
gathers gives the standard deviation that an estimate would have.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sccal.align import Timeline, build_timeline
from sccal.arrays import Floats
from sccal.calibration.extension import Free, FreeEffects, view_run
from sccal.calibration.result import Unseen
from sccal.effects.catalogue import effect_named
from sccal.effects.effect import Effect
from sccal.filter.columns import Placed, kernel_columns
from sccal.filter.iterate import At, RunProblem
from sccal.filter.scoring import score
from sccal.filter.start import Constants

ASKED = ("lever_arm", "gnss_latency")
"""What every robot with a receiver has some of, and what good fixes show and bad ones do not."""
FIRST_LOOK_S = 600.0
STANDS_OUT = 6.75
"""Sigmas at which a parameter that nobody asked for is beyond doubt: those of a finding, and half as much again."""


def unseen_parameters(problem: RunProblem, values: Floats) -> tuple[Unseen, ...]:
    """Parameters of ASKED that would have to be larger than their priors allow to be seen; values (4 + m,) as found.

    Those that the filter estimates already are left out: they have a status of their own.
    """
    extension = problem.extension
    free = {effect.name for effect, _ in extension.parameters} if isinstance(extension, FreeEffects) else set()
    asked = [effect_named(name) for name in ASKED if name not in free]
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
    at = At(Constants.of(values), values[4:])
    clear = problem.clear_steps(at.constants)
    view = view_run(problem, at, clear)
    placed: list[Placed] = []
    priors: list[float] = []
    for effect in asked:
        parameters = Free(effect).parameters
        placed += Free(effect).placed(view, [0.0] * len(parameters), len(priors))
        priors += [one.prior_sigma for one in parameters]
    run = problem.begun(at, True, clear)
    columns = kernel_columns(placed, problem.timeline)
    block = np.zeros(problem.timeline.t_s.size, dtype=np.int32)
    found = score(run.events, run.columns, columns, len(priors), run.model, run.x, run.P, block)
    information = found.information[0] + np.diag(1.0 / np.array(priors) ** 2)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information))))
