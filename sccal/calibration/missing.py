"""A quick look for what the model lacks: all candidates free beside it once, and what the evidence would keep.

The log is thinned, no moments and places are searched for, no forms compared, nothing refitted: a diagnosis does that.
The noise is estimated beside the candidates, since under the noise of a model that lacks something nothing seems to be
missing.
"""

from __future__ import annotations

from sccal.arrays import Floats
from sccal.calibration.result import Missing
from sccal.effects.logged import logged_effects
from sccal.effects.view import DriveView
from sccal.evidence.candidates import without_shadows
from sccal.evidence.extension import Free, plain_forms
from sccal.evidence.model import Accepted, model_of
from sccal.evidence.posterior import PRICE_NATS
from sccal.evidence.saturated import saturate
from sccal.filter.iterate import At, RunProblem
from sccal.filter.noise import Reach
from sccal.filter.start import Constants

STRONG_NATS = 20.0
"""Odds of 5 × 10⁸: a quick look that is wrong would take the verdict from a good log."""


def look_for_missing(problem: RunProblem, values: Floats, heading_rate_hz: float) -> tuple[Missing, ...]:
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
    return tuple(sorted(strong, key=lambda one: -one.evidence_nats))


def _candidates(view: DriveView) -> list[Free]:
    named = plain_forms()
    columns, _ = without_shadows(named, [Free(one) for one in logged_effects([view.logged])], [view])
    return [*named, *columns]
