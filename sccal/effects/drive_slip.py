"""Drive slip: while it gathers speed, the body travels less than the wheels say.

along = s (1 − k max(a, 0))      a = d|v|/dt: forwards and backwards alike
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.rims import speeding_up_mps2, stretch_along
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, less, percent
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair


class DriveSlip(Effect):
    """Share of the travel that is lost per m/s² of speeding up."""

    name = "drive_slip"
    title = "slip while speeding up"
    parameters = (Parameter("per_mps2", "s²/m", 0.05, -0.5, 0.5, matters=0.01),)
    looks_like = "each start falls short of what the wheels say, in proportion to how hard it speeds up"
    excited_by = "speed up hard as well as gently, to more than one speed"
    reference = "Fazekas et al., Sensors 2021, 21, 337, on wheel radii that change with the driving state"
    shown_against = "acceleration"

    def says(self, found: Mapping[str, Measured]) -> str:
        rate = found["per_mps2"]
        return f"the robot travels {percent(rate)} {less(rate)} than its wheels say for each m/s² of speeding up"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        speeding_up = np.maximum(np.sign(steps.speed_mps) * steps.acceleration_mps2, 0.0)
        return (Column("per_mps2", "along", -steps.along_m * speeding_up),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _SpeedingUp(values["per_mps2"])


@dataclass(frozen=True)
class _SpeedingUp(Physics):
    per_mps2: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"drive_slip": {"per_mps2": self.per_mps2}}

    def wheel_travel(self, motion: Motion, travel_m: WheelPair) -> WheelPair:
        kept = 1.0 - self.per_mps2 * np.maximum(speeding_up_mps2(motion), 0.0)
        return stretch_along(travel_m, 1.0 / np.maximum(kept, 0.05))
