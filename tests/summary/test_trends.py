"""Changes are found where they are, and hardly ever where they are not."""

import numpy as np
import pytest
from scipy import stats

from sccal.summary.charts import on_one_turn_deg, scatter_between, set_aside, weighted_median
from sccal.summary.trends import ALARM, best_trend, between_runs, significant


def stable(rng, count, kind):
    """Values of a parameter that does not change, and what the runs say of their sigmas."""
    if kind == "unequal sigmas":
        sigma = np.exp(rng.normal(0.0, 0.8, count))
        return sigma * rng.normal(size=count), sigma
    if kind == "scatter beyond sigmas":
        sigma = np.exp(rng.normal(0.0, 0.8, count))
        return sigma * rng.normal(size=count) + 3.0 * rng.normal(size=count), sigma
    if kind == "sigmas three times too small":
        sigma = np.exp(rng.normal(0.0, 0.5, count))
        return 3.0 * sigma * rng.normal(size=count), sigma
    sigma = np.ones(count)
    value = rng.normal(size=count)
    if kind == "one bad run":
        value[rng.integers(count)] += 15.0
    return value, sigma


KINDS = ("honest", "unequal sigmas", "scatter beyond sigmas", "sigmas three times too small", "one bad run")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [6, 14, 40])
def test_a_stable_fleet_gets_no_sentence(kind, count):
    rng = np.random.default_rng([count, KINDS.index(kind)])
    fleets = 60
    alarms = 0
    for _ in range(fleets):
        at = np.sort(rng.uniform(0.0, 60.0, count))
        chances = []
        for _ in range(4):
            value, sigma = stable(rng, count, kind)
            used = ~set_aside(value, sigma, scatter_between(value, sigma))
            chances.append(best_trend(at[used], value[used], sigma[used], True).p_value)
        alarms += significant(chances).any()
    # One of 60 happens by chance in half of all such tests at 1 %, three in one of forty thousand.
    assert alarms <= 2


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("shape", "of_time"),
    [
        ("drift", lambda u: u),
        ("step", lambda u: (u > 0.55) * 1.0),
        ("onset", lambda u: np.maximum(0.0, u - 0.5) / 0.5),
    ],
)
def test_a_change_is_found_with_its_size_sign_and_place(shape, of_time, sign):
    rng = np.random.default_rng(4)
    found = []
    errors = []
    for _ in range(40):
        at = np.linspace(0.0, 60.0, 24)
        sigma = rng.uniform(0.5, 1.5, 24)
        value = 100.0 + 8.0 * sign * of_time(at / 60.0) + sigma * rng.normal(size=24)
        trend = best_trend(at, value, sigma, True)
        found.append(trend.shape == shape and trend.p_value < ALARM / 4)
        if trend.shape == shape:
            errors.append((trend.change - 8.0 * sign) / trend.sigma)
            if shape == "step":
                assert abs(at[trend.after] - 33.0) < 8.0
            if shape == "onset":
                assert abs(at[trend.before] - 30.0) < 16.0
            if shape == "drift":
                assert (trend.before, trend.after, trend.days) == (0, 23, 60.0)
    assert np.mean(found) > 0.8
    assert 0.6 < np.std(errors) < 1.8
    assert abs(np.mean(errors)) < 1.0


def test_a_straight_drift_is_judged_as_textbook_regression_judges_it():
    rng = np.random.default_rng(8)
    at = np.arange(15.0)
    value = 5.0 * rng.normal(size=15) + 2.0 * at
    line = stats.linregress(at, value)
    trend = best_trend(at, value, np.full(15, 1e-3), True)
    assert trend.shape == "drift"
    assert trend.change == pytest.approx(14.0 * line.slope, rel=1e-3)
    assert trend.sigma == pytest.approx(14.0 * line.stderr, rel=1e-2)


def test_one_bad_run_does_not_hide_a_drift():
    rng = np.random.default_rng(3)
    at = np.linspace(0.0, 60.0, 20)
    value, sigma = 10.0 * at / 60.0 + rng.normal(size=20), np.ones(20)
    value[7] += 40.0
    aside = set_aside(value, sigma, scatter_between(value, sigma))
    assert np.flatnonzero(aside).tolist() == [7]
    assert best_trend(at[~aside], value[~aside], sigma[~aside], True).p_value < 1e-4


def test_one_late_run_far_off_is_no_trend():
    at = np.array([0.3, 28.4, 30.0, 30.1, 33.7, 49.3])
    value = np.array([-0.4, -1.1, -0.8, -0.8, 1.0, 15.8])
    assert best_trend(at, value, np.ones(6), True).p_value == 1.0


def test_a_step_sets_no_run_aside():
    rng = np.random.default_rng(5)
    value = rng.normal(size=30) + 50.0 * (np.arange(30) > 11)
    assert not set_aside(value, np.ones(30), scatter_between(value, np.ones(30))).any()


def test_too_few_runs_or_no_time_between_them_have_no_trend():
    four, same = np.arange(4.0), np.zeros(9)
    assert best_trend(four, four, np.full(4, 0.01), True) is None
    assert best_trend(same, np.arange(9.0), np.full(9, 0.01), True) is None


def test_units_do_not_matter():
    rng = np.random.default_rng(2)
    at, value, sigma = np.arange(12.0), rng.normal(size=12) + np.arange(12.0), rng.uniform(0.5, 1.0, 12)
    one = best_trend(at, value, sigma, True)
    other = best_trend(at, 1e-6 * value, 1e-6 * sigma, True)
    assert (one.shape, one.before) == (other.shape, other.before)
    assert other.p_value == pytest.approx(one.p_value)
    assert 1e6 * other.change == pytest.approx(one.change)


def test_false_discoveries_are_held_as_scipy_holds_them():
    rng = np.random.default_rng(1)
    for _ in range(50):
        p = rng.uniform(size=rng.integers(1, 30)) ** 4
        assert significant(p, 0.05).tolist() == (stats.false_discovery_control(p) <= 0.05).tolist()
    assert significant([]).size == 0


def test_the_scatter_between_runs_is_found_and_is_zero_where_sigmas_explain_it():
    rng = np.random.default_rng(6)
    sigma = rng.uniform(0.5, 2.0, 20_000)
    own = sigma * rng.normal(size=20_000)
    more = own + 3.0 * rng.normal(size=20_000)
    assert scatter_between(more, sigma) == pytest.approx(3.0, rel=0.05)
    assert np.sqrt(between_runs(more, sigma)) == pytest.approx(3.0, rel=0.05)
    assert scatter_between(own, 1.1 * sigma) == 0.0
    drifting = more + 0.001 * np.arange(20_000)
    assert scatter_between(drifting, sigma) == pytest.approx(3.0, rel=0.05)


def test_a_weighted_median_is_that_of_repeated_values():
    rng = np.random.default_rng(7)
    for _ in range(50):
        value = rng.normal(size=rng.integers(1, 12))
        weight = rng.integers(1, 5, len(value))
        assert weighted_median(value, weight.astype(float)) == pytest.approx(np.median(np.repeat(value, weight)))


def test_directions_stand_on_one_turn():
    turned = on_one_turn_deg(np.array([179.0, -179.0, 178.0]))
    assert np.ptp(turned) == pytest.approx(3.0)
    assert np.allclose(np.cos(np.radians(turned - [179.0, -179.0, 178.0])), 1.0)
