"""What an effect says of itself: the digits are those of the reports, and a drive's shape shows what it must."""

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.words import amplitude, less, moment, percent, rounded, sense, size
from sccal.results.numbers import plain


@dataclass(frozen=True)
class Found:
    value: float
    sigma: float = 0.1


@given(st.floats(), st.integers(1, 6))
def test_digits_are_those_of_the_reports(value, digits):
    assert rounded(value, digits) == plain(value, digits)


def test_sizes_lose_their_sign_to_the_words():
    assert size(Found(-0.742)) == "0.74"
    assert percent(Found(-0.12)) == "12.0 %"
    assert amplitude(Found(-3.0), Found(4.0)) == "5.00"
    assert moment(Found(312.4)) == "312 s after the run's start"
    assert sense(Found(1.0)) != sense(Found(-1.0))
    assert (less(Found(1.0)), less(Found(-1.0)), less(Found(-1.0), "more")) == ("less", "further", "more")


@dataclass(frozen=True)
class Shape:
    reversed_m: float | None = None
    speed_median_mps: float = 1.0
    speed_max_mps: float = 1.0
    turned_left_rad: float = 0.0
    turned_right_rad: float = 0.0
    headings: int = 1
    arcs: int = 0
    pivots: int = 0


SHOWS = {
    "lever_arm": Shape(turned_left_rad=4.0, turned_right_rad=4.0),
    "gnss_latency": Shape(reversed_m=6.0),
    "hard_iron": Shape(headings=8),
    "soft_iron": Shape(headings=8),
    "turn_slip": Shape(turned_left_rad=4.0, turned_right_rad=4.0, arcs=2, pivots=2),
    "speed_slip": Shape(speed_max_mps=1.7),
    "side_slip": Shape(turned_left_rad=4.0, turned_right_rad=4.0, pivots=2, speed_max_mps=1.7),
}


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_straight_line_shows_none_of_the_effects_that_have_a_rule(name):
    assert CATALOGUE[name].shown_by(Shape()) is (False if name in SHOWS else None)


@pytest.mark.parametrize(("name", "shape"), SHOWS.items())
def test_the_drive_that_a_rule_asks_for_shows_the_effect(name, shape):
    assert CATALOGUE[name].shown_by(shape) is True
    assert CATALOGUE[name].shown_by(Shape(turned_left_rad=9.0)) is False
