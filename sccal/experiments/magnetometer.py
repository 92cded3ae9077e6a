"""A magnetometer whose offset is not the same all along the way, as the paper saw on its robot.

reading = heading + offset + w(t)      w: Gauss-Markov, σ and τ below (ours: the paper shows the wander, not its size)
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats
from sccal.randomness import gauss_markov, random_stream
from sccal.results.experiments import MAGNETOMETER_WANDER
from sccal.simulate.physics import Physics
from sccal.simulate.world import State

WANDER_DEG, WANDER_TIME_S = MAGNETOMETER_WANDER.sigma_deg, MAGNETOMETER_WANDER.time_s
_STEP_S = 1.0


class WanderingOffset(Physics):
    """Adds a slow error to the heading reading; the same seed, the same error."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def wander_rad(self, t_s: Floats) -> Floats:
        """The error (n,) at times from the start of the drive."""
        count = int(np.ceil(float(t_s.max(initial=0.0)) / _STEP_S)) + 2
        rng = random_stream(self.seed, "experiments.magnetometer")
        error = gauss_markov(rng, count, _STEP_S, np.radians(WANDER_DEG), WANDER_TIME_S)
        return np.interp(t_s, np.arange(count) * _STEP_S, error)

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        """The reading with the error added."""
        return reading_rad + self.wander_rad(state.t_s)
