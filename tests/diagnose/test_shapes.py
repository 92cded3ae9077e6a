"""Steps and places: found at the right moment, with the right sign and size, and nowhere else."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sccal.diagnose.criteria import LEAST_NATS, SEARCH_T
from sccal.diagnose.shapes import Found, find_moments, settled, shape_sigma
from sccal.effects.catalogue import CATALOGUE
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, refitted
from tests.evidence.logs import bare


@cache
def found(*texts: str, path: str = "general") -> tuple[Found, ...]:
    """Everything that stands out in one log, the first as it enters a model."""
    model = bare(*texts, path=path)
    first, *others = [*find_moments(model, ()), None]
    return () if first is None else (settled(model, first), *others[:-1])


def best(text: str) -> Found:
    several = found(text)
    assert [one.gain_nats for one in several] == sorted((one.gain_nats for one in several), reverse=True)
    first = several[0]
    assert first.free.effect.name == text.split("=")[0]
    assert first.run == first.accepted.run == 0
    assert first.gain_nats > LEAST_NATS
    assert first.t > SEARCH_T
    return first


@pytest.mark.parametrize("path", ["general", "rectangle"])
def test_nothing_stands_out_where_nothing_happened(path):
    assert found(path=path) == ()


@pytest.mark.parametrize(("deg", "at_s"), [(5.0, 100.0), (-3.0, 70.5)])
def test_a_heading_step_has_its_moment_to_the_reading_and_its_sign(deg, at_s):
    one = best(f"heading_step={deg},{at_s}")
    assert one.free.shapes["at_s"] == pytest.approx(at_s, abs=0.25)
    assert one.values[0] == pytest.approx(deg, abs=4.0 * one.sigmas[0])
    assert one.sigmas[0] < 0.5
    assert one.t == pytest.approx(abs(one.values[0]) / one.sigmas[0])


@pytest.mark.parametrize(("east_m", "north_m", "at_s"), [(0.2, -0.1, 110.0), (-4.0, 3.0, 90.0)])
def test_a_base_shift_has_its_moment_to_the_fix_and_both_its_signs(east_m, north_m, at_s):
    """One of 5 m too: whoever gates outliers must not throw away half of the run."""
    one = best(f"base_shift={east_m},{north_m},{at_s}")
    assert one.free.shapes["at_s"] == pytest.approx(at_s, abs=0.25)
    assert one.values == pytest.approx([east_m, north_m], abs=4.0 * one.sigmas.max())
    assert one.sigmas.max() < 0.05


def test_a_radius_step_has_its_moment_and_its_sign():
    one = best("radius_step=0.03,100")
    assert one.free.shapes["at_s"] == pytest.approx(100.0, abs=5.0)
    assert one.values[0] == pytest.approx(0.03, abs=4.0 * one.sigmas[0])
    assert one.sigmas[0] < 0.004


def test_a_local_field_has_its_place_its_size_and_its_sign():
    one = best("local_field=-15,-10,-6,3")
    place = one.free.shapes
    assert np.hypot(place["east_m"] + 10.0, place["north_m"] + 6.0) < 1.0
    assert place["radius_m"] == pytest.approx(3.0, rel=0.3)
    assert one.values[0] == pytest.approx(-15.0, rel=0.25)
    assert set(one.shape_sigmas) == {"east_m", "north_m", "radius_m"}


def test_what_is_known_already_is_not_looked_for():
    again = find_moments(bare("heading_step=5.0,100.0"), ("heading_step",))
    assert "heading_step" not in [one.free.effect.name for one in again]


def test_beside_an_effect_that_is_in_the_model_nothing_stands_out():
    model = refitted(bare("lever_arm=0.3,-0.1"), [Accepted(Free(CATALOGUE["lever_arm"]))])
    assert find_moments(model, ()) == []


# How well a shape is known


@pytest.mark.parametrize("sigma", [0.05, 0.4, 3.0, 20.0])
@pytest.mark.parametrize("top", [0.0, 8.0])
def test_the_sigma_of_a_shape_is_that_of_the_parabola_however_coarse_the_points(top, sigma):
    """With points far further apart than the sigma, and with the top at the first of them."""
    points = top + np.array([0.0, 1.0, 2.0, 5.0, 9.0])
    if top > 0.0:
        points = np.unique([*points, *(top - points[1:] + top)])
    gains = -0.5 * ((points - top) / sigma) ** 2
    assert shape_sigma(points, gains) == pytest.approx(sigma, rel=1e-6)


def test_a_shape_without_a_top_has_no_sigma():
    assert np.isnan(shape_sigma(np.array([1.0, 2.0, 3.0]), np.array([0.0, -1.0, 0.0])))


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("radius_step_left=-0.03,100", "radius_step_left", -0.03),
        ("radius_step_right=0.02,100", "radius_step_right", 0.02),
        ("track_step=-0.15,90", "track_step", -0.15),
    ],
)
def test_a_step_is_told_of_the_wheel_or_the_track_that_has_it(text, name, value):
    one = best(text)
    assert one.free.effect.name == name
    assert abs(one.values[0] - value) < 4.0 * one.sigmas[0]
