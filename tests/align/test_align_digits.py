"""The digits of a column: their step is found from the values, and is the floor of what a reading errs by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.align import align
from sccal.align.accuracy import FLOOR_M
from sccal.align.digits import OF_ROUNDING, step_of

EARTH_M_PER_DEG = 111_100.0


@given(st.sampled_from([1e-3, 0.01, 0.05, 0.1, 1.0, 1e-5 / 60.0]), st.integers(0, 50), st.floats(-40.0, 40.0))
def test_the_step_of_rounded_values_is_found(step, seed, around):
    values = around + 300.0 * step * np.random.default_rng(seed).standard_normal(500)
    assert step_of(np.round(values / step) * step) == pytest.approx(step, rel=1e-3)


@given(st.integers(0, 200), st.integers(8, 2000))
def test_values_on_no_grid_have_no_step(seed, count):
    assert step_of(np.random.default_rng(seed).standard_normal(count)) == 0.0


def test_few_values_that_never_meet_still_show_their_step():
    assert step_of(0.1 * np.array([0, 4, 10, 22, 28, 42, 54, 64, 83])) == pytest.approx(0.1)


def test_too_few_values_show_none():
    for values in ([], [1.0], [1.0, 1.0, 1.0], [1.0, 2.0, 3.0], [np.nan] * 20):
        assert step_of(np.array(values)) == 0.0


def rounded(run, minutes_step: float):
    """The run with its coordinates rounded to so many minutes of arc, as NMEA writes them."""
    per_deg = 60.0 / minutes_step
    lat, lon = (np.round(each * per_deg) / per_deg for each in (run.fixes.lat_deg, run.fixes.lon_deg))
    return replace(run, fixes=replace(run.fixes, lat_deg=lat, lon_deg=lon))


def test_no_variance_is_below_that_of_rounding(simulate, streams):
    aligned = align(rounded(streams(simulate()), 1e-4))
    step_m = 1e-4 / 60.0 * EARTH_M_PER_DEG
    east_m, north_m = np.sqrt(aligned.fix_var_east_m2), np.sqrt(aligned.fix_var_north_m2)
    assert north_m == pytest.approx(step_m * OF_ROUNDING, rel=0.01)
    assert east_m == pytest.approx(np.cos(np.radians(37.5)) * step_m * OF_ROUNDING, rel=0.01)
    assert aligned.fix_floor_m == pytest.approx((east_m[0], north_m[0]))


def test_fine_digits_change_no_variance(simulate, streams):
    run = streams(simulate())
    for minutes_step in (1e-7, 1e-5):
        aligned = align(rounded(run, minutes_step))
        assert np.sqrt(aligned.fix_var_east_m2) == pytest.approx(0.015)
        assert max(aligned.fix_floor_m) < FLOOR_M


@pytest.mark.parametrize("resolution_deg", [0.01, 0.1, 1.0])
def test_the_headings_floor_is_that_of_its_digits(simulate, streams, resolution_deg):
    aligned = align(streams(simulate(ahrs={"resolution_deg": resolution_deg})))
    assert np.degrees(aligned.yaw_floor_rad) == pytest.approx(resolution_deg / np.sqrt(12.0), rel=1e-3)


def test_a_heading_in_full_digits_has_no_floor(simulate, streams):
    run = streams(simulate())
    fine = run.heading.yaw_rad + 1e-4 * np.random.default_rng(0).standard_normal(run.heading.yaw_rad.size)
    assert align(replace(run, heading=replace(run.heading, yaw_rad=fine))).yaw_floor_rad == 0.0
