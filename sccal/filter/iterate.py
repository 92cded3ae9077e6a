"""The constants as the maximum of the posterior: passes that start and linearise at their own answer.

A forward pass linearises at whatever it believes on the way. For the final values the pass is repeated with start and
derivatives *at* the estimate, and the prior carried as what it is: a Gauss-Newton iteration whose fixed point is the
posterior mode (as in the iterated Kalman filter, Bell and Cathey 1993).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.align import Aligned, Timeline, clear_steps
from sccal.arrays import Floats
from sccal.filter.forward import Filter, ForwardPass, Noise, numeric_limits, prior_covariance
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start, first_constants

MAX_ROUNDS = 6
CLOSE_SIGMAS = 0.05
SAME_RATIO = 1e-4
"""R_r/R_l known so well leaves less turn in a straight line than slip does."""


@dataclass(frozen=True)
class RunProblem:
    """One run prepared for filtering: what passes over it need, whatever constants they start from."""

    aligned: Aligned
    timeline: Timeline
    start: Start
    noise: Noise
    options: FilterOptions

    @property
    def centre(self) -> Constants:
        """The middle of the constants' priors."""
        return first_constants(self.aligned, self.start)

    def clear_steps(self, constants: Constants) -> tuple[Floats, Floats]:
        """The wheels' motion freed of slip, given the ratio of the radii."""
        return clear_steps(self.aligned, self.timeline, constants.radius_right_m / constants.radius_left_m)

    def begun(
        self,
        constants: Constants,
        linear_at: Constants | None = None,
        clear: tuple[Floats, Floats] | None = None,
    ) -> Filter:
        """A filter at the first event, its constants' priors around the given values."""
        clear = self.clear_steps(constants) if clear is None else clear
        run = Filter(self.aligned, self.timeline, self.noise, self.options, self.centre, clear, linear_at)
        run.begin(self.start, constants, prior_covariance(self.centre, self.options))
        return run


def iterate(problem: RunProblem, first: Constants, max_rounds: int = MAX_ROUNDS) -> tuple[Floats, ForwardPass]:
    """Posterior mode of R_r, R_l, L, Ofs (4,), and the pass linearised there.

    A pass that starts at x* with prior covariance P0 treats x* as the prior mean. To first order the posterior with
    the true prior mean m0 is then its own mean plus P P0⁻¹ (m0 − x*), P its posterior covariance.
    """
    centre = problem.centre.as_array()
    information = np.linalg.inv(prior_covariance(problem.centre, problem.options))
    lower, upper = numeric_limits(problem.centre)
    at = np.clip(first.as_array(), lower, upper)
    clear, ratio = None, np.inf
    for _ in range(max_rounds):
        constants = Constants(*(float(v) for v in at))
        if clear is None or abs(at[0] / at[1] - ratio) > SAME_RATIO:
            clear, ratio = problem.clear_steps(constants), float(at[0] / at[1])
        found = problem.begun(constants, constants, clear).finish()
        covariance = found.final_covariance[3:7, 3:7]
        mode = found.final_state[3:7] + covariance[:, :3] @ information @ (centre - at)
        mode[:3] = np.clip(mode[:3], lower, upper)
        moved = np.abs(mode[:3] - at) / np.sqrt(np.maximum(np.diag(covariance)[:3], 1e-30))
        at = mode[:3]
        if moved.max() < CLOSE_SIGMAS:
            break
    return mode, found
