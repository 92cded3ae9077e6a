"""Side slip: the body slides outwards in a turn, in proportion to its sideways acceleration v ω.

side = −s ω τ      left positive: in a left turn at τ > 0 it slides to the right
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from sccal.effects.drive_shape import DriveShape, both_ways, spins, two_speeds
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import BodySteps


class SideSlip(Effect):
    """Speed of the slide per sideways acceleration, s."""

    name = "side_slip"
    title = "sliding outwards in turns taken at speed"
    parameters = (Parameter("s", "s", 0.1, -1.0, 1.0, matters=0.02),)
    looks_like = (
        "fixes drift to the outside of every arc but not of spins in place; like a forward lever arm at one speed"
    )
    excited_by = (
        "drive arcs both ways at two clearly different speeds and spin in place: "
        "at one speed it is the same as a forward lever arm"
    )
    reference = (
        "Pentzer, Brennan and Reichard, Journal of Field Robotics 2014; lateral dynamics of cars for the term v ω"
    )
    shown_against = "turn_rate"

    def says(self, found: Mapping[str, Measured]) -> str:
        way = "outwards" if found["s"].value > 0.0 else "inwards"
        return f"the robot slides {way} in turns, at {size(found['s'])} m/s for each m/s² of sideways acceleration"

    def shown_by(self, drive: DriveShape) -> bool:
        return spins(drive) and both_ways(drive) and two_speeds(drive)

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        return (Column("s", "side", -steps.along_m * steps.turn_rate_radps),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Sliding(values["s"])


@dataclass(frozen=True)
class _Sliding(Physics):
    s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"side_slip": {"s": self.s}}

    def body(self, steps: BodySteps) -> BodySteps:
        step_s = float(steps.t_s[1] - steps.t_s[0])
        speed_mps, turn_rate_radps = steps.along_m / step_s, steps.turn_rad / step_s
        outwards_mps = self.s * speed_mps * turn_rate_radps
        return replace(steps, side_m=steps.side_m - outwards_mps * step_s)
