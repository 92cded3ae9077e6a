"""Fixes that a receiver smooths: each shows a mean of where the antenna was, the recent past counting most.

fix += x̄ − x      x̄ the robot's path after a first-order filter, τ dx̄/dt = x − x̄

On a straight line at one speed that is a latency of τ. In turns it also cuts the corner: a circle driven at the turn
rate ω shows smaller by 1/√(1 + (ωτ)²), and with it the radii of the wheels come out.

The column is (x̄ − x)/τ at the current value: times τ it is the whole. At zero, where that is the column of a latency,
it is taken at 1 s, which tells the two apart. An antenna's arm is taken as it stands at the stamp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.gnss_latency import TRANSPORT_S
from sccal.effects.low_pass import low_passed
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import State

BEGIN_S, LEAST_S = 1.0, 0.05
"""Where a smoothing begins to be fitted, and what is none."""


def behind(values: Floats, t_s: Floats, smoothing_s: float) -> Floats:
    """How far quantities (n, …) are behind after each second of smoothing, about the smoothing given."""
    tau_s = smoothing_s if smoothing_s > LEAST_S else BEGIN_S
    return (low_passed(values, t_s, tau_s) - values) / tau_s


class FixSmoothing(Effect):
    """Time constant of the receiver's filter, s."""

    name = "fix_smoothing"
    stage = "body"
    title = "fixes that the receiver smooths: each shows a mean of where the antenna was"
    parameters = (Parameter("s", "s", 0.3, -0.1, 10.0, "run", matters=0.1, hidden_sigma=TRANSPORT_S),)
    looks_like = "fixes lag in proportion to speed and cut every corner, and all radii come out too small"
    excited_by = "turn at two turn rates, and drive straights at two speeds"
    reference = "a first-order filter; Kaplan and Hegarty 2017, Understanding GPS/GNSS, on smoothing in receivers"
    shown_against = "turn_rate"
    beside = "gnss_latency"

    def says(self, found: Mapping[str, Measured]) -> str:
        return f"the receiver smooths its positions over {size(found['s'])} s"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        yaw = drive.step_yaw_rad - 0.5 * steps.turn_rad
        path = np.column_stack((steps.along_m * np.cos(yaw), steps.along_m * np.sin(yaw))).cumsum(axis=0)
        east, north = (drive.at_fixes(one) for one in behind(path, steps.t_s, at["s"]).T)
        return (Column("s", "east", east), Column("s", "north", north))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Smoothing(values["s"])


@dataclass(frozen=True)
class _Smoothing(Physics):
    s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"fix_smoothing": {"s": self.s}}

    def antenna(self, state: State, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        return low_passed(east_m, state.t_s, self.s), low_passed(north_m, state.t_s, self.s)
