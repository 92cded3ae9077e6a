"""Drives: exact distances and angles, bounded acceleration, the shapes that their names promise."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.errors import UsageError
from sccal.simulate.paths import Route, plan_drive
from sccal.simulate.settings import PATH_NAMES, DriveSettings
from sccal.simulate.world import integrate


def motion_of(seed=3, **drive):
    chosen = DriveSettings(**drive)
    return integrate(plan_drive(chosen, seed).steps(chosen.grid_hz))


@pytest.mark.parametrize("path", PATH_NAMES)
def test_every_path_keeps_to_its_accelerations(path):
    chosen = DriveSettings(path=path, duration_s=400.0, stand_first_s=2.0, reverse_first_m=3.0)
    drive = plan_drive(chosen, seed=3)
    assert np.all(np.diff(drive.corner_t_s) > 0)
    widths = np.diff(drive.corner_t_s)
    assert np.max(np.abs(np.diff(drive.corner_speed_mps)) / widths) <= chosen.acceleration_mps2 * (1 + 1e-6)
    turn_acceleration = np.max(np.abs(np.diff(drive.corner_turn_rate_radps)) / widths)
    assert turn_acceleration <= chosen.turn_acceleration_radps2 * (1 + 1e-6)
    steps = drive.steps(chosen.grid_hz)
    step_s = 1.0 / chosen.grid_hz
    assert np.max(np.abs(np.diff(steps.along_m))) <= chosen.acceleration_mps2 * step_s**2 * (1 + 1e-6)
    assert np.max(np.abs(np.diff(steps.turn_rad))) <= chosen.turn_acceleration_radps2 * step_s**2 * (1 + 1e-6)


@pytest.mark.parametrize("path", PATH_NAMES)
def test_every_path_lasts_as_long_as_asked(path):
    end_s = motion_of(path=path, duration_s=250.0).t_s[-1]
    if path == "rectangle":
        assert 250.0 <= end_s < 450.0
    else:
        assert end_s == pytest.approx(250.0, abs=0.01)


@pytest.mark.parametrize("path", PATH_NAMES)
def test_stand_first_stands(path):
    steps = motion_of(path=path, duration_s=60.0, stand_first_s=7.0).steps
    standing = steps.t_s[1:] <= 7.0
    assert not steps.along_m[standing].any()
    assert not steps.turn_rad[standing].any()
    assert steps.along_m[~standing].any()


@pytest.mark.parametrize("path", PATH_NAMES)
def test_reverse_first_goes_backwards_that_far_and_then_on(path):
    motion = motion_of(path=path, duration_s=90.0, reverse_first_m=5.0)
    along = motion.steps.along_m
    first = along[np.flatnonzero(along)[0]]
    assert first < 0
    forwards = int(np.flatnonzero(along > 0)[0]) if (along > 0).any() else along.size
    turns = np.flatnonzero(motion.steps.turn_rad)
    back = along[: min(forwards, int(turns[0]) if turns.size else forwards)]
    assert back.sum() <= -5.0 + 1e-9
    if path != "general":
        assert back.sum() == pytest.approx(-5.0, abs=1e-9)


@pytest.mark.parametrize("corners", ["pivot", "arc"])
@pytest.mark.parametrize("rounds", ["counterclockwise", "clockwise", "alternate"])
def test_rectangle_closes_and_fills_its_sides(corners, rounds):
    motion = motion_of(path="rectangle", corners=corners, rounds=rounds, duration_s=400.0)
    assert math.hypot(motion.east_m[-1], motion.north_m[-1]) < 1e-4
    assert math.remainder(motion.yaw_rad[-1], 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
    assert np.ptp(motion.east_m) == pytest.approx(20.0, abs=1e-4)
    assert np.ptp(motion.north_m) == pytest.approx(24.0 if rounds == "alternate" else 12.0, abs=1e-4)
    turn = motion.steps.turn_rad
    assert (turn > 1e-9).any() == (rounds != "clockwise")
    assert (turn < -1e-9).any() == (rounds != "counterclockwise")


def test_pivots_do_not_travel_and_arcs_do_not_stop():
    pivots = motion_of(path="rectangle", duration_s=100.0).steps
    assert not pivots.along_m[np.abs(pivots.turn_rad) > 1e-6].any()
    arcs = motion_of(path="rectangle", corners="arc", duration_s=100.0).steps
    assert arcs.along_m[np.abs(arcs.turn_rad) > 1e-6] == pytest.approx(0.6 / 200.0)


@pytest.mark.parametrize(("rounds", "sign"), [("counterclockwise", 1), ("clockwise", -1)])
def test_circle_has_its_radius_and_goes_one_way(rounds, sign):
    motion = motion_of(path="circle", rounds=rounds, duration_s=300.0, circle_radius_m=8.0)
    late = motion.t_s > 40.0
    east, north = motion.east_m[late], motion.north_m[late]
    assert np.ptp(east) == pytest.approx(16.0, abs=1e-3)
    assert np.ptp(north) == pytest.approx(16.0, abs=1e-3)
    assert np.all(sign * motion.steps.turn_rad >= 0)
    straight = motion.t_s < 10.0
    assert np.ptp(motion.north_m[straight]) == 0.0


def test_a_circle_cannot_alternate():
    with pytest.raises(UsageError, match="circle goes one way"):
        DriveSettings(path="circle", rounds="alternate")


def test_straight_never_turns():
    motion = motion_of(path="straight", duration_s=600.0)
    assert not motion.steps.turn_rad.any()
    assert motion.east_m[-1] == pytest.approx(0.6 * 600.0 - 0.5 * 0.6**2 / 0.5)


def test_figure8_turns_both_ways_equally():
    turn = motion_of(path="figure8", duration_s=1200.0).steps.turn_rad
    left, right = turn[turn > 0].sum(), -turn[turn < 0].sum()
    assert left > 4 * math.pi
    assert right > 4 * math.pi
    assert abs(left - right) <= 2 * math.pi + 1e-6


def test_rows_run_north_and_south():
    motion = motion_of(path="rows", duration_s=900.0)
    moving = motion.steps.along_m > 0.9 * 0.6 / 200
    yaw_deg = np.degrees(motion.yaw_rad[:-1][moving])
    lanes = np.abs(np.sin(np.radians(yaw_deg))) > 0.999
    assert lanes.mean() > 0.95
    assert np.ptp(motion.north_m) == pytest.approx(30.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_general_has_everything(seed):
    steps = motion_of(path="general", duration_s=400.0, seed=seed).steps
    speed, rate = steps.along_m * 200.0, steps.turn_rad * 200.0
    assert speed.max() > 0.8
    assert speed.max() <= 1.2 + 1e-9
    spinning = np.abs(speed) < 1e-9
    assert (rate[spinning] > 0.25).any()
    assert (rate[spinning] < -0.25).any()
    assert (rate[speed > 0.25] > 0.05).any()
    assert (rate[speed > 0.25] < -0.05).any()
    assert (spinning & (rate == 0)).any()
    backwards = -steps.along_m[steps.along_m < 0].sum()
    assert backwards > 29.0


def test_general_is_seeded():
    one, again, other = (motion_of(path="general", duration_s=100.0, seed=s).east_m for s in (1, 1, 2))
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)


@settings(max_examples=60)
@given(
    distance_m=st.floats(0.05, 40.0),
    backwards=st.booleans(),
    speed_mps=st.floats(0.1, 2.0),
    angle_rad=st.floats(0.02, 12.0),
    to_the_right=st.booleans(),
    turn_rate_radps=st.floats(0.1, 2.0),
)
def test_distances_and_angles_come_out_exact(
    distance_m, backwards, speed_mps, angle_rad, to_the_right, turn_rate_radps
):
    route = Route(acceleration_mps2=0.5, turn_acceleration_radps2=0.8)
    distance_m = -distance_m if backwards else distance_m
    angle_rad = -angle_rad if to_the_right else angle_rad
    route.travel(distance_m, speed_mps)
    route.pivot(angle_rad, turn_rate_radps)
    route.hold(0.1)
    steps = route.drive(math.inf, 0.0).steps(200.0)
    assert steps.along_m.sum() == pytest.approx(distance_m, abs=1e-9)
    assert steps.turn_rad.sum() == pytest.approx(angle_rad, abs=1e-9)


def test_a_side_too_short_for_its_corners_is_refused():
    with pytest.raises(UsageError, match="too short"):
        motion_of(path="rectangle", corners="arc", rectangle_width_m=1.5, duration_s=10.0)


def test_a_lap_of_the_calibration_drive_has_some_of_everything():
    steps = motion_of(path="calibration", duration_s=320.0).steps
    hz = DriveSettings().grid_hz
    speed, rate = steps.along_m * hz, steps.turn_rad * hz
    straight = np.abs(rate) < 1e-6
    cruising = {round(float(v), 2) for v in speed[straight]}
    assert {0.3, 1.2, -0.6, 0.0} <= cruising
    arcs = (np.abs(rate) > 1e-6) & (np.abs(speed) > 0.2)
    spins = (np.abs(rate) > 1e-6) & (np.abs(speed) < 1e-6)
    for turning in (arcs, spins):
        sizes = np.abs(rate[turning])
        assert sizes.max() > 1.8 * np.median(sizes[sizes < 0.7 * sizes.max()])
        assert abs(steps.turn_rad[turning & (rate > 0)].sum()) > 2 * math.pi
        assert abs(steps.turn_rad[turning & (rate < 0)].sum()) > 2 * math.pi
