"""What columns may be computed from: the drive as wheels, heading and tilt show it, at every event and measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from sccal.align import Aligned, Series, Timeline
from sccal.arrays import Floats

SMOOTH_S = 0.3


@dataclass(frozen=True)
class Rates:
    """Speed, turn rate and acceleration over SMOOTH_S about any time; computed where somebody asks."""

    t_s: Floats
    along_m: Floats
    """Cumulative, as the turn."""
    turn_rad: Floats

    @classmethod
    def of_steps(cls, t_s: Floats, right_m: Floats, left_m: Floats, track_m: float) -> Rates:
        """Of the wheels' travel in each step (n,)."""
        right, left = np.cumsum(right_m), np.cumsum(left_m)
        return cls(t_s, 0.5 * (right + left), (right - left) / track_m)

    def speed(self, at_s: Floats) -> Floats:
        """Along, m/s."""
        return _rate(self.t_s, self.along_m, at_s)

    def turn_rate(self, at_s: Floats) -> Floats:
        """By the wheels, rad/s."""
        return _rate(self.t_s, self.turn_rad, at_s)

    def acceleration(self, at_s: Floats) -> Floats:
        """Along, m/s²."""
        half = 0.5 * SMOOTH_S
        return (self.speed(at_s + half) - self.speed(at_s - half)) / (2.0 * half)


@dataclass(frozen=True)
class Steps:
    """The n motion events of a timeline; each quantity belongs to the step that ends there (0 at the first)."""

    t_s: Floats
    dt_s: Floats
    right_m: Floats
    """Travel of the right wheel."""
    left_m: Floats
    track_m: float
    rates: Rates
    right_angle_rad: Floats
    """Cumulative angle of the right wheel from the log's first sample, in the middle of the step."""
    left_angle_rad: Floats
    right_rate_radps: Floats
    """Of the right wheel, as counted."""
    left_rate_radps: Floats
    pitch_rad: Floats
    """Nose up; 0 where the AHRS does not give it."""
    roll_rad: Floats
    """Left side up."""

    @cached_property
    def along_m(self) -> Floats:
        """Travel of the middle between the wheels."""
        return 0.5 * (self.right_m + self.left_m)

    @cached_property
    def turn_rad(self) -> Floats:
        """Turn by the wheels."""
        return (self.right_m - self.left_m) / self.track_m

    @cached_property
    def speed_mps(self) -> Floats:
        """Along, in the middle of the step."""
        return self.rates.speed(self._middle_s)

    @cached_property
    def turn_rate_radps(self) -> Floats:
        """In the middle of the step."""
        return self.rates.turn_rate(self._middle_s)

    @cached_property
    def acceleration_mps2(self) -> Floats:
        """Along; positive while a forward speed grows."""
        return self.rates.acceleration(self._middle_s)

    @property
    def _middle_s(self) -> Floats:
        return self.t_s - 0.5 * self.dt_s


@dataclass(frozen=True)
class Moments:
    """The robot at some measurements."""

    t_s: Floats
    rates: Rates
    yaw_rad: Floats
    """The robot's heading as far as known, not wrapped."""
    east_m: Floats
    north_m: Floats

    @cached_property
    def speed_mps(self) -> Floats:
        """Along."""
        return self.rates.speed(self.t_s)

    @cached_property
    def turn_rate_radps(self) -> Floats:
        """By the wheels."""
        return self.rates.turn_rate(self.t_s)

    @cached_property
    def acceleration_mps2(self) -> Floats:
        """Along; positive while a forward speed grows."""
        return self.rates.acceleration(self.t_s)


@dataclass(frozen=True)
class DriveView:
    """One run, seen for its effects."""

    start_s: float
    """First time of the run: drifts and steps count from here."""
    duration_s: float
    steps: Steps
    headings: Moments
    fixes: Moments
    fix_delay_s: Floats | float = 0.0
    """How old each fix is as far as known (f,): it shows the robot as it stood so long before its stamp."""
    heading_delay_s: float = 0.0
    """The same of the AHRS readings."""
    logged: Mapping[str, Series] = field(default_factory=dict)
    """The log's further columns."""

    @property
    def step_yaw_rad(self) -> Floats:
        """Heading at the motion events (n,)."""
        return self._at_steps(self.headings.yaw_rad)

    @property
    def step_place_m(self) -> tuple[Floats, Floats]:
        """East and north at the motion events, (n,) each."""
        return self._at_steps(self.headings.east_m), self._at_steps(self.headings.north_m)

    def at_fixes(self, of_steps: Floats) -> Floats:
        """A quantity of the motion events (n,) where the fixes show the robot (f,)."""
        return np.interp(self.fixes.t_s - self.fix_delay_s, self.steps.t_s, of_steps)

    def at_headings(self, of_steps: Floats) -> Floats:
        """The same where the AHRS readings show the robot (h,)."""
        return np.interp(self.headings.t_s - self.heading_delay_s, self.steps.t_s, of_steps)

    def _at_steps(self, of_headings: Floats) -> Floats:
        return np.interp(self.steps.t_s, self.headings.t_s, of_headings)

    def logged_at(self, name: str, t_s: Floats) -> Floats:
        """A further column interpolated to some times; zeros where this log has no such column."""
        series = self.logged.get(name)
        return np.zeros(t_s.size) if series is None else np.interp(t_s, series.t_s, series.values)


@dataclass(frozen=True)
class Belief:
    """What is known of the vehicle and its path when columns are computed."""

    radius_right_m: float
    radius_left_m: float
    track_m: float
    t_s: Floats
    """Times of the path (k,)."""
    yaw_rad: Floats
    east_m: Floats
    north_m: Floats


def view_drive(
    aligned: Aligned, timeline: Timeline, belief: Belief, clear: tuple[Floats, Floats] | None = None
) -> DriveView:
    """The drive at the timeline's events and measurements.

    ``clear`` are the wheels' steps freed of slip, right and left (n,) rad, as from sccal.align.clear_steps: a column
    made of steps or rates that hold the noise it is regressed on would come out biased. None: the steps as they are.
    """
    right_rad, left_rad = (timeline.right_rad, timeline.left_rad) if clear is None else clear
    right_m, left_m = belief.radius_right_m * right_rad, belief.radius_left_m * left_rad
    if clear is None:
        right, left = belief.radius_right_m * aligned.right_rad, belief.radius_left_m * aligned.left_rad
        rates = Rates(aligned.wheel_t_s, 0.5 * (right + left), (right - left) / belief.track_m)
    else:
        rates = Rates.of_steps(timeline.t_s, right_m, left_m, belief.track_m)

    def moments(at_s: Floats) -> Moments:
        return Moments(
            t_s=at_s,
            rates=rates,
            yaw_rad=np.interp(at_s, belief.t_s, belief.yaw_rad),
            east_m=np.interp(at_s, belief.t_s, belief.east_m),
            north_m=np.interp(at_s, belief.t_s, belief.north_m),
        )

    ends = timeline.t_s
    dt = np.diff(ends, prepend=ends[0])
    middle = ends - 0.5 * dt
    pitch, roll = aligned.pitch_rad, aligned.roll_rad
    zeros = np.zeros(ends.size)
    steps = Steps(
        t_s=ends,
        dt_s=dt,
        right_m=right_m,
        left_m=left_m,
        track_m=belief.track_m,
        rates=rates,
        right_angle_rad=np.interp(middle, aligned.wheel_t_s, aligned.right_rad),
        left_angle_rad=np.interp(middle, aligned.wheel_t_s, aligned.left_rad),
        right_rate_radps=_rate(aligned.wheel_t_s, aligned.right_rad, middle),
        left_rate_radps=_rate(aligned.wheel_t_s, aligned.left_rad, middle),
        pitch_rad=zeros if pitch is None else np.interp(middle, aligned.heading_t_s, pitch),
        roll_rad=zeros if roll is None else np.interp(middle, aligned.heading_t_s, roll),
    )
    return DriveView(
        start_s=aligned.span_s[0],
        duration_s=aligned.span_s[1] - aligned.span_s[0],
        steps=steps,
        headings=moments(aligned.heading_t_s[timeline.heading_index]),
        fixes=moments(aligned.fix_t_s[timeline.fix_index]),
        logged=aligned.extras,
    )


def with_travel(drive: DriveView, right_m: Floats, left_m: Floats) -> DriveView:
    """The same drive with other travel of the wheels in each step (n,): speeds and turn rates follow."""
    rates = Rates.of_steps(drive.steps.t_s, right_m, left_m, drive.steps.track_m)
    return replace(
        drive,
        steps=replace(drive.steps, right_m=right_m, left_m=left_m, rates=rates),
        headings=replace(drive.headings, rates=rates),
        fixes=replace(drive.fixes, rates=rates),
    )


def _rate(t_s: Floats, cumulative: Floats, at_s: Floats) -> Floats:
    half = 0.5 * SMOOTH_S
    first, last = np.maximum(at_s - half, t_s[0]), np.minimum(at_s + half, t_s[-1])
    change = np.interp(last, t_s, cumulative) - np.interp(first, t_s, cumulative)
    return np.asarray(change / np.maximum(last - first, 1e-9))
