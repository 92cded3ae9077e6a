"""How far fixes are trusted: the table, what is stated, and the floor."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.align.accuracy import FLOOR_M, fix_covariance, table_sigma_m, usable

SIGMAS = {-1: 1.0, 1: 3.0, 2: 1.0, 3: 1.5, 4: 0.015, 5: 0.35, 8: 0.015, 9: 1.0}


def sigmas(quality: int, east_m: float = np.nan, north_m: float = np.nan, cov_m2: float = 0.0) -> tuple[float, ...]:
    """East and north sigma and covariance of one fix."""
    var_east, var_north, cov = fix_covariance(
        np.array([quality]), np.array([east_m]), np.array([north_m]), np.array([cov_m2])
    )
    return float(np.sqrt(var_east[0])), float(np.sqrt(var_north[0])), float(cov[0])


@pytest.mark.parametrize(("quality", "sigma_m"), SIGMAS.items())
def test_the_quality_gives_the_sigma_where_none_is_stated(quality, sigma_m):
    assert table_sigma_m(np.array([quality])).tolist() == [sigma_m]
    assert sigmas(quality) == pytest.approx((sigma_m, sigma_m, 0.0))


def test_better_qualities_have_smaller_sigmas():
    fixed, floating, differential, autonomous = table_sigma_m(np.array([4, 5, 2, 1]))
    assert fixed < floating < differential < autonomous


@pytest.mark.parametrize("quality", range(-3, 12))
def test_usable_are_exactly_the_qualities_of_the_table(quality):
    assert usable(np.array([quality])).tolist() == [quality in SIGMAS]


def test_a_stated_sigma_wins_over_the_table():
    assert sigmas(1, 0.02, 0.05) == pytest.approx((0.02, 0.05, 0.0))
    assert sigmas(4, 2.0, 3.0) == pytest.approx((2.0, 3.0, 0.0))


def test_no_sigma_is_below_the_floor():
    assert FLOOR_M == 0.008
    assert sigmas(4, 0.001, 0.02) == pytest.approx((0.008, 0.02, 0.0))


@pytest.mark.parametrize(("east_m", "north_m"), [(0.0, 0.0), (-1.0, 0.5), (0.5, np.nan), (0.5, np.inf), (np.inf, 0.5)])
def test_a_stated_sigma_that_makes_no_sense_is_not_stated(east_m, north_m):
    assert sigmas(5, east_m, north_m, 0.1) == pytest.approx((0.35, 0.35, 0.0))


@given(
    st.floats(1e-4, 100.0),
    st.floats(1e-4, 100.0),
    st.floats(-1e5, 1e5) | st.just(float("nan")),
)
def test_every_covariance_matrix_is_positive_definite(east_m, north_m, cov_m2):
    east, north, cov = sigmas(4, east_m, north_m, cov_m2)
    assert abs(cov) <= 0.95 * east * north * (1 + 1e-9)
    assert east > 0
    assert north > 0


def test_a_possible_covariance_is_kept_with_its_sign():
    assert sigmas(4, 0.1, 0.2, -0.005)[2] == pytest.approx(-0.005)
    assert sigmas(4, 0.1, 0.2, -1.0)[2] == pytest.approx(-0.95 * 0.1 * 0.2)


def test_each_fix_is_judged_on_its_own():
    var_east, var_north, cov = fix_covariance(
        np.array([4, 5, 1]), np.array([np.nan, 0.1, np.nan]), np.array([np.nan, 0.2, 1.0]), np.array([9.0, 0.01, 9.0])
    )
    assert np.sqrt(var_east) == pytest.approx([0.015, 0.1, 3.0])
    assert np.sqrt(var_north) == pytest.approx([0.015, 0.2, 3.0])
    assert cov == pytest.approx([0.0, 0.01, 0.0])
