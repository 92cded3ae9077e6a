"""The simulator: one scenario in, one run folder out, with the truth beside it.

A scenario says everything: the robot, its instruments and their noise, the drive, the ground, the effects and the
logged columns. Everything random comes from named streams of its seed, so that two scenarios of one seed that differ in
an effect share drive and noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from studies.antenna import antenna_m, delay_s
from studies.arrays import BoolArray, Effects, FloatArray, IntArray, floats, gauss_markov, stream
from studies.columns import COLUMN_PORTS, Column, draw_columns
from studies.compass import column_on_grid, readings_rad
from studies.drives import Plan
from studies.motion import Motion, drive, grid
from studies.terrain import Terrain, draw_hills
from studies.vehicles import Instruments, Noise, Robot
from studies.wheels import told_angles_rad


@dataclass(frozen=True)
class Scenario:
    """Everything that makes one log."""

    seed: int = 0
    plan: Plan = field(default_factory=Plan)
    robot: Robot = field(default_factory=Robot)
    noise: Noise = field(default_factory=Noise)
    instruments: Instruments = field(default_factory=Instruments)
    effects: Effects = field(default_factory=dict)
    idle_columns: int = 0
    hills: bool = False

    @property
    def cause_columns(self) -> list[str]:
        """Names of the logged columns that drive an effect."""
        found = [name.split("~", 1)[1] for name in self.effects if name.split("~", 1)[0] in COLUMN_PORTS]
        return list(dict.fromkeys(found))

    def with_only(self, name: str) -> Scenario:
        """The same scenario with one of its effects alone, and without noise."""
        return replace(self, effects={name: self.effects[name]}, noise=Noise.none(), idle_columns=0)


@dataclass(frozen=True)
class Headings:
    """Readings of the AHRS: degrees counter-clockwise from east, not wrapped and not rounded; pitch and roll."""

    t_s: FloatArray
    yaw_deg: FloatArray
    pitch_deg: FloatArray
    roll_deg: FloatArray


@dataclass(frozen=True)
class Fixes:
    """Positions as the receiver has them."""

    stamp_s: FloatArray
    """The epoch by the receiver's clock, counted from the beginning of the log."""
    received_s: FloatArray
    """When the logging computer has it, by its own clock."""
    east_m: FloatArray
    north_m: FloatArray


@dataclass(frozen=True)
class Simulated:
    """One log in memory."""

    scenario: Scenario
    terrain: Terrain
    columns: Sequence[Column]
    motion: Motion

    @cached_property
    def told_rad(self) -> tuple[FloatArray, FloatArray]:
        """Cumulative angles of the wheels as they are counted, right and left, on the grid of the truth."""
        return told_angles_rad(self.motion, self.scenario.robot, self.scenario.effects)

    @cached_property
    def encoder_t_s(self) -> FloatArray:
        """Times of the samples of the counters."""
        return self._times("encoder", self.scenario.instruments.encoder_hz)

    @cached_property
    def headings(self) -> Headings:
        """The AHRS's readings, with white and Gauss-Markov error."""
        scenario, motion = self.scenario, self.motion
        rate_hz, noise = scenario.instruments.ahrs_hz, scenario.noise
        t_s = self._times("ahrs", rate_hz)
        yaw = np.degrees(readings_rad(motion, scenario.effects, self.columns, t_s, scenario.robot.heading_offset_deg))
        yaw += noise.heading_white_deg * self._normal("heading white", t_s)
        slow = self._normal("heading slow", t_s)
        yaw += gauss_markov(slow, 1.0 / rate_hz, noise.heading_slow_deg, noise.heading_slow_s)
        at_ahrs = [np.interp(t_s, motion.t_s, values) for values in (motion.east_m, motion.north_m, motion.heading_rad)]
        tilts = self.terrain.tilts(*at_ahrs)
        shake_deg = scenario.instruments.tilt_noise_deg if noise != Noise.none() else 0.0
        pitch, roll = (
            np.degrees(tilt) + shake_deg * self._normal(name, t_s) for tilt, name in zip(tilts, ("p", "r"), strict=True)
        )
        return Headings(t_s, yaw, pitch, roll)

    @cached_property
    def fixes(self) -> Fixes:
        """The receiver's fixes, with white and Gauss-Markov error, gaps, outliers and repeated positions."""
        scenario, told = self.scenario, self.scenario.instruments
        stamp_s = self._epochs()
        east, north = antenna_m(self.motion, scenario.effects, self.terrain, stamp_s)
        east, north = (values + self._fix_error(name, stamp_s) for values, name in ((east, "east"), (north, "north")))
        if told.holds_still:
            last = self._last_moving(stamp_s)
            east, north = east[last], north[last]
        kept = self._outside_gaps(stamp_s)
        late_s = told.delay_s + told.jitter_s * stream(scenario.seed, "transport").standard_exponential(stamp_s.size)
        latency_s = scenario.effects.get("gnss_latency", {}).get("s", 0.0)
        gained_s = delay_s(scenario.effects, stamp_s) - latency_s
        received = np.maximum.accumulate(stamp_s - gained_s + late_s)
        return Fixes(stamp_s[kept], received[kept], east[kept], north[kept])

    def column_at(self, column: Column, t_s: FloatArray) -> FloatArray:
        """A logged quantity at any times."""
        return floats(np.interp(t_s, self.motion.t_s, column_on_grid(self.motion, column)))

    def _times(self, name: str, rate_hz: float) -> FloatArray:
        """Sample times of one stream over the whole log, with a phase of its own."""
        count = int(self.scenario.plan.total_s * rate_hz)
        return floats((np.arange(count) + stream(self.scenario.seed, f"phase {name}").random()) / rate_hz)

    @property
    def utc_fraction_s(self) -> float:
        """Where the beginning of the log falls within a second of the receiver's clock."""
        return float(stream(self.scenario.seed, "utc").random())

    def _epochs(self) -> FloatArray:
        """The receiver's epochs: whole multiples of its period since a full second of its clock."""
        rate_hz, total_s = self.scenario.instruments.fix_hz, self.scenario.plan.total_s
        return 1.0 - self.utc_fraction_s + np.arange(int((total_s - 1.0) * rate_hz)) / rate_hz

    def _normal(self, name: str, t_s: FloatArray) -> FloatArray:
        """Standard normal draws; those within parking come from a stream of their own, so that they move no other."""
        parked = np.zeros(t_s.shape, dtype=bool)
        for begin, end in self._pauses:
            parked |= (t_s >= begin) & (t_s < end)
        out = np.empty(t_s.shape)
        out[~parked] = stream(self.scenario.seed, name).standard_normal(int(np.sum(~parked)))
        out[parked] = stream(self.scenario.seed, f"{name} parked").standard_normal(int(np.sum(parked)))
        return out

    @property
    def _pauses(self) -> list[tuple[float, float]]:
        return [(0.0, self.scenario.plan.parked_first_s), *self.motion.pauses_s]

    def _fix_error(self, axis: str, stamp_s: FloatArray) -> FloatArray:
        """White and slow error of one axis, and now and then an outlier of some fifteen times both."""
        noise, rate_hz = self.scenario.noise, self.scenario.instruments.fix_hz
        error = noise.fix_white_m * self._normal(f"{axis} white", stamp_s)
        error += gauss_markov(self._normal(f"{axis} slow", stamp_s), 1.0 / rate_hz, noise.fix_slow_m, noise.fix_slow_s)
        wild = stream(self.scenario.seed, "outliers").random(stamp_s.size) < noise.outlier_share
        size_m = 15.0 * np.hypot(noise.fix_white_m, noise.fix_slow_m)
        return floats(error + wild * size_m * stream(self.scenario.seed, f"{axis} wild").standard_normal(stamp_s.size))

    def _last_moving(self, stamp_s: FloatArray) -> IntArray:
        """For each epoch the last one at which the robot moved, or the first of all."""
        stands = self.motion.of_steps(self.motion.stands_in_step, stamp_s) > 0.99
        last: IntArray = np.maximum.accumulate(np.where(stands, 0, np.arange(stamp_s.size)))
        return last

    def _outside_gaps(self, stamp_s: FloatArray) -> BoolArray:
        kept = np.ones(stamp_s.shape, dtype=bool)
        for begin, end in self.scenario.instruments.gaps_s:
            kept &= ~((stamp_s >= begin) & (stamp_s <= end))
        return kept


def simulate(scenario: Scenario) -> Simulated:
    """Drive a scenario; its streams are sampled when they are asked for."""
    columns = draw_columns(scenario.seed, grid(scenario.plan), scenario.cause_columns, scenario.idle_columns)
    hills = draw_hills(stream(scenario.seed, "hills"), scenario.robot.unit_m) if scenario.hills else Terrain()
    motion = drive(
        scenario.plan,
        scenario.robot,
        scenario.seed,
        scenario.effects,
        columns,
        hills,
        scenario.noise.slip_m_per_sqrt_m,
    )
    return Simulated(scenario, hills, columns, motion)


def write_log(scenario: Scenario, folder: Path) -> Simulated:
    """Simulate a scenario and write its run folder."""
    from studies.writing import write_run

    simulated = simulate(scenario)
    write_run(simulated, folder)
    return simulated
