"""Antenna height: on a body that pitches and rolls, an antenna above the ground swings out.

fix += Rot(θ) (−h sin pitch cos roll, −h sin roll)      nose up: backwards      left side up: to the right
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.ground import HILLS
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class AntennaHeight(Effect):
    """Height of the antenna above the ground, m."""

    name = "antenna_height"
    title = "antenna high above a body that pitches and rolls"
    parameters = (Parameter("m", "m", 2.0, -20.0, 20.0, matters=0.1),)
    looks_like = "the fixes stand on the downhill side of the path, and swing where the robot pitches or rolls"
    excited_by = "drive up, down and across a slope of 5° or more, with an AHRS that logs pitch and roll"
    reference = "NovAtel OEM7 documentation, Terrain Compensation; Bell, Comput. Electron. Agric. 2000, 25, 53"
    shown_against = "pitch"

    def says(self, found: Mapping[str, Measured]) -> str:
        where = f"{size(found['m'])} m {'above' if found['m'].value > 0.0 else 'below'} the ground"
        return f"the antenna stands {where}, and swings out where the robot pitches and rolls"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        pitch, roll = (drive.at_fixes(tilt) for tilt in (drive.steps.pitch_rad, drive.steps.roll_rad))
        back, right = np.sin(pitch) * np.cos(roll), np.sin(roll)
        return (Column("m", "antenna_forward", -back), Column("m", "antenna_left", -right))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Tall(values["m"])


@dataclass(frozen=True)
class _Tall(Physics):
    m: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"antenna_height": {"m": self.m}}

    def tilt(self, state: State, pitch_rad: Floats, roll_rad: Floats) -> tuple[Floats, Floats]:
        return HILLS.tilt(state.east_m, state.north_m, state.yaw_rad)

    def antenna(self, state: State, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        """The mast stands at right angles to the ground: along (−slope forward, −slope left, 1)."""
        pitch, roll = HILLS.tilt(state.east_m, state.north_m, state.yaw_rad)
        slope = np.tan(pitch) + 1j * np.tan(roll)
        out = -self.m * slope / np.sqrt(1.0 + np.abs(slope) ** 2) * np.exp(1j * state.yaw_rad)
        return east_m + out.real, north_m + out.imag
