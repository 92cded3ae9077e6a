"""Scales, gains and sizes far from the nominal ones are told as what they are, and usual ones are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align.aligned import align
from sccal.align.proportions import fit_of_path, shares_of_turning
from sccal.logs.streams import Run
from tests.align.test_scale import EAST_M, NORTH_M, T_S, YAW_RAD, refusal, run


def sided(right: float = 1.0, left: float = 1.0) -> Run:
    """A good drive whose counters count so many times too much."""
    of = run()
    return replace(
        of, wheels=replace(of.wheels, right_rad=right * of.wheels.right_rad, left_rad=left * of.wheels.left_rad)
    )


def doubts(of: Run) -> list[str]:
    return [notice.doubt for notice in align(of).notices if notice.doubt]


def test_sizes_are_measured_beside_the_nominal_ones() -> None:
    aligned = align(run(wheels=1.0 / 1.05))
    shares = shares_of_turning(aligned)
    assert shares is not None
    assert (shares.right, shares.left) == pytest.approx((1.05, 1.05), rel=2e-3)
    fit = fit_of_path(aligned, shares.right, shares.left)
    assert fit is not None
    assert fit.scale == pytest.approx(1.0, rel=5e-3)
    assert fit.explained > 0.999


@pytest.mark.parametrize(
    ("scale", "notation"),
    [(0.6, "minutes stand where"), (0.36, "packed"), (3.28, "another unit"), (0.5, "another unit")],
)
def test_coordinates_of_another_scale_are_named_beside_the_counts(scale: float, notation: str) -> None:
    said = refusal(run(east_m=scale * EAST_M, north_m=scale * NORTH_M))
    assert "both radii and the track come out at about the same share" in said
    assert notation in said
    assert "ticks_per_rev" in said


@pytest.mark.parametrize("wheels", [0.25, 0.7, 1.5, 3.6])
def test_counts_of_another_turn_are_doubted(wheels: float) -> None:
    (doubt,) = doubts(run(wheels=wheels))
    assert f"{1.0 / wheels:.2f} times their nominal radius: check ticks_per_rev" in doubt


@pytest.mark.parametrize("wheels", [0.9, 1.1])
def test_worn_or_loaded_wheels_raise_no_doubt(wheels: float) -> None:
    assert doubts(run(wheels=wheels)) == []


def test_sides_that_count_differently_are_doubted_and_beyond_reason_refused() -> None:
    (doubt,) = doubts(sided(left=1.3))
    assert doubt.startswith("the left counter counts 1.30 times as much")
    assert "the right counter counts 2.00 times as much as the other one" in refusal(sided(right=2.0))
    assert doubts(sided(right=1.08)) == []


@pytest.mark.parametrize(("gain", "word"), [(0.5, "about half as far"), (2.0, "about twice as far"), (0.8, "0.8")])
def test_a_gain_far_off_is_named(gain: float, word: str) -> None:
    said = refusal(run(yaw=gain))
    assert "times as far as the path of the fixes" in said
    assert word in said


def test_a_compass_that_iron_bends_is_no_gain() -> None:
    heading = 1.2 * np.sin(YAW_RAD)  # To and fro about north, where iron makes the slope less than one.
    place = np.cumsum(0.7 * np.exp(1j * heading)) * 0.05
    of = run(east_m=place.real, north_m=place.imag)
    half = 0.5 * 0.7 * np.gradient(heading, T_S)
    left, right = (np.cumsum(0.7 + side * half) * 0.05 / 0.08 for side in (-1.0, 1.0))
    bent = replace(of.heading, yaw_rad=heading - 0.25 * np.sin(heading))
    assert align(replace(of, wheels=replace(of.wheels, left_rad=left, right_rad=right), heading=bent)).name == "run"


def test_tracks_that_skid_are_no_gain() -> None:
    of = run()
    wide = replace(of, vehicle=replace(of.vehicle, track_m=of.vehicle.track_m / 1.7))
    assert doubts(wide) == []


def test_fixes_of_another_drive_are_refused() -> None:
    other = np.cumsum(0.7 * np.exp(1j * (0.6 * np.sin(0.083 * T_S) * T_S**0.5))) * 0.05
    said = refusal(run(east_m=other.real, north_m=other.imag))
    assert "the fixes do not move together with wheels and yaw" in said


def with_yaw(yaw_rad: np.ndarray) -> Run:
    of = run()
    return replace(of, heading=replace(of.heading, yaw_rad=yaw_rad))


def test_a_compass_beyond_the_field_of_the_earth_is_named() -> None:
    seen = np.arctan2(np.sin(YAW_RAD) + 0.9, np.cos(YAW_RAD) + 1.1)
    assert "does not go all the way round when the robot does" in refusal(with_yaw(seen))


def test_a_rate_called_yaw_is_named() -> None:
    assert "the column is a rate" in refusal(with_yaw(5.0 * np.gradient(YAW_RAD, T_S)))


def test_a_yaw_of_another_time_is_told_with_its_lag() -> None:
    assert "s later than the wheels turn" in refusal(with_yaw(np.interp(T_S - 25.0, T_S, YAW_RAD)))


def test_a_course_that_flips_in_reverse_is_named() -> None:
    flips = (np.floor(T_S / 6.0) % 2) * np.pi
    assert "the yaw flips by 180 degrees" in refusal(with_yaw((YAW_RAD + flips + np.pi) % (2.0 * np.pi) - np.pi))
