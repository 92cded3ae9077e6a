"""Slope: on a hill the wheels run the slanted way, the map shows the level one.

along = s (1 − ratio (1 − cos pitch)) ≈ s − s ratio pitch²/2      ratio 1: geometry alone
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.ground import HILLS
from sccal.effects.rims import stretch_along
from sccal.effects.view import DriveView
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, State, WheelPair


class Slope(Effect):
    """Share of the missing cosine that is really missing; slip on slopes makes it more than 1."""

    name = "slope"
    title = "level distance shorter than the travelled one on a slope"
    parameters = (Parameter("ratio", "1", 1.0, -10.0, 10.0, matters=0.2),)
    looks_like = "both radii seem smaller on steep stretches, uphill and downhill alike"
    excited_by = "drive up and down a slope of 5° or more, and on level ground, with an AHRS that logs pitch"
    reference = "geometry: the level part of a slanted way is its cosine"
    shown_against = "pitch"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        return (Column("ratio", "along", -0.5 * steps.along_m * np.square(steps.pitch_rad)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Slanted(values["ratio"])


@dataclass(frozen=True)
class _Slanted(Physics):
    ratio: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"slope": {"ratio": self.ratio}}

    def wheel_travel(self, motion: Motion, travel_m: WheelPair) -> WheelPair:
        middle = motion.at(0.5 * (motion.t_s[1:] + motion.t_s[:-1]))
        pitch, _ = HILLS.tilt(middle.east_m, middle.north_m, middle.yaw_rad)
        return stretch_along(travel_m, 1.0 / (1.0 - self.ratio * (1.0 - np.cos(pitch))))

    def tilt(self, state: State, pitch_rad: Floats, roll_rad: Floats) -> tuple[Floats, Floats]:
        pitch, _ = HILLS.tilt(state.east_m, state.north_m, state.yaw_rad)
        return pitch, roll_rad
