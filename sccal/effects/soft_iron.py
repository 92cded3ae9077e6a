"""Soft iron: iron of the robot bends the earth's field, more along one of its axes than along the other.

With ψ the robot's heading in enu, the field that the robot sees (forward, left) is not (sin ψ, cos ψ), the earth's, but

    (1 + s      c  )
    (  c      1 − s) (sin ψ, cos ψ)

of which a turn of the frame goes into the heading offset and a common factor does nothing. The reading is wrong by

    h = atan2(N, D)      N = c cos 2ψ + s sin 2ψ      D = 1 + c sin 2ψ − s cos 2ψ

to first order N itself. As h is not linear in c and s the columns are secants, see sccal.effects.hard_iron.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.hard_iron import deviation_secants
from sccal.effects.view import DriveView
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class SoftIron(Effect):
    """Deviation of the compass with the cosine and the sine of twice the robot's heading, deg."""

    name = "soft_iron"
    title = "iron near the compass that bends the earth's field"
    parameters = (
        Parameter("cos2_deg", "deg", 5.0, -30.0, 30.0, matters=0.03),
        Parameter("sin2_deg", "deg", 5.0, -30.0, 30.0, matters=0.03),
    )
    looks_like = "the heading error swings twice per full turn of the robot and is the same going there and back"
    excited_by = "drive in at least eight headings: full circles, or spin in place both ways by whole turns"
    reference = "NGA Pub. 226, Handbook of Magnetic Compass Adjustment: coefficients D and E"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        cos2, sin2 = deviation_secants(2.0 * drive.headings.yaw_rad, at["cos2_deg"], at["sin2_deg"])
        return (Column("cos2_deg", "heading", cos2), Column("sin2_deg", "heading", sin2))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Bent(values["cos2_deg"], values["sin2_deg"])


@dataclass(frozen=True)
class _Bent(Physics):
    cos2_deg: float
    sin2_deg: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"soft_iron": {"cos2_deg": self.cos2_deg, "sin2_deg": self.sin2_deg}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        c, s = np.radians(self.cos2_deg), np.radians(self.sin2_deg)
        earth = np.stack((np.sin(state.yaw_rad), np.cos(state.yaw_rad)))
        forward, left = np.array([[1.0 + s, c], [c, 1.0 - s]]) @ earth
        turned = np.arctan2(earth[0] * left - earth[1] * forward, earth[0] * forward + earth[1] * left)
        return np.asarray(reading_rad - turned)
