"""What a parameter above zero does to the real machine, each effect on its own: physics first, then the columns."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.ground import HILLS
from sccal.simulate.choose import settings_from
from sccal.simulate.run import simulate_run
from sccal.simulate.world import BodySteps, integrate, rim_travel
from tests.effects.harness import NOISELESS, injected, innovations

TRACK_M = 0.7


def moved(speed_mps, turn_rate_radps, seconds=10.0):
    """A body that does one thing, and what its rims run for it."""
    count = int(seconds * 200)
    full = np.full(count, 1.0 / 200.0)
    steps = BodySteps(
        np.arange(count + 1) / 200.0, speed_mps * full, np.zeros(count), turn_rate_radps * full, np.radians(30.0)
    )
    return integrate(steps), rim_travel(steps, TRACK_M)


@pytest.mark.parametrize(
    ("speed_mps", "turn_rate_radps", "more_m"),
    [(0.5, 0.0, 0.6), (-0.5, 0.0, -0.6), (0.3, 0.4, 0.6), (0.0, 0.5, 0.0), (0.0, 0.0, 0.0)],
)
def test_the_wheels_of_a_speed_offset_run_further_than_the_body_while_it_travels(speed_mps, turn_rate_radps, more_m):
    motion, rims = moved(speed_mps, turn_rate_radps)
    found = CATALOGUE["speed_offset"].physics({"mps": 0.06}).wheel_travel(motion, rims)
    for before, after in ((rims.left, found.left), (rims.right, found.right)):
        assert np.sum(after - before) == pytest.approx(more_m, abs=1e-9)


def test_an_offset_below_zero_takes_from_the_wheels():
    motion, rims = moved(-0.5, 0.0)
    found = CATALOGUE["speed_offset"].physics({"mps": -0.06}).wheel_travel(motion, rims)
    assert np.sum(found.left - rims.left) == pytest.approx(0.6)


def test_the_column_of_a_speed_offset_takes_it_back():
    view = injected("lever_arm", (0.0, 0.0)).view
    (column,) = CATALOGUE["speed_offset"].columns(view, {"mps": 0.0})
    steps = view.steps
    assert column.port == "along"
    fast = np.abs(steps.speed_mps) > 0.05
    assert column.values[fast] == pytest.approx((-np.sign(steps.speed_mps) * steps.dt_s)[fast])
    still = np.abs(steps.speed_mps) < 0.005
    assert np.count_nonzero(still & (np.abs(steps.turn_rate_radps) > 0.2)) > 20
    assert np.all(column.values[still] == 0.0)


def test_a_speed_offset_lasts_from_start_to_stop():
    """A limit at the crawl itself would lose a hundredth of the time, at the ends of every leg."""
    log = injected("speed_offset", (0.05, 0.02))
    without, with_it = (innovations(log, "speed_offset", {"mps": mps})[1] for mps in (0.0, 0.05))
    assert np.sqrt(np.mean(with_it**2)) < 0.005 * np.sqrt(np.mean(without**2))


def test_a_gyro_with_too_much_gain_reads_turns_too_large():
    """Two turns to the left read as two turns and 14.4°, and two to the right as much on the other side."""
    for way in (1.0, -1.0):
        motion, _ = moved(0.0, way * 0.4 * np.pi)
        state = motion.at(motion.t_s)
        reading = CATALOGUE["heading_scale"].physics({"ratio": 0.02}).heading(state, state.yaw_rad)
        assert reading[0] == state.yaw_rad[0]
        assert np.degrees(reading[-1] - state.yaw_rad[-1]) == pytest.approx(way * 0.02 * 720.0)
    view = injected("lever_arm", (0.0, 0.0)).view
    (column,) = CATALOGUE["heading_scale"].columns(view, {"ratio": 0.0})
    assert column.port == "heading"
    assert column.values == pytest.approx(view.headings.yaw_rad - view.headings.yaw_rad[0])


def test_a_high_antenna_stands_downhill_of_the_robot():
    """Wherever the ground is steep, the fix is moved down the slope, by the height times its sine."""
    rng = np.random.default_rng(2)
    motion, _ = moved(1.0, 0.3, 60.0)
    state = motion.at(rng.uniform(0.0, 60.0, 200))
    east, north = CATALOGUE["antenna_height"].physics({"m": 3.0}).antenna(state, state.east_m, state.north_m)

    def height_m(east_m, north_m):
        wave = 2.0 * np.pi / HILLS.length_m
        sines = np.sin(wave * (east_m + HILLS.east_shift_m)) + np.sin(wave * (north_m + HILLS.north_shift_m))
        return np.tan(np.radians(HILLS.steepest_deg)) / wave * sines

    out = np.hypot(east - state.east_m, north - state.north_m)
    drop = height_m(state.east_m, state.north_m) - height_m(east, north)
    steep = out > 0.05
    assert np.count_nonzero(steep) > 100
    assert np.all(drop[steep] > 0.0)
    pitch, roll = HILLS.tilt(state.east_m, state.north_m, state.yaw_rad)
    assert out == pytest.approx(3.0 * np.hypot(np.sin(pitch), np.sin(roll)), rel=0.01, abs=1e-6)


def test_the_column_of_a_high_antenna_goes_back_where_the_nose_goes_up():
    """And to the right where the left side goes up."""
    view = injected("antenna_height", (2.0,)).view
    ahead, aside = CATALOGUE["antenna_height"].columns(view, {"m": 0.0})
    assert (ahead.port, aside.port) == ("antenna_forward", "antenna_left")
    pitch, roll = (view.at_fixes(tilt) for tilt in (view.steps.pitch_rad, view.steps.roll_rad))
    assert ahead.values == pytest.approx(-np.sin(pitch) * np.cos(roll))
    assert aside.values == pytest.approx(-np.sin(roll))
    assert np.ptp(ahead.values) > 0.1
    assert np.ptp(aside.values) > 0.1


def test_effects_on_one_hill_do_not_pile_it_up():
    """Pitch and roll are those of the ground, however many effects need it."""
    chosen = settings_from(["drive.path=general", "drive.duration_s=60", *NOISELESS], 11)
    slope, roll, tall = (
        CATALOGUE[name].physics(values)
        for name, values in (("slope", {"ratio": 1.0}), ("roll_slip", {"ratio": 0.0}), ("antenna_height", {"m": 2.0}))
    )
    alone, both, all_three, hilly = (
        simulate_run(chosen, one).ahrs for one in ([slope], [slope, tall], [tall, slope, roll], [slope, roll])
    )
    assert np.array_equal(alone.pitch_deg, both.pitch_deg)
    assert np.max(np.abs(alone.pitch_deg)) > 3.0
    assert np.all(alone.roll_deg == 0.0)
    for one in (both, all_three):
        assert np.array_equal(one.pitch_deg, hilly.pitch_deg)
        assert np.array_equal(one.roll_deg, hilly.roll_deg)


def test_a_latency_is_known_no_better_than_its_lines_travel():
    of_lines = {"gnss_latency", "fix_smoothing", "heading_smoothing"}
    for name in of_lines:
        (age,) = CATALOGUE[name].parameters
        assert 0.0 < 4.5 * age.hidden_sigma < age.matters
    others = [one for name, effect in CATALOGUE.items() if name not in of_lines for one in effect.parameters]
    assert {one.hidden_sigma for one in others} == {0.0}
