"""Sigmas that own up to small amounts of everything else.

A filter that is told of one effect knows its size by white theory, as if nothing else in the catalogue existed. Every
robot has a little of most of it: here every other effect is free beside the found ones, within half of the smallest
size that matters.
"""

from __future__ import annotations

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
