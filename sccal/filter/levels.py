"""The noise of one log as named levels: what each is, its unit, its prior and its limits.

An error is white plus a first-order Gauss-Markov part (standard deviation "slow", correlation time tau); each wheel's
slip is a random walk along the distance. The logarithm of every level has a normal prior, wide enough to matter only
where the log says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.results.noise import Noise

FINEST_FIX_M = 0.0005
"""White error of a fix below which no receiver is: a carrier phase is read to about a hundredth of a wave of 0.19 m,
and five satellites or more share the error."""


@dataclass(frozen=True)
class Level:
    """One number of the noise, searched for by its logarithm."""

    field: str
    """Its field in Noise, in whose order the levels stand."""
    unit: str
    centre: float
    width: float
    """Standard deviation of the logarithm."""
    low: float
    high: float
    of_slow_heading: bool = False
    """Whether it vanishes with the heading's slow part, which a filter without the offset state does not have."""


@dataclass(frozen=True)
class Levels:
    """The table for one log: priors and limits of the levels' logarithms, (7,) each."""

    table: tuple[Level, ...]
    with_offset: bool

    @classmethod
    def of(cls, fix_sigma_m: float, heading_floor_rad: float, with_offset: bool) -> Levels:
        """For fixes of that typical stated sigma and headings written in steps that leave at least that error."""
        least_heading = max(np.radians(0.005), heading_floor_rad)
        table = (
            Level("heading_white_rad", "rad", np.radians(0.2), 1.5, least_heading, np.radians(30.0)),
            Level("heading_coloured_rad", "rad", np.radians(0.7), 1.2, np.radians(0.005), np.radians(60.0), True),
            Level("heading_tau_s", "s", 25.0, 0.8, 1.0, 300.0, True),
            Level("fix_scale", "1", 1.0, 2.0, min(FINEST_FIX_M / fix_sigma_m, 1.0), 1000.0),
            Level("fix_coloured_m", "m", fix_sigma_m, 1.5, 1e-4, 100.0),
            Level("fix_tau_s", "s", 40.0, 0.8, 2.0, 600.0),
            Level("slip_m_per_sqrt_m", "m/√m", 0.005, 1.5, 2e-4, 1.0),
        )
        return cls(table, with_offset)

    @property
    def centre(self) -> Floats:
        return np.log([level.centre for level in self.table])

    @property
    def width(self) -> Floats:
        return np.array([level.width for level in self.table])

    @property
    def low(self) -> Floats:
        return np.log([level.low for level in self.table])

    @property
    def high(self) -> Floats:
        return np.log([level.high for level in self.table])

    @property
    def free(self) -> Bools:
        """Which are searched for."""
        return np.array([self.with_offset or not level.of_slow_heading for level in self.table])

    def price(self, logs: Floats) -> float:
        """Negative logarithm of the prior density, up to a constant."""
        return 0.5 * float((((logs - self.centre) / self.width)[self.free] ** 2).sum())

    def noise(self, logs: Floats) -> Noise:
        """The levels as the filter takes them."""
        return Noise(*np.exp(logs).tolist())

    def logs(self, noise: Noise) -> Floats:
        """The other way, within the limits."""
        values = np.log([max(getattr(noise, level.field), 1e-12) for level in self.table])
        return np.clip(values, self.low, self.high)
