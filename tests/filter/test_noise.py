"""The noise of a log: the way down is found, the prior is looked at everywhere, and the truth is never likelier."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.filter.levels import Levels
from sccal.filter.noise import POINTS, SPREAD, Look, Search, descend, estimate_noise
from sccal.filter.options import FilterOptions
from sccal.filter.start import coarse_constants, find_start
from tests.filter.logs import TrueNoise, aligned

FAR = np.full(7, 50.0)
HEADING_HZ = 5.0
LOGS = {
    "circle": TrueNoise(0.15, 0.4, 15.0, 0.01, 0.02, 60.0, 0.003),
    "general": TrueNoise(0.4, 1.2, 30.0, 0.03, 0.01, 40.0, 0.006),
    "rectangle": TrueNoise(0.1, 0.3, 10.0, 0.006, 0.04, 100.0, 0.0015),
    "rows": TrueNoise(0.3, 0.8, 20.0, 0.02, 0.006, 25.0, 0.01),
}
"""By path: an AHRS good or poor, fixes that scatter or wander, wheels that slip little or much."""

# The way down


def looked(function, signs):
    """As ``descend`` wants it, and how often it was asked."""
    asked = []

    def look(points):
        asked.extend(points)
        return [Look(float(function(point)), signs(point)) for point in points]

    return look, asked


@settings(max_examples=60)
@given(st.integers(1, 7), st.integers(0, 10_000), st.floats(0.0, 4.0))
def test_the_least_of_levels_that_the_log_shows_unevenly_is_found(size, seed, log_condition):
    """Some are shown by thousands of readings, some are held by the prior alone, and neighbours hang together."""
    rng = np.random.default_rng(seed)
    sigma = 10.0 ** (-0.5 * rng.uniform(0.0, log_condition, size))
    root = (np.eye(size) + 0.5 * rng.uniform(-1.0, 1.0) * np.eye(size, k=1)) / sigma
    least = rng.uniform(-1.5, 1.5, size)
    look, asked = looked(lambda x: 0.5 * ((root @ (x - least)) ** 2).sum(), lambda x: root @ x)
    found = descend(look, np.zeros(size), -FAR[:size], FAR[:size])
    assert look([found])[0].cost < 0.5
    assert len(asked) < 6 * (size + 1)


@settings(max_examples=40)
@given(st.integers(2, 7), st.integers(0, 10_000))
def test_it_never_ends_higher_than_it_began_and_never_outside(size, seed):
    """Even where the curvature that is expected is not the one there is, and there are several hills."""
    rng = np.random.default_rng(seed)
    low, high = -rng.uniform(0.5, 2.0, size), rng.uniform(0.5, 2.0, size)
    least = rng.uniform(-3.0, 3.0, size)
    weights = 10.0 ** rng.uniform(0.0, 3.0, size)
    start = rng.uniform(low, high)
    look, asked = looked(
        lambda x: (weights * (x - least) ** 2).sum() + np.sin(5.0 * x).sum(), lambda x: np.sqrt(weights) * x
    )
    found = descend(look, start, low, high)
    assert look([found])[0].cost <= look([start])[0].cost
    assert np.all((found >= low) & (found <= high))
    reached = np.array(asked)
    assert np.all((reached >= low - 1e-9) & (reached <= high + 1e-9))


@settings(max_examples=30)
@given(st.integers(2, 6), st.integers(0, 10_000))
def test_a_least_at_a_bound_is_found_there(size, seed):
    """One level wants to vanish (fixes that do not wander); the others are found beside it all the same."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size)) / np.sqrt(size)
    curvature = 30.0 * (root @ root.T + 0.1 * np.eye(size))
    factor = np.linalg.cholesky(curvature).T
    low, high = np.full(size, -2.0), np.full(size, 2.0)
    least = rng.uniform(-1.0, 1.0, size)
    least[0] = -4.0
    look, _ = looked(lambda x: 0.5 * (x - least) @ curvature @ (x - least), lambda x: factor @ x)
    found = descend(look, np.zeros(size), low, high)
    rest = np.arange(1, size)
    given_the_bound = least.copy()
    given_the_bound[0] = -2.0
    given_the_bound[rest] += np.linalg.solve(curvature[np.ix_(rest, rest)], -2.0 * curvature[rest, 0])
    if np.all(np.abs(given_the_bound) <= 2.0):
        assert look([found])[0].cost < look([given_the_bound])[0].cost + 0.5


def test_the_curvature_that_innovations_promise_is_that_of_the_cost(search):
    """Fisher's information is what second differences of the negative log-likelihood are on average."""
    log = search.aligned
    noise, at = estimate_noise(log, search.start, FilterOptions(), HEADING_HZ)
    _, events = search.timelines(HEADING_HZ)
    here, logs = search.about(events, at), search.levels.logs(noise)
    step = 0.05 * np.eye(7)
    looks = {sign: [here.look(logs + sign * one) for one in step] for sign in (-1, 1)}
    found = [(b.cost - 2.0 * here.cost(logs) + a.cost) / 0.05**2 for a, b in zip(looks[-1], looks[1], strict=True)]
    expected = [np.nansum((b.signs - a.signs) ** 2) / 0.1**2 for a, b in zip(looks[-1], looks[1], strict=True)]
    shown = [0, 1, 4, 6]
    np.testing.assert_allclose(np.array(expected)[shown], np.array(found)[shown], rtol=0.35)


# Where it is looked


@pytest.fixture(scope="module")
def search():
    log = aligned("circle", LOGS["circle"], 1)
    return Search(log, find_start(log), FilterOptions(soft_gate=True))


def test_points_leave_no_large_hole_in_the_prior(search):
    levels = search.levels
    points = np.array(search.points())
    assert points.shape == (POINTS, 7)
    spread = (points - levels.centre) / (SPREAD * levels.width)
    within = (points > levels.low + 1e-9) & (points < levels.high - 1e-9)
    for level in range(7):
        values = np.sort(spread[within[:, level], level])
        assert values[0] < -1.0 or not within[:, level].all()
        assert values[-1] > 1.5
        middle = values[np.abs(values) < 1.5]
        assert np.diff(middle).max() < 0.25
    # Any point of the prior has one of them nearer than random ones would be.
    drawn = np.random.default_rng(0).normal(size=(400, 7)) / SPREAD
    inside = np.clip(levels.centre + SPREAD * levels.width * drawn, levels.low, levels.high)
    apart = ((inside[:, None, :] - points[None]) / levels.width) ** 2
    assert np.sqrt(apart.sum(axis=2)).min(axis=1).max() < 5.5


def test_the_first_points_are_spread_as_the_rest(search):
    levels = search.levels
    few = (np.array(search.points()[:24]) - levels.centre) / levels.width
    assert np.all(np.abs(few.mean(axis=0)) < 0.5)
    assert np.all(few.std(axis=0) > 0.7)


def test_levels_and_their_logarithms_are_one():
    levels = Levels.of(0.015, 0.0, True)
    logs = levels.centre + 0.3 * levels.width
    assert levels.logs(levels.noise(logs)) == pytest.approx(logs)
    assert levels.free.all()
    assert Levels.of(0.015, 0.0, False).free.sum() == 5
    assert levels.price(levels.centre) == 0.0
    assert levels.price(levels.centre + levels.width) == pytest.approx(3.5)
    wild = levels.noise(levels.high + 5.0)
    assert np.all(levels.logs(wild) <= levels.high)


# The law


@pytest.mark.parametrize("path", LOGS)
def test_what_is_found_is_as_likely_as_the_truth(path):
    """On the same events, constants settled to either: a search that ends lower has found the wrong hill."""
    log, true = aligned(path, LOGS[path], 1), LOGS[path]
    start = find_start(log)
    found, _ = estimate_noise(log, start, FilterOptions(), HEADING_HZ)
    assert found.apart_nats < 1.0
    search = Search(log, start, FilterOptions(soft_gate=True))
    _, events = search.timelines(HEADING_HZ)
    truth = replace(
        found,
        heading_white_rad=np.radians(true.white_deg),
        heading_coloured_rad=np.radians(true.slow_deg),
        heading_tau_s=true.slow_s,
        fix_scale=true.fix_white_m / search.fix_sigma_m,
        fix_coloured_m=true.fix_slow_m,
        fix_tau_s=true.fix_slow_s,
        slip_m_per_sqrt_m=true.slip,
    )
    rough = search.problem(events, search.levels.centre).at_centre(coarse_constants(log, start))
    costs = []
    for noise in (found, truth):
        logs, here = search.levels.logs(noise), search.about(events, rough)
        for _ in range(2):
            cost, here = search.settled(logs, here)
        costs.append(cost)
    assert costs[0] <= costs[1] + 1.0
