"""A quick look for what the model lacks: all candidates free beside it once, and what the evidence would keep.

The log is thinned, no moments and places are searched for, no forms compared, nothing refitted: a diagnosis does that.
The noise is estimated beside the candidates, since under the noise of a model that lacks something nothing seems to be
missing.

What is missing in a model moves its constants, by more than any sigma says that takes the model for true. By how much
is seen at once in the same quick fit, with the strongest of what it lacks and without.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from sccal.arrays import Floats
from sccal.effects.logged import logged_effects
from sccal.effects.view import DriveView
from sccal.evidence.candidates import without_shadows
from sccal.evidence.extension import Free, plain_forms
from sccal.evidence.joint import at_least
from sccal.evidence.model import Accepted, Model, model_of, refitted
from sccal.evidence.posterior import PRICE_NATS
from sccal.evidence.saturated import posterior_of, saturate
from sccal.filter.iterate import At, RunProblem
from sccal.filter.layout import OFFSET
from sccal.filter.noise import Reach
from sccal.filter.start import Constants
from sccal.results.calibration import Missing

STRONG_NATS = 20.0
"""Odds of 5 × 10⁸: a quick look that is wrong would take the verdict from a good log."""


@dataclass(frozen=True)
class Lacking:
    """What a model lacks, and what that does to its constants."""

    missing: tuple[Missing, ...] = ()
    """Strongest first."""
    apart: Floats = field(default_factory=lambda: np.zeros(4))
    """(4,) R_r, R_l, L and heading offset with it less without, m and rad."""
    sigmas: Floats = field(default_factory=lambda: np.zeros(4))
    """(4,) what they are known to with it."""

    def widened(self, covariance: Floats) -> Floats:
        """The covariance (4, 4) of the constants, owning up to what is missing; an offset that is held stays held."""
        apart = np.where(np.diag(covariance) > 0.0, self.apart, 0.0)
        return np.asarray(at_least(covariance, np.diag(self.sigmas**2)) + np.outer(apart, apart))


def look_for_missing(problem: RunProblem, values: Floats, heading_rate_hz: float) -> Lacking:
    """Effects with strong evidence and a size that matters beside a run's own model; values (4 + m,) as found."""
    start = At(Constants.of(values), values[4:])
    model = model_of([problem], [start], heading_rate_hz, thinned=True)
    inside = {one.free.effect.name for one in model.accepted}
    candidates = [Accepted(free) for free in _candidates(model.view(0)) if free.effect.name not in inside]
    known = [one.key for one in model.accepted]
    full = saturate(model, [*model.accepted, *candidates], {one.key: PRICE_NATS for one in candidates}, Reach.LOOK)
    posterior = full.posterior
    kept = posterior.select(known)
    by_key = {one.key: one.free for one in candidates}
    found = [
        Missing(free.effect.name, free.effect.title, posterior.worth(key, kept), posterior.size(free, kept))
        for key, free in by_key.items()
        if key in kept
    ]
    strong = [one for one in found if one.evidence_nats >= STRONG_NATS and one.size >= 1.0]
    whole = full.model
    while strong:
        # Among fifty others two that make up for each other may look strong; fitted without the others they have to be.
        names = {one.effect for one in strong}
        chosen = [*model.accepted, *(one for one in candidates if one.free.effect.name in names)]
        whole = refitted(full.model, chosen, full.given([one.key for one in chosen]), Reach.LOOK)
        alone = posterior_of(whole, {one.key: PRICE_NATS for one in chosen})
        worths = {one.free.effect.name: alone.worth(one.key, list(alone.rows)) for one in chosen}
        held = [one for one in strong if worths[one.effect] >= STRONG_NATS]
        if len(held) == len(strong):
            break
        strong = held
    if not strong:
        return Lacking()
    apart = _constants(whole) - _constants(model)
    apart[3] = float(np.angle(np.exp(1j * apart[3])))
    sigmas = np.append(np.sqrt(np.diag(whole.fit.robust)[:3]), np.sqrt(whole.path(0).final_covariance[OFFSET, OFFSET]))
    return Lacking(tuple(sorted(strong, key=lambda one: -one.evidence_nats)), apart, sigmas)


def _constants(model: Model) -> Floats:
    """R_r, R_l, L and the heading offset (4,) of the only run."""
    return np.append(model.fit.values[:3], model.path(0).final_state[OFFSET])


def _candidates(view: DriveView) -> list[Free]:
    named = plain_forms()
    columns, _ = without_shadows(named, [Free(one) for one in logged_effects([view.logged])], [view])
    return [*named, *columns]


def missing_in_any(runs: Iterable[Sequence[Missing]]) -> tuple[Missing, ...]:
    """What the model lacks in some run, each by the run that shows it most; the strongest first."""
    strongest: dict[str, Missing] = {}
    for one in (one for run in runs for one in run):
        if one.effect not in strongest or one.evidence_nats > strongest[one.effect].evidence_nats:
            strongest[one.effect] = one
    return tuple(sorted(strongest.values(), key=lambda one: -one.evidence_nats))
