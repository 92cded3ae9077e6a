"""The hooks: where a further effect happens, stage by stage.

A subclass overrides the stages at which its effect acts and leaves the others alone; ``simulate_run`` applies several
in the order given. Nothing here knows how a calibration would model the effect.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from sccal.arrays import Floats
from sccal.simulate.world import BodySteps, Motion, State, WheelPair

Sensor = Literal["encoder", "ahrs", "gnss"]


class Physics:
    """One effect of the real world; this one does nothing."""

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        """The effect's parameters by effect name, for truth.json: ``{"turn_slip": {"per_radps": 0.1}}``."""
        return {}

    def body(self, steps: BodySteps) -> BodySteps:
        """How the body really moves in each step, before positions are integrated: side slip, say."""
        return steps

    def wheel_travel(self, motion: Motion, travel_m: WheelPair) -> WheelPair:
        """What each rim runs over the ground in each step while the body moves so: slip in turns, or with speed."""
        return travel_m

    def wheel_angle(self, motion: Motion, angle_rad: WheelPair) -> WheelPair:
        """Cumulative angle of each wheel at each grid time: a radius that changes, an eccentric wheel."""
        return angle_rad

    def shown_time(self, sensor: Sensor, t_s: Floats) -> Floats:
        """The true moment that a sample taken at ``t_s`` (from the start of the drive) shows: a latency."""
        return t_s

    def host_time(self, sensor: Sensor, t_s: Floats, host_t_s: Floats) -> Floats:
        """The stamp that the logging computer puts on the sample of ``t_s``: skew, a clock that jumps."""
        return host_t_s

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        """What the AHRS reads (enu, not wrapped): iron, drift, a knock."""
        return reading_rad

    def tilt(self, state: State, pitch_rad: Floats, roll_rad: Floats) -> tuple[Floats, Floats]:
        """Pitch (nose up) and roll (left side up) of the ground below, level at first: a hill puts its own in place.

        Effects that need the same hill each lay it out, so it must not be added to what is there.
        """
        return pitch_rad, roll_rad

    def antenna(self, state: State, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        """Where the fixes say that the antenna is: a lever arm, a base that moved."""
        return east_m, north_m
