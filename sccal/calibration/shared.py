"""Radii and track of one vehicle from what each of its runs says of them, without the runs themselves in memory.

The joint fit of ``joint`` for runs without effects. A run is linearised at its own answer; that is as good as at the
joint one while both are close, by the run's own sigmas. Runs that are further off have to be linearised again there,
by whoever has them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.evidence.joint import RunLikelihood, at_least, between_runs, disagreement
from sccal.filter.forward import numeric_limits
from sccal.filter.iterate import At, RunProblem
from sccal.filter.layout import CONSTANTS
from sccal.filter.start import Constants
from sccal.results.calibration import Calibration

FAR_SIGMAS = 3.0
STAYED_SIGMAS = 0.05
MAX_ROUNDS = 4


@dataclass(frozen=True)
class SharedLikelihood:
    """What one run says of R_r, R_l and L (m), everything else of it marginalised."""

    precision: Floats
    """(3, 3)"""
    vector: Floats
    """(3,) precision times the run's best values."""
    covariance: Floats
    """(3, 3) as the run alone has it, with its prior."""
    prior: Floats
    """(3, 3) covariance of the prior, which is not in the precision."""
    prior_mean: Floats
    """(3,)"""
    at: Floats
    """(3,) where the run was linearised."""

    @classmethod
    def of(cls, problem: RunProblem, at: Floats) -> SharedLikelihood:
        """Of a run without effects, linearised at R_r, R_l and L."""
        found = RunLikelihood.of(problem, At(Constants.of(at), np.zeros(0)))
        covariance = found.path.final_covariance[CONSTANTS, CONSTANTS]
        return cls(found.precision, found.vector, covariance, problem.prior, problem.prior_mean, at)


@dataclass(frozen=True)
class SharedFit:
    """The answer for all runs together."""

    mode: Floats
    """(3,)"""
    covariance: Floats
    """(3, 3) as the model has it."""
    robust: Floats
    """(3, 3) with every sigma at least the runs' scatter."""
    chi2_per_dof: float | None
    """Disagreement of the runs; None for one."""


def own_answer(run: Calibration) -> Floats:
    """R_r, R_l and L (3,) of one run, in metres."""
    p = run.parameters
    return np.array([p.radius_right_m.value, p.radius_left_m.value, p.track_m.value])


def pooled(runs: Sequence[SharedLikelihood]) -> SharedFit:
    """Posterior mode and covariance of all runs, the prior counted once."""
    prior = np.asarray(np.linalg.inv(runs[0].prior), dtype=np.float64)
    centre = np.median([one.prior_mean for one in runs], axis=0)
    precision = prior + sum(one.precision for one in runs)
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    mode = covariance @ (prior @ centre + sum(one.vector for one in runs))
    mode = np.clip(mode, *numeric_limits(Constants.of(runs[0].prior_mean)))
    robust = at_least(covariance, between_runs(runs, mode, covariance)) if len(runs) > 1 else covariance
    return SharedFit(mode, covariance, robust, disagreement(runs, mode, prior))


def far_off(runs: Sequence[SharedLikelihood], fit: SharedFit) -> list[int]:
    """Places of the runs whose linearisation stands further from the joint answer than FAR_SIGMAS of their own."""
    apart = [one.at - fit.mode for one in runs]
    distances = [np.sqrt(d @ np.linalg.solve(one.covariance, d)) for d, one in zip(apart, runs, strict=True)]
    return [place for place, distance in enumerate(distances) if not distance <= FAR_SIGMAS]


def stayed(before: SharedFit, after: SharedFit) -> bool:
    """Whether linearising again moved the joint answer by less than STAYED_SIGMAS."""
    moved = np.abs(after.mode - before.mode) / np.sqrt(np.diag(after.covariance))
    return bool(moved.max() < STAYED_SIGMAS)
