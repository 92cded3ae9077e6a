"""A hilly ground, for the physics of effects on slopes.

height = a (sin κ(x + x₀) + sin κ(y + y₀))      tan pitch = ∇height · forward      tan roll = ∇height · left
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats


@dataclass(frozen=True)
class Hills:
    """Waves in both directions; each steep enough to see, gentle enough to drive."""

    steepest_deg: float = 6.0
    """Of either wave."""
    length_m: float = 25.0
    east_shift_m: float = 3.0
    north_shift_m: float = 8.0

    def tilt(self, east_m: Floats, north_m: Floats, yaw_rad: Floats) -> tuple[Floats, Floats]:
        """Pitch (nose up) and roll (left side up), rad."""
        wave = 2.0 * math.pi / self.length_m
        steepest = math.tan(math.radians(self.steepest_deg))
        east = steepest * np.cos(wave * (east_m + self.east_shift_m))
        north = steepest * np.cos(wave * (north_m + self.north_shift_m))
        cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
        return np.arctan(east * cos + north * sin), np.arctan(north * cos - east * sin)


HILLS = Hills()
"""The one ground of all effects on slopes, so that they agree on it when they act together."""
