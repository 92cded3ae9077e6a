"""Hard iron: magnetised parts of the robot add a constant horizontal field to the earth's.

With ψ the robot's heading in enu and c, s the added field in parts of the earth's horizontal one, c forward and −s to
the left (so that both are angles for small ones), the reading is wrong by

    h = atan2(N, D)      N = c cos ψ + s sin ψ      D = 1 + c sin ψ − s cos ψ
    heading += h'        τ dh'/dt = h − h'        c and s in degrees of field: 57.3 are as strong as the earth

to first order N itself. The files hold c and s times 180/π, so that weak iron turns the reading by so many degrees.
An AHRS that lets its compass in slowly shows h', after a first-order filter of time constant τ. As h is not linear in c
and s the columns are made anew at the last answer, see sccal.effects.compass.
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


class HardIron(Effect):
    """The added field with the cosine and the sine of the robot's heading, deg of field, and the AHRS's slowness, s."""

    name = "hard_iron"
    title = "magnetised parts near the compass"
    parameters = (
        Parameter("cos_deg", "deg", 10.0, -100.0, 100.0, matters=0.03),
        Parameter("sin_deg", "deg", 10.0, -100.0, 100.0, matters=0.03),
        TAU,
    )
    looks_like = "the heading error swings once per full turn of the robot: one way going east, the other going west"
    excited_by = "drive in at least eight headings: full circles, or spin in place both ways by whole turns"
    reference = "NGA Pub. 226, Handbook of Magnetic Compass Adjustment: coefficients B and C"
    shown_against = "heading"
    search = "scale"
    bends_heading = True

    def says(self, found: Mapping[str, Measured]) -> str:
        most = amplitude(found["cos_deg"], found["sin_deg"])
        return f"magnetised parts near the compass turn it by up to {most} deg, once per full turn"

    def shown_by(self, drive: DriveShape) -> bool:
        return all_round(drive)

    def shape_grid(self, drive: DriveView) -> tuple[Mapping[str, float], ...]:
        """Time constants that the drive is long enough for."""
        return tried_taus(drive)

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        tau_s = at.get("tau_s", 0.0)
        cos, sin = slow_deviation_columns(drive.headings, 1.0, at["cos_deg"], at["sin_deg"], tau_s)
        return (Column("cos_deg", "heading", cos), Column("sin_deg", "heading", sin))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Magnetised(values["cos_deg"], values["sin_deg"], values.get("tau_s", 0.0))


@dataclass(frozen=True)
class _Magnetised(Physics):
    cos_deg: float
    sin_deg: float
    tau_s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"hard_iron": {"cos_deg": self.cos_deg, "sin_deg": self.sin_deg, **of_tau(self.tau_s)}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return np.asarray(reading_rad + let_in(state, self._deviation, self.tau_s))

    def _deviation(self, yaw_rad: Floats) -> Floats:
        """The field as the robot sees it: forward + i left, the earth's pointing north."""
        earth = 1j * np.exp(-1j * yaw_rad)
        own = np.radians(self.cos_deg) - 1j * np.radians(self.sin_deg)
        return np.asarray(-np.angle((earth + own) / earth))
