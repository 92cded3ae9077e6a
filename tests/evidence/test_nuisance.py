"""Sigmas that own up to what else could be there: never much smaller, and larger where a drive shows too little."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, Model, refitted
from sccal.evidence.nuisance import sigmas_beside_small
from tests.evidence.logs import bare

ARM = (0.3, -0.1)


@cache
def fitted(path: str) -> Model:
    """A lever arm in the log and in the model."""
    model = bare(f"lever_arm={ARM[0]},{ARM[1]}", path=path, duration_s=150.0)
    return refitted(model, [Accepted(Free(CATALOGUE["lever_arm"]))])


def widened(path):
    """By parameter of the arm: value, sigma as the fit has it, and with small amounts of everything else allowed."""
    model = fitted(path)
    beside = sigmas_beside_small(model)
    found = {}
    for place, key in enumerate(model.fit.places.keys):
        if key[0] == "lever_arm":
            found[key[1]] = (model.fit.values[place], np.sqrt(model.fit.all_robust[place, place]), beside[key])
    return found


def test_on_a_drive_that_shows_everything_they_stay_near():
    for (value, by_fit, beside), truth in zip(widened("general").values(), ARM, strict=True):
        assert 0.7 * by_fit < beside < 0.05
        assert abs(value - truth) < 4.0 * beside


def test_on_turns_one_way_they_grow_a_lot():
    """To the side it is a radius of the circle, so a scale of the wheels; forward it is a latency."""
    general, circle = widened("general"), widened("circle")
    for name, truth in (("forward_m", ARM[0]), ("left_m", ARM[1])):
        value, _, beside = circle[name]
        assert beside > 2.0 * general[name][2]
        assert abs(value - truth) < 3.0 * beside


@pytest.mark.parametrize("path", ["general", "circle"])
def test_constants_of_the_vehicle_have_theirs_too(path):
    beside = sigmas_beside_small(fitted(path))
    for name in ("radius_right_m", "radius_left_m", "track_m"):
        assert 0.0 < beside["", name, -1] < 0.1
