"""Radius step: from one moment on, both radii are another size: a load taken up, soil picked up.

travel = R φ (1 + ratio [t > at_s])      each wheel; t from the start of the run
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, moment, percent
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair


class RadiusStep(Effect):
    """Share by which both radii are larger from ``at_s`` on."""

    name = "radius_step"
    stage = "wheels"
    title = "radii that change at one moment: a load, mud, a loss of pressure"
    parameters = (
        Parameter("ratio", "1", 0.02, -0.5, 0.5, scope="run", matters=0.004),
        Parameter("at_s", "s", 600.0, 0.0, 86400.0, scope="run", shape=True),
    )
    looks_like = "both radii jump at one moment and stay there"
    excited_by = "drive straights before and after the change, at the same speed"
    reference = "loaded against unloaded wheel radius; geometry"
    search = "moment"
    suspect_stream = "motion"

    def says(self, found: Mapping[str, Measured]) -> str:
        grow = "grow" if found["ratio"].value > 0.0 else "shrink"
        return f"both wheels' radii {grow} by {percent(found['ratio'])} {moment(found['at_s'])}"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        steps = drive.steps
        since_s = steps.t_s - drive.start_s - at["at_s"]
        share = np.clip(since_s / np.maximum(steps.dt_s, 1e-9), 0.0, 1.0)
        return (
            Column("ratio", "right_wheel", steps.right_m * share),
            Column("ratio", "left_wheel", steps.left_m * share),
        )

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Loaded(values["ratio"], values["at_s"])


@dataclass(frozen=True)
class _Loaded(Physics):
    ratio: float
    at_s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"radius_step": {"ratio": self.ratio, "at_s": self.at_s}}

    def wheel_angle(self, motion: Motion, angle_rad: WheelPair) -> WheelPair:
        def turned(rad: Floats) -> Floats:
            before = float(np.interp(self.at_s, motion.t_s, rad))
            return np.where(motion.t_s > self.at_s, before + (rad - before) / (1.0 + self.ratio), rad)

        return WheelPair(left=turned(angle_rad.left), right=turned(angle_rad.right))
