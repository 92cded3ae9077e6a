"""Heading step: the AHRS's zero jumps once, and stays.

heading += p after the time at_s from the run's start
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, moment, sense, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class HeadingStep(Effect):
    """Size of the jump, deg counter-clockwise, and its time, s from the run's start."""

    name = "heading_step"
    title = "AHRS heading that jumps once: a reset, or a knock on the mounting"
    parameters = (
        Parameter("deg", "deg", 10.0, -180.0, 180.0, "run", matters=1.5),
        Parameter("at_s", "s", 1000.0, 0.0, 1e6, "run", shape=True),
    )
    looks_like = "the heading offset has one value up to a moment and another one from there on"
    excited_by = "keep moving, with straights of 20 m before and after the jump"
    reference = "Basseville and Nikiforov 1993, Detection of Abrupt Changes: additive jump of a mean"
    search = "moment"
    suspect_stream = "headings"

    def says(self, found: Mapping[str, Measured]) -> str:
        jump = found["deg"]
        return f"the AHRS heading jumps by {size(jump)} deg {sense(jump)} {moment(found['at_s'])}"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        after = drive.headings.t_s - drive.start_s > at["at_s"]
        return (Column("deg", "heading", np.where(after, np.radians(1.0), 0.0)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Knocked(values["deg"], values["at_s"])


@dataclass(frozen=True)
class _Knocked(Physics):
    deg: float
    at_s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"heading_step": {"deg": self.deg, "at_s": self.at_s}}

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return np.asarray(reading_rad + np.radians(self.deg) * np.heaviside(state.t_s - self.at_s, 0.0))
