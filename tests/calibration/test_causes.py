"""What reports draw beside the result: residuals against their causes, their consistency, and what was driven."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from sccal.calibration.causes import BINS, FEWEST_IN_BIN, NEAR_EDGE, SHIFTS, binned, find_causes
from sccal.calibration.consistency import STRETCHES, in_stretches
from sccal.calibration.manoeuvres import describe_manoeuvres
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from tests.runs import read, written

VALUES = np.array([0.1, 0.1, 0.8, 0.0])


def near_an_edge(values: np.ndarray, first: float, width: float) -> int:
    """How many lie within a tenth of a bin of an edge."""
    return sum(abs((value - first) / width - round((value - first) / width)) < NEAR_EDGE for value in values)


@pytest.mark.parametrize("legs_deg", [(0.0, 90.0, 180.0, 270.0), (11.25, 101.25), (180.0,)])
def test_noise_about_a_heading_is_not_sorted_into_a_trend(legs_deg: tuple[float, ...]) -> None:
    """What was predicted is off by an error that the residual holds with the opposite sign."""
    rng = np.random.default_rng(6)
    leg = np.radians(rng.choice(legs_deg, 4000))
    error = rng.normal(0.0, 0.005, leg.size)
    residuals = rng.normal(0.0, 0.003, leg.size) - error
    x = np.pi - (np.pi - leg - error) % (2.0 * np.pi)
    assert binned("heading", "yaw", x, residuals).chance > 1e-3
    assert binned("heading", "yaw", x, residuals + 0.002 * np.cos(leg)).chance < 1e-6


@given(st.integers(0, 10_000), st.integers(2, 400))
@settings(max_examples=40)
def test_means_are_those_of_a_loop(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=count), rng.normal(size=count)
    found = binned("along", "speed", x, y)
    low, high = np.quantile(x, (0.005, 0.995))
    width = (high - low) / BINS
    crowds = [near_an_edge(x[(x >= low) & (x <= high)], low - width * k / SHIFTS, width) for k in range(SHIFTS)]
    edges = low + width * (np.arange(BINS + 2) - np.argmin(crowds) / SHIFTS)
    inside = (x >= low) & (x <= high)
    expected = []
    for a, b in pairwise(edges):
        some = y[inside & (x >= a) & ((x < b) | (b == edges[-1]))]
        if some.size >= FEWEST_IN_BIN:
            expected.append((0.5 * (a + b), some.mean(), some.std(ddof=1) / np.sqrt(some.size)))
    got = np.column_stack((found.bin_x, found.bin_mean, found.bin_sigma))
    oracle = np.array(expected).reshape(-1, 3)
    np.testing.assert_allclose(got[:, :2], oracle[:, :2], rtol=1e-6, atol=1e-9)
    wider = got[:, 2] / oracle[:, 2]
    np.testing.assert_allclose(wider, wider[:1].repeat(len(wider)), rtol=1e-6)
    assert (wider > 1.0 - 1e-9).all()
    assert (wider < 2.5).all()


def test_errors_that_last_are_not_taken_for_a_trend() -> None:
    """A slow error of 5 s beside a cause that comes and goes: its means scatter as their errors say."""
    rng = np.random.default_rng(4)
    chances = []
    for _ in range(60):
        slow = np.zeros(3000)
        steps = rng.normal(size=slow.size)
        for k in range(1, slow.size):
            slow[k] = 0.98 * slow[k - 1] + steps[k]
        x = np.cumsum(rng.normal(size=slow.size)) * 0.1 + np.sin(np.arange(slow.size) / 300.0)
        chances.append(binned("heading", "turn_rate", x, slow).chance)
    assert np.mean(np.array(chances) < 1e-4) < 0.1


def test_chance_tells_a_trend_from_noise() -> None:
    rng = np.random.default_rng(1)
    x = rng.uniform(-1.0, 1.0, (200, 2000))
    noise = rng.normal(0.0, 0.01, x.shape)
    chances = np.array([binned("along", "speed", a, b).chance for a, b in zip(x, noise, strict=True)])
    assert np.mean(chances < 0.1) == pytest.approx(0.1, abs=0.07)
    assert binned("along", "speed", x[0], noise[0] + 0.005 * x[0]).chance < 1e-6
    assert binned("along", "speed", x[0], noise[0] + 0.005 * np.abs(x[0])).chance < 1e-6


def test_missing_values_and_nothing_at_all() -> None:
    x = np.array([np.nan, 1.0, 2.0])
    assert binned("across", "roll", x, np.array([1.0, np.nan, 3.0])).x.tolist() == [2.0]
    assert np.isnan(binned("across", "roll", x[:0], x[:0]).chance)


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory):
    folder = written(tmp_path_factory.mktemp("causes"), duration_s=240.0)
    calibration, problem = calibrate_run(read(folder), CalibrationOptions())
    return calibration, problem, problem.begun(problem.at_centre()).finish()


def test_directions_and_signs(solved) -> None:
    """Residuals made from the path itself come back along it, with its own speed and turn rate."""
    calibration, problem, found = solved
    path, p = calibration.trajectory, calibration.parameters
    values = np.array([p.radius_right_m.value, p.radius_left_m.value, p.track_m.value, p.heading_offset_rad.value])
    t_s = problem.aligned.fix_t_s[problem.timeline.fix_index]
    yaw = np.interp(t_s, path.t_s, np.unwrap(path.yaw_rad))
    ahead = np.exp(1j * yaw)
    velocity = np.gradient(path.east_m, path.t_s) + 1j * np.gradient(path.north_m, path.t_s)
    speed = (np.interp(t_s, path.t_s, velocity.real) + 1j * np.interp(t_s, path.t_s, velocity.imag)) * ahead.conj()
    turn_rate = np.interp(t_s, path.t_s, np.gradient(np.unwrap(path.yaw_rad), path.t_s))
    nu = (0.02 * speed.real + 0.5j * turn_rate) * ahead
    made = replace(
        found,
        fix_nu_m=np.column_stack((nu.real, nu.imag)),
        fix_accepted=np.ones_like(found.fix_accepted),
        heading_nu_rad=0.01 * np.sin(problem.aligned.yaw_rad[problem.timeline.heading_index] - values[3]),
        heading_accepted=np.ones_like(found.heading_accepted),
    )
    causes = {(one.residual, one.quantity): one for one in find_causes(problem, made, values, t_s[0] + 20.0)}
    along, across = causes["along", "speed"], causes["across", "turn_rate"]
    assert np.polyfit(along.x, along.residuals, 1)[0] == pytest.approx(0.02, rel=0.1)
    assert np.polyfit(across.x, across.residuals, 1)[0] == pytest.approx(0.5, rel=0.1)
    heading = causes["heading", "yaw"]
    np.testing.assert_allclose(heading.residuals, 0.01 * np.sin(heading.x), atol=1.1e-4)
    assert np.abs(heading.x).max() <= np.pi
    assert along.chance < 1e-6
    assert across.chance < 1e-6


def test_a_good_model_leaves_nothing_that_follows(solved) -> None:
    calibration, _, _ = solved
    assert {(one.residual, one.quantity) for one in calibration.causes} >= {
        ("heading", "yaw"),
        ("heading", "turn_rate"),
        ("along", "speed"),
        ("across", "turn_rate"),
    }
    assert all(one.chance > 1e-4 for one in calibration.causes)
    assert {one.measured for one in calibration.consistency} == {"fixes", "headings"}
    for one in calibration.consistency:
        assert 0.9 < one.inside < 0.99
    driven = sum(one.distance_m for one in calibration.manoeuvres)
    assert driven == pytest.approx(calibration.drive.distance_m, rel=0.03)


@pytest.mark.parametrize("dof", [1, 2])
def test_the_band_of_the_means(dof: int) -> None:
    rng = np.random.default_rng(dof)
    t_s = np.sort(rng.uniform(0.0, 480.0, 5000))
    nis = rng.chisquare(dof, t_s.size)
    accepted = rng.random(t_s.size) > 0.1
    found = in_stretches("fixes", t_s, nis, accepted, dof, (0.0, 480.0))
    assert found.t_s.size == STRETCHES
    for k in (0, 17, STRETCHES - 1):
        some = nis[accepted & (t_s >= 10.0 * k) & (t_s < 10.0 * (k + 1))]
        assert found.nis[k] == pytest.approx(some.mean() / dof)
        n = dof * some.size
        assert (found.low[k], found.high[k]) == pytest.approx(tuple(chi2.ppf((0.025, 0.975), n) / n))
    assert found.inside == pytest.approx(0.95, abs=0.01)
    assert np.mean((found.nis < found.low) | (found.nis > found.high)) < 0.2
    assert in_stretches("fixes", t_s, 4.0 * nis, accepted, dof, (0.0, 480.0)).inside < 0.75


def test_each_kind_of_driving_is_counted() -> None:
    """Speed and turn rate of seven stretches of 20 s, and what each must be called."""
    stretches = {
        "straight": (1.0, 0.0),
        "straight_back": (-0.5, 0.0),
        "arc_left": (0.8, 0.4),
        "arc_right": (-0.8, -0.4),
        "spin_left": (0.0, 0.7),
        "spin_right": (0.01, -0.7),
        "standing": (0.0, 0.0),
    }
    t_s = np.arange(0.0, 140.0001, 0.01)
    place = np.minimum((t_s[:-1] // 20.0).astype(int), 6)
    speed, turn = np.array(list(stretches.values())).T
    right = np.concatenate(([0.0], np.cumsum(0.01 * (speed + 0.4 * turn)[place]))) / 0.1
    left = np.concatenate(([0.0], np.cumsum(0.01 * (speed - 0.4 * turn)[place]))) / 0.1
    aligned = SimpleNamespace(wheel_t_s=t_s, right_rad=right, left_rad=left, span_s=(0.0, float(t_s[-1])))
    found = {one.kind: one for one in describe_manoeuvres(aligned, VALUES)}
    assert set(found) == set(stretches)
    for kind, (v, w) in stretches.items():
        assert found[kind].duration_s == pytest.approx(20.0, abs=1.0)
        assert found[kind].distance_m == pytest.approx(20.0 * abs(v), abs=0.6)
        assert found[kind].turned_rad == pytest.approx(20.0 * abs(w), abs=0.5)
        assert found[kind].speed_mps[1] == pytest.approx(abs(v) + 0.4 * abs(w), rel=0.05, abs=1e-9)
