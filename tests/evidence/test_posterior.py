"""The evidence of every subset, against marginal likelihoods computed one by one."""

from __future__ import annotations

import copy
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.evidence.posterior import CONSTANTS, WIDTHS, Posterior


class Problem:
    """y = A c + B p + e with e of variance one, c the constants and p effects of one to three parameters, prior one."""

    def __init__(self, effects: int, seed: int, size: float = 0.5, data: int = 30, alike: float = 0.0) -> None:
        rng = np.random.default_rng(seed)
        self.counts = rng.integers(1, 4, effects)
        total = int(self.counts.sum())
        self.A = rng.normal(size=(data, CONSTANTS))
        common = rng.normal(size=(data, 1))
        self.B = np.sqrt(1.0 - alike**2) * rng.normal(size=(data, total)) + alike * common
        self.core = np.diag(rng.uniform(0.5, 3.0, CONSTANTS))
        there = np.repeat(rng.random(effects) < 0.4, self.counts)
        self.y = self.A @ rng.normal(size=CONSTANTS) + self.B @ (size * there * rng.normal(size=total))
        self.y = self.y + rng.normal(size=data)
        ends = CONSTANTS + np.concatenate(([0], np.cumsum(self.counts)))
        self.rows = {f"e{k}": np.arange(ends[k], ends[k + 1]) for k in range(effects)}

    @property
    def names(self) -> list[str]:
        return list(self.rows)

    def columns(self, kept) -> np.ndarray:
        places = np.concatenate([np.zeros(0, int), *(self.rows[name] for name in kept)]).astype(int)
        return self.B[:, places - CONSTANTS]

    def log_likelihood(self, kept) -> float:
        """Of the data, everything kept marginalised."""
        B = self.columns(kept)
        covariance = np.eye(self.y.size) + self.A @ self.core @ self.A.T + B @ B.T
        _, log_determinant = np.linalg.slogdet(covariance)
        return float(-0.5 * (log_determinant + self.y @ np.linalg.solve(covariance, self.y)))

    def posterior(self, price: float = 0.0) -> Posterior:
        """Everything free."""
        X = np.hstack((self.A, self.B))
        precision = X.T @ X + np.diag(np.concatenate((1.0 / np.diag(self.core), np.ones(self.B.shape[1]))))
        covariance = np.linalg.inv(precision)
        mean = covariance @ (X.T @ self.y)
        return Posterior(self.rows, mean, covariance, np.ones(mean.size), dict.fromkeys(self.rows, price))

    def every_subset(self):
        return [kept for k in range(len(self.names) + 1) for kept in combinations(self.names, k)]


@settings(max_examples=40)
@given(st.integers(1, 5), st.integers(0, 10_000), st.floats(0.0, 0.9))
def test_the_evidence_is_the_difference_of_the_marginal_likelihoods(effects, seed, alike):
    problem = Problem(effects, seed, alike=alike)
    posterior, none = problem.posterior(), problem.log_likelihood(())
    for kept in problem.every_subset():
        assert posterior.evidence(kept) == pytest.approx(problem.log_likelihood(kept) - none, abs=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_a_mixture_of_widths_is_the_mean_of_the_marginal_likelihoods(seed):
    """For one effect beside others that keep their widest prior."""
    problem = Problem(3, seed, size=0.3)
    whole = problem.posterior()
    mixed = replace(whole, widths={"e1": (0.01, 5.0)})
    for kept in (("e1",), ("e0", "e1"), ("e0", "e1", "e2")):
        likelihoods = []
        for width in np.geomspace(0.01, 5.0, WIDTHS):
            scaled = copy.copy(problem)
            scaled.B = problem.B.copy()
            scaled.B[:, problem.rows["e1"] - CONSTANTS] *= width
            likelihoods.append(scaled.log_likelihood(kept))
        expected = np.logaddexp.reduce(likelihoods) - np.log(WIDTHS) - problem.log_likelihood(())
        assert mixed.evidence(kept) == pytest.approx(expected, abs=1e-6)


def test_every_kept_effect_costs_its_price():
    problem = Problem(4, 1)
    free, dear = problem.posterior(), problem.posterior(3.0)
    for kept in problem.every_subset():
        assert dear.evidence(kept) == pytest.approx(free.evidence(kept) - 3.0 * len(kept))


@settings(max_examples=30)
@given(st.integers(1, 5), st.integers(0, 10_000))
def test_values_given_that_the_rest_is_zero_are_those_of_the_smaller_problem(effects, seed):
    problem = Problem(effects, seed)
    posterior = problem.posterior()
    for kept in problem.every_subset():
        X = np.hstack((problem.A, problem.columns(kept)))
        prior = np.concatenate((1.0 / np.diag(problem.core), np.ones(X.shape[1] - CONSTANTS)))
        covariance = np.linalg.inv(X.T @ X + np.diag(prior))
        mean, found = posterior.given(kept)
        np.testing.assert_allclose(mean, covariance @ X.T @ problem.y, atol=1e-8)
        np.testing.assert_allclose(found, covariance, atol=1e-8)


@settings(max_examples=25, derandomize=True)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.5, 0.9]), st.floats(0.0, 6.0))
def test_the_subset_of_most_evidence_is_found_among_all(seed, alike, price):
    """By brute force over the subsets of eight, effects that look much alike among them."""
    problem = Problem(8, seed, size=1.0, alike=alike)
    posterior = problem.posterior(price)
    best = max(posterior.evidence(kept) for kept in problem.every_subset())
    assert posterior.evidence(posterior.select()) == pytest.approx(best, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_found_wherever_the_climb_begins(seed):
    problem = Problem(6, seed, size=1.0)
    posterior = problem.posterior(1.0)
    for first in ((), problem.names[:2], problem.names):
        assert sorted(posterior.select(first)) == sorted(posterior.select())


def test_gain_and_worth_are_one_step_up_and_down():
    problem = Problem(4, 7, size=1.0)
    posterior = problem.posterior(2.0)
    kept = ["e0", "e2"]
    assert posterior.gain("e1", kept) == pytest.approx(posterior.worth("e1", [*kept, "e1"]))
    assert posterior.gain("e1", kept) == pytest.approx(posterior.evidence([*kept, "e1"]) - posterior.evidence(kept))


def test_what_the_data_do_not_show_costs_nothing_and_brings_nothing():
    """A column of zeros: prior and posterior are one, and only the price is left."""
    problem = Problem(3, 2)
    problem.B[:, problem.rows["e1"] - CONSTANTS] = 0.0
    posterior = problem.posterior(3.0)
    assert posterior.gain("e1", []) == pytest.approx(-3.0, abs=1e-9)
    assert "e1" not in posterior.select()


@pytest.mark.parametrize("seed", range(4))
def test_a_copy_of_a_cause_shares_its_evidence_and_only_one_is_kept(seed):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(200, 1))
    problem = Problem(2, seed, data=200)
    problem.B = np.hstack((x, x))
    problem.rows = {"cause": np.array([3]), "copy": np.array([4])}
    problem.y = 0.8 * x[:, 0] + rng.normal(size=200)
    posterior = problem.posterior(3.0)
    assert posterior.evidence(["cause"]) == pytest.approx(posterior.evidence(["copy"]), abs=1e-6)
    assert len(posterior.select()) == 1
    assert posterior.gain("copy", ["cause"]) < -2.0
