"""Speed slip: the faster the wheels run, the smaller the share of their travel that moves the body.

along = s (1 − k |v|)      s and v as the wheels say; backwards as forwards, the body travels less
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.effects.drive_shape import DriveShape, much_faster
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.rims import loss_solved, speed_mps, stretch_along
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, less, percent
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair


class SpeedSlip(Effect):
    """Share of the travel that is lost per m/s of speed."""

    name = "speed_slip"
    title = "wheels that slip more at higher speed"
    parameters = (Parameter("per_mps", "s/m", 0.03, -0.2, 0.2, matters=0.005),)
    looks_like = "both radii seem smaller on fast stretches than on slow ones"
    excited_by = "drive at a second speed: the same kind of straight, slow and fast"
    reference = "Fazekas et al., Sensors 2021, 21, 337, on wheel radii that change with the driving state"
    shown_against = "speed"

    def says(self, found: Mapping[str, Measured]) -> str:
        rate = found["per_mps"]
        return f"the robot travels {percent(rate)} {less(rate)} than its wheels say for each m/s of speed"

    def shown_by(self, drive: DriveShape) -> bool:
        return much_faster(drive)

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        return (Column("per_mps", "along", -steps.along_m * np.abs(steps.speed_mps)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Slipping(values["per_mps"])


@dataclass(frozen=True)
class _Slipping(Physics):
    per_mps: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"speed_slip": {"per_mps": self.per_mps}}

    def wheel_travel(self, motion: Motion, travel_m: WheelPair) -> WheelPair:
        return stretch_along(travel_m, loss_solved(self.per_mps * np.abs(speed_mps(motion))))
