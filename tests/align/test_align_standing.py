"""Standing: where the wheels rest, and that hours of it weigh next to nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align import align, build_timeline
from sccal.align.standing import (
    FIRST_S,
    dither_rad,
    standing_spans,
    worth_taking,
)
from sccal.logs.streams import Run

RATE_HZ = 20.0
COUNT_RAD = 2.0 * np.pi / 1024
MOST_RAD = dither_rad(0.08, 1024.0)


def wheels(*parts: tuple[float, float], rate_hz: float = RATE_HZ) -> tuple[np.ndarray, np.ndarray]:
    """Times and one wheel's angle of a drive in parts of (seconds, rad/s), counted in whole counts."""
    speed = np.concatenate([np.full(round(seconds * rate_hz), radps) for seconds, radps in parts])
    angle = np.cumsum(speed) / rate_hz
    return np.arange(speed.size) / rate_hz, np.floor(angle / COUNT_RAD) * COUNT_RAD


def spans(t_s, right_rad, left_rad=None, loose=None):
    left_rad = right_rad if left_rad is None else left_rad
    loose = np.zeros(t_s.size, dtype=bool) if loose is None else loose
    return standing_spans(t_s, right_rad, left_rad, loose, MOST_RAD)


def test_a_stand_is_found_where_it_is():
    t_s, angle = wheels((20.0, 5.0), (60.0, 0.0), (20.0, 5.0))
    ((begin_s, end_s),) = spans(t_s, angle)
    assert 20.0 <= begin_s < 20.6
    assert 79.4 < end_s <= 80.0


@pytest.mark.parametrize("stop_s", [0.5, 1.0, 1.8])
def test_a_short_rest_is_part_of_the_drive(stop_s):
    t_s, angle = wheels((20.0, 5.0), (stop_s, 0.0), (20.0, 5.0))
    assert spans(t_s, angle) == ()


def test_both_wheels_must_stand():
    t_s, angle = wheels((60.0, 0.0))
    _, turning = wheels((60.0, 2.0))
    assert spans(t_s, angle, turning) == spans(t_s, turning, angle) == spans(t_s, turning, -turning) == ()


def test_a_wheel_on_the_edge_of_a_count_stands():
    t_s, angle = wheels((20.0, 5.0), (60.0, 0.0), (20.0, 5.0))
    dither = COUNT_RAD * np.random.default_rng(0).integers(0, 2, t_s.size)
    ((begin_s, end_s),) = spans(t_s, angle + np.where((t_s > 20.0) & (t_s < 80.0), dither, 0.0))
    assert end_s - begin_s > 58.0


def test_an_idling_engine_does_not_wake_a_fine_encoder():
    t_s = np.arange(0.0, 60.0, 0.01)
    shaking = 3e-4 / 0.08 * np.sin(2.0 * np.pi * 7.0 * t_s)
    found = standing_spans(t_s, shaking, shaking, np.zeros(t_s.size, dtype=bool), dither_rad(0.08, 32768.0))
    assert found[0][1] - found[0][0] > 58.0


@pytest.mark.parametrize("speed_mps", [0.005, 0.02, -0.02])
def test_creeping_is_no_standing(speed_mps):
    t_s, angle = wheels((120.0, speed_mps / 0.08))
    assert spans(t_s, angle) == ()


def test_swaying_to_and_fro_is_no_standing():
    t_s = np.arange(0.0, 60.0, 0.05)
    assert spans(t_s, 0.2 * np.sin(2.0 * np.pi * t_s / 2.0)) == ()


def test_travel_that_is_not_known_is_no_standing():
    t_s, angle = wheels((60.0, 0.0))
    loose = np.zeros(t_s.size, dtype=bool)
    loose[round(30.0 * RATE_HZ)] = True
    before, after = spans(t_s, angle, loose=loose)
    assert 29.0 < before[1] <= 30.0 <= after[0] < 31.0


def test_a_gap_without_a_count_is_a_stand():
    """Counters are cumulative: a driver that only sends changes is silent while the robot stands."""
    t_s, angle = wheels((20.0, 5.0), (60.0, 0.0), (20.0, 5.0))
    sent = (t_s < 25.0) | (t_s > 78.0)
    ((begin_s, end_s),) = spans(t_s[sent], angle[sent])
    assert begin_s < 21.0
    assert end_s > 79.0


def test_a_gap_with_counts_is_none():
    t_s, angle = wheels((20.0, 5.0), (60.0, 1.0), (20.0, 5.0))
    sent = (t_s < 20.0) | (t_s > 80.0)
    assert spans(t_s[sent], angle[sent]) == ()


def test_a_moment_shows_nothing():
    assert standing_spans(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1, dtype=bool), MOST_RAD) == ()
    assert spans(*wheels((1.5, 0.0))) == ()


def test_a_stand_keeps_its_first_moments_and_one_reading_an_octave():
    t_s = np.arange(0.0, 4000.0, 0.1)
    taken = t_s[worth_taking(t_s, ((100.0, 3700.0),), 0.0)]
    assert np.count_nonzero(taken < 100.0) == 1000
    assert np.count_nonzero(taken > 3700.0) == np.count_nonzero(t_s > 3700.0)
    standing = taken[(taken >= 100.0) & (taken <= 3700.0)] - 100.0
    assert np.count_nonzero(standing < FIRST_S - 0.05) == 30
    assert standing[standing > FIRST_S - 0.05] == pytest.approx(FIRST_S * 2.0 ** np.arange(11), abs=0.11)


def test_ten_hours_of_standing_say_hardly_more_than_one():
    t_s = np.arange(0.0, 36000.0, 0.2)
    one, ten = (worth_taking(t_s, ((0.0, end_s),), 0.0)[t_s <= end_s].sum() for end_s in (3600.0, 36000.0))
    assert ten - one <= 4


def test_what_repeats_while_standing_says_nothing():
    t_s = np.arange(0.0, 60.0, 0.1)
    east, north = np.zeros(t_s.size), np.zeros(t_s.size)
    stand = ((20.0, 40.0),)
    standing = (t_s >= 20.0) & (t_s <= 40.0)
    assert worth_taking(t_s, stand, 0.0, east, north)[standing].sum() == 1
    assert worth_taking(t_s, stand, 0.0, east, north)[~standing].all()
    north[t_s > 21.0] = 1.0
    assert worth_taking(t_s, stand, 0.0, east, north)[standing].sum() == 2


def test_a_part_that_begins_in_a_stand_has_its_own_first_moments():
    t_s = np.arange(500.0, 1000.0, 0.1)
    taken = t_s[worth_taking(t_s, ((0.0, 2000.0),), 500.0, np.zeros(t_s.size), np.arange(t_s.size))]
    assert np.count_nonzero(taken < 500.0 + FIRST_S - 0.05) == 30


@pytest.fixture(scope="module")
def parked(simulate, streams):
    """A drive that begins with 20 minutes of standing; with ``held``, the receiver repeats its position meanwhile."""

    def of(held: bool, seed: int = 3) -> Run:
        run = streams(simulate(seed=seed, stand_first_s=1200.0, duration_s=1500.0))
        fixes = run.fixes
        if held:
            still = fixes.utc_s < fixes.utc_s[0] + 1199.0
            lat, lon = (np.where(still, each[0], each) for each in (fixes.lat_deg, fixes.lon_deg))
            fixes = replace(fixes, lat_deg=lat, lon_deg=lon)
        return replace(run, fixes=fixes)

    return of


def late(run: Run, from_s: float) -> Run:
    """The run from so many seconds after its begin on."""

    def cut(stream, t_s):
        kept = t_s >= run.wheels.t_s[0] + from_s
        columns = {name: each[kept] for name, each in vars(stream).items() if isinstance(each, np.ndarray)}
        return replace(stream, **columns)

    return replace(
        run,
        wheels=cut(run.wheels, run.wheels.t_s),
        heading=cut(run.heading, run.heading.t_s),
        fixes=cut(run.fixes, run.fixes.host_t_s),
    )


@pytest.mark.parametrize("held", [False, True])
def test_hours_of_parking_cost_no_events(parked, held):
    run = parked(held)
    aligned, without = align(run), align(late(run, 1195.0))
    long, short = (build_timeline(each, output_rate_hz=0.01) for each in (aligned, without))
    assert long.t_s.size < short.t_s.size + 150
    assert long.fix_index.size < short.fix_index.size + 30
    assert long.heading_index.size < short.heading_index.size + 50
    ((begin_s, end_s),) = [span for span in aligned.standing_s if span[1] - span[0] > 100.0]
    assert end_s - begin_s == pytest.approx(1200.0, abs=10.0)


def test_no_wheel_motion_is_lost_over_a_stand(parked):
    aligned = align(parked(False))
    timeline = build_timeline(aligned)
    assert timeline.right_rad.sum() == pytest.approx(aligned.right_rad[-1], abs=1e-9)
    assert timeline.left_rad.sum() == pytest.approx(aligned.left_rad[-1], abs=1e-9)
    starts = [end for _, end in aligned.standing_s]
    assert np.isin(starts, timeline.t_s).all()


@pytest.mark.parametrize("held", [False, True])
def test_a_robot_that_parked_has_the_same_constants(parked, held):
    from sccal.calibration.options import CalibrationOptions
    from sccal.calibration.single import calibrate_run

    run = parked(held)
    found, _ = calibrate_run(run, CalibrationOptions())
    without, _ = calibrate_run(late(run, 1195.0), CalibrationOptions())
    for name, one in vars(found.parameters).items():
        other = getattr(without.parameters, name)
        assert one.status == other.status == "estimated"
        assert abs(one.value - other.value) < max(one.sigma, other.sigma), name
        assert 0.5 < one.sigma / other.sigma < 2.0, name
    assert found.fit.recoveries == 0
