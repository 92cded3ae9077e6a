"""Soft iron: iron of the robot bends the earth's field, more along one of its axes than along the other.

With ψ the robot's heading in enu, the field that the robot sees (forward, left) is not (sin ψ, cos ψ), the earth's, but

    (1 + s      c  )
    (  c      1 − s) (sin ψ, cos ψ)

of which a turn of the frame goes into the heading offset and a common factor does nothing. The reading is wrong by

    h = atan2(N, D)      N = c cos 2ψ + s sin 2ψ      D = 1 + c sin 2ψ − s cos 2ψ
    heading += h'        τ dh'/dt = h − h'        c and s in degrees of field: 57.3 are as strong as the earth

to first order N itself. The files hold c and s times 180/π. An AHRS that lets its compass in slowly shows h', after a
first-order filter of time constant τ. As h is not linear in c and s the columns are made anew at the last answer, see
sccal.effects.compass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.compass import TAU, let_in, of_tau, slow_deviation_columns, tried_taus
from sccal.effects.drive_shape import DriveShape, all_round
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, amplitude
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class SoftIron(Effect):
    """How the field is bent with the cosine and the sine of twice the heading, deg, and the AHRS's slowness, s."""

    name = "soft_iron"
    title = "iron near the compass that bends the earth's field"
    parameters = (
        Parameter("cos2_deg", "deg", 5.0, -30.0, 30.0, matters=0.03),
        Parameter("sin2_deg", "deg", 5.0, -30.0, 30.0, matters=0.03),
        TAU,
    )
    looks_like = "the heading error swings twice per full turn of the robot and is the same going there and back"
    excited_by = "drive in at least eight headings: full circles, or spin in place both ways by whole turns"
    reference = "NGA Pub. 226, Handbook of Magnetic Compass Adjustment: coefficients D and E"
    shown_against = "heading"
    search = "scale"
    bends_heading = True

    def says(self, found: Mapping[str, Measured]) -> str:
        most = amplitude(found["cos2_deg"], found["sin2_deg"])
        return f"iron near the compass turns it by up to {most} deg, twice per full turn"

    def shown_by(self, drive: DriveShape) -> bool:
        return all_round(drive)

    def shape_grid(self, drive: DriveView) -> tuple[Mapping[str, float], ...]:
        """Time constants that the drive is long enough for."""
        return tried_taus(drive)

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        tau_s = at.get("tau_s", 0.0)
        cos2, sin2 = slow_deviation_columns(drive.headings, 2.0, at["cos2_deg"], at["sin2_deg"], tau_s)
        return (Column("cos2_deg", "heading", cos2), Column("sin2_deg", "heading", sin2))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Bent(values["cos2_deg"], values["sin2_deg"], values.get("tau_s", 0.0))


@dataclass(frozen=True)
class _Bent(Physics):
    cos2_deg: float
    sin2_deg: float
    tau_s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"soft_iron": {"cos2_deg": self.cos2_deg, "sin2_deg": self.sin2_deg, **of_tau(self.tau_s)}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return np.asarray(reading_rad + let_in(state, self._deviation, self.tau_s))

    def _deviation(self, yaw_rad: Floats) -> Floats:
        """How far the bent field is turned from the earth's, as the robot sees both: the reading turns back by that."""
        c, s = np.radians(self.cos2_deg), np.radians(self.sin2_deg)
        earth_forward, earth_left = np.sin(yaw_rad), np.cos(yaw_rad)
        forward = (1.0 + s) * earth_forward + c * earth_left
        left = c * earth_forward + (1.0 - s) * earth_left
        return np.asarray(
            -np.arctan2(earth_forward * left - earth_left * forward, earth_forward * forward + earth_left * left)
        )
