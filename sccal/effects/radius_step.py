"""Radius step: from one moment on, the wheels are another size: a load taken up, soil picked up, a tyre that loses air.

travel = R φ (1 + ratio [t > at_s])      both wheels, or the one that is named; t from the start of the run
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.one_wheel import Wheels, changes, wheel_columns, wheels_turned
from sccal.effects.view import DriveView, Steps
from sccal.effects.words import Measured, moment
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair


def after(steps: Steps, at_s: float) -> Floats:
    """Share of each step (n,) that comes after a moment on the log's clock."""
    return np.clip((steps.t_s - at_s) / np.maximum(steps.dt_s, 1e-9), 0.0, 1.0)


class _RadiusStep(Effect):
    """Share by which some wheels' radii are larger from ``at_s`` on."""

    stage = "wheels"
    parameters = (
        Parameter("ratio", "1", 0.02, -0.5, 0.5, scope="run", matters=0.004),
        Parameter("at_s", "s", 600.0, 0.0, 86400.0, scope="run", shape=True),
    )
    excited_by = "drive straights before and after the change, at the same speed"
    reference = "loaded against unloaded wheel radius; geometry"
    search = "moment"
    suspect_stream = "motion"
    wheels: Wheels
    whose: str

    def says(self, found: Mapping[str, Measured]) -> str:
        return f"{changes(self.wheels, self.whose, found['ratio'])} {moment(found['at_s'])}"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        return wheel_columns("ratio", self.wheels, drive.steps, after(drive.steps, drive.start_s + at["at_s"]))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Loaded(self.name, self.wheels, values["ratio"], values["at_s"])


class RadiusStep(_RadiusStep):
    """Share by which both radii are larger from ``at_s`` on."""

    name = "radius_step"
    title = "radii that change at one moment: a load, mud, a loss of pressure"
    looks_like = "both radii jump at one moment and stay there"
    wheels = ("right", "left")
    whose = "both wheels' radii"


class RadiusStepLeft(_RadiusStep):
    """Share by which the left radius is larger from ``at_s`` on."""

    name = "radius_step_left"
    title = "left wheel whose radius changes at one moment: a tyre that loses air, mud"
    looks_like = "from one moment on the path bends by the wheels alone, and the left radius is another"
    wheels = ("left",)
    whose = "the left wheel's radius"


class RadiusStepRight(_RadiusStep):
    """Share by which the right radius is larger from ``at_s`` on."""

    name = "radius_step_right"
    title = "right wheel whose radius changes at one moment: a tyre that loses air, mud"
    looks_like = "from one moment on the path bends by the wheels alone, and the right radius is another"
    wheels = ("right",)
    whose = "the right wheel's radius"


@dataclass(frozen=True)
class _Loaded(Physics):
    name: str
    wheels: Wheels
    ratio: float
    at_s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {self.name: {"ratio": self.ratio, "at_s": self.at_s}}

    def wheel_angle(self, motion: Motion, angle_rad: WheelPair) -> WheelPair:
        def turned(rad: Floats) -> Floats:
            before = float(np.interp(self.at_s, motion.t_s, rad))
            return np.where(motion.t_s > self.at_s, before + (rad - before) / (1.0 + self.ratio), rad)

        return wheels_turned(self.wheels, angle_rad, turned)
