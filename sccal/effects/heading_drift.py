"""Heading drift: the AHRS's zero moves evenly with time.

heading += p t, with t from the run's start
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


class HeadingDrift(Effect):
    """Rate at which the reading runs away, deg per hour, counter-clockwise."""

    name = "heading_drift"
    title = "AHRS heading that drifts with time"
    parameters = (Parameter("deg_per_hour", "deg/h", 20.0, -1000.0, 1000.0, "run", matters=4),)
    looks_like = "the heading offset of the first minutes differs from that of the last; in between it moves evenly"
    excited_by = "drive for longer, with straights of 20 m in two directions at the beginning and at the end"
    reference = "Titterton and Weston 2004, Strapdown Inertial Navigation Technology: gyroscope bias"

    def says(self, found: Mapping[str, Measured]) -> str:
        rate = found["deg_per_hour"]
        return f"the AHRS heading drifts by {size(rate)} deg an hour {sense(rate)}"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        return (Column("deg_per_hour", "heading", np.radians((drive.headings.t_s - drive.start_s) / 3600.0)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Drifting(values["deg_per_hour"])


@dataclass(frozen=True)
class _Drifting(Physics):
    deg_per_hour: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"heading_drift": {"deg_per_hour": self.deg_per_hour}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return np.asarray(reading_rad + np.radians(self.deg_per_hour) / 3600.0 * state.t_s)
