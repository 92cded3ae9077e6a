"""One run: truth recovered with honest sigmas, whatever the start; statuses; outages that learn nothing."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants
from sccal.results.noise import Noise
from tests.runs import read, written

NAMES = ("radius_right_m", "radius_left_m", "track_m", "heading_offset_rad")
GIVEN = Noise(np.radians(0.15), np.radians(0.4), 15.0, 0.67, 0.01, 60.0, 0.003, "given")


def estimates(calibration):
    return [getattr(calibration.parameters, name) for name in NAMES]


def truth(folder):
    true = json.loads((folder / "truth.json").read_text())["parameters"]
    return [
        true["radius_right_m"],
        true["radius_left_m"],
        true["track_m"],
        np.radians(true["heading_offset_deg"]),
    ]


def scores(folder, options=None):
    calibration, _ = calibrate_run(read(folder), options or CalibrationOptions())
    return calibration, np.array(
        [(one.value - true) / one.sigma for one, true in zip(estimates(calibration), truth(folder), strict=True)]
    )


OWN_NOISE = ("plain", "outliers", "coarse_encoder", "noisy_ahrs", "wide_track")
"""Variants whose noise is estimated; of the others, which differ in how the same is written, it is given."""
VARIANTS = {
    "plain": (),
    "yaw_zero_137": ("ahrs.heading_offset_deg=137",),
    "yaw_zero_minus_170": ("ahrs.heading_offset_deg=-170",),
    "compass_ned": ("ahrs.convention=ned", "ahrs.heading_offset_deg=-8.9"),
    "starts_in_reverse": ("drive.reverse_first_m=8",),
    "stands_first": ("drive.stand_first_s=60",),
    "counters_wrap_at_16_bits": ("encoder.counter_bits=16",),
    "without_host_time": ("gnss.with_host_time=false", "gnss.receive_delay_s=0", "gnss.receive_jitter_s=0"),
    "with_gst": ("gnss.with_gst=true",),
    "outliers": ("gnss.outlier_fraction=0.01",),
    "coarse_encoder": ("encoder.ticks_per_rev=512",),
    "noisy_ahrs": ("ahrs.white_sigma_deg=0.5", "ahrs.drift_sigma_deg=0.7", "ahrs.drift_time_s=20"),
    "wide_track": ("vehicle.track_m=1.05",),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_truth_lies_within_the_stated_sigmas(tmp_path, variant):
    options = CalibrationOptions(noise=None if variant in OWN_NOISE else GIVEN)
    calibration, score = scores(written(tmp_path, *VARIANTS[variant], duration_s=300, seed=5), options)
    assert np.abs(score).max() < 3.5
    assert all(one.status == "estimated" for one in estimates(calibration))
    assert 0.8 < calibration.fit.nis_gnss < 1.25
    assert 0.8 < calibration.fit.nis_heading < 1.25
    sigma = [one.sigma for one in estimates(calibration)]
    assert sigma[0] < 2e-4
    assert sigma[2] < 5e-3


def test_variants_of_the_same_drive_give_the_same_parameters(tmp_path):
    options = CalibrationOptions(noise=GIVEN)
    plain, _ = scores(written(tmp_path / "plain", duration_s=300, seed=5), options)
    for name in ("yaw_zero_137", "compass_ned", "counters_wrap_at_16_bits"):
        other, _ = scores(written(tmp_path / name, *VARIANTS[name], duration_s=300, seed=5), options)
        for one, same in zip(estimates(plain)[:3], estimates(other)[:3], strict=True):
            assert abs(one.value - same.value) < one.sigma


@pytest.mark.parametrize("path", ["general", "circle", "straight"])
def test_errors_over_sigmas_are_about_one(tmp_path, path):
    every = []
    for seed in range(2):
        calibration, score = scores(written(tmp_path / str(seed), path=path, duration_s=240, seed=200 + seed))
        observed = [one.status == "estimated" for one in estimates(calibration)]
        every += list(score[observed])
    rms = np.sqrt(np.mean(np.square(every)))
    assert 0.4 < rms < 1.6, every


def test_a_straight_drive_does_not_observe_the_track(tmp_path):
    calibration, score = scores(written(tmp_path, path="straight", duration_s=240))
    track = calibration.parameters.track_m
    assert track.status == "unobserved"
    assert "spin in place" in track.reason
    assert calibration.parameters.radius_right_m.status == "estimated"
    assert abs(score[0]) < 3.5
    assert abs(track.value - 0.70) < 1.5 * 0.21


def test_without_the_offset_state_the_ahrs_is_taken_as_true(tmp_path):
    folder = written(tmp_path, "ahrs.heading_offset_deg=0", duration_s=240)
    options = CalibrationOptions(filter=FilterOptions(with_offset=False))
    calibration, _ = calibrate_run(read(folder), options)
    *radii, _, offset = estimates(calibration)
    assert (offset.value, offset.sigma, offset.status) == (0.0, 0.0, "held")
    for one, true in zip(radii, truth(folder), strict=False):
        assert abs(one.value - true) < 4.0 * one.sigma


def test_a_wheel_scale_beyond_its_bound_is_called_so(tmp_path):
    folder = written(tmp_path, duration_s=200)
    toml = folder / "vehicle.toml"
    toml.write_text(toml.read_text().replace("wheel_radius_m = 0.08", "wheel_radius_m = 0.03"))
    calibration, _ = calibrate_run(read(folder), CalibrationOptions())
    radius = calibration.parameters.radius_right_m
    assert radius.status == "at_bound"
    assert abs(radius.value - truth(folder)[0]) < 4 * radius.sigma
    assert "ticks_per_rev" in radius.reason
    assert any("ticks_per_rev" in str(notice) for notice in calibration.notices)


def test_a_window_is_judged_by_what_came_before_it(tmp_path):
    """Fixes inside and after a window may say what they like: the prediction in it stays the same."""
    run = read(written(tmp_path, duration_s=200))
    options = CalibrationOptions(noise=GIVEN)
    calibration, _ = calibrate_run(run, options)
    window = calibration.outage.windows[2]
    late = run.fixes.host_t_s > window.start_s
    north = run.fixes.lat_deg + np.where(late, 5e-5, 0.0)
    spoilt, _ = calibrate_run(replace(run, fixes=replace(run.fixes, lat_deg=north)), options)
    again = spoilt.outage.windows[2]
    assert again.start_s == pytest.approx(window.start_s, abs=1e-6)
    assert again.drift_m.size == window.drift_m.size
    shift = 5e-5 * 110_990
    assert np.all(np.abs(again.drift_m - shift) <= window.drift_m + 0.02)
    first, same = calibration.outage.windows[1], spoilt.outage.windows[1]
    np.testing.assert_allclose(first.drift_m, same.drift_m, atol=1e-9)


def test_a_moved_base_station_is_survived_and_counted(tmp_path):
    run = read(written(tmp_path, duration_s=300, seed=5))
    t_s = run.fixes.host_t_s
    moved = run.fixes.lat_deg + np.where(t_s > np.median(t_s), 3e-5, 0.0)
    calibration, _ = calibrate_run(
        replace(run, fixes=replace(run.fixes, lat_deg=moved)), CalibrationOptions(noise=GIVEN)
    )
    assert calibration.fit.recoveries == 1
    assert 5 <= calibration.fit.fixes_rejected <= 30
    true = truth(tmp_path)
    for one, value in zip(estimates(calibration), true, strict=True):
        assert abs(one.value - value) < 4 * one.sigma


def test_the_trajectory_is_where_the_robot_was(tmp_path):
    from sccal.geodesy import TangentPlane
    from sccal.simulate.choose import settings_from
    from sccal.simulate.run import simulate_run
    from tests.runs import SMALL

    folder = written(tmp_path, duration_s=200)
    calibration, _ = calibrate_run(read(folder), CalibrationOptions())
    motion = simulate_run(settings_from(["drive.path=general", "drive.duration_s=200", *SMALL], 1)).motion
    document = json.loads((folder / "truth.json").read_text())
    home = TangentPlane(document["origin"]["lat_deg"], document["origin"]["lon_deg"], 110.0)
    here = TangentPlane(calibration.origin.lat_deg, calibration.origin.lon_deg, 110.0)
    east, north = here.to_east_north(*home.to_lat_lon(motion.east_m, motion.north_m))
    path = calibration.trajectory
    true_t = motion.t_s + document["settings"]["clock"]["start_utc_s"]
    late = path.t_s > path.t_s[0] + 30
    for got, sigma, true in ((path.east_m, path.sigma_east_m, east), (path.north_m, path.sigma_north_m, north)):
        score = (got - np.interp(path.t_s, true_t, true))[late] / sigma[late]
        assert np.sqrt(np.mean(score**2)) < 2.0
    yaw = np.interp(path.t_s, true_t, np.unwrap(motion.yaw_rad))
    error = np.angle(np.exp(1j * (path.yaw_rad - yaw)))[late]
    assert np.abs(error).max() < np.radians(2.0)


def test_noise_is_found_from_the_log(tmp_path):
    calibration, _ = scores(written(tmp_path, "encoder.rate_hz=50", "ahrs.rate_hz=20", duration_s=500, seed=2))
    noise = calibration.noise
    assert np.degrees(noise.heading_white_rad) == pytest.approx(0.15, rel=0.15)
    assert np.degrees(noise.heading_coloured_rad) == pytest.approx(0.4, rel=0.4)
    assert 6.0 < noise.heading_tau_s < 40.0
    assert noise.fix_scale * 0.015 == pytest.approx(0.01, rel=0.15)
    assert 0.004 < noise.fix_coloured_m < 0.025
    assert noise.slip_m_per_sqrt_m == pytest.approx(0.003, rel=0.3)


def test_fixes_that_scatter_more_than_they_say_are_trusted_less(tmp_path):
    folder = written(tmp_path, "gnss.white_sigma_m=1.0", "gnss.drift_sigma_m=0", duration_s=400, seed=3)
    calibration, score = scores(folder)
    assert calibration.noise.fix_scale * 0.015 == pytest.approx(1.0, rel=0.15)
    assert calibration.parameters.radius_right_m.sigma > 1e-4
    assert np.abs(score).max() < 3.5


def test_derivatives_from_raw_wheels_would_learn_the_track_from_slip(tmp_path):
    """Why the derivatives are freed of slip: on a circle the plain ones are sure of a wrong track."""
    folder = written(tmp_path, "encoder.rate_hz=100", path="circle", duration_s=400, seed=3)
    calibration, problem = calibrate_run(read(folder), CalibrationOptions(noise=GIVEN))
    true = truth(folder)[2]
    raw = problem.timeline.right_rad, problem.timeline.left_rad
    at = problem.at_centre(Constants(*truth(folder)[:3]))
    plain = problem.begun(at, False, problem.laid_out(at, raw)).finish()
    sigma = np.sqrt(plain.final_covariance[5, 5])
    track = calibration.parameters.track_m
    assert (plain.final_state[5] - true) / sigma > 5.0
    assert abs(track.value - true) / track.sigma < 3.0
    assert abs(track.value - true) < 0.3 * abs(plain.final_state[5] - true)
