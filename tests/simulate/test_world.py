"""The truth: signs, exact arcs, slip; and that true parameters on noiseless angles lead back to it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.randomness import random_stream, random_walk
from sccal.simulate.run import simulate_run
from sccal.simulate.settings import (
    PATH_NAMES,
    DriveSettings,
    EncoderSettings,
    SimulationSettings,
    VehicleSettings,
)
from sccal.simulate.world import BodySteps, integrate, rim_travel, wheel_angles


def constant(along_m, turn_rad, count=1000, side_m=0.0, start_yaw_rad=0.0):
    full = np.full(count, 1.0)
    return BodySteps(np.arange(count + 1) / 200.0, along_m * full, side_m * full, turn_rad * full, start_yaw_rad)


def dead_reckon(left_rad, right_rad, vehicle, start):
    """The model of the calibration, mid-arc, with the true parameters."""
    right, left = vehicle.radius_right_m * np.diff(right_rad), vehicle.radius_left_m * np.diff(left_rad)
    s, turn = 0.5 * (right + left), (right - left) / vehicle.track_m
    yaw = start[2] + np.concatenate(([0.0], np.cumsum(turn)))
    middle = yaw[:-1] + 0.5 * turn
    return (
        start[0] + np.concatenate(([0.0], np.cumsum(s * np.cos(middle)))),
        start[1] + np.concatenate(([0.0], np.cumsum(s * np.sin(middle)))),
        yaw,
    )


@pytest.mark.parametrize("path", PATH_NAMES)
def test_true_parameters_lead_back_to_the_truth(path):
    run = simulate_run(
        SimulationSettings(
            drive=DriveSettings(path=path, duration_s=600.0),
            vehicle=VehicleSettings(slip_m_per_sqrt_m=0.0),
            encoder=EncoderSettings(ticks_per_rev=2**40),
        )
    )
    state = run.motion.at(run.encoder.true_t_s)
    turned = 2 * math.pi / 2**40
    east, north, yaw = dead_reckon(
        run.encoder.left_ticks * turned,
        run.encoder.right_ticks * turned,
        run.settings.vehicle,
        (state.east_m[0], state.north_m[0], state.yaw_rad[0]),
    )
    assert np.max(np.hypot(east - state.east_m, north - state.north_m)) < 1e-3
    assert np.max(np.abs(yaw - state.yaw_rad)) < 1e-6


def test_tick_quantisation_is_all_that_the_default_encoder_adds():
    run = simulate_run(SimulationSettings(vehicle=VehicleSettings(slip_m_per_sqrt_m=0.0)))
    turned = 2 * math.pi / run.settings.encoder.ticks_per_rev
    expected = np.interp(run.encoder.true_t_s, run.motion.t_s, run.wheel_angle_rad.left)
    short = expected - run.encoder.left_ticks * turned
    assert np.all(short > -1e-9)
    assert np.all(short < turned + 1e-9)


def test_turning_left_raises_yaw_and_the_right_wheel_runs_further():
    steps = constant(along_m=0.003, turn_rad=0.001)
    motion = integrate(steps)
    assert motion.yaw_rad[-1] == pytest.approx(1.0)
    assert motion.north_m[-1] > 0
    rims = rim_travel(steps, track_m=0.7)
    assert np.all(rims.right > rims.left)
    assert rims.right - rims.left == pytest.approx(0.7 * 0.001)
    assert 0.5 * (rims.right + rims.left) == pytest.approx(0.003)


@pytest.mark.parametrize("yaw_deg", [0.0, 37.0, 90.0, -135.0])
def test_forward_is_along_the_yaw_and_side_is_to_its_left(yaw_deg):
    yaw = math.radians(yaw_deg)
    ahead = integrate(constant(0.003, 0.0, start_yaw_rad=yaw))
    assert (ahead.east_m[-1], ahead.north_m[-1]) == pytest.approx((3 * math.cos(yaw), 3 * math.sin(yaw)))
    aside = integrate(constant(0.0, 0.0, side_m=0.003, start_yaw_rad=yaw))
    assert (aside.east_m[-1], aside.north_m[-1]) == pytest.approx((-3 * math.sin(yaw), 3 * math.cos(yaw)))


@settings(max_examples=50)
@given(
    along_m=st.floats(-0.01, 0.01),
    side_m=st.floats(-0.01, 0.01),
    turn_rad=st.floats(-0.05, 0.05),
    t_s=st.floats(0.0, 5.0),
)
def test_constant_motion_is_an_exact_arc_at_any_time(along_m, side_m, turn_rad, t_s):
    state = integrate(constant(along_m, turn_rad, side_m=side_m)).at(np.array([t_s]))
    steps = t_s * 200.0
    wide = turn_rad * steps
    velocity = complex(along_m, side_m)
    bend = 1.0 if abs(wide) < 1e-12 else np.expm1(1j * wide) / (1j * wide)
    expected = velocity * steps * bend
    assert complex(state.east_m[0], state.north_m[0]) == pytest.approx(expected, abs=1e-9)
    assert state.yaw_rad[0] == pytest.approx(wide, abs=1e-9)


def test_outside_the_drive_the_robot_stands():
    motion = integrate(constant(0.003, 0.001))
    state = motion.at(np.array([-1.0, 99.0]))
    assert state.east_m.tolist() == pytest.approx([0.0, motion.east_m[-1]])
    assert not state.speed_mps.any()
    assert not state.turn_rate_radps.any()


def test_slip_variance_grows_with_distance():
    steps_m = np.full(400, 0.05)
    ends = np.array([random_walk(random_stream(seed, "slip.test"), steps_m, 0.003)[-1] for seed in range(800)])
    assert ends.std() == pytest.approx(0.003 * math.sqrt(20.0), rel=0.1)
    assert abs(ends.mean()) < 4 * ends.std() / math.sqrt(800)


def test_wheels_slip_independently_and_only_while_moving():
    steps = constant(0.003, 0.0, count=50_000)
    vehicle = VehicleSettings(slip_m_per_sqrt_m=0.003)
    angles = wheel_angles(rim_travel(steps, vehicle.track_m), vehicle, seed=1)
    left = np.diff(angles.left) * vehicle.radius_left_m - steps.along_m
    right = np.diff(angles.right) * vehicle.radius_right_m - steps.along_m
    assert left.std() == pytest.approx(0.003 * math.sqrt(0.003), rel=0.03)
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.03
    still = wheel_angles(rim_travel(constant(0.0, 0.0), vehicle.track_m), vehicle, seed=1)
    assert not still.left.any()
