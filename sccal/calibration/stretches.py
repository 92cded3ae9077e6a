"""Do the stretches of a run agree with each other about the constants? Where they do not, no sigma of theirs holds.

Each stretch of some 20 s leaves a score about the constants that all of them together found: with the right model and
the right noise its χ² per degree of freedom is 1. Counts that are lost above a speed, or clocks that run apart, make
fast stretches say another radius than slow ones, and the joint answer is sure of something in between.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sccal.arrays import Floats
from sccal.evidence.joint import at_least, fit_jointly
from sccal.filter.iterate import At, RunProblem
from sccal.filter.start import Constants
from sccal.logs.streams import Notice

BEYOND_CHANCE = 5.0
"""Standard deviations of χ² per degree of freedom, √(2/n), beyond which chance is no answer: 3 logs in ten million."""


@dataclass(frozen=True)
class Stretches:
    """How far the stretches of a run contradict what all of them say."""

    chi2: float = 0.0
    degrees_of_freedom: int = 0
    robust: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    """(3, 3) of R_r, R_l and L, from the scatter of the stretches where that is larger."""

    @property
    def chi2_per_dof(self) -> float:
        """1 where they agree."""
        return self.chi2 / max(self.degrees_of_freedom, 1)

    @property
    def contradict(self) -> bool:
        """Whether chance cannot be the reason."""
        n = self.degrees_of_freedom
        return n > 0 and self.chi2_per_dof > 1.0 + BEYOND_CHANCE * float(np.sqrt(2.0 / n))

    def widened(self, covariance: Floats) -> Floats:
        """The covariance (4, 4) of constants and offset as far as the stretches leave it (Wedderburn 1974)."""
        if not self.contradict:
            return covariance
        return self.chi2_per_dof * at_least(covariance, np.diag([*np.diag(self.robust), 0.0]))

    @property
    def notices(self) -> tuple[Notice, ...]:
        """For the run's notices and its verdict."""
        if not self.contradict:
            return ()
        told = f"{self.chi2_per_dof:.0f} times as much as their noise allows"
        return (
            Notice(
                "filter",
                f"run whose stretches contradict each other about radii and track, {told}: sigmas widened",
                1,
                "",
                "warning",
                f"stretches of the run contradict each other about radii and track, {told}",
            ),
        )


def compare_stretches(problem: RunProblem, values: Floats) -> Stretches:
    """The stretches of a run about its answer (4 + m,)."""
    fit = fit_jointly([problem], [At(Constants.of(values), values[4:])], 1, with_stretches=True)
    return Stretches(*fit.stretches_chi2, fit.robust[:3, :3])
