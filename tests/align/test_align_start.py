"""The start: pose, heading offset and scale from the first metres, whatever the AHRS calls zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align import align
from sccal.degrade.faults import Faults, fault_run
from sccal.errors import DataError
from sccal.filter.start import Constants, coarse_constants, find_start, first_constants
from sccal.simulate.sensors import origin
from tests.runs import read, written

DRIVES = {
    "forwards": {"path": "rectangle"},
    "in reverse": {"path": "rectangle", "reverse_first_m": 15.0},
    "standing first": {"stand_first_s": 60.0, "duration_s": 120.0},
    "standing, then in reverse": {
        "path": "straight",
        "stand_first_s": 60.0,
        "reverse_first_m": 10.0,
        "duration_s": 120.0,
    },
    "in a curve": {"path": "circle", "lead_in_m": 0.0},
}


def turned(angle_rad: float) -> float:
    """The angle in degrees, in [−180, 180)."""
    return float((np.degrees(angle_rad) + 180.0) % 360.0 - 180.0)


@pytest.mark.parametrize("convention", ["enu", "ned"])
@pytest.mark.parametrize("offset_deg", [0.0, 137.0, -170.0, 180.0])
@pytest.mark.parametrize("name", DRIVES)
def test_the_offset_is_right_for_any_zero_of_the_ahrs(simulate, streams, name, offset_deg, convention):
    log = simulate(seed=3, ahrs={"heading_offset_deg": offset_deg, "convention": convention}, **DRIVES[name])
    aligned = align(streams(log))
    start = find_start(aligned)
    assert abs(turned(start.offset_rad - np.radians(offset_deg))) < 2.0
    assert -np.pi < start.offset_rad <= np.pi
    assert start.wheel_scale == pytest.approx(1.0, abs=0.02)

    true = log.motion.at(np.array([aligned.span_s[0] - log.settings.clock.start_utc_s]))
    assert abs(turned(start.yaw_rad - true.yaw_rad[0])) < 2.0
    lat, lon = aligned.plane.to_lat_lon(np.array([start.east_m]), np.array([start.north_m]))
    east, north = origin(log.settings.gnss).to_east_north(lat, lon)
    assert np.hypot(east - true.east_m, north - true.north_m)[0] < 0.15


@pytest.mark.parametrize("seed", range(8))
def test_the_stated_sigmas_cover_the_errors(simulate, streams, seed):
    log = simulate(seed=seed, ahrs={"heading_offset_deg": 137.0, "drift_sigma_deg": 3.0})
    aligned = align(streams(log))
    start = find_start(aligned)
    true = log.motion.at(np.array([aligned.span_s[0] - log.settings.clock.start_utc_s]))
    assert abs(turned(start.yaw_rad - true.yaw_rad[0])) < 3.0 * np.degrees(start.sigma_yaw_rad)
    assert 0.0 < start.sigma_position_m < 1.0
    assert np.degrees(start.sigma_yaw_rad) < 20.0


def test_the_window_begins_with_the_motion(simulate, streams):
    aligned = align(streams(simulate(path="straight", stand_first_s=60.0, duration_s=120.0)))
    start = find_start(aligned)
    assert start.moving_from_s - aligned.span_s[0] == pytest.approx(60.0, abs=2.0)
    assert start.until_s - start.moving_from_s == pytest.approx(10.0)


def test_worse_fixes_need_a_longer_window(simulate, streams):
    def length_s(sigma_m: float, quality: int) -> float:
        gnss = {"white_sigma_m": sigma_m, "drift_sigma_m": sigma_m, "quality": quality}
        start = find_start(align(streams(simulate(gnss=gnss, path="straight", duration_s=300.0))))
        assert abs(turned(start.offset_rad - np.radians(12.5))) < 10.0
        return start.until_s - start.moving_from_s

    assert length_s(0.01, 4) < length_s(1.0, 1)


def test_outliers_do_not_turn_the_start(simulate, streams):
    gnss = {"outlier_fraction": 0.1, "outlier_smallest_m": 3.0, "outlier_largest_m": 30.0}
    start = find_start(align(streams(simulate(gnss=gnss))))
    assert abs(turned(start.offset_rad - np.radians(12.5))) < 4.0


def test_a_robot_that_stands_is_refused(simulate, streams):
    aligned = align(streams(simulate(path="straight", stand_first_s=60.0, duration_s=60.0)))
    with pytest.raises(DataError, match=r"the robot hardly moves.* 0\.00 m in \d+ s.*drive at least"):
        find_start(aligned)


def test_a_robot_that_only_shuffles_is_refused(simulate, streams):
    log = simulate(path="straight", stand_first_s=59.4, duration_s=60.0)
    aligned = align(streams(log))
    assert 0.05 < aligned.travel_m[-1] < 0.15
    with pytest.raises(DataError, match="hardly moves"):
        find_start(aligned)


def test_a_robot_that_only_spins_is_refused(simulate, streams):
    aligned = align(streams(simulate(path="straight", stand_first_s=60.0, duration_s=60.0)))
    angle = np.linspace(0.0, 40.0, aligned.wheel_t_s.size)
    yaw_rate = 2.0 * 40.0 * 0.08 / 0.70 / np.ptp(aligned.wheel_t_s)
    spinning = replace(
        aligned,
        right_rad=angle,
        left_rad=-angle,
        yaw_rad=aligned.yaw_rad + yaw_rate * (aligned.heading_t_s - aligned.heading_t_s[0]),
    )
    with pytest.raises(DataError, match="hardly moves"):
        find_start(spinning)


def test_a_receiver_that_froze_is_refused(simulate, streams):
    aligned = align(streams(simulate()))
    frozen = replace(aligned, fix_east_m=np.zeros(aligned.fix_t_s.size), fix_north_m=np.zeros(aligned.fix_t_s.size))
    with pytest.raises(DataError, match="the fixes do not"):
        find_start(frozen)


@pytest.mark.parametrize("factor", [0.7, 1.3])
def test_a_radius_thirty_percent_off_shows_in_the_scale(simulate, streams, factor):
    nominal_m = 0.08 / factor
    aligned = align(streams(simulate(), wheel_radius_m=nominal_m))
    start = find_start(aligned)
    assert start.wheel_scale == pytest.approx(factor, rel=0.02)
    first = first_constants(aligned, start)
    assert (first.radius_right_m, first.radius_left_m) == pytest.approx((0.0802, 0.0802), rel=0.02)
    assert first.track_m == 0.70


def test_a_radius_a_little_off_starts_from_nominal(simulate, streams):
    aligned = align(streams(simulate(), wheel_radius_m=0.075))
    assert first_constants(aligned, find_start(aligned)) == Constants(0.075, 0.075, 0.70)


@pytest.mark.parametrize("nominal_m", [0.4, 0.7, 1.2])
def test_a_track_far_off_shows_in_the_turning(simulate, streams, nominal_m):
    aligned = align(streams(simulate(), track_m=nominal_m))
    coarse = coarse_constants(aligned, find_start(aligned))
    assert coarse.track_m == pytest.approx(0.728, rel=0.05)
    assert coarse.radius_right_m == pytest.approx(0.0802, rel=0.02)


def test_a_straight_drive_keeps_the_nominal_track(simulate, streams):
    aligned = align(streams(simulate(path="straight"), track_m=0.5))
    assert coarse_constants(aligned, find_start(aligned)).track_m == 0.5


def test_good_fixes_at_a_standstill_and_coarse_ones_on_the_way_are_enough(tmp_path):
    """Trusted fixes hold the robot at one place while it stands; that it moved later is not theirs to show."""
    run = read(written(tmp_path / "run", "drive.stand_first_s=30", duration_s=180.0))
    coarse, _ = fault_run(run, Faults(sigma_m=5.0, from_s=25.0))
    assert set(coarse.fixes.quality.tolist()) == {1, 4}
    start = find_start(align(coarse))
    assert abs(np.degrees(start.offset_rad) - 12.5) < 4.0 * np.degrees(start.sigma_yaw_rad)
