"""What the sensors make of the truth: signs, conventions, noise that is what it claims, counters that wrap."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.randomness import gauss_markov, random_stream
from sccal.simulate.noise import in_order
from sccal.simulate.physics import Physics
from sccal.simulate.run import simulate_run
from sccal.simulate.sensors import ahrs_reading_deg, origin, wrap_counter
from sccal.simulate.settings import (
    AhrsSettings,
    ClockSettings,
    DriveSettings,
    EncoderSettings,
    GnssSettings,
    SimulationSettings,
)

QUIET_AHRS = AhrsSettings(drift_sigma_deg=0.0, white_sigma_deg=0.0)
QUIET_GNSS = GnssSettings(white_sigma_m=0.0, drift_sigma_m=0.0, speed_sigma_mps=0.0)
GENERAL = DriveSettings(path="general", duration_s=120.0)


@pytest.mark.parametrize("convention", ["enu", "ned"])
def test_ahrs_reads_the_yaw_plus_the_offset(convention):
    ahrs = replace(QUIET_AHRS, convention=convention, heading_offset_deg=-33.0)
    run = simulate_run(SimulationSettings(drive=GENERAL, ahrs=ahrs))
    yaw_deg = np.degrees(run.motion.at(run.ahrs.true_t_s).yaw_rad)
    enu_deg = run.ahrs.yaw_deg if convention == "enu" else 90.0 - run.ahrs.yaw_deg
    error = (enu_deg - yaw_deg + 33.0 + 180.0) % 360.0 - 180.0
    assert np.max(np.abs(error)) < 0.0051


def test_a_compass_turns_clockwise_from_north():
    ned = replace(QUIET_AHRS, convention="ned", heading_offset_deg=0.0)
    readings = ahrs_reading_deg(np.radians([90.0, 0.0, -90.0, 180.0, 90.001]), ned)
    assert readings.tolist() == [0.0, 90.0, 180.0, 270.0, 0.0]


@given(st.floats(-4000.0, 4000.0))
def test_readings_stay_in_their_ranges(enu_deg):
    enu = ahrs_reading_deg(np.radians([enu_deg]), QUIET_AHRS)[0]
    ned = ahrs_reading_deg(np.radians([enu_deg]), replace(QUIET_AHRS, convention="ned"))[0]
    assert -180.0 < enu <= 180.0
    assert 0.0 <= ned < 360.0
    assert math.remainder(enu - enu_deg, 360.0) == pytest.approx(0.0, abs=0.0051)
    assert math.remainder(90.0 - ned - enu_deg, 360.0) == pytest.approx(0.0, abs=0.0051)


@pytest.mark.parametrize(("forward_m", "left_m"), [(0.0, 0.0), (0.4, -0.7)])
def test_fixes_lead_back_to_the_antenna(forward_m, left_m):
    gnss = replace(QUIET_GNSS, antenna_forward_m=forward_m, antenna_left_m=left_m)
    run = simulate_run(SimulationSettings(drive=GENERAL, gnss=gnss))
    state = run.motion.at(run.gnss.true_t_s)
    arm = (forward_m + 1j * left_m) * np.exp(1j * state.yaw_rad)
    east, north = origin(gnss).to_east_north(run.gnss.lat_deg, run.gnss.lon_deg)
    assert np.max(np.abs(east + 1j * north - (state.east_m + 1j * state.north_m + arm))) < 1e-4


def test_course_and_speed_are_those_of_the_antenna():
    gnss = replace(QUIET_GNSS, antenna_forward_m=0.4, antenna_left_m=-0.7)
    run = simulate_run(SimulationSettings(drive=GENERAL, gnss=gnss))

    def antenna(t_s):
        state = run.motion.at(t_s)
        return state.east_m + 1j * state.north_m + (0.4 - 0.7j) * np.exp(1j * state.yaw_rad)

    t = run.gnss.true_t_s[5:-5]
    velocity = (antenna(t + 0.002) - antenna(t - 0.002)) / 0.004
    logged = run.gnss.speed_mps * np.exp(1j * np.radians(90.0 - run.gnss.course_deg))
    assert np.max(np.abs(logged[5:-5] - velocity)) < 0.01


def test_fixes_stand_on_whole_utc_epochs_and_arrive_later():
    clock = ClockSettings(start_utc_s=1717243200.37, host_epoch_offset_s=1717243000.0)
    run = simulate_run(SimulationSettings(drive=DriveSettings(duration_s=200.0), clock=clock))
    fifths = run.gnss.utc_s * 5.0
    assert np.array_equal(fifths, np.round(fifths))
    assert run.gnss.true_t_s == pytest.approx(run.gnss.utc_s - clock.start_utc_s, abs=1e-6)
    delay = run.gnss.host_t_s - (run.gnss.utc_s - clock.host_epoch_offset_s)
    assert np.all(delay > 0)
    assert delay.mean() == pytest.approx(0.02, abs=0.001)
    assert delay.std() == pytest.approx(0.005, rel=0.15)
    assert run.encoder.host_t_s - run.encoder.true_t_s == pytest.approx(200.37, abs=1e-6)


def test_outliers_are_as_frequent_and_large_as_asked():
    drive = DriveSettings(path="straight", duration_s=2000.0)
    run = simulate_run(SimulationSettings(drive=drive, gnss=replace(QUIET_GNSS, outlier_fraction=0.05)))
    state = run.motion.at(run.gnss.true_t_s)
    east, north = origin(QUIET_GNSS).to_east_north(run.gnss.lat_deg, run.gnss.lon_deg)
    jump = np.hypot(east - state.east_m, north - state.north_m)
    assert run.gnss.outlier.mean() == pytest.approx(0.05, abs=0.01)
    assert np.array_equal(jump > 0.5, run.gnss.outlier)
    assert jump[run.gnss.outlier].min() > 0.99
    assert jump.max() < 5.01


@pytest.mark.parametrize(("sigma", "time_s", "step_s"), [(0.4, 15.0, 0.02), (1.0, 60.0, 5.0)])
def test_gauss_markov_has_its_sigma_and_correlation_time(sigma, time_s, step_s):
    error = gauss_markov(random_stream(5, "gm"), 2_000_000, step_s, sigma, time_s)
    assert error.std() == pytest.approx(sigma, rel=0.05)
    lag = round(time_s / step_s)
    correlation = np.mean(error[:-lag] * error[lag:]) / error.var()
    assert correlation == pytest.approx(math.exp(-lag * step_s / time_s), abs=0.05)


def test_gauss_markov_is_stationary_from_its_first_sample():
    first = np.array([gauss_markov(random_stream(seed, "gm"), 2, 0.02, 0.4, 15.0) for seed in range(2000)])
    assert first.std(axis=0) == pytest.approx([0.4, 0.4], rel=0.07)


@settings(max_examples=80)
@given(
    bits=st.sampled_from([8, 16, 24, 32]),
    signed=st.booleans(),
    start=st.integers(-(2**40), 2**40),
    seed=st.integers(0, 1000),
)
def test_a_wrapped_counter_unwraps_to_the_same_travel(bits, signed, start, seed):
    half = 2 ** (bits - 1)
    steps = np.random.default_rng(seed).integers(-half + 1, half, 50)
    count = start + np.cumsum(steps)
    shown = wrap_counter(count, bits, signed)
    low = -half if signed else 0
    assert shown.min() >= low
    assert shown.max() < low + 2**bits
    again = (np.diff(shown) + half) % 2**bits - half
    assert np.array_equal(again, np.diff(count))


@pytest.mark.parametrize("signed", [True, False])
def test_a_wrapping_encoder_logs_the_same_drive(signed):
    drive = DriveSettings(duration_s=300.0)
    plain = simulate_run(SimulationSettings(drive=drive)).encoder
    narrow = EncoderSettings(counter_bits=16, counter_signed=signed, start_left_ticks=123_456, start_right_ticks=-5)
    wrapped = simulate_run(SimulationSettings(drive=drive, encoder=narrow)).encoder
    assert np.abs(np.diff(wrapped.left_ticks)).max() > 60_000
    travel = (np.diff(wrapped.left_ticks) + 2**15) % 2**16 - 2**15
    assert np.array_equal(travel, np.diff(plain.left_ticks))
    assert (wrapped.left_ticks[0] - plain.left_ticks[0] - 123_456) % 2**16 == 0
    assert (wrapped.right_ticks[0] - plain.right_ticks[0] + 5) % 2**16 == 0


def test_jittered_stamps_are_late_and_in_order():
    settings_ = SimulationSettings(drive=GENERAL, encoder=EncoderSettings(arrival_jitter_s=0.004))
    log = simulate_run(settings_).encoder
    late = log.host_t_s - (log.true_t_s + settings_.clock.start_utc_s)
    assert np.all(np.diff(np.round(log.host_t_s, 4)) > 0)
    assert np.all(late > -1e-6)
    assert 0.003 < late.mean() < 0.007


@given(st.lists(st.floats(0.0, 10.0), min_size=1, max_size=50), st.floats(0.001, 1.0))
def test_a_queue_keeps_its_order_and_is_never_early(stamps, gap_s):
    arrived = in_order(np.array(stamps), gap_s)
    assert np.all(arrived >= np.array(stamps) - 1e-9)
    assert np.all(np.diff(arrived) >= gap_s - 1e-9)


def test_one_sensor_does_not_change_the_noise_of_another():
    base = simulate_run(SimulationSettings(drive=GENERAL))
    changed = simulate_run(
        SimulationSettings(
            drive=GENERAL,
            ahrs=AhrsSettings(rate_hz=20.0, drift_sigma_deg=2.0),
            encoder=EncoderSettings(arrival_jitter_s=0.001),
        )
    )
    assert np.array_equal(base.gnss.lat_deg, changed.gnss.lat_deg)
    assert np.array_equal(base.gnss.host_t_s, changed.gnss.host_t_s)
    assert np.array_equal(base.encoder.left_ticks, changed.encoder.left_ticks)
    outliers = simulate_run(SimulationSettings(drive=GENERAL, gnss=GnssSettings(outlier_fraction=0.1)))
    clean = ~outliers.gnss.outlier
    assert np.array_equal(base.gnss.lat_deg[clean], outliers.gnss.lat_deg[clean])
    assert np.array_equal(base.ahrs.yaw_deg, outliers.ahrs.yaw_deg)


class Knock(Physics):
    """The AHRS is turned by 5° after a minute, and all fixes are 0.2 s old."""

    def heading(self, state, reading_rad):
        return reading_rad + np.radians(5.0) * (state.t_s > 60.0)

    def shown_time(self, sensor, t_s):
        return t_s - 0.2 if sensor == "gnss" else t_s


class TrackedTurns(Physics):
    """The body turns a tenth less than the tracks say."""

    def wheel_travel(self, motion, travel_m):
        more = 0.5 * (travel_m.right - travel_m.left) * (1 / 0.9 - 1)
        return replace(travel_m, left=travel_m.left - more, right=travel_m.right + more)


def test_effects_act_at_their_own_stage_only():
    chosen = SimulationSettings(drive=GENERAL, gnss=QUIET_GNSS)
    base, knocked = simulate_run(chosen), simulate_run(chosen, [Knock()])
    step = (knocked.ahrs.yaw_deg - base.ahrs.yaw_deg + 180.0) % 360.0 - 180.0
    assert step == pytest.approx(5.0 * (base.ahrs.true_t_s > 60.0), abs=0.011)
    assert np.array_equal(base.encoder.right_ticks, knocked.encoder.right_ticks)
    assert np.array_equal(base.motion.yaw_rad, knocked.motion.yaw_rad)
    earlier = knocked.motion.at(knocked.gnss.true_t_s - 0.2)
    east, _north = origin(QUIET_GNSS).to_east_north(knocked.gnss.lat_deg, knocked.gnss.lon_deg)
    assert np.max(np.abs(east - earlier.east_m)) < 1e-4

    slipping = simulate_run(chosen, [TrackedTurns(), Knock()])
    turned = np.ptp(slipping.wheel_angle_rad.right - slipping.wheel_angle_rad.left)
    assert turned > 1.05 * np.ptp(base.wheel_angle_rad.right - base.wheel_angle_rad.left)
    assert np.array_equal(base.motion.yaw_rad, slipping.motion.yaw_rad)
    assert np.array_equal(knocked.ahrs.yaw_deg, slipping.ahrs.yaw_deg)
