"""Differences: after minus before, and an offset's differences go the short way round."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.results.calibration import Estimate
from sccal.results.differences import Difference, difference, unit_of, why_not_estimated, why_own_log_only

angles = st.floats(-180.0, 180.0, exclude_min=True)


def of(value, sigma=1.0, status="estimated", reason=""):
    return Estimate(value, sigma, status, reason)


def test_the_sign_is_after_minus_before():
    d = difference("track_m", of(0.70, 3e-3), of(0.71, 4e-3))
    assert d.amount == pytest.approx(0.01)
    assert d.sigma == pytest.approx(5e-3)
    assert d.in_sigmas == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("before", "after", "amount"),
    [(179.0, -179.0, 2.0), (-179.0, 179.0, -2.0), (10.0, 30.0, 20.0), (-90.0, 90.0, 180.0), (90.0, -90.0, 180.0)],
)
def test_an_offset_goes_the_short_way_round(before, after, amount):
    assert difference("heading_offset_deg", of(before), of(after)).amount == pytest.approx(amount)


@given(angles, angles)
def test_an_offsets_difference_leads_from_one_to_the_other(before, after):
    d = difference("heading_offset_deg", of(before), of(after)).amount
    assert -180.0 < d <= 180.0
    turns = (before + d - after) / 360.0
    assert turns == pytest.approx(round(turns), abs=1e-9)


def test_amplitudes_in_degrees_do_not_wrap():
    assert difference("cos_deg", of(-179.0), of(179.0)).amount == pytest.approx(358.0)


def test_without_sigmas_any_difference_is_infinitely_many():
    assert Difference(-1e-9, 0.0).in_sigmas == -math.inf
    assert Difference(0.0, 0.0).in_sigmas == 0.0


@pytest.mark.parametrize(
    ("key", "unit"),
    [("track_m", "m"), ("cos_deg", "deg"), ("s", "s"), ("at_s", "s"), ("deg_per_mps", ""), ("ratio", ""), ("cos", "")],
)
def test_units_stand_at_the_end_of_names(key, unit):
    assert unit_of(key) == unit


def test_moments_and_places_mean_something_in_their_own_log_only():
    place, shift = ("deg", "east_m", "north_m", "radius_m"), ("east_m", "north_m", "at_s")
    assert [key for key in place if why_own_log_only(key, place)] == ["east_m", "north_m"]
    assert [key for key in shift if why_own_log_only(key, shift)] == ["at_s"]


def test_only_estimates_with_a_value_can_be_compared():
    assert why_not_estimated(of(1.0)) == ""
    assert why_not_estimated(of(1.0, status="unobserved", reason="turn both ways")) == "not excited: turn both ways"
    assert "bound" in why_not_estimated(of(1.0, status="at_bound"))
    assert "held" in why_not_estimated(of(1.0, status="held"))
    assert "no value" in why_not_estimated(of(math.nan))
