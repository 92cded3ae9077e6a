"""Effects in the filter: exact where they are not linear, and together where one changes the other."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.view import with_travel
from sccal.errors import DataError, UsageError
from sccal.evidence.extension import Free, FreeEffects, effect_by_name
from sccal.filter.columns import MOTION_PORTS
from sccal.filter.layout import (
    PORT_ALONG,
    PORT_ANTENNA_FORWARD,
    PORT_ANTENNA_LEFT,
    PORT_LEFT_WHEEL,
    PORT_RIGHT_WHEEL,
    PORT_TURN,
)
from tests.effects.harness import injected

IRON = (28.0, -19.0)
"""A third of the earth's field and more: 34 deg."""


def turned(view, by_rad):
    """The drive with the robot headed elsewhere."""
    return replace(view, headings=replace(view.headings, yaw_rad=view.headings.yaw_rad + by_rad))


@cache
def drive():
    """A general drive without effects."""
    return injected("lever_arm", (0.0, 0.0))


def deviation_rad(yaw_rad, cos_deg, sin_deg):
    """Of a compass: the angle from the earth's field to the whole one."""
    c, s = np.radians(cos_deg), np.radians(sin_deg)
    across = c * np.cos(yaw_rad) + s * np.sin(yaw_rad)
    along = 1.0 + c * np.sin(yaw_rad) - s * np.cos(yaw_rad)
    return np.arctan2(across, along)


# Headings that bend


@pytest.mark.parametrize("values", [IRON, (-30.0, 16.0), (3.0, 4.0), (0.0, 0.0)])
def test_strong_iron_is_exact_where_it_is_linearised(values):
    log = drive()
    effects, at = FreeEffects((Free(CATALOGUE["hard_iron"], {"tau_s": 0.0}),)), np.array(values)
    columns = effects.columns_in(log.view, at, log.timeline)
    yaw = log.view.headings.yaw_rad
    reading = columns.heading @ at[columns.heading_param] + columns.heading_known
    np.testing.assert_allclose(reading, deviation_rad(yaw, *values), atol=1e-9)
    if np.any(at):
        assert np.array_equal(columns.heading_at, yaw)
    else:
        assert not columns.heading_slope.any()


def test_beside_it_readings_change_as_the_deviation_does():
    """By both parameters and by the heading, by central differences of the exact deviation."""
    log = drive()
    at = np.array(IRON)
    columns = FreeEffects((Free(CATALOGUE["hard_iron"], {"tau_s": 0.0}),)).columns_in(log.view, at, log.timeline)
    yaw, step = log.view.headings.yaw_rad, 1e-4
    for k, parameter in enumerate(columns.heading_param):
        more, less = at + step * np.eye(2)[parameter], at - step * np.eye(2)[parameter]
        slope = (deviation_rad(yaw, *more) - deviation_rad(yaw, *less)) / (2.0 * step)
        np.testing.assert_allclose(columns.heading[:, k], slope, atol=2e-6)
    by_heading = (deviation_rad(yaw + step, *IRON) - deviation_rad(yaw - step, *IRON)) / (2.0 * step)
    assert np.abs(by_heading).max() > 0.3
    np.testing.assert_allclose(columns.heading_slope, by_heading, atol=2e-3)


def test_a_slow_ahrs_is_exact_as_well():
    """What the filter adds is what the simulated AHRS shows, through its own filter."""
    log = injected("hard_iron", (*IRON, 20.0))
    free, at = Free(CATALOGUE["hard_iron"], {"tau_s": 20.0}), np.array(IRON)
    columns = FreeEffects((free,)).columns_in(log.view, at, log.timeline)
    added = columns.heading @ at[columns.heading_param] + columns.heading_known
    motion = log.simulated.motion.at(log.simulated.ahrs.true_t_s)
    physics = CATALOGUE["hard_iron"].physics({"cos_deg": IRON[0], "sin_deg": IRON[1], "tau_s": 20.0})
    shown = physics.heading(motion, motion.yaw_rad) - motion.yaw_rad
    exact = np.interp(log.view.headings.t_s - log.timeline.t_s[0], motion.t_s - motion.t_s[0], shown)
    assert np.abs(exact).max() > np.radians(15.0)
    np.testing.assert_allclose(added, exact, atol=2e-3)
    ahead = free.turns(turned(log.view, 1e-4), at) - free.turns(turned(log.view, -1e-4), at)
    np.testing.assert_allclose(columns.heading_slope, ahead / 2e-4, atol=2e-3)


def test_two_irons_add_up():
    log = drive()
    hard, soft = (Free(CATALOGUE[name], {"tau_s": 0.0}) for name in ("hard_iron", "soft_iron"))
    at = np.array([*IRON, 9.0, -6.0])
    columns = FreeEffects((hard, soft)).columns_in(log.view, at, log.timeline)
    added = columns.heading @ at[columns.heading_param] + columns.heading_known
    np.testing.assert_allclose(added, hard.turns(log.view, at[:2]) + soft.turns(log.view, at[2:]), atol=1e-9)


def test_effects_at_zero_and_elsewhere_bend_nothing():
    log = drive()
    effects = FreeEffects((Free(CATALOGUE["hard_iron"], {"tau_s": 0.0}), Free(CATALOGUE["lever_arm"])))
    columns = effects.columns_in(log.view, np.array([0.0, 0.0, 0.4, -0.2]), log.timeline)
    assert not columns.heading_known.any()
    assert not columns.heading_slope.any()


# Late fixes and the arm


def shown_by_columns(log, effects, values):
    """Where the fixes are, less where the robot is (f, 2), as the filter adds it up at the true headings."""
    columns = effects.columns_in(log.view, values, log.timeline)
    size = columns.fix * values[columns.fix_param]
    forward = size[:, columns.fix_port == PORT_ANTENNA_FORWARD].sum(axis=1)
    left = size[:, columns.fix_port == PORT_ANTENNA_LEFT].sum(axis=1)
    c, s = np.cos(log.view.fixes.yaw_rad), np.sin(log.view.fixes.yaw_rad)
    return np.column_stack((c * forward - s * left, s * forward + c * left))


def shown_by_geometry(log, forward_m, left_m, late_s):
    """The same from the true path: the antenna as it stood when the fix was taken."""
    view = log.view
    t_s = view.fixes.t_s - view.fixes.t_s[0]
    start = log.simulated.settings.clock.start_utc_s - log.simulated.settings.clock.host_epoch_offset_s
    then = log.simulated.motion.at(view.fixes.t_s - start - late_s)
    now = log.simulated.motion.at(view.fixes.t_s - start)
    c, s = np.cos(then.yaw_rad), np.sin(then.yaw_rad)
    east = then.east_m + c * forward_m - s * left_m - now.east_m
    north = then.north_m + s * forward_m + c * left_m - now.north_m
    return np.column_stack((east, north))[(t_s > 2.0) & (t_s < t_s[-1] - 2.0)]


@pytest.mark.parametrize("late_s", [0.5, -0.3])
@pytest.mark.parametrize(("forward_m", "left_m"), [(0.8, 0.0), (0.0, -0.8), (-0.5, 0.6)])
def test_a_late_fix_turns_the_arm_back(forward_m, left_m, late_s):
    log = drive()
    arm, late = Free(CATALOGUE["lever_arm"]), Free(CATALOGUE["gnss_latency"])
    exact = shown_by_geometry(log, forward_m, left_m, late_s)
    t_s = log.view.fixes.t_s - log.view.fixes.t_s[0]
    inside = (t_s > 2.0) & (t_s < t_s[-1] - 2.0)
    for effects, values in (((arm, late), (forward_m, left_m, late_s)), ((late, arm), (late_s, forward_m, left_m))):
        error = shown_by_columns(log, FreeEffects(effects), np.array(values))[inside] - exact
        rate = np.abs(log.view.fixes.turn_rate_radps[inside]).max()
        cross_term = abs(late_s) * rate * np.hypot(forward_m, left_m)
        assert cross_term > 0.02
        assert np.abs(error).max() < 0.2 * cross_term


def test_a_clock_that_runs_fast_turns_it_too():
    log = drive()
    effects = FreeEffects((Free(CATALOGUE["lever_arm"]), Free(CATALOGUE["clock_skew"])))
    alone = FreeEffects((Free(CATALOGUE["lever_arm"]),))
    skew_ppm = 4000.0
    together = shown_by_columns(log, effects, np.array([0.8, 0.0, skew_ppm]))
    still = shown_by_columns(log, alone, np.array([0.8, 0.0]))
    late = shown_by_columns(log, FreeEffects((Free(CATALOGUE["clock_skew"]),)), np.array([skew_ppm]))
    turned_by = together - late - still
    t_s = log.view.fixes.t_s - log.view.start_s
    expected = 0.8 * np.abs(log.view.fixes.turn_rate_radps) * skew_ppm * 1e-6 * t_s
    # But for the moments in which a turn begins or ends.
    assert np.mean(np.abs(np.hypot(*turned_by.T) - expected) < 0.005) > 0.95
    assert expected.max() > 0.03


def test_an_arm_whose_fixes_are_in_time_stays_where_it_is():
    log = drive()
    effects = FreeEffects((Free(CATALOGUE["lever_arm"]), Free(CATALOGUE["gnss_latency"])))
    alone = FreeEffects((Free(CATALOGUE["lever_arm"]),))
    values = np.array([0.8, -0.3, 0.0])
    np.testing.assert_allclose(shown_by_columns(log, effects, values), shown_by_columns(log, alone, values[:2]))


# Names


def test_an_effect_with_shapes_is_told_apart_by_them():
    assert Free(CATALOGUE["lever_arm"]).key == "lever_arm"
    assert Free(CATALOGUE["hard_iron"], {"tau_s": 8.0}).key == "hard_iron(tau_s=8)"
    assert [one.name for one in Free(CATALOGUE["hard_iron"], {"tau_s": 8.0}).parameters] == ["cos_deg", "sin_deg"]


def test_priors_stand_in_the_order_of_the_effects_and_may_be_narrowed():
    effects = FreeEffects((Free(CATALOGUE["gnss_latency"]), Free(CATALOGUE["lever_arm"], {}, 0.1)))
    latency, arm = CATALOGUE["gnss_latency"].parameters, CATALOGUE["lever_arm"].parameters
    assert effects.prior_sigmas == pytest.approx([latency[0].prior_sigma, *(0.1 * one.prior_sigma for one in arm)])
    assert [one.name for _, one in effects.parameters] == ["s", "forward_m", "left_m"]


def test_names_are_of_the_catalogue_or_of_the_log():
    with pytest.raises(UsageError, match="no effect called"):
        effect_by_name("arm", None)
    with pytest.raises(DataError, match="none at all"):
        effect_by_name("heading~current_a", None)
    with pytest.raises(UsageError, match="at_s must be searched for"):
        FreeEffects.named(("heading_step",))
    assert FreeEffects.named(()) is None
    assert len(FreeEffects.named(("lever_arm", "lever_arm")).effects) == 1


# What stands between the counters and the body


def motion_of(log, effects, values):
    """Travel and turn of the body in each step: the wheels' and what all columns make of it."""
    columns = FreeEffects(effects).columns_in(log.view, values, log.timeline)
    added = dict.fromkeys(MOTION_PORTS.values(), 0.0)
    for values_of, port, k in zip(columns.motion.T, columns.motion_port, columns.motion_param, strict=True):
        added[int(port)] = added[int(port)] + values[k] * values_of
    steps = log.view.steps
    right, left = added[PORT_RIGHT_WHEEL], added[PORT_LEFT_WHEEL]
    along = steps.along_m + added[PORT_ALONG] + 0.5 * (right + left)
    return along, steps.turn_rad + added[PORT_TURN] + (right - left) / steps.track_m


def test_the_ground_takes_its_share_of_the_wheels_travel_and_not_of_the_counts():
    """Of a wheel that travels 20 % more than it says, the slip takes a share that is 20 % larger and grows with it."""
    log = drive()
    steps = log.view.steps
    lost = Free(CATALOGUE["missed_right"], {"above_radps": 0.0})
    slips = Free(CATALOGUE["speed_slip"])
    values = np.array([0.05, 1.0 - 1.0 / 1.2])
    along, _ = motion_of(log, (slips, lost), values)
    travelled = with_travel(log.view, 1.2 * steps.right_m, steps.left_m).steps
    expected = travelled.along_m * (1.0 - 0.05 * np.abs(travelled.speed_mps))
    np.testing.assert_allclose(along, expected, atol=1e-12)
    counted = travelled.along_m - 0.05 * steps.along_m * np.abs(steps.speed_mps)
    assert np.abs(expected - counted).sum() > 1e-3 * np.abs(expected).sum()


def test_an_old_fix_shows_how_the_body_moved_and_not_what_the_wheels_say():
    """With a third of the travel lost, a fix lags by two thirds of what the wheels cover in its age."""
    log = drive()
    late, lost = Free(CATALOGUE["gnss_latency"]), Free(CATALOGUE["missed_right"], {"above_radps": 0.0})
    both_lose = (late, lost, Free(CATALOGUE["missed_left"], {"above_radps": 0.0}))
    share = 1.0 - 1.0 / (1.0 - 1.0 / 3.0)
    values = np.array([0.5, share, share])
    alone = FreeEffects((late,)).columns_in(log.view, values[:1], log.timeline).fix
    beside = FreeEffects(both_lose).columns_in(log.view, values, log.timeline).fix
    forward, slower = (np.hypot(*one.T[:2]) for one in (alone, beside))
    np.testing.assert_allclose(slower, forward * 2.0 / 3.0, rtol=2e-2, atol=1e-3)


def test_a_reading_of_the_heading_that_is_old_lags_by_what_the_body_turned():
    log = drive()
    late, slips = Free(CATALOGUE["heading_latency"]), Free(CATALOGUE["turn_slip"])
    values = np.array([0.3, 0.4])
    columns = FreeEffects((late, slips)).columns_in(log.view, values, log.timeline)
    _, turn = motion_of(log, (late, slips), values)
    turned = np.interp(log.view.headings.t_s, log.view.steps.t_s, np.cumsum(turn))
    before = np.interp(log.view.headings.t_s - 0.3, log.view.steps.t_s, np.cumsum(turn))
    does = columns.heading_known + columns.heading @ values[columns.heading_param]
    inside = log.view.headings.t_s > log.view.steps.t_s[0] + 0.5
    np.testing.assert_allclose(does[inside], (before - turned)[inside], atol=2e-3)
    assert np.abs(turned - before).max() > 0.05


def test_a_high_antenna_swings_as_the_robot_stood_when_an_old_fix_was_taken():
    log = injected("antenna_height", (2.0,))
    effects = FreeEffects((Free(CATALOGUE["gnss_latency"]), Free(CATALOGUE["antenna_height"])))
    columns = effects.columns_in(log.view, np.array([0.4, 2.0]), log.timeline)
    tall = columns.fix[:, columns.fix_param == 1]
    steps = log.view.steps
    pitch, roll = (np.interp(log.view.fixes.t_s - 0.4, steps.t_s, one) for one in (steps.pitch_rad, steps.roll_rad))
    size = np.hypot(np.sin(pitch) * np.cos(roll), np.sin(roll))
    # Rotated from how the robot stood then into how it stands now; the size stays.
    ports = columns.fix_port[columns.fix_param == 1]
    forward, left = (tall[:, ports == port].sum(axis=1) for port in (PORT_ANTENNA_FORWARD, PORT_ANTENNA_LEFT))
    np.testing.assert_allclose(np.hypot(forward, left), size, atol=1e-9)
