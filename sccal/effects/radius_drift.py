"""Radius drift: radii that grow with time, as tyres warm up, lose air or pick up soil.

travel = R φ (1 + k t)      both wheels, or the one that is named; t from the start of the run
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.one_wheel import Wheels, changes, wheel_columns, wheels_turned
from sccal.effects.view import DriveView
from sccal.effects.words import Measured
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair

_HOUR_S = 3600.0


class _RadiusDrift(Effect):
    """Growth of some wheels' radii, as a share of them per hour."""

    stage = "wheels"
    parameters = (Parameter("per_hour", "1/h", 0.05, -1.0, 1.0, scope="run", matters=0.01),)
    excited_by = (
        "drive for half an hour or more at the same mix of speeds, repeating one straight at the start and the end"
    )
    reference = "Fazekas et al., Sensors 2021, 21, 337, on wheel radii that change while driving"
    wheels: Wheels
    whose: str

    def says(self, found: Mapping[str, Measured]) -> str:
        return f"{changes(self.wheels, self.whose, found['per_hour'])} an hour"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        hours = (steps.t_s - 0.5 * steps.dt_s - drive.start_s) / _HOUR_S
        return wheel_columns("per_hour", self.wheels, steps, hours)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Growing(self.name, self.wheels, values["per_hour"])


class RadiusDrift(_RadiusDrift):
    """Growth of both radii, as a share of them per hour."""

    name = "radius_drift"
    title = "radii that grow during the run: warming tyres, soil that sticks"
    looks_like = "both radii estimated from the first half of the run differ from those of the second half, gradually"
    wheels = ("right", "left")
    whose = "both wheels' radii"


class RadiusDriftLeft(_RadiusDrift):
    """Growth of the left radius, as a share of it per hour."""

    name = "radius_drift_left"
    title = "left wheel whose radius changes during the run: a slow puncture, soil that sticks"
    looks_like = "by the wheels alone the path bends more and more to one side, and the left radius drifts"
    wheels = ("left",)
    whose = "the left wheel's radius"


class RadiusDriftRight(_RadiusDrift):
    """Growth of the right radius, as a share of it per hour."""

    name = "radius_drift_right"
    title = "right wheel whose radius changes during the run: a slow puncture, soil that sticks"
    looks_like = "by the wheels alone the path bends more and more to one side, and the right radius drifts"
    wheels = ("right",)
    whose = "the right wheel's radius"


@dataclass(frozen=True)
class _Growing(Physics):
    name: str
    wheels: Wheels
    per_hour: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {self.name: {"per_hour": self.per_hour}}

    def wheel_angle(self, motion: Motion, angle_rad: WheelPair) -> WheelPair:
        middle_s = 0.5 * (motion.t_s[1:] + motion.t_s[:-1])
        radius_ratio = 1.0 + self.per_hour * middle_s / _HOUR_S

        def turned(rad: Floats) -> Floats:
            return np.asarray(rad[0] + np.concatenate(([0.0], np.cumsum(np.diff(rad) / radius_ratio))))

        return wheels_turned(self.wheels, angle_rad, turned)
