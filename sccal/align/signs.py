"""Do yaw, wheels and fixes turn the same way, and do both wheels roll forward? If not, say which setting is wrong.

Three independent witnesses of every turn: the wheels (a_r − a_l over the track), the AHRS, and the path of the fixes.
The slope of the AHRS on the wheels shows that one of these is mirrored, the path of the fixes which.
A wheel that counts backwards shows in the distance: the fixes then move by half the *difference* of the two wheels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sccal.align.counters import check_directions, check_stops
from sccal.align.path import laid_out
from sccal.align.proportions import check_gain, check_proportions, check_sides, wheel_turn
from sccal.align.reasons import check_goes_round
from sccal.align.scale import check_scale, unit_of_yaw
from sccal.arrays import Complexes, Floats
from sccal.errors import DataError
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, VEHICLE_FILE

if TYPE_CHECKING:
    from sccal.align.aligned import Aligned

WINDOW_S = 1.0
MIN_TURN_RAD = np.radians(30.0)
MIN_CORRELATION = 0.5
MIN_TRAVEL_SIGMAS = 8.0
MIN_WINDOWS = 8
STRETCH_RAD = 4.0
CLEARLY_WORSE = 2.0
LEAST_SLOPE = 0.4
"""Of the yaw on the wheels, as declared, that turn together: tracks that skid turn half as far as they seem to."""
STUCK_TRAVEL_M = 5.0
STUCK_SHARE = 0.02
STUCK_YAW_RAD = np.radians(1.0)
STUCK_TURN_RAD = np.radians(60.0)


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


def slope_through_origin(x: Floats, y: Floats) -> Slope:
    """Slope of y on x; correlation 0 where either does not vary."""
    xx, yy, xy = float(x @ x), float(y @ y), float(x @ y)
    if x.size == 0 or xx == 0.0 or yy == 0.0:
        return Slope(0.0, 0.0, int(x.size))
    return Slope(xy / xx, xy / np.sqrt(xx * yy), int(x.size))


def check_signs(aligned: Aligned) -> None:
    """Raise DataError where a sign is certainly wrong; say nothing where the drive cannot tell."""
    _check_that_both_wheels_turn(aligned)
    check_stops(aligned)
    check_scale(aligned)
    windows = _fix_windows(aligned)
    if windows is not None:
        _check_wheel_directions(aligned, *windows)
    _check_turning(aligned)
    check_directions(aligned)
    check_proportions(aligned)


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


def _check_that_both_wheels_turn(aligned: Aligned) -> None:
    radius = aligned.vehicle.wheel_radius_m
    right = radius * float(np.abs(np.diff(aligned.right_rad)).sum())
    left = radius * float(np.abs(np.diff(aligned.left_rad)).sum())
    if max(right, left) > STUCK_TRAVEL_M and min(right, left) < STUCK_SHARE * max(right, left):
        side = "right" if right < left else "left"
        raise DataError(
            f"{ENCODER_FILE}: the {side} wheel's counter hardly moves ({min(right, left):.2f} m in all, the other "
            f"wheel's {max(right, left):.2f} m): check the encoder and the column {side}_ticks"
        )


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
    as_declared = slope_through_origin((right - left) / aligned.vehicle.track_m, yaw)
    if as_declared.clear and LEAST_SLOPE < abs(as_declared.value) < 1.0 / LEAST_SLOPE:
        return  # A robot that turns on the spot moves an antenna off its middle.
    who, column = "one wheel", "left_ticks or right_ticks"
    if turning.clear:
        side = "left" if turning.value > 0 else "right"
        who, column = f"the {side} wheel", f"{side}_ticks"
    raise DataError(
        f"{ENCODER_FILE}: {who} seems to count backwards: over {displacement.size} stretches the fixes move by half "
        f"the difference of the wheels' travel, not by half their sum; negate {column}"
    )


def _unexplained(x: Floats, y: Floats) -> float:
    """Share of the variation of y that a multiple of x (within a factor of two) leaves unexplained."""
    slope = np.clip(slope_through_origin(x, y).value, 0.5, 2.0)
    return float(((y - slope * x) ** 2).sum() / max((y**2).sum(), 1e-12))


def _check_turning(aligned: Aligned) -> None:
    start, end = aligned.span_s
    t_s = np.arange(start, end, WINDOW_S)
    if t_s.size < MIN_WINDOWS + 1:
        return
    inside = (t_s >= aligned.heading_t_s[0]) & (t_s <= aligned.heading_t_s[-1])
    t_s = t_s[inside]
    wheels = np.diff(wheel_turn(aligned, t_s))
    yaw = np.diff(np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad))
    swing, turned = float(np.ptp(aligned.yaw_rad)), float(np.ptp(wheel_turn(aligned, t_s)))
    if swing < STUCK_YAW_RAD and turned > STUCK_TURN_RAD:
        raise DataError(
            f"{aligned.heading_source}: the yaw stays within {np.degrees(swing):.2f}° while the wheels turn the robot "
            f"by {np.degrees(turned):.0f}°: the AHRS is stuck, or the wrong column is called yaw"
        )
    if np.abs(wheels).sum() < MIN_TURN_RAD or np.abs(yaw).sum() < MIN_TURN_RAD:
        return
    yaw_on_wheels = slope_through_origin(wheels, yaw)
    check_goes_round(aligned, yaw_on_wheels.correlation)
    check_sides(aligned)
    if yaw_on_wheels.clear and (unit := unit_of_yaw(yaw_on_wheels.value)):
        raise DataError(
            f"{aligned.heading_source}: the yaw turns {abs(yaw_on_wheels.value):.3g} times as far as the wheels "
            f"(correlation {yaw_on_wheels.correlation:+.2f} over {yaw_on_wheels.windows} s): its unit is not what its "
            f"name says, and may be {unit}"
        )
    if not yaw_on_wheels.opposed:
        if yaw_on_wheels.clear:
            _check_mirrored_places(aligned)
            check_gain(aligned, yaw_on_wheels.value)
        return

    convention = aligned.heading_convention or aligned.vehicle.convention
    other = "ned" if convention == "enu" else "enu"
    wheels_fit = _turns_as_the_fixes_do(aligned, wheel_turn(aligned, aligned.wheel_t_s))
    yaw_fits = _turns_as_the_fixes_do(aligned, aligned.yaw_at_wheels_rad)
    seen = (
        f"the AHRS yaw turns against the wheels (slope {yaw_on_wheels.value:+.2f}, "
        f"correlation {yaw_on_wheels.correlation:+.2f} over {yaw_on_wheels.windows} s)"
    )
    swapped = _swapped(aligned)
    mirrored = (
        f'set convention = "{other}" under [ahrs] in {VEHICLE_FILE} (it is "{convention}"), '
        "or, for quaternions in messages, give --orientation ned"
    )
    if aligned.heading_convention is not None:
        mirrored = f"the headings of {aligned.heading_source} do not turn clockwise from north: write an {AHRS_FILE}"
    if wheels_fit is False and yaw_fits is not False:
        raise DataError(f"{seen}, and the path of the fixes sides with the AHRS: {swapped}")
    if yaw_fits is False and wheels_fit is not False:
        raise DataError(f"{seen}, and the path of the fixes sides with the wheels: {mirrored}")
    raise DataError(f"{seen}, and the fixes do not tell which is right: {mirrored}, or, if that was right, {swapped}")


def _swapped(aligned: Aligned) -> str:
    """What to do where wheels turn the other way round: exchanged or both reversed, the likelier first.

    Robots go forward more than back.
    """
    steps = np.diff(aligned.travel_m)
    back, way = float(np.maximum(-steps, 0.0).sum()), float(np.abs(steps).sum())
    share = f"{100.0 * back / max(way, 1e-9):.0f} % of the way by the wheels"
    if back > 0.5 * way:
        return (
            f"both wheels look as if they count backwards, for {share} is in reverse: negate both left_ticks and "
            f"right_ticks in {ENCODER_FILE} (or, if the robot did drive so, exchange them: push it forward, and both "
            "counts must rise)"
        )
    return (
        f"left and right wheels look swapped: exchange left_ticks and right_ticks in {ENCODER_FILE} (or, if both count "
        f"backwards and {share} being in reverse is not so, negate both: push the robot forward, and both must rise)"
    )


def _check_mirrored_places(aligned: Aligned) -> None:
    """Raise DataError where yaw and wheels turn one way and the path of the fixes is their mirror image."""
    if _turns_as_the_fixes_do(aligned, wheel_turn(aligned, aligned.wheel_t_s)) is not False:
        return
    if _turns_as_the_fixes_do(aligned, aligned.yaw_at_wheels_rad) is False:
        raise DataError(
            "gnss: yaw and wheels turn together, and the path of the fixes is the mirror image of both: latitude and "
            "longitude are exchanged, or one of them lacks its sign (west and south are negative)"
        )


def _turns_as_the_fixes_do(aligned: Aligned, turn_rad: Floats) -> bool | None:
    """Whether the wheels' travel laid out along a heading is the fixes' path, or its mirror image; None if unclear.

    A path and its mirror image differ however they are turned, shifted and scaled, so the zero of the heading does not
    matter, nor does driving in reverse. Stretches are short enough that a wrong track does not bend them out of shape.
    """
    path = laid_out(aligned.travel_m, turn_rad)
    fix_t_s = aligned.fix_t_s[aligned.fix_leading]
    fixes = (aligned.fix_east_m + 1j * aligned.fix_north_m)[aligned.fix_leading]
    p = np.interp(fix_t_s, aligned.wheel_t_s, path)
    turned = np.interp(fix_t_s, aligned.wheel_t_s, np.concatenate(([0.0], np.cumsum(np.abs(np.diff(turn_rad))))))
    as_is = mirrored = 0.0
    for stretch in np.unique(np.floor(turned / STRETCH_RAD)):
        rows = np.floor(turned / STRETCH_RAD) == stretch
        if rows.sum() >= MIN_WINDOWS:
            as_is += _misfit(p[rows], fixes[rows])
            mirrored += _misfit(np.conj(p[rows]), fixes[rows])
    noise = float((aligned.fix_var_east_m2 + aligned.fix_var_north_m2)[aligned.fix_leading].mean())
    if max(as_is, mirrored) < CLEARLY_WORSE * min(as_is, mirrored) or max(as_is, mirrored) < 10.0 * noise:
        return None
    return as_is < mirrored


def _misfit(path: Complexes, fixes: Complexes) -> float:
    """Sum of squares (m²) that turning, shifting and scaling the path leaves unexplained of the fixes."""
    p, z = path - path.mean(), fixes - fixes.mean()
    power = float((np.abs(p) ** 2).sum())
    alpha = (np.conj(p) * z).sum() / power if power > 0 else 0.0
    return float((np.abs(z - alpha * p) ** 2).sum())
