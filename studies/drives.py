"""Drives: endless programs of manoeuvres, drawn from a seed.

A *dull* drive is one kind of figure at one speed; a *varied* one changes its speed from lap to lap and adds, between
laps, spins both ways at two rates, reverse legs, stops and starts: the pieces without which some effects look alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np

from studies.arrays import pick_sign
from studies.manoeuvres import Arc, Line, Manoeuvre, Spin, Stop, Straight
from studies.vehicles import Robot

Lap = Callable[[np.random.Generator, Robot, float], Iterator[Manoeuvre]]


@dataclass(frozen=True)
class Plan:
    """Which drive: its kind, whether it is varied, its length, and how long the robot stands beside that."""

    kind: str = "mixed"
    varied: bool = True
    duration_s: float = 600.0
    stand_first_s: float = 5.0
    parked_first_s: float = 0.0
    """Parking before the drive; it comes on top of the duration."""
    parked_midway_s: float | None = None
    """Parking in the middle of the drive, on top of the duration too; zero is a short stop there, None is no stop."""
    turn_first_deg: float | None = None

    @property
    def total_s(self) -> float:
        """The length of the log."""
        return self.duration_s + self.parked_first_s + (self.parked_midway_s or 0.0)


def rectangle_with_pivots(rng: np.random.Generator, robot: Robot, speed_mps: float) -> Iterator[Manoeuvre]:
    """A rectangle from the middle of the field, turning in place at each corner."""
    long_m, wide_m = robot.unit_m * rng.uniform(1.0, 2.2), robot.unit_m * rng.uniform(0.6, 1.4)
    side = pick_sign(rng)
    for distance_m in (long_m, wide_m, long_m, wide_m):
        yield Straight(float(distance_m), speed_mps)
        yield Spin(side * math.pi / 2.0, robot.turn_rate_radps * float(rng.uniform(0.6, 1.0)))


def rectangle_with_arcs(rng: np.random.Generator, robot: Robot, speed_mps: float) -> Iterator[Manoeuvre]:
    """A rectangle with rounded corners, which is driven without a stop."""
    long_m, wide_m = robot.unit_m * rng.uniform(1.0, 2.2), robot.unit_m * rng.uniform(0.8, 1.4)
    radius_m = tightest_m(robot, speed_mps) * float(rng.uniform(1.0, 1.8))
    side, first = pick_sign(rng), float(rng.integers(0, 4)) * math.pi / 2.0
    east_m, north_m = rng.uniform(-0.5, 0.5, 2) * robot.unit_m
    for number, distance_m in enumerate((long_m, wide_m, long_m, wide_m)):
        course = first + side * number * math.pi / 2.0
        east_m, north_m = east_m + distance_m * math.cos(course), north_m + distance_m * math.sin(course)
        back_m = min(radius_m, 0.45 * distance_m)
        yield Line(
            float(east_m - back_m * math.cos(course)), float(north_m - back_m * math.sin(course)), speed_mps, False
        )
        yield Arc(radius_m, side * math.pi / 2.0, speed_mps)


def circle(rng: np.random.Generator, robot: Robot, speed_mps: float) -> Iterator[Manoeuvre]:
    """Two times round a circle."""
    radius_m = max(tightest_m(robot, speed_mps), robot.unit_m * float(rng.uniform(0.25, 0.8)))
    yield Arc(radius_m, pick_sign(rng) * 4.0 * math.pi, speed_mps)


def figure_eight(rng: np.random.Generator, robot: Robot, speed_mps: float) -> Iterator[Manoeuvre]:
    """One circle to the left and one to the right."""
    radius_m = max(tightest_m(robot, speed_mps), robot.unit_m * float(rng.uniform(0.2, 0.6)))
    side = pick_sign(rng)
    yield Arc(radius_m, side * 2.0 * math.pi, speed_mps)
    yield Arc(radius_m, -side * 2.0 * math.pi, speed_mps)


def rows(rng: np.random.Generator, robot: Robot, speed_mps: float) -> Iterator[Manoeuvre]:
    """Some rows of a field, with a half circle or a turn in three pieces at each headland."""
    length_m, pieces = robot.unit_m * float(rng.uniform(1.0, 2.5)), rng.random() < 0.5
    course = float(rng.integers(0, 8)) * math.pi / 4.0
    side, slow_mps = pick_sign(rng), 0.6 * speed_mps
    radius_m = tightest_m(robot, slow_mps) * float(rng.uniform(0.8, 1.2))
    start = rng.uniform(-0.6, 0.6, 2) * robot.unit_m
    yield Line(float(start[0]), float(start[1]), speed_mps)
    for number in range(int(rng.integers(3, 6))):
        forth = course + number * math.pi
        ahead = (length_m if number % 2 == 0 else 0.0) * np.array([math.cos(course), math.sin(course)])
        aside = side * 2.0 * radius_m * number * np.array([-math.sin(course), math.cos(course)])
        end = start + ahead + aside
        yield Line(float(end[0]), float(end[1]), speed_mps, stops=pieces)
        turn = side if math.cos(forth - course) > 0 else -side
        if pieces:
            yield Spin(turn * math.pi / 2.0, robot.turn_rate_radps)
            yield Straight(2.0 * radius_m, slow_mps)
            yield Spin(turn * math.pi / 2.0, robot.turn_rate_radps)
        else:
            yield Arc(radius_m, turn * math.pi, slow_mps)


def wander(rng: np.random.Generator, robot: Robot, speed_mps: float) -> Iterator[Manoeuvre]:
    """Five places of the field in turn, with or without a stop at each, and an arc now and then."""
    for _ in range(5):
        east_m, north_m = rng.uniform(-1.3, 1.3, 2) * robot.unit_m
        hurry = float(rng.uniform(0.6, 1.0)) * speed_mps
        yield Line(float(east_m), float(north_m), hurry, stops=bool(rng.random() < 0.5))
        if rng.random() < 0.4:
            radius_m = tightest_m(robot, hurry) * float(rng.uniform(1.0, 2.5))
            yield Arc(radius_m, pick_sign(rng) * float(rng.uniform(0.5, 2.0)) * math.pi, hurry)


LAPS: dict[str, Lap] = {
    "pivots": rectangle_with_pivots,
    "arcs": rectangle_with_arcs,
    "circle": circle,
    "eights": figure_eight,
    "rows": rows,
    "wander": wander,
}
KINDS = (*LAPS, "mixed")
SPEEDS = (0.45, 0.7, 1.0)
"""The speeds of the laps of a varied drive, over the fastest; every three laps have all of them, in any order."""


def extras(rng: np.random.Generator, robot: Robot) -> Iterator[Manoeuvre]:
    """Between two laps: spins both ways at two rates, a reverse leg, a stop, or several of them."""
    side = pick_sign(rng)
    if rng.random() < 0.7:
        turns = float(rng.uniform(1.0, 1.6)) * 2.0 * math.pi
        yield Spin(side * turns, robot.turn_rate_radps)
        yield Spin(-side * turns, robot.turn_rate_radps * float(rng.uniform(0.35, 0.6)))
    if rng.random() < 0.6:
        yield Stop(float(rng.uniform(1.0, 6.0)))
    if rng.random() < 0.7:
        yield Straight(robot.unit_m * float(rng.uniform(0.4, 1.0)), -robot.speed_mps * float(rng.uniform(0.4, 0.8)))
    if rng.random() < 0.4:
        radius_m = tightest_m(robot, robot.speed_mps) * float(rng.uniform(1.0, 1.6))
        yield Arc(radius_m, side * math.pi, -0.5 * robot.speed_mps)


def tightest_m(robot: Robot, speed_mps: float) -> float:
    """The smallest radius of an arc at a speed: the turn rate is held, and 1.5 m/s² to the side."""
    return max(speed_mps / robot.turn_rate_radps, speed_mps**2 / 1.5, 0.6 * robot.track_m)


def program(plan: Plan, robot: Robot, rng: np.random.Generator) -> Iterator[Manoeuvre]:
    """The endless sequence of manoeuvres of a plan, beginning with a stand and a turn towards any direction."""
    yield Stop(plan.stand_first_s)
    turn_deg = float(rng.uniform(-170.0, 170.0)) if plan.turn_first_deg is None else plan.turn_first_deg
    if abs(turn_deg) > 1.0:
        yield Spin(math.radians(turn_deg), robot.turn_rate_radps)
    steady_mps = robot.speed_mps * float(rng.uniform(0.6, 1.0))
    speeds = np.array([1.0])
    for lap in count():
        kind = str(rng.choice(list(LAPS))) if plan.kind == "mixed" else plan.kind
        if lap % len(SPEEDS) == 0:
            speeds = rng.permutation(SPEEDS)
        speed_mps = robot.speed_mps * float(speeds[lap % len(SPEEDS)]) if plan.varied else steady_mps
        yield from homeward(rng, robot, speed_mps, kind)
        yield from LAPS[kind](rng, robot, speed_mps)
        if plan.varied:
            yield from extras(rng, robot)


def homeward(rng: np.random.Generator, robot: Robot, speed_mps: float, kind: str) -> Iterator[Manoeuvre]:
    """For figures that begin where the robot stands: back to the middle of the field, so that it does not walk away."""
    if kind in ("pivots", "eights", "circle") and rng.random() < 0.25:
        east_m, north_m = rng.uniform(-0.4, 0.4, 2) * robot.unit_m
        yield Line(float(east_m), float(north_m), speed_mps)
