"""Roll slip: driving across a slope, the body slides downhill.

side = −|s| ratio sin roll ≈ −|s| ratio roll      left side up: to the right
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.ground import HILLS
from sccal.effects.view import DriveView
from sccal.simulate.physics import Physics
from sccal.simulate.world import BodySteps, State, integrate


class RollSlip(Effect):
    """Slide downhill per distance driven and per rad of roll."""

    name = "roll_slip"
    title = "sliding downhill while driving across a slope"
    parameters = (Parameter("ratio", "1", 0.1, -2.0, 2.0, matters=0.02),)
    looks_like = "the path drifts to the low side on slopes, whichever way they are crossed; fixes pull it back uphill"
    excited_by = "drive across a slope of 5° or more in both directions, with an AHRS that logs roll"
    reference = "statics of a wheel that creeps under a side load; slope slip of tracked vehicles"
    shown_against = "roll"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        return (Column("ratio", "side", -np.abs(steps.along_m) * steps.roll_rad),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Downhill(values["ratio"])


_ROUNDS = 50
_SETTLED_M = 1e-9


@dataclass(frozen=True)
class _Downhill(Physics):
    ratio: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"roll_slip": {"ratio": self.ratio}}

    def body(self, steps: BodySteps) -> BodySteps:
        """The slide changes the place and with it the roll: repeated until both agree."""
        sliding = steps
        for _ in range(_ROUNDS):
            motion = integrate(sliding)
            middle = motion.at(0.5 * (motion.t_s[1:] + motion.t_s[:-1]))
            _, roll = HILLS.tilt(middle.east_m, middle.north_m, middle.yaw_rad)
            side = steps.side_m - self.ratio * np.abs(steps.along_m) * np.sin(roll)
            change = float(np.max(np.abs(np.cumsum(side - sliding.side_m)), initial=0.0))
            sliding = replace(steps, side_m=side)
            if change < _SETTLED_M:
                break
        return sliding

    def tilt(self, state: State, pitch_rad: Floats, roll_rad: Floats) -> tuple[Floats, Floats]:
        _, roll = HILLS.tilt(state.east_m, state.north_m, state.yaw_rad)
        return pitch_rad, roll
