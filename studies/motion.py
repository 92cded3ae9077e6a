"""The motion: a driver, a motor controller that trusts the declared robot, two wheels, the ground, and the path.

Each step of the grid is an arc: with the travel s, the slide d and the turn Δθ of the body,

    (x, y) += Rot(θ + Δθ/2) (s, d) · sin(Δθ/2) / (Δθ/2)      θ += Δθ
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from studies.arrays import Effects, FloatArray, floats, stream
from studies.columns import Column
from studies.drives import Plan, program
from studies.ground import Ground, Radii, eccentric_travel
from studies.manoeuvres import Command, Manoeuvre, Seen, Stop
from studies.terrain import Terrain
from studies.vehicles import Robot

GRID_HZ = 100.0
STEP_S = 1.0 / GRID_HZ
LEAD_S = 1.0
"""The robot stands for so long before the log begins, and the truth goes on for so long after its end."""
MOTOR_LAG_S = 0.12
DRIVER_EVERY = 5
"""The driver looks at every fifth step of the grid."""
MIDWAY_STAND_S = 8.0
"""Where a plan parks midway, the robot stands so much longer than it parks; with no parking, just so long."""


@dataclass(frozen=True)
class Motion:
    """What happened, at the points of the grid; what is called `*_in_step` holds between two of them."""

    t_s: FloatArray
    """Zero is the beginning of the log."""
    east_m: FloatArray
    north_m: FloatArray
    heading_rad: FloatArray
    """Counter-clockwise from east, not wrapped."""
    right_rad: FloatArray
    left_rad: FloatArray
    """True angles of the wheels."""
    v_in_step_mps: FloatArray
    w_in_step_radps: FloatArray
    a_in_step_mps2: FloatArray
    """Speed, turn rate and d|v|/dt as the wheels say."""
    body_v_in_step_mps: FloatArray
    """Speed of the body, forward."""
    pauses_s: tuple[tuple[float, float], ...]
    """Spans of parking that come on top of the drive."""

    def of_steps(self, in_step: FloatArray, t_s: FloatArray) -> FloatArray:
        """A quantity of the steps at any times, through the middles of the steps."""
        return floats(np.interp(t_s, self.t_s[:-1] + 0.5 * STEP_S, in_step))

    @property
    def stands_in_step(self) -> FloatArray:
        """One where neither wheel turns, else zero."""
        still = (np.diff(self.right_rad) == 0.0) & (np.diff(self.left_rad) == 0.0)
        return floats(still)


@dataclass
class Driver:
    """Goes through a program, and parks before it and midway."""

    plan: Plan
    robot: Robot
    manoeuvres: Iterator[Manoeuvre]
    current: Manoeuvre | None = None
    parked_midway: bool = False
    pauses_s: list[tuple[float, float]] = field(default_factory=list)

    def command(self, seen: Seen) -> Command:
        """What is wanted of the robot now."""
        if seen.t_s < self.plan.parked_first_s - 1e-6:
            return 0.0, 0.0
        for _ in range(20):
            if self.current is None:
                self.current = self._next(seen.t_s)
            wanted = self.current.command(seen, self.robot)
            if wanted is not None:
                return wanted
            self.current = None
        return 0.0, 0.0

    def _next(self, t_s: float) -> Manoeuvre:
        midway_s = self.plan.parked_first_s + 0.5 * self.plan.duration_s
        if self.plan.parked_midway_s is not None and not self.parked_midway and t_s >= midway_s - 1e-6:
            self.parked_midway = True
            begins_s = round(t_s) + MIDWAY_STAND_S / 2.0
            self.pauses_s.append((begins_s, begins_s + self.plan.parked_midway_s))
            return Stop(MIDWAY_STAND_S + self.plan.parked_midway_s)
        return next(self.manoeuvres)


@dataclass
class Motors:
    """Speed and turn rate follow what is wanted: at most so fast, and a little late; below a crawl they are zero."""

    robot: Robot
    v_asked: float = 0.0
    w_asked: float = 0.0
    v: float = 0.0
    w: float = 0.0

    def follow(self, wanted: Command) -> tuple[float, float]:
        """One step of the grid; returns the mean speed and turn rate in it."""
        before_v, before_w = self.v, self.w
        most_v, most_w = self.robot.acceleration_mps2 * STEP_S, self.robot.turn_acceleration_radps2 * STEP_S
        self.v_asked += max(-most_v, min(most_v, wanted[0] - self.v_asked))
        self.w_asked += max(-most_w, min(most_w, wanted[1] - self.w_asked))
        self.v += (self.v_asked - self.v) * STEP_S / MOTOR_LAG_S
        self.w += (self.w_asked - self.w) * STEP_S / MOTOR_LAG_S
        if self.v_asked == 0.0 and abs(self.v) < 1e-3:
            self.v = 0.0
        if self.w_asked == 0.0 and abs(self.w) < 1e-3:
            self.w = 0.0
        return 0.5 * (before_v + self.v), 0.5 * (before_w + self.w)


def drive(
    plan: Plan,
    robot: Robot,
    seed: int,
    effects: Effects | None = None,
    columns: Sequence[Column] = (),
    terrain: Terrain | None = None,
    slip_m_per_sqrt_m: float = 0.0,
) -> Motion:
    """Drive a plan with a robot on a ground; the same seed drives the same program and slips by the same draws."""
    t_s = grid(plan)
    terrain, effects = terrain or Terrain(), effects or {}
    ground = Ground(effects, columns, terrain)
    radii = Radii.of(robot.radius_right_m, robot.radius_left_m, effects, t_s[:-1] + 0.5 * STEP_S)
    driver = Driver(plan, robot, program(plan, robot, stream(seed, "program")))
    kicks = (slip_m_per_sqrt_m * stream(seed, "slip").standard_normal((t_s.size, 2))).tolist()
    body = Body(robot, ground, radii, kicks, heading_rad=float(stream(seed, "start").uniform(-math.pi, math.pi)))
    points, steps = _march(t_s.tolist(), driver, Motors(robot), body)
    (east, north, heading, right, left), (v, w, a, body_v) = floats(points).T, floats(steps).T
    return Motion(t_s, east, north, heading, right, left, v, w, a, body_v, tuple(driver.pauses_s))


def grid(plan: Plan) -> FloatArray:
    """The times of the truth, from a little before the log to a little after it."""
    count = round((plan.total_s + 2.0 * LEAD_S) * GRID_HZ) + 1
    return floats(np.arange(count) * STEP_S - LEAD_S)


@dataclass
class Body:
    """The robot's place, and how one step of its motors moves it."""

    robot: Robot
    ground: Ground
    radii: Radii
    kicks: list[list[float]]
    """Slip of the right and of the left wheel, for one metre, at each step in which the robot moves."""
    east_m: float = 0.0
    north_m: float = 0.0
    heading_rad: float = 0.0
    right_rad: float = 0.0
    left_rad: float = 0.0
    last_v: float = 0.0
    moved: int = 0

    @property
    def point(self) -> tuple[float, ...]:
        """Place, heading and wheel angles."""
        return self.east_m, self.north_m, self.heading_rad, self.right_rad, self.left_rad

    def step(self, number: int, v_mean: float, w_mean: float) -> tuple[float, ...]:
        """Move by one step of the grid; returns v, ω and a as the wheels say, and the body's own v."""
        if v_mean == 0.0 and w_mean == 0.0:
            a, self.last_v = -abs(self.last_v) / STEP_S, 0.0
            return 0.0, 0.0, a, 0.0
        says_right, says_left, goes_right, goes_left = self._turn_wheels(number, v_mean, w_mean)
        track_m = self.robot.track_m * self.radii.track_growth[number]
        v, w = 0.5 * (says_right + says_left) / STEP_S, (says_right - says_left) / track_m / STEP_S
        a, self.last_v = (abs(v) - abs(self.last_v)) / STEP_S, v
        place = (self.east_m, self.north_m, self.heading_rad)
        along_share, turn_share, side_per_m, pull_per_m = self.ground.shares(number, v, w, a, place)
        travel = 0.5 * (goes_right + goes_left)
        turn = (goes_right - goes_left) / track_m * turn_share + travel * pull_per_m
        along, side = travel * along_share, travel * side_per_m
        chord, middle = 1.0 - turn * turn / 24.0, self.heading_rad + 0.5 * turn
        self.east_m += chord * (along * math.cos(middle) - side * math.sin(middle))
        self.north_m += chord * (along * math.sin(middle) + side * math.cos(middle))
        self.heading_rad += turn
        return v, w, a, v * along_share

    def _turn_wheels(self, number: int, v_mean: float, w_mean: float) -> tuple[float, float, float, float]:
        """Turn both wheels as the declared robot would need it: what they say, and what they go, right and left."""
        robot, radii = self.robot, self.radii
        aside = w_mean * 0.5 * robot.nominal_track_m
        right_to = self.right_rad + (v_mean + aside) * STEP_S / robot.nominal_radius_m
        left_to = self.left_rad + (v_mean - aside) * STEP_S / robot.nominal_radius_m
        right_m, left_m = radii.right_m * radii.right_growth[number], radii.left_m * radii.left_growth[number]
        says_right, says_left = right_m * (right_to - self.right_rad), left_m * (left_to - self.left_rad)
        kick_right, kick_left = self.kicks[self.moved]
        goes_right = says_right + right_m * eccentric_travel(radii.right_off, self.right_rad, right_to)
        goes_left = says_left + left_m * eccentric_travel(radii.left_off, self.left_rad, left_to)
        goes_right += math.sqrt(abs(says_right)) * kick_right
        goes_left += math.sqrt(abs(says_left)) * kick_left
        self.right_rad, self.left_rad, self.moved = right_to, left_to, self.moved + 1
        return says_right, says_left, goes_right, goes_left


Rows = list[tuple[float, ...]]


def _march(t_s: list[float], driver: Driver, motors: Motors, body: Body) -> tuple[Rows, Rows]:
    """Step by step: points are (x, y, θ, φ_r, φ_l), steps are (v, ω, a, v of the body)."""
    wanted = (0.0, 0.0)
    points: Rows = [body.point]
    steps: Rows = []
    for number, t in enumerate(t_s[:-1]):
        if number % DRIVER_EVERY == 0 and t >= 0.0:
            wanted = driver.command(Seen(t, body.east_m, body.north_m, body.heading_rad, motors.v))
        steps.append(body.step(number, *motors.follow(wanted)))
        points.append(body.point)
    return points, steps
