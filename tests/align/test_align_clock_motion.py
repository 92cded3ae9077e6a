"""Clocks that disagree are found from the motion, with honest sigmas; clocks that agree are left alone."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sccal.align import align
from sccal.errors import DataError
from sccal.logs.streams import Run
from sccal.report.sentences import clock_line

REPEATING = ("rectangle", "rows", "figure8")


@pytest.fixture(scope="session")
def drive(simulate, streams):
    """A drive of several minutes, in memory; its logging clock is UTC."""

    @cache
    def of(path: str = "general", seed: int = 1, duration_s: float = 300.0, **gnss: object) -> Run:
        return streams(simulate(seed=seed, path=path, duration_s=duration_s, gnss=gnss))

    return of


def off(run: Run, offset_s: float, skew_ppm: float = 0.0, receive_times: bool = False) -> tuple[Run, float]:
    """The run with its logging clock off and running fast, and its offset at the median fix."""
    begin_s, rate = run.wheels.t_s[0], 1.0 + 1e-6 * skew_ppm

    def clock(t_s: np.ndarray) -> np.ndarray:
        return (t_s - begin_s) * rate + begin_s + offset_s

    host_t_s = clock(run.fixes.host_t_s) if receive_times else np.full(run.fixes.utc_s.size, np.nan)
    changed = replace(
        run,
        wheels=replace(run.wheels, t_s=clock(run.wheels.t_s)),
        heading=replace(run.heading, t_s=clock(run.heading.t_s)),
        fixes=replace(run.fixes, host_t_s=host_t_s),
    )
    middle_s = float(np.median(run.fixes.utc_s))
    return changed, float(clock(np.array(middle_s)) - middle_s)


@pytest.mark.parametrize("path", ["general", "rectangle", "rows"])
@pytest.mark.parametrize(
    ("offset_s", "skew_ppm"), [(97.0, 200.0), (-130.0, 0.0), (0.4, 0.0), (18.0, -500.0), (-1.7e9, 50.0)]
)
def test_offset_and_skew_are_found(drive, path, offset_s, skew_ppm):
    run, true_s = off(drive(path), offset_s, skew_ppm)
    clock = align(run).clock
    assert clock.source == "motion"
    assert 0 < clock.sigma_offset_s < 0.005
    assert abs(clock.offset_s - true_s) < min(4.0 * clock.sigma_offset_s, 0.01)
    assert abs(clock.skew_ppm - skew_ppm) < 4.0 * clock.sigma_skew_ppm


def test_the_fixes_stand_where_they_would_have_stood(drive):
    run, _ = off(drive(), 0.0)
    moved, _ = off(drive(), 97.0, 200.0)
    here, there = align(run), align(moved)
    begin_s = run.wheels.t_s[0]
    back_s = (there.fix_t_s - begin_s - 97.0) / (1.0 + 200e-6) + begin_s
    common = min(back_s.size, here.fix_t_s.size) - 4
    first = int(np.argmin(np.abs(here.fix_t_s - back_s[0])))
    assert back_s[:common] == pytest.approx(here.fix_t_s[first : first + common], abs=0.02)


@pytest.mark.parametrize("path", ["figure8", "circle"])
def test_at_one_speed_the_sigma_says_what_the_drive_shows(drive, path):
    run, true_s = off(drive(path), 97.0, 200.0)
    clock = align(run).clock
    assert clock.source == "motion"
    assert 0.01 < clock.sigma_offset_s < 0.3
    assert abs(clock.offset_s - true_s) < 4.0 * clock.sigma_offset_s


@pytest.mark.parametrize(("path", "doubtful"), [("circle", True), ("rectangle", False), ("general", False)])
def test_turning_one_way_leaves_a_doubt_about_the_heading(drive, path, doubtful):
    run, _ = off(drive(path), 97.0)
    doubts = [notice.doubt for notice in align(run).notices if notice.doubt]
    assert any("of the heading offset" in doubt for doubt in doubts) == doubtful


def test_sigmas_are_honest(drive):
    scores = []
    for seed in range(1, 9):
        run, true_s = off(drive("general", seed, 200.0), 40.0)
        clock = align(run).clock
        scores.append((clock.offset_s - true_s) / clock.sigma_offset_s)
    assert 0.3 < np.sqrt(np.mean(np.square(scores))) < 2.0


@pytest.mark.parametrize("path", ["general", "circle", "straight", *REPEATING])
@pytest.mark.parametrize("white_sigma_m", [0.01, 1.0])
@pytest.mark.parametrize(("offset_s", "skew_ppm"), [(0.0, 0.0), (0.1, 50.0), (-0.1, 0.0)])
def test_clocks_that_nearly_agree_are_moved_by_as_little_as_they_are_off(
    drive, path, white_sigma_m, offset_s, skew_ppm
):
    run, true_s = off(drive(path, white_sigma_m=white_sigma_m), offset_s, skew_ppm)
    aligned = align(run)
    clock = aligned.clock
    assert abs(clock.offset_s - true_s) < 4.0 * clock.sigma_offset_s + 0.1 * (clock.source == "utc")
    assert abs(clock.skew_ppm - skew_ppm) < 4.0 * clock.sigma_skew_ppm + skew_ppm * (clock.source == "utc")
    assert not [notice for notice in aligned.notices if notice.doubt]


def test_receive_times_of_the_same_computer_need_no_motion(drive):
    run, true_s = off(drive(), 97.0, 200.0, receive_times=True)
    clock = align(run).clock
    assert clock.source == "utc_mapped"
    assert clock.offset_s == pytest.approx(true_s + 0.012, abs=0.005)
    assert clock.skew_ppm == pytest.approx(200.0, abs=max(5.0, 4.0 * clock.sigma_skew_ppm))


@pytest.mark.parametrize("known", ["mapped", "host"])
def test_receive_times_of_another_computer_are_found_out(drive, known):
    run, true_s = off(drive(), 97.0, receive_times=False)
    fixes = replace(run.fixes, host_t_s=drive().fixes.host_t_s)
    if known == "host":
        fixes = replace(fixes, utc_s=np.full(fixes.utc_s.size, np.nan))
    clock = align(replace(run, fixes=fixes)).clock
    assert clock.source == "motion"
    assert clock.offset_s == pytest.approx(true_s, abs=0.03)


def test_what_was_found_is_told(drive):
    run, _ = off(drive(), 97.0, 200.0)
    aligned = align(run)
    (notice,) = [n for n in aligned.notices if "by their motion" in n.what]
    assert notice.severity == "warning"
    assert notice.doubt == ""
    assert "offset +97.0" in notice.what
    assert "latency" in notice.what
    assert clock_line(aligned.clock).startswith("fixes put on the wheels' clock by their motion: +97.0")


@pytest.mark.parametrize("path", REPEATING)
def test_laps_are_told_apart_by_where_both_streams_begin_and_end(drive, path):
    run, true_s = off(drive(path, duration_s=400.0), 40.0)
    clock = align(run).clock
    assert clock.source == "motion"
    assert abs(clock.offset_s - true_s) < max(4.0 * clock.sigma_offset_s, 0.01)


def test_laps_that_nothing_tells_apart_are_refused(drive):
    run, _ = off(drive("rectangle", duration_s=500.0), -1.7e9)
    middle = (run.fixes.utc_s > run.fixes.utc_s[0] + 150.0) & (run.fixes.utc_s < run.fixes.utc_s[0] + 330.0)
    fields = ("host_t_s", "utc_s", "lat_deg", "lon_deg", "alt_m", "quality")
    fields += ("sigma_east_m", "sigma_north_m", "cov_en_m2")
    fixes = replace(run.fixes, **{name: getattr(run.fixes, name)[middle] for name in fields})
    with pytest.raises(DataError, match=r"share no time as logged, and the drive repeats itself: \d offsets"):
        align(replace(run, fixes=fixes))


def test_a_frozen_stream_does_not_move_the_clocks(drive):
    run = drive("rectangle", duration_s=400.0)
    t_s = run.wheels.t_s - run.wheels.t_s[0]
    still = (t_s > 100.0) & (t_s < 160.0)
    held = np.flatnonzero(still)[0]
    wheels = replace(
        run.wheels,
        left_rad=np.where(still, run.wheels.left_rad[held], run.wheels.left_rad),
        right_rad=np.where(still, run.wheels.right_rad[held], run.wheels.right_rad),
    )
    aligned = align(replace(run, wheels=wheels))
    assert aligned.clock.source == "utc_mapped"
    assert any(notice.doubt for notice in aligned.notices)


def test_a_wrong_convention_is_still_found_when_the_clocks_are_off(drive):
    run, _ = off(drive(), 97.0)
    with pytest.raises(DataError, match=r"set convention"):
        align(replace(run, vehicle=replace(run.vehicle, convention="ned")))


@pytest.mark.parametrize("receive_times", [False, True])
def test_dates_of_another_gps_era_are_put_right(drive, receive_times):
    run, _ = off(drive(), 0.0, receive_times=receive_times)
    era_s = 1024 * 7 * 86400.0
    aligned = align(replace(run, fixes=replace(run.fixes, utc_s=run.fixes.utc_s - era_s)))
    assert aligned.clock.offset_s == pytest.approx(era_s, abs=0.03)
    assert any("1024 weeks in the past" in notice.what for notice in aligned.notices)


def test_the_offset_is_told_at_the_start_too(drive):
    """With skew an offset means nothing without its moment: at the median fix, and at the first."""
    run, _ = off(drive(), 97.0, 200.0)
    aligned = align(run)
    clock, half_s = aligned.clock, 0.5 * float(np.ptp(run.fixes.utc_s))
    assert clock.offset_at_start_s == pytest.approx(clock.offset_s - 1e-6 * clock.skew_ppm * half_s, abs=1e-3)
    assert clock.offset_s - clock.offset_at_start_s > 0.01


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("offset_s", [0.0, 0.1, 40.0])
def test_a_robot_that_parked_for_long_shows_its_clocks_as_well(simulate, streams, held, offset_s):
    """Twenty minutes of a receiver that holds its position, or of its noise alone, must not outvote five of driving."""
    run = streams(simulate(path="general", stand_first_s=1200.0, duration_s=1500.0, gnss={"white_sigma_m": 0.3}))
    if held:
        still = run.fixes.utc_s < run.fixes.utc_s[0] + 1199.0
        lat, lon = (np.where(still, each[0], each) for each in (run.fixes.lat_deg, run.fixes.lon_deg))
        run = replace(run, fixes=replace(run.fixes, lat_deg=lat, lon_deg=lon))
    moved, true_s = off(run, offset_s)
    aligned = align(moved)
    assert not [notice.doubt for notice in aligned.notices if "do not move together" in notice.doubt]
    clock = aligned.clock
    driving_s = 0.5 * float(np.ptp(run.fixes.utc_s))
    there_s = clock.offset_s + 1e-6 * clock.skew_ppm * driving_s
    assert there_s == pytest.approx(true_s, abs=0.3)
