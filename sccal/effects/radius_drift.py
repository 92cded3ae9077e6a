"""Radius drift: both radii grow with time, as tyres warm up or soil builds up.

travel = R φ (1 + k t)      each wheel; t from the start of the run
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
from sccal.simulate.world import Motion, WheelPair

_HOUR_S = 3600.0


class RadiusDrift(Effect):
    """Growth of both radii, as a share of them per hour."""

    name = "radius_drift"
    stage = "wheels"
    title = "radii that grow during the run: warming tyres, soil that sticks"
    parameters = (Parameter("per_hour", "1/h", 0.05, -1.0, 1.0, scope="run", matters=0.01),)
    looks_like = "both radii estimated from the first half of the run differ from those of the second half, gradually"
    excited_by = (
        "drive for half an hour or more at the same mix of speeds, repeating one straight at the start and the end"
    )
    reference = "Fazekas et al., Sensors 2021, 21, 337, on wheel radii that change while driving"

    def says(self, found: Mapping[str, Measured]) -> str:
        grow = "grow" if found["per_hour"].value > 0.0 else "shrink"
        return f"both wheels' radii {grow} by {percent(found['per_hour'])} an hour"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        hours = (steps.t_s - 0.5 * steps.dt_s - drive.start_s) / _HOUR_S
        return (
            Column("per_hour", "right_wheel", steps.right_m * hours),
            Column("per_hour", "left_wheel", steps.left_m * hours),
        )

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Growing(values["per_hour"])


@dataclass(frozen=True)
class _Growing(Physics):
    per_hour: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"radius_drift": {"per_hour": self.per_hour}}

    def wheel_angle(self, motion: Motion, angle_rad: WheelPair) -> WheelPair:
        middle_s = 0.5 * (motion.t_s[1:] + motion.t_s[:-1])
        radius_ratio = 1.0 + self.per_hour * middle_s / _HOUR_S

        def turned(rad: Floats) -> Floats:
            return np.asarray(rad[0] + np.concatenate(([0.0], np.cumsum(np.diff(rad) / radius_ratio))))

        return WheelPair(left=turned(angle_rad.left), right=turned(angle_rad.right))
