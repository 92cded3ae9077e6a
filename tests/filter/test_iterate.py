"""Where a pass starts is no part of the answer: its likelihood under the true prior, and the posterior mode."""

from __future__ import annotations

import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.filter.forward import ForwardPass
from sccal.filter.iterate import At, RunProblem, prior_shift_nats
from sccal.filter.layout import BASE_STATES
from sccal.filter.start import Constants


def normal_nll(residual: np.ndarray, covariance: np.ndarray) -> float:
    """Negative logarithm of a normal density."""
    _, log_determinant = np.linalg.slogdet(2.0 * np.pi * covariance)
    return float(0.5 * (log_determinant + residual @ np.linalg.solve(covariance, residual)))


class Linear:
    """z = H (θ, Ofs) + noise, θ of R_r, R_l, L and some effects: a run whose passes are exact."""

    def __init__(self, effects: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        k = 4 + effects
        self.H = rng.normal(size=(25, k))
        self.R = np.diag(rng.uniform(0.5, 2.0, 25))
        root = rng.normal(size=(k, k))
        self.P0 = root @ root.T + 0.1 * np.eye(k)
        # The offset is a state with a prior of its own, about zero wherever the constants start.
        self.P0[3, :] = self.P0[:, 3] = 0.0
        self.P0[3, 3] = 2.0
        self.learnt = np.r_[0:3, 4:k]
        self.mean = np.zeros(k)
        self.mean[self.learnt] = rng.normal(size=k - 1)
        self.z = self.H @ rng.normal(size=k) + rng.normal(size=25)

    def problem(self) -> SimpleNamespace:
        return SimpleNamespace(
            prior=self.P0[np.ix_(self.learnt, self.learnt)],
            prior_mean=self.mean[self.learnt],
            extra=self.learnt.size - 3,
        )

    def nll(self, about: np.ndarray) -> float:
        """Of the measurements under a prior with that mean."""
        return normal_nll(self.z - self.H @ about, self.H @ self.P0 @ self.H.T + self.R)

    def passed(self, about: np.ndarray) -> SimpleNamespace:
        """What the filter leaves that takes ``about`` for the prior's mean."""
        gain = self.P0 @ self.H.T @ np.linalg.inv(self.H @ self.P0 @ self.H.T + self.R)
        mean = about + gain @ (self.z - self.H @ about)
        covariance = self.P0 - gain @ self.H @ self.P0
        size = BASE_STATES + self.learnt.size - 3
        rows = np.r_[3:7, BASE_STATES:size]
        state, whole = np.zeros(size), np.eye(size)
        state[rows] = mean
        whole[np.ix_(rows, rows)] = covariance
        return SimpleNamespace(final_state=state, final_covariance=whole)


@settings(max_examples=60)
@given(st.integers(0, 6), st.integers(0, 10_000), st.floats(0.0, 3.0))
def test_the_likelihood_is_that_of_the_true_prior_wherever_a_pass_started(effects, seed, away):
    run = Linear(effects, seed)
    about = run.mean.copy()
    about[run.learnt] += away * np.random.default_rng(seed + 1).normal(size=run.learnt.size)
    theta = about[run.learnt]
    shift = prior_shift_nats(run.problem(), At(Constants.of(theta), theta[3:]), run.passed(about))
    assert run.nll(about) + shift == pytest.approx(run.nll(run.mean), abs=1e-6)


def test_a_pass_that_starts_at_the_priors_mean_needs_no_shift():
    run = Linear(2, 3)
    theta = run.mean[run.learnt]
    at = At(Constants.of(theta), theta[3:])
    assert prior_shift_nats(run.problem(), at, run.passed(run.mean)) == pytest.approx(0.0, abs=1e-12)


@settings(max_examples=40)
@given(st.integers(1, 6), st.integers(0, 10_000), st.sampled_from([0.1, 0.5]))
def test_a_pass_with_narrower_priors_is_made_whole_again(effects, seed, scale):
    """Mean, covariance and likelihood of the linear problem under its own prior, from those under a narrower one."""
    run = Linear(effects, seed)
    own = slice(4, 4 + effects)
    run.P0[own, :] = run.P0[:, own] = 0.0
    run.P0[own, own] = np.diag(np.random.default_rng(seed).uniform(0.2, 3.0, effects))
    narrow = copy.copy(run)
    narrow.P0 = run.P0.copy()
    narrow.P0[own, own] *= scale**2
    theta = run.mean[run.learnt]
    problem = replace(RunProblem(None, None, None, None, None))
    for name, value in {"prior": run.problem().prior, "prior_mean": theta}.items():
        problem.__dict__[name] = value
    problem.__dict__["extension"] = SimpleNamespace(prior_sigmas=np.ones(effects))
    left = narrow.passed(run.mean)
    empty = np.zeros(0)
    found = ForwardPass(None, empty, empty, left.final_state, left.final_covariance, *([empty] * 6), 0, 0.0, 0.0)
    whole = problem.with_whole_prior(At(Constants.of(theta), theta[3:]), found, scale)
    expected = run.passed(run.mean)
    rows = np.r_[3:7, BASE_STATES : expected.final_state.size]
    np.testing.assert_allclose(whole.final_state[rows], expected.final_state[rows], rtol=1e-6, atol=1e-8)
    wanted = expected.final_covariance[np.ix_(rows, rows)]
    np.testing.assert_allclose(whole.final_covariance[np.ix_(rows, rows)], wanted, rtol=1e-6, atol=1e-8)
    assert narrow.nll(run.mean) + whole.nll_prior == pytest.approx(run.nll(run.mean), abs=1e-6)
    assert whole.prior_scale == scale
