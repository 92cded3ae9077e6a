"""Do yaw, wheels and fixes turn the same way, and do both wheels roll forward? If not, say which setting is wrong.

Three independent witnesses of every turn: the wheels (a_r − a_l over the track), the AHRS, and the course of the fixes.
Slopes of one on another, over windows long enough for the fixes to show a course, tell which of them is mirrored.
A wheel that counts backwards shows in the distance: the fixes then move by half the *difference* of the two wheels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError

if TYPE_CHECKING:
    from sccal.align.aligned import Aligned

WINDOW_S = 1.0
MIN_TURN_RAD = np.radians(30.0)
MIN_CORRELATION = 0.5
MIN_TRAVEL_SIGMAS = 8.0
MIN_WINDOWS = 8


@dataclass(frozen=True)
class Slope:
    """Least-squares slope through the origin of y on x, and their correlation."""

    value: float
    correlation: float
    windows: int

    @property
    def clear(self) -> bool:
        return self.windows >= MIN_WINDOWS and abs(self.correlation) >= MIN_CORRELATION

    @property
    def opposed(self) -> bool:
        return self.clear and self.value < 0

    @property
    def agreed(self) -> bool:
        return self.clear and self.value > 0


def slope_through_origin(x: Floats, y: Floats) -> Slope:
    """Slope of y on x; correlation 0 where either does not vary."""
    xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
    if x.size == 0 or xx == 0.0 or yy == 0.0:
        return Slope(0.0, 0.0, int(x.size))
    return Slope(xy / xx, xy / np.sqrt(xx * yy), int(x.size))


def check_signs(aligned: Aligned) -> None:
    """Raise DataError where a sign is certainly wrong; say nothing where the drive cannot tell."""
    windows = _fix_windows(aligned)
    if windows is not None:
        _check_wheel_directions(aligned, *windows)
    _check_turning(aligned, windows)


def _wheel_turn(aligned: Aligned, t_s: Floats) -> Floats:
    """Turning by the wheels (rad, nominal radius and track) up to each time."""
    difference = aligned.right_rad - aligned.left_rad
    scale = aligned.vehicle.wheel_radius_m / aligned.vehicle.track_m
    return scale * np.interp(t_s, aligned.wheel_t_s, difference)


def _fix_windows(aligned: Aligned) -> tuple[Floats, Floats, Floats] | None:
    """Times (k,), east and north (k,) of leading fixes so far apart that each step shows a course; None if too few."""
    rows = np.flatnonzero(aligned.fix_leading)
    sigma = float(np.median(np.sqrt(aligned.fix_var_east_m2[rows])))
    path = np.interp(
        aligned.fix_t_s[rows],
        aligned.wheel_t_s,
        np.concatenate(([0.0], np.cumsum(np.abs(np.diff(aligned.right_rad)) + np.abs(np.diff(aligned.left_rad))))),
    )
    step_m = max(0.5, MIN_TRAVEL_SIGMAS * sigma)
    mark = np.floor(0.5 * aligned.vehicle.wheel_radius_m * path / step_m)
    chosen = rows[np.concatenate(([True], np.diff(mark) > 0))]
    if chosen.size < MIN_WINDOWS + 1:
        return None
    return aligned.fix_t_s[chosen], aligned.fix_east_m[chosen], aligned.fix_north_m[chosen]


def _check_wheel_directions(aligned: Aligned, t_s: Floats, east_m: Floats, north_m: Floats) -> None:
    displacement = np.hypot(np.diff(east_m), np.diff(north_m))
    radius = aligned.vehicle.wheel_radius_m
    right = radius * np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.right_rad))
    left = radius * np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.left_rad))
    together = _unexplained(np.abs(right + left) / 2, displacement)
    opposite = _unexplained(np.abs(right - left) / 2, displacement)
    if not (opposite < 0.2 and together > 0.6):
        return
    yaw = np.diff(np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad))
    turning = slope_through_origin(right + left, yaw)
    who, column = "one wheel", "left_ticks or right_ticks"
    if turning.clear:
        side = "left" if turning.value > 0 else "right"
        who, column = f"the {side} wheel", f"{side}_ticks"
    raise DataError(
        f"encoder.csv: {who} seems to count backwards: over {displacement.size} stretches the fixes move by half the "
        f"difference of the wheels' travel, not by half their sum; negate {column}"
    )


def _unexplained(x: Floats, y: Floats) -> float:
    """Share of the variation of y that a multiple of x (within a factor of two) leaves unexplained."""
    slope = np.clip(slope_through_origin(x, y).value, 0.5, 2.0)
    return float(((y - slope * x) ** 2).sum() / max((y**2).sum(), 1e-12))


def _check_turning(aligned: Aligned, windows: tuple[Floats, Floats, Floats] | None) -> None:
    start, end = aligned.span_s
    t_s = np.arange(start, end, WINDOW_S)
    if t_s.size < MIN_WINDOWS + 1:
        return
    inside = (t_s >= aligned.heading_t_s[0]) & (t_s <= aligned.heading_t_s[-1])
    t_s = t_s[inside]
    wheels = np.diff(_wheel_turn(aligned, t_s))
    yaw = np.diff(np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad))
    if np.abs(wheels).sum() < MIN_TURN_RAD or np.abs(yaw).sum() < MIN_TURN_RAD:
        return
    yaw_on_wheels = slope_through_origin(wheels, yaw)
    if not yaw_on_wheels.opposed:
        return

    convention = aligned.vehicle.convention
    other = "ned" if convention == "enu" else "enu"
    course_on_wheels, course_on_yaw = _course_slopes(aligned, windows)
    seen = (
        f"the AHRS yaw turns against the wheels (slope {yaw_on_wheels.value:+.2f}, "
        f"correlation {yaw_on_wheels.correlation:+.2f} over {yaw_on_wheels.windows} s)"
    )
    swapped = "left and right wheels look swapped: exchange left_ticks and right_ticks in encoder.csv"
    mirrored = f'set convention = "{other}" under [ahrs] in vehicle.toml (it is "{convention}")'
    if course_on_wheels.opposed and course_on_yaw.agreed:
        raise DataError(f"{seen}, and the course of the fixes sides with the AHRS: {swapped}")
    if course_on_wheels.agreed and not course_on_yaw.agreed:
        raise DataError(f"{seen}, and the course of the fixes sides with the wheels: {mirrored}")
    raise DataError(f"{seen}, and the fixes do not tell which is right: {mirrored}, or, if that was right, {swapped}")


def _course_slopes(aligned: Aligned, windows: tuple[Floats, Floats, Floats] | None) -> tuple[Slope, Slope]:
    """Slopes of the change of course of the fixes on the turning by the wheels, and by the AHRS."""
    nothing = Slope(0.0, 0.0, 0)
    if windows is None:
        return nothing, nothing
    t_s, east, north = windows
    course = np.arctan2(np.diff(north), np.diff(east))
    # A reversal flips the course by half a turn; turning itself does not: compare modulo π.
    change = np.diff(course)
    change = change - np.pi * np.round(change / np.pi)
    middle = 0.5 * (t_s[1:] + t_s[:-1])
    by_wheels = np.diff(_wheel_turn(aligned, middle))
    by_yaw = np.diff(np.interp(middle, aligned.heading_t_s, aligned.yaw_rad))
    small = (np.abs(by_yaw) < 1.2) & (np.abs(by_wheels) < 2.4)
    return (
        slope_through_origin(by_wheels[small], change[small]),
        slope_through_origin(by_yaw[small], change[small]),
    )
