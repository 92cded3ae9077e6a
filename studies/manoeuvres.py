"""What a driver can ask of a robot: straight lines, arcs, spins in place and stops, followed by what he sees.

Each manoeuvre is asked at every tick of the driver for a forward speed and a turn rate, and answers None when it is
done. The driver sees where the robot really is, as somebody standing beside it does, and steers against what slips.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

from studies.vehicles import Robot

Command = tuple[float, float]


@dataclass(frozen=True)
class Seen:
    """What the driver sees: place, heading (not wrapped), forward speed and turn rate of the robot, and the time."""

    t_s: float
    east_m: float
    north_m: float
    heading_rad: float
    speed_mps: float


class Manoeuvre(Protocol):
    """One piece of a drive."""

    def command(self, seen: Seen, robot: Robot) -> Command | None:
        """Speed and turn rate that are wanted now, or None when the piece is done."""


@dataclass
class Stop:
    """Stand for some time."""

    duration_s: float
    begun_s: float | None = None

    def command(self, seen: Seen, robot: Robot) -> Command | None:
        """Zero speed until the time is over."""
        if self.begun_s is None:
            self.begun_s = seen.t_s
        return (0.0, 0.0) if seen.t_s < self.begun_s + self.duration_s - 1e-6 else None


@dataclass
class Spin:
    """Turn in place by an angle, to the left where it is positive."""

    angle_rad: float
    rate_radps: float
    goal_rad: float | None = None

    def command(self, seen: Seen, robot: Robot) -> Command | None:
        """The wanted rate, less of it towards the end: ω² = 2 α × the angle that is left."""
        if self.goal_rad is None:
            self.goal_rad = seen.heading_rad + self.angle_rad
        left = (self.goal_rad - seen.heading_rad) * math.copysign(1.0, self.angle_rad)
        if left < 0.01:
            return None
        rate = min(self.rate_radps, math.sqrt(1.4 * robot.turn_acceleration_radps2 * left))
        return 0.0, math.copysign(rate, self.angle_rad)


@dataclass
class Arc:
    """Drive an arc by an angle, to the left where it is positive; backwards where the speed is negative."""

    radius_m: float
    angle_rad: float
    speed_mps: float
    begun_rad: float | None = None

    def command(self, seen: Seen, robot: Robot) -> Command | None:
        """The wanted speed, and the turn rate that belongs to the speed of the moment."""
        if self.begun_rad is None:
            self.begun_rad = seen.heading_rad
        if (seen.heading_rad - self.begun_rad) * math.copysign(1.0, self.angle_rad) >= abs(self.angle_rad):
            return None
        return self.speed_mps, math.copysign(max(abs(seen.speed_mps), 0.02) / self.radius_m, self.angle_rad)


@dataclass
class Line:
    """Drive to a place on a straight line from where the robot is; backwards where the speed is negative."""

    east_m: float
    north_m: float
    speed_mps: float
    stops: bool = True
    begun: tuple[float, float] | None = field(default=None)

    def command(self, seen: Seen, robot: Robot) -> Command | None:
        """Follow the line: aim at it some way ahead, slower while the robot points elsewhere, and brake at its end."""
        if self.begun is None:
            self.begun = (seen.east_m, seen.north_m)
        course = math.atan2(self.north_m - self.begun[1], self.east_m - self.begun[0])
        to_go_east, to_go_north = self.east_m - seen.east_m, self.north_m - seen.north_m
        left_m = to_go_east * math.cos(course) + to_go_north * math.sin(course)
        if left_m <= 0.02 * abs(self.speed_mps) + 0.003:
            return None
        aside_m = to_go_east * math.sin(course) - to_go_north * math.cos(course)
        aim = course - math.atan(aside_m / max(1.5 * abs(self.speed_mps), 0.3))
        facing = seen.heading_rad + (math.pi if self.speed_mps < 0 else 0.0)
        off = math.remainder(aim - facing, 2.0 * math.pi)
        speed = abs(self.speed_mps) * max(math.cos(off), 0.0) ** 4
        if self.stops:
            speed = min(speed, math.sqrt(1.4 * robot.acceleration_mps2 * left_m))
        turn = max(-robot.turn_rate_radps, min(robot.turn_rate_radps, 1.5 * off))
        return math.copysign(speed, self.speed_mps), turn


@dataclass
class Straight:
    """Drive straight on by a distance; backwards where the speed is negative."""

    distance_m: float
    speed_mps: float
    line: Line | None = None

    def command(self, seen: Seen, robot: Robot) -> Command | None:
        """As on a line to the place that lies this far ahead."""
        if self.line is None:
            ahead_m = math.copysign(self.distance_m, self.speed_mps)
            self.line = Line(
                seen.east_m + ahead_m * math.cos(seen.heading_rad),
                seen.north_m + ahead_m * math.sin(seen.heading_rad),
                self.speed_mps,
            )
        return self.line.command(seen, robot)
