"""Counts that are lost above a speed: what the counter holds, and which steps the columns take for fast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.missed import limits_radps, share_above
from sccal.simulate.world import BodySteps, WheelPair, integrate
from tests.effects.harness import injected

NAMES = ("missed_left", "missed_right")
SIDES = {"missed_left": "left", "missed_right": "right"}


def counted(name, rates_radps, ratio, above_radps, seconds=20.0):
    """Angle that the counter holds at the end of each stretch at a rate, and of the other wheel."""
    rate = np.repeat(rates_radps, int(seconds * 200))
    t_s = np.arange(rate.size + 1) / 200.0
    angle = np.concatenate(([0.0], np.cumsum(rate / 200.0)))
    nothing = np.zeros(rate.size)
    motion = integrate(BodySteps(t_s, 0.08 * rate / 200.0, nothing, nothing, 0.0))
    physics = CATALOGUE[name].physics({"ratio": ratio, "above_radps": above_radps})
    found = physics.wheel_angle(motion, WheelPair(left=angle, right=angle))
    other = found.right if name == "missed_left" else found.left
    assert np.array_equal(other, angle)
    return getattr(found, SIDES[name])[:: int(seconds * 200)]


@pytest.mark.parametrize("name", NAMES)
def test_counts_are_lost_above_the_limit_only_forwards_and_backwards(name):
    stretches = np.diff(counted(name, [4.0, 10.0, -4.0, -10.0], 0.1, 7.0))
    assert stretches == pytest.approx([80.0, 180.0, -80.0, -180.0], abs=0.2)


@pytest.mark.parametrize("name", NAMES)
def test_at_a_limit_of_zero_a_share_of_all_counts_is_lost(name):
    assert np.diff(counted(name, [4.0, 0.0, -10.0], 0.1, 0.0)) == pytest.approx([72.0, 0.0, -180.0])


def two_speeds(name, slow=4.0, fast=9.0):
    """A view whose wheels hold two counted rates, ten seconds each, forwards and then backwards."""
    view = injected("lever_arm", (0.0, 0.0)).view
    size = view.steps.t_s.size
    rate = np.array([slow, fast, -slow, -fast])[np.minimum(4 * np.arange(size) // size, 3)]
    metres = 0.08 * rate * view.steps.dt_s
    steps = replace(view.steps, left_m=metres, right_m=metres, left_rate_radps=rate, right_rate_radps=rate)
    return replace(view, steps=steps), rate, metres


@pytest.mark.parametrize("name", NAMES)
def test_a_step_is_fast_by_its_rate_before_the_loss(name):
    """9 counted at a tenth lost are 10 turned: above a limit of 9.5, and so lost; 4 are 4.4, and below it."""
    view, rate, metres = two_speeds(name)
    (column,) = CATALOGUE[name].columns(view, {"ratio": 0.1, "above_radps": 9.5})
    assert column.port == f"{SIDES[name]}_wheel"
    inside = np.abs(np.gradient(rate)) == 0.0
    fast = np.abs(rate) > 8.0
    assert column.values[inside & fast] == pytest.approx((metres / 0.9)[inside & fast])
    assert np.all(column.values[inside & ~fast] == 0.0)
    (none,) = CATALOGUE[name].columns(view, {"ratio": 0.0, "above_radps": 9.5})
    assert np.all(none.values[inside] == 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_a_limit_left_out_is_none(name):
    view, _, metres = two_speeds(name)
    (column,) = CATALOGUE[name].columns(view, {"ratio": 0.1})
    assert column.values == pytest.approx(metres / 0.9)


def test_a_step_that_speeds_up_through_the_limit_is_lost_in_part():
    rate = np.arange(10.0)
    assert share_above(rate, 4.25).tolist() == [0.0, 0.0, 0.0, 0.0, 0.25, 1.0, 1.0, 1.0, 1.0, 1.0]
    assert share_above(rate[::-1], 4.25).tolist() == [1.0, 1.0, 1.0, 1.0, 1.0, 0.25, 0.0, 0.0, 0.0, 0.0]
    assert share_above(np.full(3, 4.0), 4.0).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("name", NAMES)
def test_limits_stand_between_the_speeds_driven(name):
    view, _, _ = two_speeds(name)
    assert [one["above_radps"] for one in CATALOGUE[name].shape_grid(view)] == [6.5]


def test_one_speed_has_no_limit_worth_trying():
    ripple = 8.0 + 0.2 * np.sin(np.arange(1000.0))
    assert limits_radps(ripple, ripple) == []
    assert limits_radps(np.zeros(5), np.zeros(5)) == []
    assert limits_radps(np.zeros(0), np.zeros(0)) == []


def test_limits_part_the_travel_of_a_drive():
    steps = injected("lever_arm", (0.0, 0.0), "calibration", 300.0).view.steps
    limits = limits_radps(steps.left_rate_radps, steps.left_m)
    assert 2 <= len(limits) <= 5
    shares = [
        np.sum(np.abs(steps.left_m)[np.abs(steps.left_rate_radps) > limit]) / np.sum(np.abs(steps.left_m))
        for limit in limits
    ]
    assert all(0.04 < share < 0.96 for share in shares)
    assert all(np.diff(shares) < -0.05)
