"""GNSS latency: a fix stamped t shows where the antenna was τ earlier.

In the robot's frame at t, with the mean speed v and the mean turn rate ω of the τ before it and k = sin(ωτ/2) / (ωτ/2):

    fix += Rot(θ) τ v k (−cos(ωτ/2), sin(ωτ/2))      to first order: forward −v τ

The columns are that divided by τ: times τ they give the whole chord at the value they were computed for, curvature and
changes of speed included, and at zero they are the derivative. How an arm turns about the robot meanwhile is the
fit's to put in, which knows the arm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.drive_shape import DriveShape, two_speeds
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import SMOOTH_S, DriveView, Steps
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics, Sensor


def mean_rates(steps: Steps, t_s: Floats, delay_s: Floats | float) -> tuple[Floats, Floats]:
    """Mean speed (m/s) and turn rate (rad/s) between ``t_s − delay_s`` and ``t_s``.

    Where the delay is shorter than SMOOTH_S they are taken over that long about the same middle: ticks are coarse.
    """
    middle, half = t_s - 0.5 * delay_s, 0.5 * np.maximum(np.abs(delay_s), SMOOTH_S)
    first, last = np.maximum(middle - half, steps.t_s[0]), np.minimum(middle + half, steps.t_s[-1])
    width = np.maximum(last - first, 1e-9)

    def mean(each: Floats) -> Floats:
        so_far = np.cumsum(each)
        return np.asarray((np.interp(last, steps.t_s, so_far) - np.interp(first, steps.t_s, so_far)) / width)

    return mean(steps.along_m), mean(steps.turn_rad)


def late_fix(drive: DriveView, delay_s: Floats | float) -> tuple[Floats, Floats]:
    """What each second of delay adds to each fix, forward and left (m/s), when the delay is ``delay_s``."""
    speed, turn_rate = mean_rates(drive.steps, drive.fixes.t_s, delay_s)
    half_turn = 0.5 * turn_rate * delay_s
    chord = speed * np.sinc(half_turn / np.pi)
    return -chord * np.cos(half_turn), chord * np.sin(half_turn)


TRANSPORT_S = 0.015
"""What lines take to arrive, and how well a receiver's time and the computer's agree: no log shows it."""


class GnssLatency(Effect):
    """Age of the fixes, s; above zero they are old."""

    name = "gnss_latency"
    stage = "body"
    on_every_robot = True
    title = "fixes that show an earlier place than their stamp says"
    parameters = (Parameter("s", "s", 0.2, -2.0, 2.0, "run", matters=0.07, hidden_sigma=TRANSPORT_S),)
    looks_like = "fixes lag behind the path in proportion to speed, and run ahead of it in reverse"
    excited_by = "drive at a second speed, or reverse 10 m: at one speed it is the same as a forward lever arm"
    reference = "Skog and Händel 2011, Time synchronization errors in loosely coupled GPS-aided inertial navigation"
    shown_against = "speed"
    undone_for = "fixes"

    def says(self, found: Mapping[str, Measured]) -> str:
        when = "before" if found["s"].value > 0.0 else "after"
        return f"the fixes show where the antenna was {size(found['s'])} s {when} their stamp"

    def shown_by(self, drive: DriveShape) -> bool:
        return two_speeds(drive)

    def fix_delay_s(self, drive: DriveView, at: Mapping[str, float]) -> Floats:
        return np.full(drive.fixes.t_s.size, at["s"])

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        forward, left = late_fix(drive, at["s"])
        return (Column("s", "antenna_forward", forward), Column("s", "antenna_left", left))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Late(values["s"])


@dataclass(frozen=True)
class _Late(Physics):
    s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"gnss_latency": {"s": self.s}}

    def shown_time(self, sensor: Sensor, t_s: Floats) -> Floats:
        return t_s - self.s if sensor == "gnss" else t_s
