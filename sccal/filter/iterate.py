"""The constants as the maximum of the posterior: passes that start and linearise at their own answer.

A forward pass linearises at whatever it believes on the way. For the final values the pass is repeated with start and
derivatives *at* the estimate, and the prior carried as what it is: a Gauss-Newton iteration whose fixed point is the
posterior mode (as in the iterated Kalman filter, Bell and Cathey 1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sccal.align import Aligned, Timeline, clear_steps
from sccal.arrays import Floats
from sccal.filter.columns import kernel_columns
from sccal.filter.forward import Filter, ForwardPass, Noise, numeric_limits, prior_covariance
from sccal.filter.layout import BASE_STATES, Columns
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start, first_constants

MAX_ROUNDS = 6
CLOSE_SIGMAS = 0.05
SAME_RATIO = 1e-4
"""R_r/R_l known so well leaves less turn in a straight line than slip does."""


@dataclass(frozen=True)
class At:
    """Where a pass starts and linearises."""

    constants: Constants
    values: Floats
    """Of the extension's parameters (m,)."""
    path: ForwardPass | None = None
    """An earlier pass, for what depends on where the robot was; None: the wheels along the AHRS yaw."""


class Extension(Protocol):
    """Parameters beyond the paper's, supplied by a room that knows effects; the filter knows columns only."""

    @property
    def prior_sigmas(self) -> Floats:
        """(m,) about zero."""
        ...

    def columns(self, problem: RunProblem, at: At, clear: tuple[Floats, Floats]) -> Columns:
        """The kernel's columns for the problem's timeline; clear as from RunProblem.clear_steps."""
        ...


@dataclass(frozen=True)
class RunProblem:
    """One run prepared for filtering: what passes over it need, wherever they start from."""

    aligned: Aligned
    timeline: Timeline
    start: Start
    noise: Noise
    options: FilterOptions
    extension: Extension | None = None

    @property
    def centre(self) -> Constants:
        """The middle of the constants' priors."""
        return first_constants(self.aligned, self.start)

    @property
    def prior_mean(self) -> Floats:
        """(3 + m,) R_r, R_l, L and the extension's parameters."""
        return np.concatenate((self.centre.as_array(), np.zeros(self.extra)))

    @property
    def prior(self) -> Floats:
        """Covariance of the same (3 + m, 3 + m)."""
        covariance = np.zeros((3 + self.extra, 3 + self.extra))
        covariance[:3, :3] = prior_covariance(self.centre, self.options)
        if self.extension is not None:
            covariance[3:, 3:] = np.diag(self.extension.prior_sigmas**2)
        return covariance

    @property
    def extra(self) -> int:
        """Number of parameters beyond the paper's."""
        return 0 if self.extension is None else self.extension.prior_sigmas.size

    def at_centre(self, constants: Constants | None = None) -> At:
        """The extension's parameters at zero."""
        return At(self.centre if constants is None else constants, np.zeros(self.extra))

    def clear_steps(self, constants: Constants) -> tuple[Floats, Floats]:
        """The wheels' motion freed of slip, given the ratio of the radii."""
        return clear_steps(self.aligned, self.timeline, constants.radius_right_m / constants.radius_left_m)

    def columns(self, at: At, clear: tuple[Floats, Floats]) -> Columns:
        """The extension's columns, or none."""
        return kernel_columns((), self.timeline) if self.extension is None else self.extension.columns(self, at, clear)

    def begun(
        self,
        at: At,
        linearise_there: bool = False,
        clear: tuple[Floats, Floats] | None = None,
        columns: Columns | None = None,
    ) -> Filter:
        """A filter at the first event, its priors around the given values.

        ``clear`` and ``columns`` spare their computation where they are known already.
        """
        clear = self.clear_steps(at.constants) if clear is None else clear
        run = Filter(
            self.aligned,
            self.timeline,
            self.noise,
            self.options,
            self.centre,
            clear,
            at.constants if linearise_there else None,
            self.columns(at, clear) if columns is None else columns,
            self.extra,
        )
        run.begin(self.start, at.constants, self.prior, at.values)
        return run


def iterate(problem: RunProblem, first: At, max_rounds: int = MAX_ROUNDS) -> tuple[Floats, ForwardPass]:
    """Posterior mode of R_r, R_l, L, Ofs and the extension's parameters (4 + m,), and the pass linearised there.

    A pass that starts at x* with prior covariance P0 treats x* as the prior mean. To first order the posterior with
    the true prior mean m0 is then its own mean plus P P0⁻¹ (m0 − x*), P its posterior covariance.
    """
    information = np.linalg.inv(problem.prior)
    lower, upper = numeric_limits(problem.centre)
    theta = np.concatenate((np.clip(first.constants.as_array(), lower, upper), first.values))
    learnt = np.r_[0:3, 4 : 4 + problem.extra]
    path = first.path
    clear, ratio = None, np.inf
    for _ in range(max_rounds):
        at = At(Constants.of(theta), theta[3:], path)
        if clear is None or abs(theta[0] / theta[1] - ratio) > SAME_RATIO:
            clear, ratio = problem.clear_steps(at.constants), float(theta[0] / theta[1])
        found = problem.begun(at, True, clear).finish()
        covariance = reported_covariance(found)
        mode = reported_values(found) + covariance[:, learnt] @ information @ (problem.prior_mean - theta)
        mode[:3] = np.clip(mode[:3], lower, upper)
        moved = np.abs(mode[learnt] - theta) / np.sqrt(np.maximum(np.diag(covariance)[learnt], 1e-30))
        theta = mode[learnt]
        path = found if problem.extra else None
        if moved.max() < CLOSE_SIGMAS:
            break
    return mode, found


def reported_values(found: ForwardPass) -> Floats:
    """R_r, R_l, L, Ofs and the extension's parameters (4 + m,) after the last event."""
    return np.concatenate((found.final_state[3:7], found.final_state[BASE_STATES:]))


def reported_covariance(found: ForwardPass) -> Floats:
    """Covariance of the same (4 + m, 4 + m)."""
    rows = np.r_[3:7, BASE_STATES : found.final_state.size]
    return np.asarray(found.final_covariance[np.ix_(rows, rows)])
