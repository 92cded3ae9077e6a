"""Steps and places: found at the right moment, with the right sign and size, and nowhere else."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sccal.diagnose.loop import MIN_HELD_OUT_NATS, MIN_MOMENT_T
from sccal.diagnose.moments import Moment, find_moments
from tests.diagnose.logs import bare


@cache
def moments(*texts: str, path: str = "general") -> tuple[Moment, ...]:
    """Everything that stands out in one log at all."""
    return tuple(find_moments(bare(*texts, path=path), 0, ()))


def strong(found):
    """Those that would be told."""
    return [one for one in found if one.gain_nats >= MIN_HELD_OUT_NATS and one.t >= MIN_MOMENT_T and one.size >= 1.0]


def best(text):
    found = moments(text)
    assert [one.gain_nats for one in found] == sorted((one.gain_nats for one in found), reverse=True)
    assert found[0].free.effect.name == text.split("=")[0]
    assert found[0].run == 0
    assert [one.free.effect.name for one in strong(found)] == [text.split("=")[0]]
    return found[0]


@pytest.mark.parametrize("path", ["general", "rectangle"])
def test_nothing_stands_out_where_nothing_happened(path):
    assert strong(moments(path=path)) == []


@pytest.mark.parametrize(("deg", "at_s"), [(5.0, 150.0), (-4.0, 120.0)])
def test_a_heading_step_has_its_moment_and_its_sign(deg, at_s):
    found = best(f"heading_step={deg},{at_s}")
    assert found.free.shapes["at_s"] == pytest.approx(at_s, abs=1.0)
    assert found.values[0] == pytest.approx(deg, abs=3.0 * found.sigmas[0])
    assert found.sigmas[0] < 0.5
    assert found.t == pytest.approx(abs(found.values[0]) / found.sigmas[0])


@pytest.mark.parametrize(
    ("east_m", "north_m", "at_s"),
    [(0.2, -0.1, 155.0), (-4.0, 3.0, 140.0), (0.2, -0.1, 140.0)],
)
def test_a_base_shift_has_its_moment_and_both_its_signs(east_m, north_m, at_s):
    """One of 5 m too: whoever gates outliers must not throw away half of the run."""
    found = best(f"base_shift={east_m},{north_m},{at_s}")
    assert found.free.shapes["at_s"] == pytest.approx(at_s, abs=1.0)
    assert found.values == pytest.approx([east_m, north_m], abs=3.0 * found.sigmas.max())
    assert found.sigmas.max() < 0.05


@pytest.mark.parametrize(("ratio", "at_s"), [(0.03, 150.0), (-0.025, 170.0)])
def test_a_radius_step_has_its_moment_and_its_sign(ratio, at_s):
    found = best(f"radius_step={ratio},{at_s}")
    assert found.free.shapes["at_s"] == pytest.approx(at_s, abs=5.0)
    assert found.values[0] == pytest.approx(ratio, abs=3.0 * found.sigmas[0])
    assert found.sigmas[0] < 0.004


@pytest.mark.parametrize("deg", [15.0, -12.0])
def test_a_local_field_has_its_place_its_size_and_its_sign(deg):
    found = best(f"local_field={deg},-10,-6,3")
    place = found.free.shapes
    assert np.hypot(place["east_m"] + 10.0, place["north_m"] + 6.0) < 1.0
    assert place["radius_m"] == pytest.approx(3.0, rel=0.3)
    assert found.values[0] == pytest.approx(deg, rel=0.25)
    assert np.sign(found.values[0]) == np.sign(deg)


def test_what_is_known_already_is_not_looked_for():
    found = find_moments(bare("heading_step=5.0,150.0"), 0, ("heading_step",))
    assert "heading_step" not in [one.free.effect.name for one in found]


def test_an_effect_that_is_always_there_is_no_moment():
    """A lever arm makes every moment of the run better; none stands out."""
    assert strong(moments("lever_arm=0.3,-0.1")) == []
