"""Random numbers that belong to times."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.randomness import gauss_markov_at, normals_at, time_keys, uniforms_at


def test_numbers_belong_to_their_keys() -> None:
    keys = np.arange(5000)
    whole = normals_at(1, "a", keys)
    np.testing.assert_array_equal(whole[::7][::-1], normals_at(1, "a", keys[::7][::-1]))
    for other in (normals_at(2, "a", keys), normals_at(1, "b", keys)):
        assert abs(np.corrcoef(whole[:, 0], other[:, 0])[0, 1]) < 0.05


def test_they_are_normal_independent_and_even() -> None:
    keys = time_keys(np.arange(200_000) * 0.1)
    normals = normals_at(5, "a", keys)
    assert normals.mean(axis=0) == pytest.approx([0, 0], abs=0.01)
    assert np.cov(normals.T) == pytest.approx(np.eye(2), abs=0.02)
    assert (np.abs(normals) > 1.959964).mean() == pytest.approx(0.05, abs=0.002)
    for lag in (1, 2, 10):
        assert abs(np.mean(normals[lag:] * normals[:-lag])) < 0.01
    even = uniforms_at(5, "b", keys)
    assert (even > 0).all()
    assert (even < 1).all()
    np.testing.assert_allclose(np.histogram(even, 10, (0, 1))[0] / even.size, 0.1, atol=0.005)


@settings(max_examples=25)
@given(st.floats(0.01, 1000), st.floats(0, 2e9), st.integers(0, 99), st.floats(0.01, 5))
def test_a_subset_of_the_times_gets_the_same_values(tau_s: float, start_s: float, seed: int, step_s: float) -> None:
    t_s = start_s + step_s * np.arange(60)
    chosen = np.random.default_rng(seed).permutation(60)[:25]
    whole = gauss_markov_at(seed, "a", t_s, tau_s)
    np.testing.assert_allclose(gauss_markov_at(seed, "a", t_s[chosen], tau_s), whole[chosen], atol=1e-6)


@pytest.mark.parametrize("step_s", [0.1, 0.013, 1.0])
def test_the_process_has_the_correlation_asked_for(step_s: float) -> None:
    values = gauss_markov_at(1, "a", 1e9 + step_s * np.arange(round(40_000 / max(step_s, 0.1))), 5 * step_s)
    assert values.std(axis=0) == pytest.approx([1, 1], abs=0.06)
    for lag in (1, 5):
        found = (values[lag:] * values[:-lag]).mean(axis=0) / values.var(axis=0)
        assert found == pytest.approx([np.exp(-lag / 5)] * 2, abs=0.04)


def test_stamps_far_apart_cost_nothing() -> None:
    t_s = np.concatenate((np.arange(100) * 0.1, [1e9, 5e17]))
    np.testing.assert_allclose(gauss_markov_at(0, "a", t_s, 30.0)[:100], gauss_markov_at(0, "a", t_s[:100], 30.0))


def test_times_name_keys_without_their_date() -> None:
    t_s = np.array([0.0, 0.1, 86399.99996, 86400.1, np.nan])
    assert time_keys(t_s).tolist() == [0, 1000, 0, 1000, 0]
