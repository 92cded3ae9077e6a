"""One run put together: conventions, what is left out and counted, and what cannot be calibrated at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align import align
from sccal.align.aligned import MIN_MEASUREMENTS, yaw_to_enu
from sccal.errors import DataError
from sccal.logs.streams import FixStream, HeadingStream, Run, WheelStream
from sccal.simulate.sensors import origin


@pytest.fixture(scope="module")
def log(simulate):
    return simulate(ahrs={"heading_offset_deg": 0.0})


@pytest.fixture(scope="module")
def run(log, streams) -> Run:
    return streams(log)


def only(stream, rows):
    """A stream with some of its rows."""
    columns = {name: value[rows] for name, value in vars(stream).items() if isinstance(value, np.ndarray)}
    return replace(stream, **columns)


def with_quality(run: Run, codes: dict[int, slice]) -> Run:
    quality = run.fixes.quality.copy()
    for code, rows in codes.items():
        quality[rows] = code
    return replace(run, fixes=replace(run.fixes, quality=quality))


def notices_about(run: Run, words: str):
    return [notice for notice in align(run).notices if words in notice.what]


@pytest.mark.parametrize(
    ("compass_deg", "enu_deg"), [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (270.0, -180.0), (10.0, 80.0)]
)
def test_a_compass_turns_clockwise_from_north(compass_deg, enu_deg):
    assert np.degrees(yaw_to_enu(np.radians([compass_deg]), "ned")) == pytest.approx([enu_deg])


def test_enu_stays_as_it_is():
    assert yaw_to_enu(np.array([-3.0, 0.0, 2.0]), "enu").tolist() == [-3.0, 0.0, 2.0]


@pytest.mark.parametrize("convention", ["enu", "ned"])
def test_the_aligned_yaw_is_the_true_one_plus_the_offset(simulate, streams, convention):
    log = simulate(ahrs={"convention": convention, "heading_offset_deg": 40.0})
    aligned = align(streams(log))
    true_t_s = aligned.heading_t_s - log.settings.clock.start_utc_s
    error_rad = aligned.yaw_rad - log.motion.at(true_t_s).yaw_rad - np.radians(40.0)
    assert np.degrees(np.abs(np.angle(np.exp(1j * error_rad)))).max() < 2.5
    assert np.abs(np.diff(aligned.yaw_rad)).max() < 0.5


def test_fixes_stand_where_the_robot_was(log, run):
    aligned = align(run)
    true_t_s = aligned.fix_t_s - log.settings.clock.start_utc_s - log.settings.gnss.receive_delay_s
    state = log.motion.at(true_t_s)
    lat, lon = aligned.plane.to_lat_lon(aligned.fix_east_m, aligned.fix_north_m)
    east, north = origin(log.settings.gnss).to_east_north(lat, lon)
    assert np.hypot(east - state.east_m, north - state.north_m).max() < 0.09
    assert aligned.fix_east_m[0] == pytest.approx(0.0, abs=1e-6)


def test_wheel_angles_count_from_zero(run):
    wheels = run.wheels
    shifted = replace(run, wheels=replace(wheels, left_rad=wheels.left_rad + 7.0, right_rad=wheels.right_rad - 3.0))
    aligned = align(shifted)
    assert (aligned.right_rad[0], aligned.left_rad[0]) == (0.0, 0.0)
    assert aligned.travel_m[-1] == pytest.approx(align(run).travel_m[-1])


def test_measurements_outside_the_wheels_time_are_counted(run):
    t_s = run.wheels.t_s
    middle = (t_s > t_s[0] + 20.0) & (t_s < t_s[-1] - 15.0)
    cut = replace(run, wheels=only(run.wheels, middle))
    aligned = align(cut)
    first, last = aligned.span_s
    for t, source in ((run.heading.t_s, "ahrs.csv"), (run.fixes.host_t_s, "gnss")):
        outside = sum(n.count for n in aligned.notices if n.source == source and "outside the time" in n.what)
        assert outside == pytest.approx(np.count_nonzero((t < first) | (t > last)), abs=1)
        assert outside > 100
    for t in (aligned.heading_t_s, aligned.fix_t_s):
        assert first <= t[0] < t[-1] <= last


def test_the_run_begins_with_the_first_heading(run):
    late = replace(run, heading=only(run.heading, run.heading.t_s > run.heading.t_s[0] + 12.0))
    aligned = align(late)
    assert aligned.wheel_t_s[0] <= late.heading.t_s[0] < aligned.wheel_t_s[1]
    assert (aligned.right_rad[0], aligned.left_rad[0]) == (0.0, 0.0)
    assert aligned.loose.size == aligned.wheel_t_s.size


@pytest.mark.parametrize(("quality", "name"), [(0, "no fix"), (6, "dead reckoning"), (7, "manual")])
def test_fixes_without_worth_are_dropped_and_counted(run, quality, name):
    aligned = align(with_quality(run, {quality: slice(100, 140)}))
    [notice] = [n for n in aligned.notices if f"quality {quality}" in n.what]
    assert notice.count == 40
    assert name in notice.what
    assert quality not in aligned.fix_quality
    assert aligned.fix_t_s.size == align(run).fix_t_s.size - 40


def test_fixes_of_a_simulator_are_used_with_a_warning(run):
    marked = with_quality(run, {8: slice(None)})
    [notice] = notices_about(marked, "simulator")
    assert notice.severity == "warning"
    assert notice.count == run.fixes.quality.size
    assert align(marked).fix_t_s.size == align(run).fix_t_s.size
    assert notices_about(run, "simulator") == []


def test_the_plane_touches_the_earth_at_the_first_fix_of_the_best_quality(run):
    aligned = align(with_quality(run, {1: slice(0, 30)}))
    assert aligned.plane.lat_deg == run.fixes.lat_deg[30]
    assert aligned.plane.lon_deg == run.fixes.lon_deg[30]
    assert aligned.fix_leading.tolist() == (aligned.fix_quality == 4).tolist()


def test_many_floats_do_not_lead_over_some_fixed(run):
    aligned = align(with_quality(run, {5: slice(0, 350)}))
    assert set(aligned.fix_quality[aligned.fix_leading].tolist()) == {4}


def test_too_few_fixes(run):
    few = slice(100, 100 + MIN_MEASUREMENTS - 1)
    with pytest.raises(DataError, match=r"gnss: 9 usable fixes within the wheels' span of \d+\.\d s, at least 10"):
        align(replace(run, fixes=only(run.fixes, few)))


def test_too_few_fixes_of_any_worth(run):
    with pytest.raises(DataError, match="gnss: 0 usable fixes"):
        align(with_quality(run, {0: slice(None)}))


def test_too_few_headings(run):
    every = slice(None, None, run.heading.t_s.size // 5)
    with pytest.raises(DataError, match=r"ahrs\.csv: \d readings within the wheels' span"):
        align(replace(run, heading=only(run.heading, every)))


def test_headings_of_another_time(run):
    moved = replace(run.heading, t_s=run.heading.t_s - 1e4)
    with pytest.raises(DataError, match=r"ahrs\.csv .* and encoder\.csv .* do not overlap"):
        align(replace(run, heading=moved))


def test_headings_that_begin_when_all_is_over(run):
    late = replace(run.heading, t_s=run.heading.t_s + np.ptp(run.wheels.t_s) - 0.1)
    with pytest.raises(DataError, match=r"ahrs\.csv begins at .* only \d encoder samples follow"):
        align(replace(run, heading=late))


def test_fixes_without_receive_times_or_motion_need_unix_time(run):
    fixes = replace(run.fixes, host_t_s=np.full(run.fixes.utc_s.size, np.nan))
    align(replace(run, fixes=fixes))
    still = replace(fixes, lat_deg=np.full_like(fixes.lat_deg, 37.5), lon_deg=np.full_like(fixes.lon_deg, 15.0))
    with pytest.raises(DataError, match=r"the fixes .* do not overlap: .* must be Unix time"):
        align(from_zero(replace(run, fixes=still)))


def test_fixes_without_any_time(run):
    nothing = np.full(run.fixes.utc_s.size, np.nan)
    with pytest.raises(DataError, match="no fix has a usable time"):
        align(replace(run, fixes=replace(run.fixes, host_t_s=nothing, utc_s=nothing)))


def test_the_zero_of_the_logging_clock_does_not_matter(run):
    here, there = align(run), align(from_zero(run))
    assert there.fix_east_m == pytest.approx(here.fix_east_m, abs=1e-6)
    begin_s = run.wheels.t_s[0]
    assert there.fix_t_s == pytest.approx(here.fix_t_s - begin_s, abs=1e-5)
    assert there.clock.offset_s == pytest.approx(here.clock.offset_s - begin_s, abs=1e-5)


def from_zero(run: Run) -> Run:
    """The same run on a logging clock that counts from the first encoder sample."""
    begin_s = run.wheels.t_s[0]
    wheels: WheelStream = replace(run.wheels, t_s=run.wheels.t_s - begin_s)
    heading: HeadingStream = replace(run.heading, t_s=run.heading.t_s - begin_s)
    fixes: FixStream = replace(run.fixes, host_t_s=run.fixes.host_t_s - begin_s)
    return replace(run, wheels=wheels, heading=heading, fixes=fixes)
