"""A heading on another clock than the wheels' is put right, with its sign and an honest sigma; others stay."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sccal.align import align
from sccal.align.clocks import fixes_on_host_clock
from sccal.align.heading_clock import LATENCY_S, clock_by_turning, wheel_turning
from sccal.effects.catalogue import effect_named
from sccal.logs.streams import HeadingStream, Run, Vehicle, WheelStream
from sccal.simulate.run import simulate_run

TURNING = ("general", "rows", "rectangle", "calibration", "figure8")
LAGS_S = (0.2, -0.2, 0.5, -0.5, 1.5, -1.5, 5.0, -5.0, 10.0, -10.0)


@pytest.fixture(scope="session")
def drive(simulate, streams):
    @cache
    def of(path: str = "general", seed: int = 1, duration_s: float = 400.0, **ahrs: object) -> Run:
        return streams(simulate(seed=seed, path=path, duration_s=duration_s, ahrs=ahrs))

    return of


def stamped_late(run: Run, seconds: float) -> Run:
    """The heading's stamps that much later than its readings were taken."""
    return replace(run, heading=replace(run.heading, t_s=run.heading.t_s + seconds))


def found(run: Run):
    yaw = run.heading.yaw_rad
    turning = wheel_turning(run.wheels, run.vehicle)
    return clock_by_turning(turning, run.heading.t_s, np.unwrap(yaw), run.heading.source)


@pytest.mark.parametrize("late_s", LAGS_S)
@pytest.mark.parametrize("path", TURNING)
def test_the_lag_is_found_with_its_sign(drive, path, late_s):
    if path == "figure8" and abs(late_s) < 0.5:
        pytest.skip("five changes of the turn rate in 400 s tell it to 0.02 s: not clear enough to move it")
    clock = found(stamped_late(drive(path), late_s))
    assert clock.offset_s == pytest.approx(-late_s, abs=0.04 if path == "figure8" else 0.008)
    assert 0.0 < clock.sigma_s < 0.025
    assert abs(clock.offset_s + late_s) < 4.0 * clock.sigma_s


@pytest.mark.parametrize("late_s", [0.0, 0.02, -0.02, 0.1, -0.1, 0.15, -0.15])
@pytest.mark.parametrize("path", [*TURNING, "circle", "straight"])
def test_a_lag_that_is_none_or_a_latency_moves_nothing(drive, path, late_s):
    assert LATENCY_S > 0.15
    run = stamped_late(drive(path), late_s)
    assert found(run).offset_s == 0.0
    if late_s == 0.0:
        aligned = align(run)
        assert np.isin(aligned.heading_t_s, run.heading.t_s).all()
        assert not [notice for notice in aligned.notices if "by their turning" in notice.what]


@pytest.mark.parametrize("late_s", [0.0, 0.5, -1.5, 5.0, -10.0])
@pytest.mark.parametrize("path", ["circle", "straight"])
@pytest.mark.parametrize("seed", [1, 2])
def test_turning_at_one_rate_shows_no_lag(drive, path, late_s, seed):
    clock = found(stamped_late(drive(path, seed), late_s))
    assert clock.offset_s == 0.0


@pytest.mark.parametrize("ahrs", [{"white_sigma_deg": 1.5}, {"drift_sigma_deg": 3.0}, {"rate_hz": 1.0}])
def test_sigmas_are_honest(drive, ahrs):
    scores = []
    for seed in range(1, 9):
        clock = found(stamped_late(drive("general", seed, 300.0, **ahrs), 1.5))
        scores.append((clock.offset_s + 1.5) / clock.sigma_s)
    assert 0.2 < np.sqrt(np.mean(np.square(scores))) < 2.5


EFFECTS = {
    "turn_slip": {"per_radps": 0.3},
    "turn_scrub": {"per_radps": 0.3},
    "hard_iron": {"cos_deg": 15.0, "sin_deg": 10.0},
    "speed_field": {"deg_per_mps": 8.0},
    "heading_drift": {"deg_per_hour": 60.0},
    "heading_step": {"deg": 20.0, "at_s": 150.0},
    "gnss_latency": {"s": 0.4},
}


@pytest.mark.parametrize("name", EFFECTS)
def test_no_other_effect_passes_for_a_lag(simulate, streams, name):
    log = simulate_run(
        simulate(path="general", duration_s=300.0).settings, (effect_named(name).physics(EFFECTS[name]),)
    )
    assert found(streams(log)).offset_s == 0.0
    late = found(stamped_late(streams(log), 1.5))
    assert late.offset_s == pytest.approx(-1.5, abs=0.02)


def test_an_old_heading_is_moved_back_in_time(simulate, streams):
    """A latency of the AHRS above zero: the reading shows an earlier heading than its stamp says."""
    physics = (effect_named("heading_latency").physics({"s": 0.6}),)
    run = streams(simulate_run(simulate(path="general", duration_s=300.0).settings, physics))
    assert found(run).offset_s == pytest.approx(-0.6, abs=0.01)


@pytest.mark.parametrize("late_s", [1.5, -0.5])
def test_the_aligned_heading_stands_where_it_would_have_stood(drive, late_s):
    run = drive("general")
    here, there = align(run), align(stamped_late(run, late_s))
    assert there.clock == here.clock
    common = (there.heading_t_s > here.heading_t_s[0]) & (there.heading_t_s < here.heading_t_s[-1])
    expected = np.interp(there.heading_t_s, here.heading_t_s, here.yaw_rad)
    assert np.degrees(np.abs(there.yaw_rad - expected)[common]).max() < 1.0
    (notice,) = [n for n in there.notices if "by their turning" in n.what]
    assert (notice.source, notice.severity, notice.doubt) == ("ahrs.csv", "warning", "")
    assert notice.count == run.heading.t_s.size
    assert ("earlier than stamped" in notice.what) == (late_s > 0)
    told_s = float(notice.what.split(": ")[1].split(" ±")[0])
    assert told_s == pytest.approx(abs(late_s), abs=0.01)


@pytest.mark.parametrize("convention", ["enu", "ned"])
def test_the_convention_does_not_matter(drive, convention):
    run = stamped_late(drive("rows", convention=convention), 2.0)
    (notice,) = [n for n in align(run).notices if "by their turning" in n.what]
    assert "earlier than stamped" in notice.what


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_a_heading_that_falls_behind_on_the_way_is_not_moved(drive, share):
    run = drive("general")
    after = np.quantile(run.heading.t_s, share)
    behind = np.where(run.heading.t_s > after, run.heading.t_s + 5.0, run.heading.t_s)
    assert found(replace(run, heading=replace(run.heading, t_s=behind))).offset_s == 0.0


def test_a_heading_that_froze_for_a_while_is_not_moved(drive):
    run = drive("rectangle")
    t_s = run.heading.t_s - run.heading.t_s[0]
    held = (t_s > 100.0) & (t_s < 160.0)
    yaw = np.where(held, run.heading.yaw_rad[np.argmax(held)], run.heading.yaw_rad)
    assert found(replace(run, heading=replace(run.heading, yaw_rad=yaw))).offset_s == 0.0


def test_readings_gone_wrong_do_not_matter(drive):
    run = stamped_late(drive("general"), 1.5)
    rng = np.random.default_rng(0)
    wild = rng.random(run.heading.yaw_rad.size) < 0.01
    yaw = np.where(wild, rng.uniform(-np.pi, np.pi, wild.size), run.heading.yaw_rad)
    assert found(replace(run, heading=replace(run.heading, yaw_rad=yaw))).offset_s == pytest.approx(-1.5, abs=0.02)


def slalom(late_s: float, period_s: float = 8.0) -> Run:
    """Left and right in turn for ten minutes, always alike."""
    t_s = np.arange(0.0, 600.0, 0.05)
    vehicle = Vehicle("by hand", Path("vehicle.toml"), 0.08, 0.70)
    yaw = 0.5 * np.sin(2.0 * np.pi * t_s / period_s)
    travel, half = 0.5 * t_s, 0.35 * yaw
    still = np.zeros(t_s.size, dtype=bool)
    wheels = WheelStream(t_s, (travel - half) / 0.08, (travel + half) / 0.08, still)
    noise = 0.002 * np.random.default_rng(0).standard_normal(t_s.size)
    return Run("run", Path("run"), vehicle, wheels, HeadingStream(t_s + late_s, yaw + noise), None)  # type: ignore[arg-type]


def test_two_lags_that_fit_alike_are_told_and_nothing_is_moved():
    clock = found(slalom(3.0))
    assert clock.offset_s == 0.0
    (notice,) = clock.notices
    assert "-3.00 s" in notice.doubt
    assert "+5.00 s" in notice.doubt
    assert notice.severity == "warning"


def test_a_drive_that_repeats_itself_is_left_alone_where_it_fits_as_logged():
    clock = found(slalom(0.0))
    assert (clock.offset_s, clock.notices) == (0.0, ())
    clock = found(slalom(8.0))
    assert (clock.offset_s, clock.notices) == (0.0, ())


def from_the_receiver(run: Run) -> Run:
    """The same reading as a compass, at the fixes' epochs, in the lines of the receiver."""
    fixes = run.fixes
    t_s, _, _ = fixes_on_host_clock(fixes, (run.wheels.t_s[0], run.wheels.t_s[-1]))
    compass = np.mod(0.5 * np.pi - np.interp(t_s, run.heading.t_s, np.unwrap(run.heading.yaw_rad)), 2 * np.pi)
    return replace(
        run,
        heading=HeadingStream(t_s, compass, utc_s=fixes.utc_s, convention="ned", source="gnss.nmea (HDT)"),
    )


def wheels_early(run: Run, seconds: float) -> Run:
    """The wheels' stamps that much earlier: everything else is late by it."""
    return replace(run, wheels=replace(run.wheels, t_s=run.wheels.t_s - seconds))


@pytest.mark.parametrize("late_s", [0.25, 2.0, -2.0])
@pytest.mark.parametrize("received", [True, False])
def test_what_comes_from_one_receiver_is_not_moved_apart(drive, late_s, received):
    """Dual antennas: the heading shows by how much both are off, and both are moved by that."""
    run = from_the_receiver(drive("general"))
    if not received:
        run = replace(run, fixes=replace(run.fixes, host_t_s=np.full(run.fixes.utc_s.size, np.nan)))
    here, there = align(run), align(wheels_early(run, late_s))
    assert there.clock.source == "motion"
    assert there.clock.offset_s - here.clock.offset_s == pytest.approx(-late_s, abs=0.02)
    assert np.isin(np.round(there.fix_t_s[5:-5], 6), np.round(there.heading_t_s, 6)).all()
    (notice,) = [n for n in there.notices if "by their turning" in n.what]
    assert notice.what.startswith("headings and fixes put")
    assert not [n for n in there.notices if "by their motion" in n.what]


def test_fixes_that_are_moved_take_a_heading_of_theirs_with_them(drive):
    """Straight ahead the heading shows no lag, and speeding up and slowing down shows the fixes'."""
    run = from_the_receiver(drive("straight"))
    there = align(wheels_early(run, 2.0))
    fixes, headings = np.round(there.fix_t_s[5:-5], 6), np.round(there.heading_t_s, 6)
    assert np.isin(fixes, headings).all()


def test_fixes_and_heading_that_share_a_lag_are_the_wheels_fault(drive):
    run = drive("general")
    there = align(wheels_early(run, 2.0))
    assert any("wheels are stamped early" in n.what for n in there.notices)
    assert there.clock.offset_s == pytest.approx(align(run).clock.offset_s - 2.0, abs=0.03)
    alone = align(stamped_late(run, 2.0))
    assert not any("wheels are stamped" in n.what for n in alone.notices)
