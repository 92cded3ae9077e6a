"""Missed counts: a counter that loses a share of a wheel's counts, so the wheel travels more than it says.

travel = R φ / (1 − ratio)      φ as counted
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair

_EXCITED_BY = (
    "drive 20 m straight, and measure the wheel's radius by hand: the log alone knows only the product of the two"
)
_REFERENCE = "counting: what is counted is 1 − ratio of what is turned"
_PARAMETERS = (Parameter("ratio", "1", 0.02, -0.5, 0.5, matters=0.005),)


class MissedLeft(Effect):
    """Share of the left wheel's counts that are lost."""

    name = "missed_left"
    title = "left counter that loses counts"
    parameters = _PARAMETERS
    looks_like = "the left radius comes out larger than the wheel is; by the wheels alone the path bends to the left"
    excited_by = _EXCITED_BY
    reference = _REFERENCE

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        return (Column("ratio", "left_wheel", drive.steps.left_m / (1.0 - at.get("ratio", 0.0))),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Losing("left", values["ratio"])


class MissedRight(Effect):
    """Share of the right wheel's counts that are lost."""

    name = "missed_right"
    title = "right counter that loses counts"
    parameters = _PARAMETERS
    looks_like = "the right radius comes out larger than the wheel is; by the wheels alone the path bends to the right"
    excited_by = _EXCITED_BY
    reference = _REFERENCE

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        return (Column("ratio", "right_wheel", drive.steps.right_m / (1.0 - at.get("ratio", 0.0))),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Losing("right", values["ratio"])


@dataclass(frozen=True)
class _Losing(Physics):
    wheel: Literal["left", "right"]
    ratio: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {f"missed_{self.wheel}": {"ratio": self.ratio}}

    def wheel_angle(self, motion: Motion, angle_rad: WheelPair) -> WheelPair:
        counted = 1.0 - self.ratio
        if self.wheel == "left":
            return replace(angle_rad, left=counted * angle_rad.left)
        return replace(angle_rad, right=counted * angle_rad.right)
