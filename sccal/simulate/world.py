"""What is true: the body's motion on a fine grid, and what the wheels do for it.

In each step the body moves with constant velocity (forward, left) and turn rate, so with s forward, d to the left and a
turn of Δθ the step is exactly an arc:

    k = sin(Δθ/2) / (Δθ/2)      x += k (s cos m − d sin m)      y += k (s sin m + d cos m)      m = θ + Δθ/2
    right rim: s + Δθ L/2       left rim: s − Δθ L/2            angle = (travel + slip) / R
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.randomness import random_stream, random_walk
from sccal.simulate.settings import VehicleSettings


@dataclass(frozen=True)
class BodySteps:
    """The body's motion in n steps between n + 1 evenly spaced times from 0."""

    t_s: Floats
    along_m: Floats
    side_m: Floats
    """To the left."""
    turn_rad: Floats
    start_yaw_rad: float


@dataclass(frozen=True)
class State:
    """The robot at some times (which need not be on the grid)."""

    t_s: Floats
    east_m: Floats
    north_m: Floats
    yaw_rad: Floats
    """Not wrapped."""
    speed_mps: Floats
    side_speed_mps: Floats
    turn_rate_radps: Floats


@dataclass(frozen=True)
class WheelPair:
    """One array for each wheel."""

    left: Floats
    right: Floats


def _arc_factor(turn_rad: Floats) -> Floats:
    return np.asarray(np.sinc(turn_rad / (2.0 * np.pi)))


@dataclass(frozen=True)
class Motion:
    """The true drive: steps, and position and heading at the n + 1 grid times."""

    steps: BodySteps
    east_m: Floats
    north_m: Floats
    yaw_rad: Floats

    @property
    def t_s(self) -> Floats:
        return self.steps.t_s

    @property
    def step_s(self) -> float:
        return float(self.t_s[1] - self.t_s[0])

    def at(self, t_s: Floats) -> State:
        """The state at any times, exact within the steps; before the start and after the end the robot stands."""
        steps = self.steps
        t = np.clip(t_s, self.t_s[0], self.t_s[-1])
        i = np.clip(np.searchsorted(self.t_s, t, side="right") - 1, 0, steps.turn_rad.size - 1)
        part = (t - self.t_s[i]) / self.step_s
        turn = steps.turn_rad[i] * part
        length = _arc_factor(turn) * part
        middle = self.yaw_rad[i] + 0.5 * turn
        cos, sin = length * np.cos(middle), length * np.sin(middle)
        per_s = np.where((t_s < self.t_s[0]) | (t_s > self.t_s[-1]), 0.0, 1.0 / self.step_s)
        return State(
            t_s=np.asarray(t_s, dtype=float),
            east_m=self.east_m[i] + steps.along_m[i] * cos - steps.side_m[i] * sin,
            north_m=self.north_m[i] + steps.along_m[i] * sin + steps.side_m[i] * cos,
            yaw_rad=self.yaw_rad[i] + turn,
            speed_mps=steps.along_m[i] * per_s,
            side_speed_mps=steps.side_m[i] * per_s,
            turn_rate_radps=steps.turn_rad[i] * per_s,
        )


def integrate(steps: BodySteps) -> Motion:
    """Positions and headings from the steps; the drive begins at the origin."""
    yaw = steps.start_yaw_rad + np.concatenate(([0.0], np.cumsum(steps.turn_rad)))
    factor = _arc_factor(steps.turn_rad)
    middle = yaw[:-1] + 0.5 * steps.turn_rad
    cos, sin = factor * np.cos(middle), factor * np.sin(middle)
    east = np.concatenate(([0.0], np.cumsum(steps.along_m * cos - steps.side_m * sin)))
    north = np.concatenate(([0.0], np.cumsum(steps.along_m * sin + steps.side_m * cos)))
    return Motion(steps=steps, east_m=east, north_m=north, yaw_rad=yaw)


def rim_travel(steps: BodySteps, track_m: float) -> WheelPair:
    """What each rim runs in each step (m), if nothing slips."""
    half = 0.5 * track_m * steps.turn_rad
    return WheelPair(left=steps.along_m - half, right=steps.along_m + half)


def wheel_angles(travel_m: WheelPair, vehicle: VehicleSettings, seed: int) -> WheelPair:
    """Cumulative wheel angles (rad) at the grid times, with each wheel's own slip."""

    def angle(name: str, steps_m: Floats, radius_m: float) -> Floats:
        slip = random_walk(random_stream(seed, f"slip.{name}"), steps_m, vehicle.slip_m_per_sqrt_m)
        return (np.concatenate(([0.0], np.cumsum(steps_m))) + slip) / radius_m

    return WheelPair(
        left=angle("left", travel_m.left, vehicle.radius_left_m),
        right=angle("right", travel_m.right, vehicle.radius_right_m),
    )
