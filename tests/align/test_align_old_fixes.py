"""Fixes that repeat the last position while the wheels go on are old; honest ones that repeat are kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align import align
from sccal.align.old_fixes import find_old, telling
from sccal.logs.streams import Run


def repeated(run: Run, every: int) -> Run:
    """A receiver that solves once in so many lines."""
    row = np.arange(run.fixes.lat_deg.size) // every * every
    return replace(run, fixes=replace(run.fixes, lat_deg=run.fixes.lat_deg[row], lon_deg=run.fixes.lon_deg[row]))


def in_minutes(run: Run, decimals: int) -> Run:
    per_deg = 60.0 * 10.0**decimals
    lat, lon = (np.round(each * per_deg) / per_deg for each in (run.fixes.lat_deg, run.fixes.lon_deg))
    return replace(run, fixes=replace(run.fixes, lat_deg=lat, lon_deg=lon))


def told(run: Run):
    return [notice for notice in align(run).notices if "repeat the position before" in notice.what]


def test_a_receiver_that_sends_faster_than_it_solves_is_told(simulate, streams):
    run = streams(simulate(duration_s=200.0))
    aligned = align(repeated(run, 5))
    (notice,) = [n for n in aligned.notices if "repeat the position before" in n.what]
    assert notice.severity == "warning"
    assert notice.doubt == ""
    assert "for up to 0.8 s" in notice.what
    assert notice.count == run.fixes.lat_deg.size - aligned.fix_t_s.size - outside(aligned)
    moving = aligned.fix_t_s[np.abs(speed_at(aligned, aligned.fix_t_s)) > 0.2]
    assert np.diff(moving).min() > 0.9
    assert aligned.clock.source == "utc_mapped"


def outside(aligned) -> int:
    return sum(n.count for n in aligned.notices if n.source == "gnss" and "outside the time" in n.what)


def speed_at(aligned, t_s):
    travel = np.interp((t_s - 0.4, t_s + 0.4), aligned.wheel_t_s, aligned.travel_m)
    return (travel[1] - travel[0]) / 0.8


def test_a_receiver_that_holds_its_position_at_low_speed_is_told(simulate, streams):
    log = simulate(duration_s=200.0)
    run = streams(log)
    speed = log.motion.at(run.fixes.utc_s - log.settings.clock.start_utc_s).speed_mps
    row = np.maximum.accumulate(np.where(np.abs(speed) > 0.35, np.arange(speed.size), 0))
    fixes = replace(run.fixes, lat_deg=run.fixes.lat_deg[row], lon_deg=run.fixes.lon_deg[row])
    (notice,) = told(replace(run, fixes=fixes))
    assert notice.count > 20


@pytest.mark.parametrize("white_sigma_m", [0.0, 0.002, 0.01])
@pytest.mark.parametrize("decimals", [4, 5, 6])
def test_honest_fixes_of_slow_motion_stay(simulate, streams, white_sigma_m, decimals):
    gnss = {"white_sigma_m": white_sigma_m, "drift_sigma_m": 0.0, "rate_hz": 10.0}
    log = simulate(gnss=gnss, slowest_mps=0.02, fastest_mps=0.06, duration_s=200.0)
    run = in_minutes(streams(log), decimals)
    same = (np.diff(run.fixes.lat_deg) == 0) & (np.diff(run.fixes.lon_deg) == 0)
    assert same.any()
    assert sum(notice.count for notice in told(run)) <= 0.001 * run.fixes.lat_deg.size


def test_chance_repeats_are_rarely_lost(simulate, streams):
    gnss = {"white_sigma_m": 0.01, "rate_hz": 10.0}
    run = in_minutes(streams(simulate(gnss=gnss, duration_s=600.0)), 5)
    assert sum(notice.count for notice in told(run)) <= 0.005 * run.fixes.lat_deg.size


def test_a_robot_that_stands_or_turns_in_place_has_no_old_fixes(simulate, streams):
    run = in_minutes(streams(simulate(path="rectangle", stand_first_s=30.0, gnss={"white_sigma_m": 0.0})), 5)
    assert told(run) == []


def test_a_receiver_that_never_solves_again_is_refused_with_the_reason(simulate, streams):
    from sccal.errors import DataError

    run = streams(simulate())
    with pytest.raises(
        DataError, match=r"gnss: \d usable fixes \(and \d+ that repeat another's position while the wheels"
    ):
        align(repeated(run, 10_000))


def drive(step_m: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    t_s = 0.1 * np.arange(300)
    return t_s, step_m * np.arange(300) + 0j


def test_the_first_of_a_held_place_is_the_one_that_is_kept():
    t_s, path = drive()
    places = path.copy()
    places[100:110] = places[100]
    found = find_old(t_s, places, path, 1e-3, np.full(300, 0.015))
    assert np.flatnonzero(found.old).tolist() == list(range(101, 110))
    assert "t = 10.1 s" in found.notices[0].where


@pytest.mark.parametrize(("sigma_m", "step_m", "old"), [(0.01, 0.02, True), (3.0, 0.02, True), (3.0, 0.2, False)])
def test_how_far_is_far_enough(sigma_m, step_m, old):
    """0.9 m: many sigmas of good fixes, and many steps of fine digits; few steps of coarse ones with coarse noise."""
    t_s, path = drive()
    places = path.copy()
    places[100:110] = places[100]
    assert find_old(t_s, places, path, step_m, np.full(300, sigma_m)).old.any() == old


def test_a_place_held_for_long_is_a_doubt():
    t_s, path = drive(0.05)
    places = path.copy()
    places[100:220] = places[100]
    (notice,) = find_old(t_s, places, path, 1e-3, np.full(300, 0.015)).notices
    assert "do not move together" in notice.doubt
    assert "12 s" in notice.doubt


def test_a_held_place_tells_clocks_when_it_begins_and_ends():
    t_s, places = drive()
    places[100:240] = places[100]
    kept = np.flatnonzero(telling(t_s, places))
    assert np.isin([*range(101), *range(239, 300)], kept).all()
    assert kept.size == 101 + 61 + 4
    assert telling(np.zeros(0), np.zeros(0, dtype=complex)).size == 0


def test_a_receiver_that_repeats_itself_does_so_at_rest_too():
    """Half of the drive stands: once it is clear that places are sent again, what repeats there says nothing either."""
    t_s, path = drive()
    path[150:] = path[150]
    places = np.repeat(path[::10], 10)
    found = find_old(t_s, places, path, 1e-3, np.full(300, 0.015))
    assert np.flatnonzero(~found.old).tolist() == [*range(0, 150, 10), 150]


def test_a_few_old_fixes_do_not_condemn_those_of_a_robot_at_rest():
    t_s, path = drive()
    path[150:] = path[150]
    places = path.copy()
    places[:3] = places[0]
    found = find_old(t_s, places, path, 1e-3, np.full(300, 0.015))
    assert np.flatnonzero(found.old).tolist() == [1, 2]
