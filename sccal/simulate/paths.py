"""Drives: speed and turn rate over time, straight lines between corners, so acceleration is bounded.

A drive is built of pieces (stand, travel a distance, pivot, follow an arc), each with its ramps. Distances and angles
come out exact, because both curves are integrated in closed form: with a slope a between two corners,

    travel(t) = travelₖ + vₖ τ + a τ²/2      τ = t − tₖ      (the turn from the turn rate likewise)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.errors import UsageError
from sccal.randomness import random_stream
from sccal.simulate.settings import DriveSettings, PathName
from sccal.simulate.world import BodySteps

_PAUSE_S = 0.5


def _area(corner_t_s: Floats, corner_value: Floats, t_s: Floats) -> Floats:
    widths = np.diff(corner_t_s)
    areas = np.concatenate(([0.0], np.cumsum(0.5 * (corner_value[1:] + corner_value[:-1]) * widths)))
    k = np.clip(np.searchsorted(corner_t_s, t_s, side="right") - 1, 0, widths.size - 1)
    tau = t_s - corner_t_s[k]
    slope = (np.diff(corner_value) / widths)[k]
    return np.asarray(areas[k] + (corner_value[k] + 0.5 * slope * tau) * tau)


@dataclass(frozen=True)
class Drive:
    """Speed and turn rate at the corners of their curves; straight lines between them."""

    corner_t_s: Floats
    """Strictly increasing from 0."""
    corner_speed_mps: Floats
    corner_turn_rate_radps: Floats
    start_yaw_rad: float

    @property
    def duration_s(self) -> float:
        return float(self.corner_t_s[-1])

    def steps(self, grid_hz: float) -> BodySteps:
        """The body's motion on an even grid, up to the last grid time within the drive."""
        t_s = np.arange(math.floor(self.duration_s * grid_hz + 1e-6) + 1) / grid_hz
        along = np.diff(_area(self.corner_t_s, self.corner_speed_mps, t_s))
        turn = np.diff(_area(self.corner_t_s, self.corner_turn_rate_radps, t_s))
        return BodySteps(t_s, along, np.zeros_like(along), turn, self.start_yaw_rad)


class Route:
    """A drive in the making: each call adds a piece at its end."""

    def __init__(self, acceleration_mps2: float, turn_acceleration_radps2: float) -> None:
        self.acceleration_mps2 = acceleration_mps2
        self.turn_acceleration_radps2 = turn_acceleration_radps2
        self._t_s = [0.0]
        self._speed_mps = [0.0]
        self._turn_rate_radps = [0.0]

    @property
    def t_s(self) -> float:
        return self._t_s[-1]

    @property
    def speed_mps(self) -> float:
        return self._speed_mps[-1]

    def _corner(self, after_s: float, speed_mps: float, turn_rate_radps: float) -> None:
        if after_s > 1e-9:
            self._t_s.append(self.t_s + after_s)
            self._speed_mps.append(speed_mps)
            self._turn_rate_radps.append(turn_rate_radps)

    def hold(self, duration_s: float) -> None:
        """Go on as now."""
        self._corner(duration_s, self.speed_mps, self._turn_rate_radps[-1])

    def change(self, speed_mps: float, turn_rate_radps: float = 0.0) -> None:
        """Reach a speed and a turn rate, both together and as soon as the limits allow."""
        after = max(
            abs(speed_mps - self.speed_mps) / self.acceleration_mps2,
            abs(turn_rate_radps - self._turn_rate_radps[-1]) / self.turn_acceleration_radps2,
        )
        self._corner(after, speed_mps, turn_rate_radps)

    def travel(self, distance_m: float, speed_mps: float, end_mps: float = 0.0) -> None:
        """Straight on for a distance, ramps included (negative: backwards), ending at ``end_mps``."""
        sign, far = math.copysign(1.0, distance_m), abs(distance_m)
        start, end = sign * self.speed_mps, sign * end_mps
        a = self.acceleration_mps2
        top = min(speed_mps, math.sqrt(a * far + 0.5 * (start * start + end * end)))
        cruise = far - (2.0 * top * top - start * start - end * end) / (2.0 * a)
        if min(start, end) < 0 or top < max(start, end) - 1e-9 or cruise < -1e-9:
            raise UsageError(f"simulation: {far:g} m is too short to go from {start:g} to {end:g} m/s at {a:g} m/s²")
        self.change(sign * top)
        self.hold(cruise / top)
        self.change(sign * end)

    def turn(self, angle_rad: float, turn_rate_radps: float) -> None:
        """Turn by an angle, ramps included, at the present speed: an arc, or a pivot where the robot stands."""
        sign, wide = math.copysign(1.0, angle_rad), abs(angle_rad)
        top = min(turn_rate_radps, math.sqrt(self.turn_acceleration_radps2 * wide))
        self.change(self.speed_mps, sign * top)
        self.hold(wide / top - top / self.turn_acceleration_radps2)
        self.change(self.speed_mps)

    def pivot(self, angle_rad: float, turn_rate_radps: float) -> None:
        """Turn in place, between two short pauses."""
        self.hold(_PAUSE_S)
        self.turn(angle_rad, turn_rate_radps)
        self.hold(_PAUSE_S)

    def drive(self, until_s: float, start_yaw_rad: float) -> Drive:
        """The drive so far, cut off at ``until_s``; whatever the robot is then doing."""
        t, speed, rate = np.array(self._t_s), np.array(self._speed_mps), np.array(self._turn_rate_radps)
        end = min(until_s, self.t_s)
        keep = t < end
        return Drive(
            corner_t_s=np.append(t[keep], end),
            corner_speed_mps=np.append(speed[keep], np.interp(end, t, speed)),
            corner_turn_rate_radps=np.append(rate[keep], np.interp(end, t, rate)),
            start_yaw_rad=start_yaw_rad,
        )


def _corner_reach_m(settings: DriveSettings) -> float:
    """How far before the crossing of two sides a rounded corner begins."""
    corner = Route(settings.acceleration_mps2, settings.turn_acceleration_radps2)
    corner.turn(math.pi / 2, settings.speed_mps / settings.corner_radius_m)
    count = 4000
    t: Floats = (np.arange(count, dtype=float) + 0.5) * (corner.t_s / count)
    yaw = _area(np.array(corner._t_s), np.array(corner._turn_rate_radps), t)
    return settings.speed_mps * corner.t_s * float(np.mean(np.cos(yaw)))


def _rectangle(route: Route, settings: DriveSettings) -> None:
    sides = (settings.rectangle_length_m, settings.rectangle_width_m)
    sign = -1.0 if settings.rounds == "clockwise" else 1.0
    reach = _corner_reach_m(settings) if settings.corners == "arc" else 0.0
    v = settings.speed_mps
    while route.t_s < settings.duration_s:
        if settings.corners == "pivot":
            for side in sides * 2:
                route.travel(side, v)
                route.pivot(sign * math.pi / 2, settings.turn_rate_radps)
        else:
            half = 0.5 * sides[0] - reach
            for length in (half, sides[1] - 2 * reach, sides[0] - 2 * reach, sides[1] - 2 * reach):
                route.travel(length, v, end_mps=v)
                route.turn(sign * math.pi / 2, v / settings.corner_radius_m)
            route.travel(half, v)
            route.hold(2 * _PAUSE_S)
        if settings.rounds == "alternate":
            sign = -sign


def _circle(route: Route, settings: DriveSettings) -> None:
    sign = -1.0 if settings.rounds == "clockwise" else 1.0
    if settings.lead_in_m > 0:
        route.travel(settings.lead_in_m, settings.speed_mps, end_mps=settings.speed_mps)
    route.change(settings.speed_mps, sign * settings.speed_mps / settings.circle_radius_m)
    route.hold(settings.duration_s)


def _straight(route: Route, settings: DriveSettings) -> None:
    route.change(settings.speed_mps)
    route.hold(settings.duration_s)


def _figure8(route: Route, settings: DriveSettings) -> None:
    sign = -1.0 if settings.rounds == "clockwise" else 1.0
    route.change(settings.speed_mps)
    while route.t_s < settings.duration_s:
        route.turn(sign * 2 * math.pi, settings.speed_mps / settings.circle_radius_m)
        sign = -sign


def _rows(route: Route, settings: DriveSettings) -> None:
    sign = -1.0
    while route.t_s < settings.duration_s:
        route.travel(settings.row_length_m, settings.speed_mps)
        route.pivot(sign * math.pi / 2, settings.turn_rate_radps)
        route.travel(settings.row_spacing_m, settings.speed_mps)
        route.pivot(sign * math.pi / 2, settings.turn_rate_radps)
        sign = -sign


def _general(route: Route, settings: DriveSettings, rng: np.random.Generator) -> None:
    """Shuffled decks of manoeuvres, so that even a short drive has some of each."""

    def speed() -> float:
        return float(rng.uniform(settings.slowest_mps, settings.fastest_mps))

    def straight() -> None:
        route.travel(float(rng.uniform(6.0, 18.0)), speed())

    def arc(sign: float) -> None:
        v = speed()
        route.change(v)
        route.turn(sign * float(rng.uniform(0.4, 1.4)) * math.pi, v / float(rng.uniform(2.0, 8.0)))
        route.change(0.0)

    def reverse() -> None:
        route.travel(-settings.reverse_leg_m, float(rng.uniform(0.4, 0.8)))

    def spin(sign: float) -> None:
        route.pivot(sign * float(rng.uniform(0.5, 2.0)) * math.pi, float(rng.uniform(0.3, 0.8)))

    def stop() -> None:
        route.hold(float(rng.uniform(2.0, 5.0)))

    deck: list[Callable[[], None]] = [
        *[straight] * 2,
        *[lambda: arc(1.0)] * 2,
        *[lambda: arc(-1.0)] * 2,
        *[reverse] * 2,
        lambda: spin(1.0),
        lambda: spin(-1.0),
        stop,
    ]
    while route.t_s < settings.duration_s:
        for card in rng.permutation(len(deck)):
            deck[card]()
            route.hold(_PAUSE_S)


def _calibration(route: Route, settings: DriveSettings) -> None:
    """The drive to make when nothing is known: two speeds, both ways round, spins, reverse, stops; 45° on each lap."""
    slow, fast = settings.slowest_mps, settings.fastest_mps
    slow_turn, fast_turn = 0.6 * settings.turn_rate_radps, 1.6 * settings.turn_rate_radps
    hard = route.acceleration_mps2
    while route.t_s < settings.duration_s:
        route.hold(10.0)
        route.travel(15.0, slow)
        route.pivot(math.pi, slow_turn)
        route.travel(15.0, fast)
        route.pivot(-math.pi, fast_turn)
        route.acceleration_mps2 = 0.3 * hard
        route.travel(-10.0, settings.speed_mps)
        route.hold(_PAUSE_S)
        route.travel(10.0, settings.speed_mps)
        route.acceleration_mps2 = hard
        for speed, radius_m in ((fast, 3.0), (slow, 1.5)):
            for side in (1.0, -1.0):
                route.change(speed)
                route.turn(side * 2.0 * math.pi, speed / radius_m)
            route.change(0.0)
        route.pivot(4.0 * math.pi, slow_turn)
        route.pivot(-4.0 * math.pi, fast_turn)
        route.pivot(0.25 * math.pi, fast_turn)


_PATHS: dict[PathName, Callable[[Route, DriveSettings], None]] = {
    "rectangle": _rectangle,
    "circle": _circle,
    "straight": _straight,
    "figure8": _figure8,
    "rows": _rows,
    "calibration": _calibration,
}


def plan_drive(settings: DriveSettings, seed: int) -> Drive:
    """The drive that the settings ask for; only ``general`` uses the seed."""
    route = Route(settings.acceleration_mps2, settings.turn_acceleration_radps2)
    route.hold(settings.stand_first_s)
    if settings.reverse_first_m > 0:
        route.travel(-settings.reverse_first_m, settings.speed_mps)
        route.hold(_PAUSE_S)
    if settings.path == "general":
        _general(route, settings, random_stream(seed, "path"))
    else:
        _PATHS[settings.path](route, settings)
    if settings.start_yaw_deg is not None:
        start_yaw_rad = math.radians(settings.start_yaw_deg)
    else:
        start_yaw_rad = math.pi / 2 if settings.path == "rows" else 0.0
    until = math.inf if settings.path == "rectangle" else settings.duration_s
    return route.drive(until, start_yaw_rad)
