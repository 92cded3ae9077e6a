"""A belief held in two stages is the belief of one state: joined and split without loss."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.filter.layout import BASE_STATES, Belief


def random_covariance(size: int, seed: int) -> np.ndarray:
    """Positive, correlated, and of units that differ by many powers of ten."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size)) * 10.0 ** rng.uniform(-3.0, 1.0, size)[:, None]
    return root @ root.T


def empty(parameters: int) -> Belief:
    n, m = BASE_STATES, parameters
    return Belief(np.arange(float(n)), np.arange(float(m)), np.zeros((n, n)), np.zeros((n, m)), np.zeros((m, m)))


@settings(max_examples=60)
@given(st.integers(0, 12), st.integers(0, 10_000))
def test_split_and_joined_again_is_the_same(parameters, seed):
    covariance = random_covariance(BASE_STATES + parameters, seed)
    belief = empty(parameters).begun(covariance)
    sigma = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(
        belief.covariance() / np.outer(sigma, sigma), covariance / np.outer(sigma, sigma), atol=1e-7
    )
    assert np.array_equal(belief.x, np.arange(float(BASE_STATES)))
    assert np.array_equal(belief.p, np.arange(float(parameters)))


@settings(max_examples=60)
@given(st.integers(1, 8), st.integers(0, 10_000))
def test_the_core_is_what_is_left_when_the_parameters_are_known(parameters, seed):
    covariance = random_covariance(BASE_STATES + parameters, seed)
    belief = empty(parameters).begun(covariance)
    given_them = np.linalg.inv(np.linalg.inv(covariance)[:BASE_STATES, :BASE_STATES])
    sigma = np.sqrt(np.diag(given_them))
    np.testing.assert_allclose(belief.core / np.outer(sigma, sigma), given_them / np.outer(sigma, sigma), atol=1e-4)


def test_parameters_without_variance_are_held():
    covariance = random_covariance(BASE_STATES + 3, 4)
    covariance[-1, :] = covariance[:, -1] = 0.0
    belief = empty(3).begun(covariance)
    np.testing.assert_allclose(belief.covariance(), covariance, rtol=1e-9, atol=1e-9 * covariance.max())
    assert np.all(belief.slope[:, -1] == 0.0)


def test_a_copy_lives_its_own_life():
    belief = empty(2).begun(random_covariance(BASE_STATES + 2, 1))
    copy = belief.copied()
    for part in copy:
        part += 1.0
    for before, after in zip(belief, copy, strict=True):
        assert np.all(after == before + 1.0)
