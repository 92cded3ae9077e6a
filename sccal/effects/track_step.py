"""Track step: from one moment on, the tracks turn the body by another share of what they say: another ground.

turn = Δθ / (1 + ratio [t > at_s])      Δθ as the wheels say with the track before; t from the start of the run

A skid-steered robot turns by the track that its ground gives it: 1.45 times the measured one on asphalt, 1.75 on grass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.radius_step import after
from sccal.effects.rims import stretch_turn
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, moment, percent
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair


class TrackStep(Effect):
    """Share by which the track is wider from ``at_s`` on."""

    name = "track_step"
    title = "track that changes at one moment: another ground under skidding tracks"
    parameters = (
        Parameter("ratio", "1", 0.1, -0.6, 1.5, scope="run", matters=0.01),
        Parameter("at_s", "s", 600.0, 0.0, 86400.0, scope="run", shape=True),
    )
    looks_like = "from one moment on every turn by the wheels is too large or too small by the same share"
    excited_by = "turn both ways before and after the change, at the same turn rates"
    reference = "Mandow et al. 2007, Experimental kinematics for wheeled skid-steer mobile robots (IROS)"
    shown_against = "turn_rate"
    search = "moment"
    suspect_stream = "motion"

    def says(self, found: Mapping[str, Measured]) -> str:
        grow = "grows" if found["ratio"].value > 0.0 else "shrinks"
        return f"the track {grow} by {percent(found['ratio'])} {moment(found['at_s'])}, as on another ground"

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        share = after(drive.steps, drive.start_s + at["at_s"]) / (1.0 + at["ratio"])
        return (Column("ratio", "turn", -drive.steps.turn_rad * share),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _OtherGround(values["ratio"], values["at_s"])


@dataclass(frozen=True)
class _OtherGround(Physics):
    ratio: float
    at_s: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        return {"track_step": {"ratio": self.ratio, "at_s": self.at_s}}

    def wheel_travel(self, motion: Motion, travel_m: WheelPair) -> WheelPair:
        return stretch_turn(travel_m, np.where(motion.t_s[1:] > self.at_s, 1.0 + self.ratio, 1.0))
