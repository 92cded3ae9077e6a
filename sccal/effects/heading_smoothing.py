"""Headings that an AHRS smooths: each shows a mean of where the robot looked, the recent past counting most.

heading += θ̄ − θ      θ̄ the robot's turning after a first-order filter, τ dθ̄/dt = θ − θ̄

In a turn that goes on longer than τ it is a latency of τ, and at its ends it is not: the reading bends in and out. Of a
spin to and fro that is shorter than τ it takes a part away, as a gyro does whose gain is low. The column is that of the
smoothing of fixes, of the turning in place of the path.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.fix_smoothing import behind
from sccal.effects.low_pass import low_passed
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import State

STEP_S = 0.005
"""Half a step of an AHRS that computes 100 times a second: whether its filter counts it, no log shows."""


class HeadingSmoothing(Effect):
    """Time constant of the AHRS's filter, s."""

    name = "heading_smoothing"
    stage = "body"
    title = "AHRS readings that are smoothed: each shows a mean of the headings before it"
    parameters = (Parameter("s", "s", 0.3, -0.1, 10.0, "run", matters=0.1, hidden_sigma=STEP_S),)
    looks_like = "the heading lags in every turn and bends into it and out of it, and is right again on the straight"
    excited_by = "turn both ways, in turns that are shorter and longer than the smoothing"
    reference = "Mahony et al. 2008, Nonlinear complementary filters on the special orthogonal group"
    bends_heading = True
    shown_against = "turn_rate"
    beside = "heading_latency"

    def says(self, found: Mapping[str, Measured]) -> str:
        return f"the AHRS smooths its headings over {size(found['s'])} s"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        late = behind(np.cumsum(steps.turn_rad), steps.t_s, at["s"])
        return (Column("s", "heading", drive.at_headings(late)),)

    def shown_turning(self, drive: DriveView, at: Mapping[str, float], turn_rad: Floats) -> Floats | None:
        late = at["s"] * behind(turn_rad.cumsum(axis=0), drive.steps.t_s, at["s"])
        return np.column_stack([drive.at_headings(one) for one in late.T])

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Smoothing(values["s"])


@dataclass(frozen=True)
class _Smoothing(Physics):
    s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"heading_smoothing": {"s": self.s}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return reading_rad + low_passed(state.yaw_rad, state.t_s, self.s) - state.yaw_rad
