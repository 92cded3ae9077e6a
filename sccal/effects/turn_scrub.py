"""Turn scrub: skidding tracks hold the body back, so it travels less while it turns.

along = s (1 − k |ω|)      s as the wheels say
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.rims import stretch_along, turn_rate_radps
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, less, percent
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair


class TurnScrub(Effect):
    """Share of the travel that is lost per rad/s of turn rate."""

    name = "turn_scrub"
    title = "tracks that scrub in turns and hold the body back"
    parameters = (Parameter("per_radps", "s/rad", 0.1, -1.0, 1.0, matters=0.02),)
    looks_like = (
        "arcs come out shorter than the wheels say, while straights fit; the radii seem smaller on curved drives"
    )
    excited_by = "drive tight arcs as well as straights, both ways and at two turn rates"
    reference = "Pentzer, Brennan and Reichard, Journal of Field Robotics 2014, on skid-steered turning"
    shown_against = "turn_rate"

    def says(self, found: Mapping[str, Measured]) -> str:
        rate = found["per_radps"]
        return f"the robot travels {percent(rate)} {less(rate)} than its wheels say for each rad/s of turn rate"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        return (Column("per_radps", "along", -steps.along_m * np.abs(steps.turn_rate_radps)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Scrubbing(values["per_radps"])


@dataclass(frozen=True)
class _Scrubbing(Physics):
    per_radps: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"turn_scrub": {"per_radps": self.per_radps}}

    def wheel_travel(self, motion: Motion, travel_m: WheelPair) -> WheelPair:
        kept = 1.0 - self.per_radps * np.abs(turn_rate_radps(motion))
        return stretch_along(travel_m, 1.0 / np.maximum(kept, 0.05))
