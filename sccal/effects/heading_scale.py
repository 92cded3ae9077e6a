"""Heading scale: the gyro's gain is off, so the reading turns by more than the robot does.

heading += p (ψ − ψ₀)      ψ the robot's heading, unwrapped, and ψ₀ that at the run's first reading
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, percent
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class HeadingScale(Effect):
    """Share by which the reading turns too far; below zero it turns too little."""

    name = "heading_scale"
    title = "gyro whose gain is off: turns read too large or small"
    parameters = (Parameter("ratio", "1", 0.02, -0.2, 0.2, matters=0.001),)
    looks_like = "the heading offset runs away with every turn to one side, and comes back with turns to the other"
    excited_by = "turn many times to one side, with straights of 20 m before and after: circles, or spins in place"
    bends_heading = True
    reference = "Titterton and Weston 2004, Strapdown Inertial Navigation Technology: gyroscope scale factor"

    def says(self, found: Mapping[str, Measured]) -> str:
        far = "further" if found["ratio"].value > 0.0 else "less"
        return f"the AHRS reading turns {percent(found['ratio'])} {far} than the robot"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        yaw = drive.headings.yaw_rad
        return (Column("ratio", "heading", yaw - yaw[:1]),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Gained(values["ratio"])


@dataclass(frozen=True)
class _Gained(Physics):
    ratio: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"heading_scale": {"ratio": self.ratio}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        turned = np.concatenate(([0.0], np.cumsum(np.diff(state.yaw_rad))))[: state.yaw_rad.size]
        return np.asarray(reading_rad + self.ratio * turned)
