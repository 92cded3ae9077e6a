"""Speed field: the motors' magnetic field grows with speed and turns the compass.

heading += p v, with v below zero in reverse: the current, and the field with it, changes its sign
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, sense, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class SpeedField(Effect):
    """What the reading gains with speed, deg per m/s, counter-clockwise."""

    name = "speed_field"
    title = "compass turned by the motors' field, in proportion to speed"
    parameters = (Parameter("deg_per_mps", "deg/(m/s)", 5.0, -60.0, 60.0, matters=0.3),)
    looks_like = "the heading offset changes when the robot stops, drives at another speed or reverses"
    excited_by = "drive at a second speed, stop now and then, and reverse 10 m"
    reference = "Ozyagcilar, NXP AN4247, Layout recommendations for PCBs using a magnetometer: fields of currents"
    shown_against = "speed"

    def says(self, found: Mapping[str, Measured]) -> str:
        rate = found["deg_per_mps"]
        return f"the motors' field turns the compass by {size(rate)} deg {sense(rate)} for each m/s of speed"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        return (Column("deg_per_mps", "heading", np.radians(drive.headings.speed_mps)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Motors(values["deg_per_mps"])


@dataclass(frozen=True)
class _Motors(Physics):
    deg_per_mps: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"speed_field": {"deg_per_mps": self.deg_per_mps}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return np.asarray(reading_rad + np.radians(self.deg_per_mps) * state.speed_mps)
