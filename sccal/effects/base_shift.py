"""Base shift: the reference station's coordinates change once during the run, and every fix with them.

east += p_e, north += p_n after the time at_s from the run's start
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, amplitude, moment
from sccal.simulate.physics import Physics
from sccal.simulate.world import State


class BaseShift(Effect):
    """How far the fixes jump, m, and when, s from the run's start."""

    name = "base_shift"
    title = "fixes that jump once: another base, or the base surveyed anew"
    parameters = (
        Parameter("east_m", "m", 1.0, -100.0, 100.0, "run", matters=0.08),
        Parameter("north_m", "m", 1.0, -100.0, 100.0, "run", matters=0.08),
        Parameter("at_s", "s", 1000.0, 0.0, 1e6, "run", shape=True),
    )
    looks_like = "from one moment on all fixes stand beside the path by the same distance in the same direction"
    excited_by = "any drive shows it; drive on for a minute before and after the jump"
    reference = "RTCM 10403, messages 1005 and 1006: coordinates of the reference station"
    search = "moment"
    suspect_stream = "fixes"

    def says(self, found: Mapping[str, Measured]) -> str:
        jump = amplitude(found["east_m"], found["north_m"])
        return f"all fixes jump by {jump} m {moment(found['at_s'])}"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        after = np.where(drive.fixes.t_s - drive.start_s > at["at_s"], 1.0, 0.0)
        return (Column("east_m", "east", after), Column("north_m", "north", after))

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Moved(values["east_m"], values["north_m"], values["at_s"])


@dataclass(frozen=True)
class _Moved(Physics):
    east_m: float
    north_m: float
    at_s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"base_shift": {"east_m": self.east_m, "north_m": self.north_m, "at_s": self.at_s}}

    def antenna(self, state: State, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        moved = np.heaviside(state.t_s - self.at_s, 0.0)
        return east_m + moved * self.east_m, north_m + moved * self.north_m
