"""Several runs of one vehicle as one problem: shared radii, track and effects, own poses, offsets and run effects.

Each run's pass leaves the posterior of what is shared with everything of its own marginalised; prior taken out, that is
the run's likelihood: precision Λ_i and vector η_i. Runs are independent given the shared constants, so the joint
posterior is Λ = Λ_0 + Σ Λ_i, η = Λ_0 m_0 + Σ η_i, the prior counted once. All runs are linearised again at the joint
answer until it stays.

Where runs disagree by more than their sigmas allow, something that the model lacks differs between them. The sigmas
then come from the runs' own scores u_i = η_i − Λ_i m (Liang and Zeger 1986, runs as clusters), if those are larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeGuard

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.calibration.extension import FreeEffects
from sccal.filter.forward import ForwardPass, numeric_limits
from sccal.filter.iterate import At, RunProblem, reported_covariance, reported_values
from sccal.filter.start import Constants

MAX_ROUNDS = 4
CLOSE_SIGMAS = 0.05


class Gaussian(Protocol):
    """What a run says of k shared parameters."""

    @property
    def precision(self) -> Floats:
        """(k, k)"""
        ...

    @property
    def vector(self) -> Floats:
        """(k,) precision times the best values."""
        ...


@dataclass(frozen=True)
class RunLikelihood:
    """What one run says of the shared parameters, its own ones marginalised, no prior of the shared ones in it."""

    precision: Floats
    """(k, k)"""
    vector: Floats
    """(k,) precision times the run's own best values."""
    path: ForwardPass
    values: Floats
    """(3 + m,) R_r, R_l, L and the effects' parameters as the run alone would have them, with its priors."""
    covariance: Floats
    """Of the same (3 + m, 3 + m)."""

    @classmethod
    def of(cls, problem: RunProblem, at: At, shared: Ints) -> RunLikelihood:
        """From a pass linearised there; shared are the places among R_r, R_l, L and the effects' parameters."""
        found = problem.begun(at, True).finish()
        theta = np.concatenate((at.constants.as_array(), at.values))
        learnt = np.r_[0:3, 4 : 4 + problem.extra]
        values = reported_values(found)[learnt]
        covariance = reported_covariance(found)[np.ix_(learnt, learnt)]
        # The run's own parameters keep their prior about zero: to first order, as in iterate.
        own = np.setdiff1d(np.arange(theta.size), shared)
        weight = np.zeros((theta.size, theta.size))
        weight[np.ix_(own, own)] = np.linalg.inv(problem.prior)[np.ix_(own, own)]
        values = values + covariance @ weight @ (problem.prior_mean - theta)
        posterior = np.linalg.inv(covariance[np.ix_(shared, shared)])
        prior = np.linalg.inv(problem.prior[np.ix_(shared, shared)])
        precision = posterior - prior
        vector = posterior @ values[shared] - prior @ theta[shared]
        return cls(0.5 * (precision + precision.T), vector, found, values, covariance)

    def own_given(self, mode: Floats, shared: Ints) -> Floats:
        """All values (3 + m,) with the shared ones at the joint answer and the run's own conditioned on it."""
        own = np.setdiff1d(np.arange(self.values.size), shared)
        theta = self.values.copy()
        theta[shared] = mode
        if own.size:
            gain = self.covariance[np.ix_(own, shared)] @ np.linalg.inv(self.covariance[np.ix_(shared, shared)])
            theta[own] += gain @ (mode - self.values[shared])
        return theta


@dataclass(frozen=True)
class JointFit:
    """The answer for all runs together."""

    mode: Floats
    """(k,) of the shared parameters: R_r, R_l, L, then the effects'."""
    covariance: Floats
    """(k, k) as the model has it."""
    robust: Floats
    """(k, k) with every sigma at least the runs' scatter; the same for one run."""
    each: tuple[Floats, ...]
    """Per run (3 + m,): the shared values, and its own given these."""
    runs: tuple[RunLikelihood, ...]
    chi2_per_dof: float | None
    """Disagreement of the runs about the shared parameters; None for one run."""


def is_free(extension: object) -> TypeGuard[FreeEffects]:
    """Whether an extension is made of effects."""
    return isinstance(extension, FreeEffects)


def shared_places(problem: RunProblem) -> Ints:
    """Places of the shared ones among R_r, R_l, L and the effects' parameters."""
    scopes = [one.scope for _, one in problem.extension.parameters] if is_free(problem.extension) else []
    return np.array([0, 1, 2, *(3 + k for k, scope in enumerate(scopes) if scope == "vehicle")], dtype=np.int64)


def fit_jointly(problems: Sequence[RunProblem], first: Sequence[At], max_rounds: int = MAX_ROUNDS) -> JointFit:
    """Posterior mode for all runs; first is where each starts: its own parameters, and the shared ones' median."""
    places = [shared_places(problem) for problem in problems]
    some = problems[0]
    shared = places[0]
    prior = np.asarray(np.linalg.inv(some.prior[np.ix_(shared, shared)]), dtype=np.float64)
    centre = np.median([problem.prior_mean[here] for problem, here in zip(problems, places, strict=True)], axis=0)
    lower, upper = numeric_limits(some.centre)
    own = [np.concatenate((at.constants.as_array(), at.values)) for at in first]
    paths = [at.path for at in first]
    at = np.asarray(np.median([theta[here] for theta, here in zip(own, places, strict=True)], axis=0))
    for _ in range(max_rounds):
        likelihoods = []
        for k, problem in enumerate(problems):
            theta = own[k].copy()
            theta[places[k]] = at
            likelihoods.append(RunLikelihood.of(problem, At(Constants.of(theta), theta[3:], paths[k]), places[k]))
            paths[k] = likelihoods[-1].path if problem.extra else None
        precision = prior + sum(one.precision for one in likelihoods)
        covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
        mode = covariance @ (prior @ centre + sum(one.vector for one in likelihoods))
        mode[:3] = np.clip(mode[:3], lower, upper)
        moved = np.abs(mode - at) / np.sqrt(np.diag(covariance))
        own_moved = 0.0
        for k, one in enumerate(likelihoods):
            given = one.own_given(mode, places[k])
            rest = np.setdiff1d(np.arange(given.size), places[k])
            if rest.size:
                sigma = np.sqrt(np.diag(one.covariance)[rest])
                own_moved = max(own_moved, float((np.abs(given - own[k])[rest] / sigma).max()))
            own[k] = given
        at = mode
        if max(float(moved.max()), own_moved) < CLOSE_SIGMAS:
            break
    robust = covariance
    if len(problems) > 1:
        robust = at_least(covariance, between_runs(likelihoods, at, covariance))
    return JointFit(at, covariance, robust, tuple(own), tuple(likelihoods), disagreement(likelihoods, at, prior))


def disagreement(likelihoods: Sequence[Gaussian], at: Floats, prior: Floats) -> float | None:
    """χ² of the runs' own answers around the joint one, per degree of freedom, over the directions they observe."""
    chi2, directions = 0.0, 0
    scale = np.sqrt(np.diag(prior))
    for one in likelihoods:
        score = (one.vector - one.precision @ at) / scale
        values, vectors = np.linalg.eigh(one.precision / np.outer(scale, scale))
        seen = values > 1.0
        chi2 += float(((vectors.T @ score)[seen] ** 2 / values[seen]).sum())
        directions += int(seen.sum())
    dof = directions - at.size
    return chi2 / dof if dof > 0 and len(likelihoods) > 1 else None


def between_runs(likelihoods: Sequence[Gaussian], at: Floats, covariance: Floats) -> Floats:
    """Covariance from the scatter of the runs' scores."""
    scores = np.array([one.vector - one.precision @ at for one in likelihoods])
    count = len(likelihoods)
    return np.asarray(covariance @ (scores.T @ scores) @ covariance * (count / (count - 1.0)))


def at_least(covariance: Floats, other: Floats) -> Floats:
    """The covariance with every sigma raised to the other's where that is larger, correlations kept."""
    sigma = np.sqrt(np.diag(covariance))
    raised = np.maximum(sigma, np.sqrt(np.maximum(np.diag(other), 0.0))) / sigma
    return np.asarray(covariance * np.outer(raised, raised))
