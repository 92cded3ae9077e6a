"""Sigmas that own up to what else could be there: never much smaller, and larger where a drive shows too little."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, Model, refitted
from sccal.evidence.nuisance import sigmas_beside_small, spread_of_shapes
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


def test_a_shape_that_is_held_a_little_off_widens_what_depends_on_it():
    """Iron of 20 deg let in over 10 s, held at 12.5: off by many sigmas of the filter and by few of all."""
    model = bare("hard_iron=17,-11,10", duration_s=300.0)
    iron = Accepted(Free(CATALOGUE["hard_iron"], {"tau_s": 12.5}))
    model = refitted(model, [iron])
    spread = spread_of_shapes(model, {iron.key: {"tau_s": 1.5}})
    rows = [place for place, key in enumerate(model.fit.places.keys) if key[0] == iron.key]
    off = np.abs(model.fit.values[rows] - (17.0, -11.0))
    plain = np.sqrt(np.diag(model.fit.covariance)[rows])
    widened = np.sqrt(plain**2 + np.diag(spread)[rows])
    assert (off / plain).max() > 5.0
    assert (off / widened).max() < 3.0
    assert np.all(np.linalg.eigvalsh(spread) > -1e-9)


def test_a_shape_that_is_known_widens_nothing():
    model = fitted("general")
    assert not spread_of_shapes(model, {}).any()
    assert not spread_of_shapes(model, {"lever_arm": {"at_s": float("nan")}}).any()
