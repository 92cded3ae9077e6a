"""Streams that do not move together are told, or refused; streams that do are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align import align
from sccal.calibration.verdict import run_verdict
from sccal.errors import DataError
from tests.runs import read, written


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return read(written(tmp_path_factory.mktemp("run"), duration_s=300, seed=5))


def doubts(run):
    return [notice.doubt for notice in align(run).notices if notice.doubt]


def late(stream, seconds, after):
    return replace(stream, t_s=np.where(stream.t_s > after, stream.t_s + seconds, stream.t_s))


def test_streams_that_move_together_raise_no_doubt(run):
    assert doubts(run) == []


def test_a_heading_that_falls_behind_is_told_with_its_place(run):
    middle = float(np.median(run.heading.t_s))
    shifted = replace(run, heading=late(run.heading, 5.0, middle))
    (doubt,) = doubts(shifted)
    assert doubt.startswith("yaw and wheels do not turn together in")
    place = next(n.where for n in align(shifted).notices if n.doubt)
    assert float(place.removeprefix("t = ").removesuffix(" s")) > middle - 60.0


def test_a_heading_that_is_behind_all_the_time_is_refused(run):
    shifted = replace(run, heading=replace(run.heading, t_s=run.heading.t_s + 20.0))
    with pytest.raises(DataError, match=r"do not turn together \(correlation [-+]0\.\d\d over \d+ s of turning\)"):
        align(shifted)


def test_fixes_that_fall_behind_are_told(run):
    middle = float(np.median(run.fixes.host_t_s))
    host = np.where(run.fixes.host_t_s > middle, run.fixes.host_t_s + 8.0, run.fixes.host_t_s)
    utc = np.where(run.fixes.host_t_s > middle, run.fixes.utc_s + 8.0, run.fixes.utc_s)
    assert any(
        "fixes and wheels" in d for d in doubts(replace(run, fixes=replace(run.fixes, host_t_s=host, utc_s=utc)))
    )


def test_a_doubt_reaches_the_verdict(run):
    from sccal.calibration.options import CalibrationOptions
    from sccal.calibration.single import calibrate_run
    from tests.calibration.test_single import GIVEN

    calibration, _ = calibrate_run(run, CalibrationOptions(noise=GIVEN))
    assert run_verdict(calibration).level == "good"
    odd = replace(calibration.notices[0], doubt="the clock stepped back") if calibration.notices else None
    assert odd is not None
    verdict = run_verdict(replace(calibration, notices=(odd,)))
    assert verdict.level == "doubtful"
    assert "the clock stepped back" in str(verdict)


NOISES = (
    (),
    ("gnss.white_sigma_m=0.3",),
    ("gnss.white_sigma_m=0.3", "gnss.quality=5"),
    ("gnss.white_sigma_m=5", "gnss.quality=1"),
    ("gnss.outlier_fraction=0.03", "gnss.outlier_largest_m=30"),
    ("gnss.rate_hz=1", "gnss.outlier_fraction=0.02"),
    ("gnss.antenna_forward_m=0.5", "gnss.antenna_left_m=0.4"),
    ("ahrs.drift_sigma_deg=5",),
)


@pytest.mark.parametrize("path", ["general", "rows"])
@pytest.mark.parametrize("settings", NOISES, ids=lambda settings: " ".join(settings) or "RTK")
def test_noise_outliers_and_antennas_are_no_disagreement(tmp_path, path, settings):
    for seed in (1, 2):
        assert doubts(read(written(tmp_path / str(seed), *settings, path=path, duration_s=300, seed=seed))) == []


@pytest.fixture(scope="module", params=[(), ("gnss.outlier_fraction=0.02",), ("gnss.rate_hz=1",)])
def noisy(request, tmp_path_factory):
    return read(written(tmp_path_factory.mktemp("noisy"), *request.param, duration_s=300, seed=6))


@pytest.mark.parametrize("seconds", [3.0, -3.0])
def test_fixes_that_are_off_by_seconds_in_half_of_the_run_are_told(noisy, seconds):
    later = noisy.fixes.host_t_s > float(np.median(noisy.fixes.host_t_s))
    by_s = np.where(later, seconds, 0.0)
    fixes = replace(noisy.fixes, host_t_s=noisy.fixes.host_t_s + by_s, utc_s=noisy.fixes.utc_s + by_s)
    aligned = align(replace(noisy, fixes=fixes))
    assert aligned.clock.source == "utc_mapped"
    assert any("fixes" in notice.doubt for notice in aligned.notices)


def test_fixes_that_stand_still_for_a_minute_are_told(noisy):
    begin_s = noisy.fixes.host_t_s[0] + 100.0
    held = (noisy.fixes.host_t_s > begin_s) & (noisy.fixes.host_t_s < begin_s + 60.0)
    first = np.flatnonzero(held)[0]
    lat, lon = (np.where(held, v[first], v) for v in (noisy.fixes.lat_deg, noisy.fixes.lon_deg))
    assert any(
        "move together" in d for d in doubts(replace(noisy, fixes=replace(noisy.fixes, lat_deg=lat, lon_deg=lon)))
    )


def test_wheels_that_stand_still_for_a_minute_are_told(noisy):
    t_s = noisy.wheels.t_s - noisy.wheels.t_s[0]
    held = (t_s > 100.0) & (t_s < 160.0)
    first = np.flatnonzero(held)[0]
    left, right = (np.where(held, v[first], v) for v in (noisy.wheels.left_rad, noisy.wheels.right_rad))
    assert any(
        "move together" in d
        for d in doubts(replace(noisy, wheels=replace(noisy.wheels, left_rad=left, right_rad=right)))
    )


def test_a_gap_in_the_encoder_is_no_disagreement(run):
    """Across a gap the cumulative angle only seems to grow evenly; the other streams must not be doubted for it."""
    wheels = run.wheels
    first = float(wheels.t_s[0]) + 100.0
    kept = (wheels.t_s < first) | (wheels.t_s > first + 60.0)
    loose = wheels.loose[kept].copy()
    loose[np.searchsorted(wheels.t_s[kept], first + 60.0)] = True
    gap = replace(
        wheels,
        t_s=wheels.t_s[kept],
        left_rad=wheels.left_rad[kept],
        right_rad=wheels.right_rad[kept],
        loose=loose,
        extras={},
    )
    assert [d for d in doubts(replace(run, wheels=gap)) if "together" in d] == []
