"""Iron near the compass: far beyond first order, beyond the earth's own field, and through a slow AHRS."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.compass import deviation_columns
from tests.effects.harness import injected, innovations

LARGE = (
    ("hard_iron", (15.0, 15.0, 0.0)),
    ("hard_iron", (-25.0, 10.0, 0.0)),
    ("hard_iron", (28.0, -19.0, 20.0)),
    ("hard_iron", (-30.0, -40.0, 0.0)),
    ("hard_iron", (70.0, 60.0, 0.0)),
    ("soft_iron", (12.0, -9.0, 0.0)),
    ("soft_iron", (20.0, 15.0, 10.0)),
)
TURN = np.linspace(-7.0, 7.0, 1401)
EARTH_DEG = np.degrees(1.0)
"""Degrees of field that are as strong as the earth's."""


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def named(name, values):
    return dict(zip((p.name for p in CATALOGUE[name].parameters), values, strict=True))


def standing(yaw_rad, t_s=None):
    """Readings at some headings."""
    yaw_rad = np.asarray(yaw_rad, dtype=float)
    return SimpleNamespace(t_s=np.arange(yaw_rad.size) * 0.05 if t_s is None else t_s, yaw_rad=yaw_rad)


def read(name, values, state):
    """What the physics makes of a true heading, less that heading."""
    found = CATALOGUE[name].physics(named(name, values)).heading(state, state.yaw_rad)
    return np.angle(np.exp(1j * (found - state.yaw_rad)))


@pytest.mark.parametrize(("name", "values"), LARGE)
def test_large_amplitudes_are_explained(name, values):
    log = injected(name, values)
    state = log.simulated.motion.at(log.simulated.ahrs.true_t_s)
    error = read(name, values, state)
    heading, _ = innovations(log, name, named(name, values))
    assert np.max(np.abs(error)) > np.radians(9.0)
    assert rms(heading) < 1e-3 * rms(error)


@pytest.mark.parametrize("times", [1.0, 2.0])
@pytest.mark.parametrize("strength", [0.1, 0.35, 0.6, 0.8, 1.1, 1.3, 1.75])
@pytest.mark.parametrize("way_deg", range(17, 360, 45))
def test_columns_made_anew_lead_from_zero_to_the_truth(times, strength, way_deg):
    """With a heading offset beside them and the prior that the effect has, innovations wrapped as the filter does."""
    truth = strength * EARTH_DEG * np.array([np.cos(np.radians(way_deg)), np.sin(np.radians(way_deg))])
    angle = times * np.cumsum(np.random.default_rng(3).normal(0.0, 0.1, 3000))
    error = np.stack(deviation_columns(angle, *truth), axis=1) @ truth + 0.2
    estimate = np.zeros(3)
    prior = np.diag([1.0 / 10.0**2, 1.0 / 10.0**2, 0.0]) * np.radians(0.1) ** 2
    for _ in range(40):
        columns = np.column_stack((*deviation_columns(angle, *estimate[:2]), np.ones(angle.size)))
        left = np.angle(np.exp(1j * (error - columns @ estimate)))
        estimate = np.linalg.solve(columns.T @ columns + prior, columns.T @ (left + columns @ estimate))
    assert estimate[:2] == pytest.approx(truth, abs=0.05)
    assert np.angle(np.exp(1j * (estimate[2] - 0.2))) == pytest.approx(0.0, abs=1e-3)


def test_at_zero_they_are_the_harmonics():
    cos, sin = deviation_columns(TURN, 0.0, 0.0)
    assert cos == pytest.approx(np.radians(np.cos(TURN)))
    assert sin == pytest.approx(np.radians(np.sin(TURN)))


@settings(max_examples=200)
@given(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0))
def test_values_times_columns_are_the_deviation_of_any_field(cos_deg, sin_deg):
    cos, sin = deviation_columns(TURN, cos_deg, sin_deg)
    field = 1j * np.exp(-1j * TURN) + np.radians(cos_deg) - 1j * np.radians(sin_deg)
    assume(np.abs(field).min() > 1e-6)
    true = -np.angle(field / (1j * np.exp(-1j * TURN)))
    assert np.angle(np.exp(1j * (cos_deg * cos + sin_deg * sin - true))) == pytest.approx(0.0, abs=1e-9)
    assert np.max(np.abs(cos_deg * cos + sin_deg * sin)) <= np.pi + 1e-9


@settings(max_examples=100)
@given(st.floats(0.0, 6.3), st.floats(0.02, 0.8), st.floats(0.0, 6.3))
def test_across_the_values_they_are_the_slope(angle, strength, way):
    """Between two fields of one strength the deviation changes as the columns say."""
    c, s = np.degrees(strength) * np.cos(way), np.degrees(strength) * np.sin(way)
    step = 1e-4 * np.array([-s, c])
    at = np.array([angle])

    def deviation(cos_deg, sin_deg):
        return float(np.dot(np.concatenate(deviation_columns(at, cos_deg, sin_deg)), (cos_deg, sin_deg)))

    slope = deviation(c + step[0], s + step[1]) - deviation(c - step[0], s - step[1])
    assert slope == pytest.approx(2.0 * float(np.concatenate(deviation_columns(at, c, s)) @ step), abs=1e-8)


@pytest.mark.parametrize(("c", "s"), [(20.0, -12.0), (80.0, -12.0), (-100.0, 100.0), (EARTH_DEG, 0.0)])
def test_no_heading_is_special(c, s):
    cos, sin = deviation_columns(np.append(TURN, np.arctan2(-c, s)), c, s)
    assert np.all(np.isfinite(cos))
    assert np.all(np.isfinite(sin))
    strength = np.hypot(c, s) / EARTH_DEG
    if strength < 0.9:
        assert np.all(np.abs(np.diff(cos[:-1])) < 5e-4)
    if abs(strength - 1.0) > 0.3:
        assert np.max(np.abs(cos)) < np.radians(1.0 / abs(strength - 1.0) + 2.0 * np.pi / strength)


def test_iron_weaker_than_the_earth_swings_and_stronger_iron_holds_the_compass():
    """A magnet twice as strong as the earth: the robot turns once, and its compass hardly."""
    once = np.linspace(0.0, 2.0 * np.pi, 721)
    weak, strong = (np.unwrap(read("hard_iron", (size, 0.0, 0.0), standing(once))) for size in (30.0, 2.0 * EARTH_DEG))
    assert abs(weak[-1] - weak[0]) < 1e-6
    assert strong[-1] - strong[0] == pytest.approx(-2.0 * np.pi)


@pytest.mark.parametrize(
    ("name", "values", "yaw_deg", "error_deg"),
    [
        ("hard_iron", (2.0, 0.0, 0.0), 0.0, 2.0),
        ("hard_iron", (2.0, 0.0, 0.0), 180.0, -2.0),
        ("hard_iron", (0.0, 2.0, 0.0), 90.0, 2.0),
        ("soft_iron", (2.0, 0.0, 0.0), 0.0, 2.0),
        ("soft_iron", (2.0, 0.0, 0.0), 90.0, -2.0),
        ("soft_iron", (0.0, 2.0, 0.0), 45.0, 2.0),
    ],
)
def test_an_amplitude_above_zero_turns_the_reading_counter_clockwise(name, values, yaw_deg, error_deg):
    assert np.degrees(read(name, values, standing([np.radians(yaw_deg)]))) == pytest.approx([error_deg], rel=0.05)


@pytest.mark.parametrize(("name", "values"), [("hard_iron", (20.0, 0.0)), ("soft_iron", (10.0, 0.0))])
def test_a_slow_ahrs_comes_behind_its_compass(name, values):
    """It begins at what the compass says, and a turn away from there is let in by the time constant."""
    t_s = np.arange(0.0, 100.0, 0.05)
    state = standing(np.where(t_s > 0.0, np.radians(90.0), 0.0), t_s)
    at_once, slow = (read(name, (*values, tau_s), state) for tau_s in (0.0, 20.0))
    assert slow[0] == at_once[0]
    share = (slow - at_once[-1]) / (at_once[0] - at_once[-1])
    assert share == pytest.approx(np.exp(-t_s / 20.0), abs=0.005)


@pytest.mark.parametrize("duration_s", [20.0, 60.0, 400.0])
def test_slowness_is_tried_as_far_as_the_drive_is_long(duration_s):
    tried = [one["tau_s"] for one in CATALOGUE["hard_iron"].shape_grid(SimpleNamespace(duration_s=duration_s))]
    assert tried == [0.0, 8.0, 30.0][: {20.0: 1, 60.0: 2, 400.0: 3}[duration_s]]
