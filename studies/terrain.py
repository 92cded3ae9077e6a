"""Hills: a smooth height field, and the pitch and roll of a robot that stands on it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from studies.arrays import FloatArray


@dataclass(frozen=True)
class Terrain:
    """A sum of plane waves, each with slope, wave number east and north, and phase; without waves it is level."""

    waves: tuple[tuple[float, float, float, float], ...] = ()

    def gradient_at(self, east_m: float, north_m: float) -> tuple[float, float]:
        """Slope towards the east and towards the north at one place: ∇h of h = Σ (slope / |k|) sin(k · x + phase)."""
        rise_east = rise_north = 0.0
        for slope, k_east, k_north, phase in self.waves:
            size = slope * math.cos(k_east * east_m + k_north * north_m + phase) / math.hypot(k_east, k_north)
            rise_east += size * k_east
            rise_north += size * k_north
        return rise_east, rise_north

    def tilt_at(self, east_m: float, north_m: float, heading_rad: float) -> tuple[float, float]:
        """Pitch (nose up) and roll (left side up) at one place.

        tan pitch = ∇h · forward      tan roll = cos pitch ∇h · left
        """
        if not self.waves:
            return 0.0, 0.0
        rise_east, rise_north = self.gradient_at(east_m, north_m)
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        pitch = math.atan(rise_east * cos + rise_north * sin)
        return pitch, math.atan((rise_north * cos - rise_east * sin) * math.cos(pitch))

    def tilts(self, east_m: FloatArray, north_m: FloatArray, heading_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pitch and roll at many places."""
        rise_east, rise_north = np.zeros_like(east_m), np.zeros_like(east_m)
        for slope, k_east, k_north, phase in self.waves:
            size = slope * np.cos(k_east * east_m + k_north * north_m + phase) / math.hypot(k_east, k_north)
            rise_east += size * k_east
            rise_north += size * k_north
        cos, sin = np.cos(heading_rad), np.sin(heading_rad)
        pitch = np.arctan(rise_east * cos + rise_north * sin)
        return pitch, np.arctan((rise_north * cos - rise_east * sin) * np.cos(pitch))


def draw_hills(rng: np.random.Generator, unit_m: float) -> Terrain:
    """Four waves from all directions, together 4 to 9 degrees steep (rms), about as long as the field is wide."""
    steepness = math.tan(math.radians(float(rng.uniform(4.0, 9.0))))
    towards = float(rng.uniform(0.0, math.pi))
    waves = []
    for number in range(4):
        direction = towards + number * math.pi / 4.0 + float(rng.uniform(-0.3, 0.3))
        k = 2.0 * math.pi / (unit_m * float(rng.uniform(1.0, 3.0)))
        slope = steepness * float(rng.uniform(0.7, 1.3)) / math.sqrt(2.0)
        waves.append((slope, k * math.cos(direction), k * math.sin(direction), float(rng.uniform(0.0, 2.0 * math.pi))))
    return Terrain(tuple(waves))
