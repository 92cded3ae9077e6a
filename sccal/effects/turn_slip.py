"""Turn slip: the tracks skid in turns, so the body turns less than they say, the more so the faster they turn.

turn = Δθ (1 − k |ω|)      Δθ and ω as the wheels say
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.effects.drive_shape import SOME, DriveShape, both_ways, spins
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.rims import loss_solved, stretch_turn, turn_rate_radps
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, less, percent
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair


class TurnSlip(Effect):
    """Share of the turn that is lost per rad/s of turn rate."""

    name = "turn_slip"
    title = "tracks that skid sideways in turns, more in fast ones"
    parameters = (Parameter("per_radps", "s/rad", 0.1, -1.0, 1.0, matters=0.03),)
    looks_like = "the track seems wider in fast turns than in slow ones; the heading jumps back after each turn"
    excited_by = "turn at two clearly different rates, both ways: slow arcs and fast spins in place"
    reference = "Pentzer, Brennan and Reichard, Journal of Field Robotics 2014, on skid-steered turning"
    shown_against = "turn_rate"

    def says(self, found: Mapping[str, Measured]) -> str:
        rate = found["per_radps"]
        return f"the robot turns {percent(rate)} {less(rate, 'more')} than its wheels say for each rad/s of turn rate"

    def shown_by(self, drive: DriveShape) -> bool:
        return spins(drive) and drive.arcs >= SOME and both_ways(drive)

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        return (Column("per_radps", "turn", -steps.turn_rad * np.abs(steps.turn_rate_radps)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Skidding(values["per_radps"])


@dataclass(frozen=True)
class _Skidding(Physics):
    per_radps: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"turn_slip": {"per_radps": self.per_radps}}

    def wheel_travel(self, motion: Motion, travel_m: WheelPair) -> WheelPair:
        return stretch_turn(travel_m, loss_solved(self.per_radps * np.abs(turn_rate_radps(motion))))
