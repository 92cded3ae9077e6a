"""Units that are far off are named: of coordinates, wheels and yaw, counts since the row before, mirrored places."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sccal.align.aligned import align
from sccal.errors import DataError
from sccal.geodesy import TangentPlane
from sccal.logs.streams import FixStream, HeadingStream, Run, Vehicle, WheelStream

T_S = np.arange(0.0, 200.0, 0.05)
TURN_RADPS = 0.5 * np.sin(0.11 * T_S) + 0.3 * np.sin(0.037 * T_S)
SPEED_MPS = 0.7 + 0.3 * np.sin(0.23 * T_S)
YAW_RAD = np.cumsum(TURN_RADPS) * 0.05
EAST_M, NORTH_M = np.cumsum(SPEED_MPS * np.cos(YAW_RAD)) * 0.05, np.cumsum(SPEED_MPS * np.sin(YAW_RAD)) * 0.05
RADIUS_M, TRACK_M = 0.08, 0.7
ROBOT = Vehicle("robot", Path("vehicle.toml"), RADIUS_M, TRACK_M)


def run(
    wheels: float = 1.0,
    yaw: float = 1.0,
    east_m: np.ndarray = EAST_M,
    north_m: np.ndarray = NORTH_M,
    steps: bool = False,
) -> Run:
    """A drive without noise, its wheels and yaw multiplied, its fixes at given places."""
    left, right = (np.cumsum(SPEED_MPS + side * 0.5 * TRACK_M * TURN_RADPS) * 0.05 / RADIUS_M for side in (-1.0, 1.0))
    if steps:
        left, right = np.diff(left, prepend=0.0), np.diff(right, prepend=0.0)
    every = slice(None, None, 4)
    lat, lon = TangentPlane(52.0, 5.0, 0.0).to_lat_lon(east_m[every], north_m[every])
    none, quality = np.full(lat.size, np.nan), np.full(lat.size, 4)
    fixes = FixStream(T_S[every], none, False, lat, lon, none, quality, none, none, np.zeros(lat.size))
    stream = WheelStream(T_S, wheels * left, wheels * right, np.zeros(T_S.size, dtype=np.bool_))
    return Run("run", Path("run"), ROBOT, stream, HeadingStream(T_S, yaw * YAW_RAD), fixes)


def refusal(of: Run) -> str:
    with pytest.raises(DataError) as caught:
        align(of)
    return str(caught.value)


def test_a_good_log_is_taken() -> None:
    assert align(run()).name == "run"
    assert align(run(wheels=1.9)).name == "run"


def test_wheels_in_degrees_are_named() -> None:
    assert "degrees, not radians" in refusal(run(wheels=np.degrees(1.0)))


def test_a_gear_that_was_forgotten_is_named() -> None:
    assert "times as fast as the fixes; else check ticks_per_rev" in refusal(run(wheels=34.0))


def test_fixes_beyond_the_wheels_travel_are_refused() -> None:
    assert "far beyond what the wheels travelled" in refusal(run(east_m=3000.0 * EAST_M, north_m=3000.0 * NORTH_M))


@pytest.mark.parametrize(("factor", "unit"), [(10.0, "tenths"), (1.0 / 57.3, "radians under a name in degrees")])
def test_a_yaw_in_another_unit_that_never_goes_round_is_named(factor: float, unit: str) -> None:
    assert unit in refusal(run(yaw=factor))


def test_counts_since_the_row_before_are_named() -> None:
    of = run(steps=True)
    wheels = replace(of.wheels, left_rad=100.0 * of.wheels.left_rad, right_rad=100.0 * of.wheels.right_rad)
    assert "increments since the row before" in refusal(replace(of, wheels=wheels))


@pytest.mark.parametrize(("east", "north"), [(NORTH_M, EAST_M), (-EAST_M, NORTH_M), (EAST_M, -NORTH_M)])
def test_places_exchanged_or_without_their_sign_are_named(east: np.ndarray, north: np.ndarray) -> None:
    assert "mirror image of both" in refusal(run(east_m=east, north_m=north))
