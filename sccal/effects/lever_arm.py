"""Lever arm: the antenna does not stand above the middle between the wheels.

fix = position + Rot(θ) (forward, left)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.drive_shape import DriveShape, both_ways
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import State

_CERTAIN = 2.0
"""Sigmas from which a direction is worth a word."""


class LeverArm(Effect):
    """Forward and left of the antenna, m."""

    name = "lever_arm"
    is_antenna = True
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

    def says(self, found: Mapping[str, Measured]) -> str:
        """The larger part, and the other where it is sure."""
        forward, left = found["forward_m"], found["left_m"]
        largest = max(abs(forward.value), abs(left.value))
        across = f"{size(left)} m to the {'left' if left.value > 0.0 else 'right'}"
        along = f"{size(forward)} m {'ahead' if forward.value > 0.0 else 'behind'}"
        shown = [text for text, part in ((along, forward), (across, left)) if abs(part.value) == largest or _sure(part)]
        middle = "the track centre" if shown[-1].endswith("behind") else "of the track centre"
        return f"the antenna sits {' and '.join(shown)} {middle}"

    def shown_by(self, drive: DriveShape) -> bool:
        return both_ways(drive)

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        one = np.ones(drive.fixes.t_s.size)
        return (Column("forward_m", "antenna_forward", one), Column("left_m", "antenna_left", one))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Mounted(values["forward_m"], values["left_m"])


def _sure(part: Measured) -> bool:
    """As far as is known: what has no sigma is told."""
    return abs(part.value) > _CERTAIN * part.sigma or not math.isfinite(part.sigma)


@dataclass(frozen=True)
class _Mounted(Physics):
    forward_m: float
    left_m: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"lever_arm": {"forward_m": self.forward_m, "left_m": self.left_m}}

    def antenna(self, state: State, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        c, s = np.cos(state.yaw_rad), np.sin(state.yaw_rad)
        return east_m + c * self.forward_m - s * self.left_m, north_m + s * self.forward_m + c * self.left_m
