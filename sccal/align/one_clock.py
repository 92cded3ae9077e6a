"""All streams on the wheels' clock: the heading by its turning, then the fixes by their motion along it.

The path that the fixes are compared with is laid along the heading, so the heading comes first. Where both come from
one receiver they have one clock, and what moves one moves the other. Fixes that only repeat an earlier one are late by
as much as they are old: they are found once the clocks agree, and the clocks are then compared again without them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.align.accuracy import usable
from sccal.align.clock_fit import Fixes, WheelPath, wheel_path
from sccal.align.clock_motion import MotionClock, clock_by_motion, small_offset
from sccal.align.heading_clock import HeadingClock, clock_by_turning, wheel_turning
from sccal.align.old_fixes import find_old, telling
from sccal.align.reference import in_order, in_plane, leading_fixes, rounding_steps_m
from sccal.align.standing import dither_rad, standing_spans
from sccal.arrays import Bools, Floats
from sccal.geodesy import TangentPlane
from sccal.logs.streams import Convention, FixStream, HeadingStream, Notice, Run, Vehicle, WheelStream

FEWEST = 10
WHEEL_RATE_HZ = 20.0
"""As fine as the path need be for comparing clocks."""
ALIKE_SIGMAS = 4.0
LATENCIES_S = 0.1
"""Receivers and AHRSs are late by as much, and not alike."""


@dataclass(frozen=True)
class FixTimes:
    """What the motion says of the fixes' times."""

    clock: MotionClock | None
    """None: they stay as they are."""
    old: Bools
    """(n,) fixes that only repeat an earlier one."""
    notices: tuple[Notice, ...]


def yaw_to_enu(yaw_rad: Floats, convention: Convention) -> Floats:
    """A yaw in the file's convention, counter-clockwise from east (same shape, not wrapped)."""
    return yaw_rad if convention == "enu" else 0.5 * np.pi - yaw_rad


def heading_by_turning(run: Run, heading: HeadingStream, yaw_rad: Floats) -> HeadingClock:
    """How far the heading is off the wheels' clock, from its readings as yaw in enu (h,), unwrapped.

    One from the receiver is on the fixes' clock already.
    """
    who = "headings" if run.heading.utc_s is None else "headings and fixes"
    turning = wheel_turning(run.wheels, run.vehicle)
    return clock_by_turning(turning, heading.t_s, yaw_rad, heading.source, who)


def path_along(heading_t_s: Floats, yaw_rad: Floats, wheels: WheelStream, vehicle: Vehicle) -> WheelPath | None:
    """Where wheels and yaw (h,) take the robot, as finely as clocks need; None where they hardly share any time."""
    every = max(1, round(WHEEL_RATE_HZ**-1 / max(float(np.median(np.diff(wheels.t_s))), 1e-6)))
    covered = (wheels.t_s >= heading_t_s[0]) & (wheels.t_s <= heading_t_s[-1])
    index = np.flatnonzero(covered)[::every]
    if index.size < FEWEST:
        return None
    travel = vehicle.wheel_radius_m * 0.5 * (wheels.right_rad[index] + wheels.left_rad[index])
    yaw = np.interp(wheels.t_s[index], heading_t_s, yaw_rad)
    most_rad = dither_rad(vehicle.wheel_radius_m, vehicle.ticks_per_rev)
    stands = standing_spans(wheels.t_s, wheels.right_rad, wheels.left_rad, wheels.loose, most_rad)
    return wheel_path(wheels.t_s[index], travel, yaw, vehicle.track_m, stands)


def fixes_by_motion(
    fixes: FixStream,
    path: WheelPath | None,
    t_s: Floats,
    timed: Bools,
    span_s: tuple[float, float],
    agreed: bool,
    unseen: bool,
) -> FixTimes:
    """What path and fixes say together.

    Parameters
    ----------
    fixes, path
        What moves; without a path nothing is said.
    t_s, timed
        Times of the fixes (n,), and which of them have one (n,).
    span_s
        What the wheels' stream covers.
    agreed
        Whether the clocks are known to agree, so that only old fixes are to be found.
    unseen
        Whether the logging computer wrote down no time at which a fix came, so that a small offset is nobody's effect.
    """
    nothing = FixTimes(None, np.zeros(t_s.size, dtype=np.bool_), ())
    if path is None:
        return nothing
    moved = None if agreed else _compared(fixes, path, t_s, timed, span_s, unseen)
    old, notices = _old(fixes, path, t_s if moved is None else moved.moved(t_s), timed)
    if old.any() and not agreed:
        moved = _compared(fixes, path, t_s, timed & ~old, span_s, unseen)
        old, notices = _old(fixes, path, t_s if moved is None else moved.moved(t_s), timed)
    return FixTimes(moved, old, (*(() if moved is None else moved.notices), *notices))


def _compared(
    fixes: FixStream, path: WheelPath, t_s: Floats, timed: Bools, span_s: tuple[float, float], unseen: bool
) -> MotionClock | None:
    """How the fixes' times have to be moved, where the motion shows that they are clearly off the wheels' clock.

    Those that came unseen are moved by little too.
    """
    rows = in_order(t_s, timed & usable(fixes.quality))
    rows = rows[telling(t_s[rows], fixes.lat_deg[rows] + 1j * fixes.lon_deg[rows])]
    if rows.size < FEWEST:
        return None
    placed = in_plane(fixes, t_s, rows, TangentPlane(float(fixes.lat_deg[rows[0]]), float(fixes.lon_deg[rows[0]]), 0.0))
    leading = leading_fixes(placed)
    sigma = float(np.sqrt(np.median((placed.var_east_m2 + placed.var_north_m2)[leading]) / 2.0))
    places = (placed.east_m + 1j * placed.north_m)[leading]
    leading_ones = Fixes(placed.t_s[leading], places, sigma)
    found = clock_by_motion(path, leading_ones, span_s)
    return small_offset(path, leading_ones) if found is None and unseen else found


def _old(fixes: FixStream, path: WheelPath, t_s: Floats, timed: Bools) -> tuple[Bools, tuple[Notice, ...]]:
    """Which fixes (n,) repeat an earlier one while the robot drives on, and what to say of them."""
    old = np.zeros(t_s.size, dtype=np.bool_)
    rows = in_order(t_s, timed & usable(fixes.quality))
    places = fixes.lat_deg[rows] + 1j * fixes.lon_deg[rows]
    if rows.size < 2 or not (places[1:] == places[:-1]).any():
        return old, ()
    plane = TangentPlane(float(fixes.lat_deg[rows[0]]), float(fixes.lon_deg[rows[0]]), 0.0)
    steps_m = rounding_steps_m(fixes, plane)
    placed = in_plane(fixes, t_s, rows, plane, steps_m)
    sigma_m = np.sqrt(0.5 * (placed.var_east_m2 + placed.var_north_m2))
    at_fixes = np.interp(t_s[rows], path.t_s, path.path_m)
    found = find_old(t_s[rows], places, at_fixes, max(steps_m), sigma_m)
    old[rows] = found.old
    return old, found.notices


def told_together(turned: HeadingClock, moved: MotionClock | None) -> tuple[Notice, ...]:
    """Where heading and fixes, each by itself, are off by the same, it is the wheels' stamps that are off."""
    fit = None if moved is None else moved.fit
    if turned.offset_s == 0.0 or fit is None:
        return ()
    apart = abs(turned.offset_s - fit.offset_s)
    if apart > LATENCIES_S + ALIKE_SIGMAS * float(np.hypot(turned.sigma_s, fit.sigma_offset_s)):
        return ()
    way = "late" if turned.offset_s > 0.0 else "early"
    what = f"sign that the wheels are stamped {way}: headings and fixes are both off by about {turned.offset_s:+.2f} s"
    return (Notice("encoder", what, 1, "", "warning"),)
