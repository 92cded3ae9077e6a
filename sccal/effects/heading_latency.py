"""Heading latency: an AHRS reading stamped t shows the heading of τ earlier.

heading −= τ ω, with ω the mean turn rate of the τ before t

With that mean, taken at the value the column is computed for, the product is the whole turn missed and not only its
first order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.gnss_latency import mean_rates
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics, Sensor


class HeadingLatency(Effect):
    """Age of the AHRS readings, s; above zero they are old."""

    name = "heading_latency"
    title = "AHRS readings that show an earlier heading than their stamp says"
    parameters = (Parameter("s", "s", 0.2, -2.0, 2.0, "run", matters=0.03),)
    looks_like = "the heading lags in every turn, the more the faster the turn, and is right again on the straight"
    excited_by = "spin in place both ways, at two turn rates"
    stage = "body"
    bends_heading = True
    undone_for = "headings"
    reference = "Kelly and Sukhatme 2014, A general framework for temporal calibration of multiple sensors"
    shown_against = "turn_rate"

    def says(self, found: Mapping[str, Measured]) -> str:
        when = "before" if found["s"].value > 0.0 else "after"
        return f"the AHRS readings show the heading of {size(found['s'])} s {when} their stamp"

    def heading_delay_s(self, at: Mapping[str, float]) -> float:
        return at["s"]

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        _, turn_rate = mean_rates(drive.steps, drive.headings.t_s, at["s"])
        return (Column("s", "heading", -turn_rate),)

    def shown_turning(self, drive: DriveView, at: Mapping[str, float], turn_rad: Floats) -> Floats | None:
        now, then = (
            np.column_stack([np.interp(t_s, drive.steps.t_s, one) for one in turn_rad.cumsum(axis=0).T])
            for t_s in (drive.headings.t_s, drive.headings.t_s - at["s"])
        )
        return np.asarray(then - now)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Late(values["s"])


@dataclass(frozen=True)
class _Late(Physics):
    s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"heading_latency": {"s": self.s}}

    def shown_time(self, sensor: Sensor, t_s: Floats) -> Floats:
        return t_s - self.s if sensor == "ahrs" else t_s
