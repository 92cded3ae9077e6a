"""Counters that stop, rise either way or go backwards are named; drives that look alike are left alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sccal.align.aligned import align
from sccal.geodesy import TangentPlane
from sccal.logs.streams import FixStream, HeadingStream, Run, WheelStream
from tests.align.test_scale import RADIUS_M, ROBOT, T_S, TRACK_M, TURN_RADPS, refusal

STEP_S = 0.05
SPEED_MPS = 0.6 + 0.5 * np.sin(0.23 * T_S)
BACK_MPS = np.where((T_S > 90.0) & (T_S < 110.0), -0.5, SPEED_MPS)


def drive(speed_mps: np.ndarray = SPEED_MPS, turn_radps: np.ndarray = TURN_RADPS, arm: complex = 0.0) -> Run:
    """A drive without noise and an antenna ahead and to the left of the middle by a complex arm."""
    yaw = np.cumsum(turn_radps) * STEP_S
    place = np.cumsum(speed_mps * np.exp(1j * yaw)) * STEP_S + arm * np.exp(1j * yaw)
    left, right = (np.cumsum(speed_mps + side * 0.5 * TRACK_M * turn_radps) * STEP_S / RADIUS_M for side in (-1.0, 1.0))
    every = slice(None, None, 4)
    lat, lon = TangentPlane(52.0, 5.0, 0.0).to_lat_lon(place.real[every], place.imag[every])
    none, quality = np.full(lat.size, np.nan), np.full(lat.size, 4)
    fixes = FixStream(T_S[every], none, False, lat, lon, none, quality, none, none, np.zeros(lat.size))
    wheels = WheelStream(T_S, left, right, np.zeros(T_S.size, dtype=np.bool_))
    return Run("run", Path("run"), ROBOT, wheels, HeadingStream(T_S, yaw), fixes)


def counted(of: Run, left_rad: np.ndarray, right_rad: np.ndarray) -> Run:
    return replace(of, wheels=replace(of.wheels, left_rad=left_rad, right_rad=right_rad))


def rising(angle_rad: np.ndarray) -> np.ndarray:
    return np.cumsum(np.abs(np.diff(angle_rad, prepend=0.0)))


def test_counters_that_rise_either_way_are_named() -> None:
    of = drive(BACK_MPS)
    assert "both counters go up whichever way" in refusal(
        counted(of, rising(of.wheels.left_rad), rising(of.wheels.right_rad))
    )
    assert "the right counter goes up whichever way" in refusal(
        counted(of, of.wheels.left_rad, rising(of.wheels.right_rad))
    )


def test_a_drive_without_reverse_rises_and_is_good() -> None:
    assert align(drive(SPEED_MPS + 0.4)).name == "run"


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_counter_that_stops_for_good_is_named_with_its_time(side: str) -> None:
    of = drive()
    angle = getattr(of.wheels, f"{side}_rad")
    stopped = np.where(T_S < 120.0, angle, angle[np.searchsorted(T_S, 120.0)])
    said = refusal(replace(of, wheels=replace(of.wheels, **{f"{side}_rad": stopped})))
    assert f"the {side} counter stops counting at t = 119.9 s" in said


def test_a_robot_that_stands_at_the_end_has_no_dead_counter() -> None:
    stands = T_S < 170.0
    assert align(drive(SPEED_MPS * stands, TURN_RADPS * stands)).name == "run"


@pytest.mark.parametrize("arm", [0.5, -0.4 + 0.3j, 0.3j])
def test_turning_on_the_spot_with_an_antenna_off_the_middle_is_no_reversed_counter(arm: complex) -> None:
    (notice,) = (notice for notice in align(drive(np.zeros(T_S.size), TURN_RADPS, arm)).notices if notice.doubt)
    assert "the robot only turns, and goes 0.0 m: drive at least 10 m straight" in notice.doubt


def test_both_counters_reversed_are_told_apart_from_exchanged_ones() -> None:
    of = drive()
    both = refusal(counted(of, -of.wheels.left_rad, -of.wheels.right_rad))
    assert "negate both left_ticks and right_ticks" in both
    assert both.index("negate both") < both.index("exchange")
    exchanged = refusal(counted(of, of.wheels.right_rad, of.wheels.left_rad))
    assert exchanged.index("exchange left_ticks and right_ticks") < exchanged.index("negate both")


def test_wheels_exchanged_and_reversed_are_told_as_a_drive_in_reverse() -> None:
    of = drive()
    (notice,) = (
        notice
        for notice in align(counted(of, -of.wheels.right_rad, -of.wheels.left_rad)).notices
        if "in reverse" in notice.what
    )
    assert "exchanged and both reversed" in notice.what
    assert notice.doubt == ""
