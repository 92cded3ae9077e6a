"""The studies' simulator: its logs hold together, and every effect has the sign that the file formats give it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.antenna import antenna_m
from studies.arrays import FloatArray, gauss_markov
from studies.compass import compass_rad, harmonic_deviation
from studies.drives import KINDS, Plan
from studies.earth import Origin, sentence, to_geodetic
from studies.motion import STEP_S
from studies.robot import Scenario, Simulated, simulate, write_log
from studies.terrain import Terrain
from studies.vehicles import Instruments, Noise, Robot
from studies.wheels import told_angles_rad

QUIET = Scenario(seed=7, plan=Plan("mixed", duration_s=150.0), noise=Noise.none())


def simulated(hills: bool = False, **effects: dict[str, float]) -> Simulated:
    """The quiet scenario with some effects."""
    return simulate(replace(QUIET, hills=hills, effects=effects))


def told_steps(log: Simulated) -> tuple[FloatArray, FloatArray]:
    """Travel and turn of each step as the counters tell them, with the true constants."""
    robot = log.scenario.robot
    right_rad, left_rad = told_angles_rad(log.motion, robot, log.scenario.effects)
    right_m, left_m = robot.radius_right_m * np.diff(right_rad), robot.radius_left_m * np.diff(left_rad)
    return 0.5 * (right_m + left_m), (right_m - left_m) / robot.track_m


def body_steps(log: Simulated) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Travel forward, slide to the left and turn of each step of the true path."""
    motion = log.motion
    middle = 0.5 * (motion.heading_rad[1:] + motion.heading_rad[:-1])
    east, north = np.diff(motion.east_m), np.diff(motion.north_m)
    along = east * np.cos(middle) + north * np.sin(middle)
    return along, north * np.cos(middle) - east * np.sin(middle), np.diff(motion.heading_rad)


def in_robot_frame(log: Simulated, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the fixes of some stamps stand from the robot's place at these times: forward and left."""
    motion = log.motion
    east, north = antenna_m(motion, log.scenario.effects, log.terrain, t_s)
    east -= np.interp(t_s, motion.t_s, motion.east_m)
    north -= np.interp(t_s, motion.t_s, motion.north_m)
    heading = np.interp(t_s, motion.t_s, motion.heading_rad)
    return east * np.cos(heading) + north * np.sin(heading), north * np.cos(heading) - east * np.sin(heading)


def radii_of_curvature_m(lat_deg: float, alt_m: float) -> tuple[float, float]:
    """Of WGS 84 at a place: along the meridian, and along the parallel about the axis."""
    eccentricity_2 = 0.0066943799901413165
    squash = 1.0 - eccentricity_2 * math.sin(math.radians(lat_deg)) ** 2
    normal_m = 6_378_137.0 / math.sqrt(squash)
    meridian_m = normal_m * (1.0 - eccentricity_2) / squash
    return meridian_m + alt_m, (normal_m + alt_m) * math.cos(math.radians(lat_deg))


def table_of(path: Path) -> FloatArray:
    """A CSV file's numbers."""
    return np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)


@pytest.mark.parametrize("kind", KINDS)
def test_a_log_without_noise_and_effects_dead_reckons_onto_its_own_fixes(tmp_path: Path, kind: str) -> None:
    exact = replace(QUIET, plan=Plan(kind, duration_s=150.0), instruments=Instruments(fix_format="csv", jitter_s=0.0))
    truth = write_log(replace(exact, instruments=replace(exact.instruments, delay_s=0.0)), tmp_path)
    encoder, fixes, robot = table_of(tmp_path / "encoder.csv"), table_of(tmp_path / "gnss.csv"), exact.robot
    left_m, right_m = (
        2.0 * math.pi * radius_m / robot.ticks_per_rev * np.diff(encoder[:, column])
        for radius_m, column in ((robot.radius_left_m, 1), (robot.radius_right_m, 2))
    )
    turned = np.concatenate(([0.0], np.cumsum((right_m - left_m) / robot.track_m))) + truth.motion.heading_rad[0]
    middle, travel_m = 0.5 * (turned[1:] + turned[:-1]), 0.5 * (right_m + left_m)
    east = np.concatenate(([0.0], np.cumsum(travel_m * np.cos(middle))))
    north = np.concatenate(([0.0], np.cumsum(travel_m * np.sin(middle))))
    origin = json.loads((tmp_path / "truth.json").read_text())["origin"]
    meridian_m, parallel_m = radii_of_curvature_m(origin["lat_deg"], origin["alt_m"])
    fix_north = meridian_m * np.radians(fixes[:, 1] - origin["lat_deg"])
    fix_east = parallel_m * np.radians(fixes[:, 2] - origin["lon_deg"])
    assert np.hypot(np.ptp(fix_east), np.ptp(fix_north)) > 3.0
    assert np.max(np.abs(np.interp(fixes[:, 0], encoder[:, 0], east) - fix_east)) < 0.003
    assert np.max(np.abs(np.interp(fixes[:, 0], encoder[:, 0], north) - fix_north)) < 0.003


def test_the_ellipsoid_has_the_radii_of_curvature_of_wgs_84() -> None:
    origin = Origin()
    lat_deg, lon_deg = to_geodetic(origin, np.array([0.0, 100.0, 0.0]), np.array([0.0, 0.0, 100.0]))
    meridian_m, parallel_m = radii_of_curvature_m(origin.lat_deg, origin.alt_m)
    assert lat_deg[0] == pytest.approx(origin.lat_deg, abs=1e-12)
    assert math.radians(lat_deg[2] - lat_deg[0]) * meridian_m == pytest.approx(100.0, abs=1e-3)
    assert math.radians(lon_deg[1] - lon_deg[0]) * parallel_m == pytest.approx(100.0, abs=1e-3)


def test_headings_without_noise_are_the_true_ones_and_a_compass_counts_clockwise_from_north(tmp_path: Path) -> None:
    fine = Instruments(heading_digits=3)
    for convention in ("enu", "ned"):
        robot = replace(QUIET.robot, convention=convention)
        log = write_log(replace(QUIET, robot=robot, instruments=fine), tmp_path / convention)
        ahrs = table_of(tmp_path / convention / "ahrs.csv")
        true_deg = np.degrees(np.interp(log.headings.t_s, log.motion.t_s, log.motion.heading_rad))
        read_deg = ahrs[:, 1] if convention == "enu" else 90.0 - ahrs[:, 1]
        off_deg = (read_deg - true_deg - robot.heading_offset_deg + 180.0) % 360.0 - 180.0
        assert np.max(np.abs(off_deg)) < 0.002


def test_a_late_fix_shows_where_the_antenna_was_earlier_and_a_fast_clock_ever_more_so() -> None:
    t_s = np.arange(5.0, 145.0, 0.1)
    late = simulated(gnss_latency={"s": 0.3})
    east, _ = antenna_m(late.motion, late.scenario.effects, late.terrain, t_s)
    assert np.allclose(east, np.interp(t_s - 0.3, late.motion.t_s, late.motion.east_m))
    forward, _ = in_robot_frame(late, t_s)
    speed = late.motion.of_steps(late.motion.body_v_in_step_mps, t_s - 0.15)
    assert np.mean(forward[speed > 0.2]) < 0.0 < np.mean(forward[speed < -0.2])
    fast = simulated(clock_skew={"ppm": 1000.0})
    east, _ = antenna_m(fast.motion, fast.scenario.effects, fast.terrain, t_s)
    assert np.allclose(east, np.interp(t_s / 1.001, fast.motion.t_s, fast.motion.east_m))


def test_a_late_heading_shows_an_earlier_one() -> None:
    log, usual = simulated(heading_latency={"s": 0.2}), simulated()
    earlier = np.interp(log.headings.t_s - 0.2, log.motion.t_s, np.degrees(log.motion.heading_rad))
    assert np.allclose(log.headings.yaw_deg, earlier + log.scenario.robot.heading_offset_deg)
    assert np.array_equal(log.motion.heading_rad, usual.motion.heading_rad)


def test_antennas_stand_forward_left_and_high() -> None:
    t_s = np.arange(5.0, 145.0, 0.5)
    forward, left = in_robot_frame(simulated(lever_arm={"forward_m": 0.4, "left_m": -0.2}), t_s)
    assert np.allclose(forward, 0.4)
    assert np.allclose(left, -0.2)
    high = simulated(hills=True, antenna_height={"m": 2.0})
    forward, left = in_robot_frame(high, t_s)
    motion = high.motion
    at = [np.interp(t_s, motion.t_s, values) for values in (motion.east_m, motion.north_m, motion.heading_rad)]
    pitch, roll = high.terrain.tilts(*at)
    assert np.allclose(forward, -2.0 * np.sin(pitch) * np.cos(roll))
    assert np.allclose(left, -2.0 * np.sin(roll))


def test_pitch_is_nose_up_and_roll_is_left_side_up() -> None:
    rises_east = Terrain(((0.2, 1e-6, 0.0, 0.0),))
    pitch, roll = rises_east.tilt_at(0.0, 0.0, 0.0)
    assert math.tan(pitch) == pytest.approx(0.2)
    assert roll == pytest.approx(0.0)
    pitch, roll = rises_east.tilt_at(0.0, 0.0, -math.pi / 2.0)
    assert pitch == pytest.approx(0.0, abs=1e-9)
    assert math.tan(roll) == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("name", "parameter", "size"),
    [
        ("speed_slip", "per_mps", 0.1),
        ("turn_scrub", "per_radps", 0.1),
        ("brake_slip", "per_mps2", 0.2),
        ("drive_slip", "per_mps2", 0.2),
        ("speed_offset", "mps", 0.04),
        ("slope", "ratio", 5.0),
    ],
)
def test_what_slips_travels_less_than_the_wheels_say(name: str, parameter: str, size: float) -> None:
    log = simulated(hills=name == "slope", **{name: {parameter: size}})
    told_m, told_turn = told_steps(log)
    along_m, side_m, turn = body_steps(log)
    v, w, a = log.motion.v_in_step_mps, log.motion.w_in_step_radps, log.motion.a_in_step_mps2
    places = [values[:-1] for values in (log.motion.east_m, log.motion.north_m, log.motion.heading_rad)]
    lost = {
        "speed_slip": told_m * size * np.abs(v),
        "turn_scrub": told_m * size * np.abs(w),
        "brake_slip": told_m * size * np.maximum(-a, 0.0),
        "drive_slip": told_m * size * np.maximum(a, 0.0),
        "speed_offset": size * STEP_S * np.sign(v) * (np.abs(v) > 0.05),
        "slope": told_m * size * (1.0 - np.cos(log.terrain.tilts(*places)[0])),
    }[name]
    assert np.sum(np.abs(lost)) > 0.01
    assert np.sum(np.abs(along_m)) < np.sum(np.abs(told_m))
    assert np.allclose(told_m - along_m, lost, atol=1e-7)
    assert np.allclose(side_m, 0.0, atol=1e-9)
    assert np.allclose(turn, told_turn, atol=1e-9)


def test_tracks_that_slip_in_turns_turn_less_and_what_slides_goes_outwards_or_downhill() -> None:
    log = simulated(turn_slip={"per_radps": 0.2})
    _, told_turn = told_steps(log)
    assert np.allclose(body_steps(log)[2], told_turn * (1.0 - 0.2 * np.abs(log.motion.w_in_step_radps)), atol=1e-12)
    slides = simulated(side_slip={"s": 0.1})
    told_m, _ = told_steps(slides)
    assert np.allclose(body_steps(slides)[1], -told_m * 0.1 * slides.motion.w_in_step_radps, atol=1e-7)
    hill = simulated(hills=True, roll_slip={"ratio": 0.3})
    told_m, _ = told_steps(hill)
    places = [values[:-1] for values in (hill.motion.east_m, hill.motion.north_m, hill.motion.heading_rad)]
    assert np.allclose(body_steps(hill)[1], -np.abs(told_m) * 0.3 * np.sin(hill.terrain.tilts(*places)[1]), atol=1e-7)


def test_radii_drift_step_and_wobble() -> None:
    drifts, steps = simulated(radius_drift={"per_hour": 0.6}), simulated(radius_step={"ratio": 0.03, "at_s": 70.0})
    t_s = drifts.motion.t_s[:-1] + 0.5 * STEP_S
    told_m, _ = told_steps(drifts)
    assert np.allclose(body_steps(drifts)[0], told_m * (1.0 + 0.6 * np.maximum(t_s, 0.0) / 3600.0), atol=1e-7)
    told_m, _ = told_steps(steps)
    assert np.allclose(body_steps(steps)[0], told_m * np.where(t_s > 70.0, 1.03, 1.0), atol=1e-7)
    log = simulated(eccentric_left={"cos": 0.05, "sin": -0.03})
    robot, angle = log.scenario.robot, log.motion.left_rad
    middle = 0.5 * (angle[1:] + angle[:-1])
    along_m, _, turn = body_steps(log)
    left_m = along_m - 0.5 * robot.track_m * turn
    wobble = 1.0 + 0.05 * np.cos(middle) - 0.03 * np.sin(middle)
    assert np.allclose(left_m, robot.radius_left_m * np.diff(angle) * wobble, atol=1e-6)


def test_one_wheel_changes_alone_and_so_does_the_track() -> None:
    log = simulated(radius_step_right={"ratio": -0.04, "at_s": 70.0}, radius_drift_left={"per_hour": 0.6})
    robot, t_s = log.scenario.robot, log.motion.t_s[:-1] + 0.5 * STEP_S
    along_m, _, turn = body_steps(log)
    right_m, left_m = (along_m + side * 0.5 * robot.track_m * turn for side in (1.0, -1.0))
    stepped = np.where(t_s > 70.0, 0.96, 1.0)
    grown = 1.0 + 0.6 * np.maximum(t_s, 0.0) / 3600.0
    assert np.allclose(right_m, robot.radius_right_m * np.diff(log.motion.right_rad) * stepped, atol=1e-6)
    assert np.allclose(left_m, robot.radius_left_m * np.diff(log.motion.left_rad) * grown, atol=1e-6)
    wide = simulated(track_step={"ratio": 0.2, "at_s": 70.0})
    told_m, told_turn = told_steps(wide)
    assert np.allclose(body_steps(wide)[0], told_m, atol=1e-7)
    assert np.allclose(body_steps(wide)[2], told_turn / np.where(t_s > 70.0, 1.2, 1.0), atol=1e-9)


def test_counters_lose_counts_only_above_a_wheel_speed() -> None:
    log = simulated(missed_right={"ratio": 0.1, "above_radps": 8.0})
    right_rad, left_rad = told_angles_rad(log.motion, log.scenario.robot, log.scenario.effects)
    turned = np.diff(log.motion.right_rad)
    fast = np.abs(turned) / STEP_S > 8.0
    assert 0.05 < np.mean(fast) < 0.95
    assert np.allclose(np.diff(right_rad), np.where(fast, 0.9 * turned, turned), atol=1e-12)
    assert np.allclose(left_rad, log.motion.left_rad, atol=1e-9)


def test_iron_adds_a_field_and_may_come_in_slowly() -> None:
    heading = np.linspace(0.0, 2.0 * math.pi, 200)
    c, s = math.radians(25.0), math.radians(-24.0)
    deviation = harmonic_deviation(1, 25.0, -24.0, heading)
    forward, left = np.cos(heading) - s, -np.sin(heading) - c
    assert np.allclose(np.angle(np.exp(1j * (-np.arctan2(left, forward) - heading - deviation))), 0.0, atol=1e-12)
    small = harmonic_deviation(1, 0.01, 0.02, heading)
    assert np.allclose(np.degrees(small), 0.01 * np.cos(heading) + 0.02 * np.sin(heading), atol=1e-4)
    iron = {"cos_deg": 25.0, "sin_deg": -24.0}
    log, slow = simulated(hard_iron=iron), simulated(hard_iron=iron | {"tau_s": 20.0})
    at_once = compass_rad(log.motion, log.scenario.effects, ()) - log.motion.heading_rad
    let_in = compass_rad(slow.motion, slow.scenario.effects, ()) - slow.motion.heading_rad
    assert let_in[0] == pytest.approx(at_once[0])
    rate = np.diff(let_in) / STEP_S
    assert np.allclose(rate, (at_once[1:] - let_in[1:]) / 20.0, atol=2e-4)


def test_the_heading_has_drift_scale_step_field_and_place() -> None:
    effects: dict[str, dict[str, float]] = {
        "heading_drift": {"deg_per_hour": 360.0},
        "heading_scale": {"ratio": 0.02},
        "heading_step": {"deg": 9.0, "at_s": 60.0},
        "speed_field": {"deg_per_mps": 3.0},
        "local_field": {"deg": 11.0, "east_m": 1.0, "north_m": 2.0, "radius_m": 3.0},
    }
    log = simulated()
    motion = log.motion
    away_m = np.hypot(motion.east_m - 1.0, motion.north_m - 2.0)
    expected = {
        "heading_drift": 0.1 * np.maximum(motion.t_s, 0.0),
        "heading_scale": 0.02 * np.degrees(motion.heading_rad - motion.heading_rad[0]),
        "heading_step": 9.0 * (motion.t_s > 60.0),
        "speed_field": 3.0 * motion.of_steps(motion.v_in_step_mps, motion.t_s),
        "local_field": 11.0 * np.exp(-(away_m**2) / 18.0),
    }
    for name, parameters in effects.items():
        error = np.degrees(compass_rad(motion, {name: parameters}, ()) - motion.heading_rad)
        assert np.max(np.abs(error)) > 0.1
        assert np.allclose(error, expected[name], atol=1e-9), name


def test_a_logged_column_drives_what_it_says(tmp_path: Path) -> None:
    per_unit = 0.002
    for port in ("heading", "along", "yaw", "side", "pull"):
        log = simulated(**{f"{port}~soil_moisture_pct": {"per_unit": per_unit}})
        column = log.columns[0]
        excess = per_unit * (column.own - column.reference)[:-1]
        told_m, told_turn = told_steps(log)
        along_m, side_m, turn = body_steps(log)
        assert np.allclose(along_m, told_m * (1.0 + excess * (port == "along")), atol=1e-7)
        assert np.allclose(side_m, told_m * excess * (port == "side"), atol=1e-7)
        pulled = told_m * excess * (port == "pull")
        assert np.allclose(turn, told_turn * (1.0 + excess * (port == "yaw")) + pulled, atol=1e-7)
        error_deg = np.degrees(compass_rad(log.motion, log.scenario.effects, log.columns) - log.motion.heading_rad)
        assert np.allclose(error_deg[:-1], excess * (port == "heading"), atol=1e-9)
    write_log(replace(QUIET, effects={"along~soil_moisture_pct": {"per_unit": per_unit}}, idle_columns=6), tmp_path)
    names = [(tmp_path / name).read_text().splitlines()[0].split(",") for name in ("encoder.csv", "ahrs.csv")]
    assert "soil_moisture_pct" in names[1]
    assert len(names[0]) + len(names[1]) == 3 + 4 + 7


def test_a_base_shift_moves_all_later_fixes() -> None:
    log = simulated(base_shift={"east_m": 1.5, "north_m": -0.5, "at_s": 80.0})
    t_s = np.array([79.9, 80.1])
    east, north = antenna_m(log.motion, log.scenario.effects, log.terrain, t_s)
    assert east - np.interp(t_s, log.motion.t_s, log.motion.east_m) == pytest.approx([0.0, 1.5])
    assert north - np.interp(t_s, log.motion.t_s, log.motion.north_m) == pytest.approx([0.0, -0.5])


def test_noise_has_the_levels_that_it_is_given() -> None:
    slow = gauss_markov(np.random.default_rng(1).standard_normal(200_000), 0.1, 2.0, 5.0)
    assert np.std(slow) == pytest.approx(2.0, rel=0.05)
    assert np.mean(slow[50:] * slow[:-50]) / np.var(slow) == pytest.approx(math.exp(-1.0), abs=0.05)
    noise = replace(Noise.none(), slip_m_per_sqrt_m=0.01)
    log = simulate(replace(QUIET, plan=Plan("mixed", duration_s=400.0), noise=noise))
    told_m, told_turn = told_steps(log)
    along_m, _, turn = body_steps(log)
    right_m = along_m - told_m + 0.5 * log.scenario.robot.track_m * (turn - told_turn)
    said_m = np.abs(told_m + 0.5 * log.scenario.robot.track_m * told_turn)
    assert np.sqrt(np.sum(right_m**2) / np.sum(said_m)) == pytest.approx(0.01, rel=0.03)


def test_the_same_seed_writes_the_same_bytes_and_parking_changes_nothing_else(tmp_path: Path) -> None:
    scenario = Scenario(seed=3, plan=Plan(duration_s=100.0), idle_columns=3)
    for name in ("one", "two"):
        write_log(scenario, tmp_path / name)
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
    parked, short = (
        simulate(replace(scenario, idle_columns=0, plan=replace(scenario.plan, parked_midway_s=parked_s)))
        for parked_s in (60.0, 0.0)
    )
    begin, end = parked.motion.pauses_s[0]
    assert end - begin == 60.0
    kept = (parked.motion.t_s < begin) | (parked.motion.t_s >= end - 1e-9)
    assert np.allclose(parked.motion.east_m[kept], short.motion.east_m, atol=1e-9)
    held = simulate(replace(parked.scenario, instruments=Instruments(holds_still=True)))
    within = (held.fixes.stamp_s > begin) & (held.fixes.stamp_s < end)
    assert np.ptp(held.fixes.east_m[within]) == 0.0 < np.ptp(parked.fixes.east_m[within])
    outside = ~((held.headings.t_s >= begin) & (held.headings.t_s < end))
    assert np.allclose(held.headings.yaw_deg[outside][:500], short.headings.yaw_deg[:500])


def test_sentences_have_their_checksum_and_gaps_have_no_fixes(tmp_path: Path) -> None:
    assert sentence("GPGLL,5057.970,N,00146.110,E,142451,A") == "$GPGLL,5057.970,N,00146.110,E,142451,A*27"
    gappy = replace(QUIET, robot=Robot(), instruments=Instruments(gaps_s=((40.0, 60.0),), states_sigma=True))
    log = write_log(gappy, tmp_path)
    assert not np.any((log.fixes.stamp_s > 40.0) & (log.fixes.stamp_s < 60.0))
    lines = (tmp_path / "gnss.nmea").read_text().splitlines()
    kinds = {line.split(" ")[1].split(",")[0] for line in lines}
    assert kinds == {"$GNGGA", "$GNGST", "$GNRMC"}
