"""What a fit's own sigmas leave out: small amounts of everything else, and shapes that were searched for and then held.

A filter that is told of one effect knows its size by white theory, as if nothing else in the catalogue existed. Every
robot has a little of most of it: here every other effect is free beside the found ones, within half of the smallest
size that matters.

A time constant or a threshold is held where it is likeliest while the rest is fitted. To first order in its own error δ
everything else is off by (∂θ/∂shape) δ, which a fit with the shape moved by its sigma shows as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sccal.arrays import Floats
from sccal.evidence.extension import plain_forms
from sccal.evidence.joint import Key
from sccal.evidence.model import Accepted, Model, refitted

SMALL = 0.5
"""Of the smallest size that matters: what is always possible and worth no word."""
ROUNDS = 2


def sigmas_beside_small(model: Model) -> dict[Key, float]:
    """Standard deviations of everything in the model, by key, with small amounts of all other effects allowed."""
    names = {one.free.effect.name for one in model.accepted}
    beside = []
    for free in plain_forms():
        if free.effect.name not in names:
            scale = min(SMALL * one.matters / one.prior_sigma for one in free.parameters)
            if scale > 0.0:
                beside.append(Accepted(replace(free, prior_scale=scale)))
    full = refitted(model, [*model.accepted, *beside], reach=None, rounds=ROUNDS)
    sigmas: Floats = np.sqrt(np.diag(full.fit.all_robust))
    return dict(zip(full.fit.places.keys, sigmas.tolist(), strict=True))


def spread_of_shapes(model: Model, shape_sigmas: Mapping[str, Mapping[str, float]]) -> Floats:
    """Covariance (G, G) that shapes known no better than their sigmas add to that of everything in the model.

    ``shape_sigmas`` are by effect (with its shapes) and shape; what has none counts as known.
    """
    spread = np.zeros_like(model.fit.covariance)
    for place, one in enumerate(model.accepted):
        for name, sigma in shape_sigmas.get(one.key, {}).items():
            if not (np.isfinite(sigma) and sigma > 0.0):
                continue
            parameter = next(each for each in one.free.effect.parameters if each.name == name)
            value = one.free.shapes[name]
            moved = value + sigma if value + sigma <= parameter.upper else max(value - sigma, parameter.lower)
            other = replace(one, free=replace(one.free, shapes={**one.free.shapes, name: moved}))
            accepted = [*model.accepted[:place], other, *model.accepted[place + 1 :]]
            fit = refitted(model, accepted, reach=None, rounds=ROUNDS).fit
            apart = fit.values - model.fit.values
            spread += np.outer(apart, apart)
    return spread
