"""Eccentric wheels: a wheel whose axle is off its middle, or whose encoder is, runs unevenly over each turn.

travel = R ∫ (1 + cos · cos φ + sin · sin φ) dφ      φ the wheel's cumulative angle from the log's first sample
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.one_wheel import wheels_turned
from sccal.effects.view import DriveView
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair

_EXCITED_BY = (
    "drive straight for many turns of the wheels, slowly enough for several heading readings in each turn of a wheel"
)
_REFERENCE = "geometry of a circle turning about a point off its middle"
_PARAMETERS = (
    Parameter("cos", "1", 0.01, -0.3, 0.3, scope="run", matters=0.002),
    Parameter("sin", "1", 0.01, -0.3, 0.3, scope="run", matters=0.002),
)
"""Of the run, not the vehicle: each log counts φ from its own first sample."""


class EccentricLeft(Effect):
    """Uneven running of the left wheel, as a share of its radius."""

    name = "eccentric_left"
    stage = "wheels"
    title = "left wheel or its encoder off the axle's middle"
    parameters = _PARAMETERS
    looks_like = "heading and path wobble once per turn of the left wheel"
    excited_by = _EXCITED_BY
    reference = _REFERENCE

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        travel_m, angle_rad = drive.steps.left_m, drive.steps.left_angle_rad
        return (
            Column("cos", "left_wheel", travel_m * np.cos(angle_rad)),
            Column("sin", "left_wheel", travel_m * np.sin(angle_rad)),
        )

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _OffCentre("left", values["cos"], values["sin"])


class EccentricRight(Effect):
    """Uneven running of the right wheel, as a share of its radius."""

    name = "eccentric_right"
    stage = "wheels"
    title = "right wheel or its encoder off the axle's middle"
    parameters = _PARAMETERS
    looks_like = "heading and path wobble once per turn of the right wheel"
    excited_by = _EXCITED_BY
    reference = _REFERENCE

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        travel_m, angle_rad = drive.steps.right_m, drive.steps.right_angle_rad
        return (
            Column("cos", "right_wheel", travel_m * np.cos(angle_rad)),
            Column("sin", "right_wheel", travel_m * np.sin(angle_rad)),
        )

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _OffCentre("right", values["cos"], values["sin"])


@dataclass(frozen=True)
class _OffCentre(Physics):
    wheel: Literal["left", "right"]
    cos: float
    sin: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {f"eccentric_{self.wheel}": {"cos": self.cos, "sin": self.sin}}

    def wheel_angle(self, motion: Motion, angle_rad: WheelPair) -> WheelPair:
        return wheels_turned((self.wheel,), angle_rad, self._turned)

    def _turned(self, even_rad: Floats) -> Floats:
        """φ with φ + cos · sin φ + sin · (1 − cos φ) = the angle of an even wheel, by Newton's method."""
        way = even_rad - even_rad[0]
        turned = way
        for _ in range(20):
            excess = turned + self.cos * np.sin(turned) + self.sin * (1.0 - np.cos(turned)) - way
            turned = turned - excess / (1.0 + self.cos * np.cos(turned) + self.sin * np.sin(turned))
        return np.asarray(even_rad[0] + turned)
