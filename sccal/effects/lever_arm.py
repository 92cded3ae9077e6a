"""Lever arm: the antenna does not stand above the middle between the wheels.

fix = position + Rot(θ) (forward, left)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class LeverArm(Effect):
    """Forward and left of the antenna, m."""

    name = "lever_arm"
    on_every_robot = True
    title = "antenna off the middle between the wheels"
    parameters = (
        Parameter("forward_m", "m", 0.5, -5.0, 5.0, matters=0.04),
        Parameter("left_m", "m", 0.5, -5.0, 5.0, matters=0.04),
    )
    looks_like = (
        "fixes circle around the path when the robot turns; wheels and track seem to differ between left and right"
    )
    excited_by = "turn both ways; spin in place for the forward part, which at one speed is the same as a GNSS latency"
    reference = "geometry; see Cantelli et al. 2016, section 3, for the model that lacks it"
    shown_against = "heading"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        one = np.ones(drive.fixes.t_s.size)
        return (Column("forward_m", "antenna_forward", one), Column("left_m", "antenna_left", one))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Mounted(values["forward_m"], values["left_m"])


@dataclass(frozen=True)
class _Mounted(Physics):
    forward_m: float
    left_m: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"lever_arm": {"forward_m": self.forward_m, "left_m": self.left_m}}

    def antenna(self, state: State, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        c, s = np.cos(state.yaw_rad), np.sin(state.yaw_rad)
        return east_m + c * self.forward_m - s * self.left_m, north_m + s * self.forward_m + c * self.left_m
