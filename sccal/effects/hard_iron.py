"""Hard iron: magnetised parts of the robot add a constant horizontal field to the earth's.

With ψ the robot's heading in enu and c, s the added field in parts of the earth's horizontal one, c forward and −s to
the left (so that both are angles for small ones), the reading is wrong by

    h = atan2(N, D)      N = c cos ψ + s sin ψ      D = 1 + c sin ψ − s cos ψ

to first order N itself. The filter adds p · column, which is linear, and h is not: at 20° the harmonics alone leave a
sixth of the amplitude, in the second harmonic. So the columns are secants: the harmonics times q = h/N at the current
values (1 where they are zero). Times those same values they give h exactly, c q cos ψ + s q sin ψ = h, and at zero they
are the derivatives. Estimating and computing the columns anew, again and again, ends where both agree: at the truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


def deviation_secants(angle_rad: Floats, cos_deg: float, sin_deg: float) -> tuple[Floats, Floats]:
    """rad per deg of a compass's cosine and sine deviation in ``angle_rad``, exact at the values given."""
    c, s = np.radians(cos_deg), np.radians(sin_deg)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    across, along = c * cos + s * sin, 1.0 + c * sin - s * cos
    small = np.abs(across) < 1e-9
    safe = np.where(small, 1.0, across)
    secant = np.where(small, 1.0 / np.maximum(along, 1e-3), np.arctan2(across, along) / safe)
    return np.radians(secant * cos), np.radians(secant * sin)


class HardIron(Effect):
    """Deviation of the compass with the cosine and the sine of the robot's heading, deg."""

    name = "hard_iron"
    title = "magnetised parts near the compass"
    parameters = (
        Parameter("cos_deg", "deg", 10.0, -40.0, 40.0, matters=0.03),
        Parameter("sin_deg", "deg", 10.0, -40.0, 40.0, matters=0.03),
    )
    looks_like = "the heading error swings once per full turn of the robot: one way going east, the other going west"
    excited_by = "drive in at least eight headings: full circles, or spin in place both ways by whole turns"
    reference = "NGA Pub. 226, Handbook of Magnetic Compass Adjustment: coefficients B and C"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        cos, sin = deviation_secants(drive.headings.yaw_rad, at["cos_deg"], at["sin_deg"])
        return (Column("cos_deg", "heading", cos), Column("sin_deg", "heading", sin))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Magnetised(values["cos_deg"], values["sin_deg"])


@dataclass(frozen=True)
class _Magnetised(Physics):
    cos_deg: float
    sin_deg: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"hard_iron": {"cos_deg": self.cos_deg, "sin_deg": self.sin_deg}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        """The field as the robot sees it: forward + i left, the earth's pointing north."""
        earth = 1j * np.exp(-1j * state.yaw_rad)
        own = np.radians(self.cos_deg) - 1j * np.radians(self.sin_deg)
        return np.asarray(reading_rad - np.angle((earth + own) / earth))
