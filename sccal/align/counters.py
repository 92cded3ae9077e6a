"""Do the counters count what yaw and fixes show? Names one that stops for good, and one that rises either way.

In windows of some seconds the fixes say how far the robot went along its yaw, forward or back, and the yaw how far it
turned: the travel that each wheel needs for that, v ± L/2 dψ, is held against what it counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sccal.align.proportions import WINDOW_S, wheel_turn
from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.names import ENCODER_FILE
from sccal.logs.streams import Notice

if TYPE_CHECKING:
    from sccal.align.aligned import Aligned

SIDES = ("left", "right")
COARSE_M = 2.0
"""Fixes that do not show as much in a window tell nothing of a wheel."""
STRAIGHT_RAD = 0.2
CLEAR_SIGMAS = 8.0
LEAST_M = 0.15
"""Travel in a window that is no noise of the fixes, whatever they state."""
ALIKE = 2.0
"""A counted way within this factor of the needed one is the same way with a lost sign; tracks skid by as much."""
FEWEST_WINDOWS = 2
FITS = 0.8
"""Share of the windows that must fit the counts, with lost signs or as they are: else something else is wrong."""
LOST_WAY_M = 1.0
FALLS = 1e-3
"""Share of a counter's steps that go back by dither, also where it never goes back."""
FLIP_RAD = np.radians(25.0)
"""A step so near to half a turn is one."""
FEWEST_FLIPS = 3
STOPPED_S = 10.0
STOPPED_WAY_M = 5.0
"""By yaw and fixes after a counter's last step: a pivot about one wheel is shorter."""
STILL = 1e-3
"""Share of a counter's range within which it stands."""
BACKWARDS = 0.6
"""Share of the way that the wheels say was in reverse; robots go forward more than back."""
LEAST_TRAVEL_M = 10.0
"""Below, the fixes do not show a radius to a per cent."""
SPINS = 2.0
"""So much more than its middle goes a wheel turns about it on a drive that only turns."""


@dataclass(frozen=True)
class NeededTravel:
    """What each wheel travelled in windows, by yaw and fixes and by its counter (k,), m; their edges (k + 1,)."""

    t_s: Floats
    needed_m: dict[str, Floats]
    counted_m: dict[str, Floats]
    clear_m: float
    """Less than this may be noise."""


def check_stops(aligned: Aligned) -> None:
    """Raise DataError where a counter stops for good while yaw and fixes move its wheel."""
    angles = {"left": aligned.left_rad, "right": aligned.right_rad}
    stopped = {side: at_s for side in SIDES if (at_s := _stops_at(aligned, angles[side])) is not None}
    travel = needed_travel(aligned) if stopped else None
    for side, at_s in stopped.items():
        if travel is not None:
            _check_stop(aligned, travel, side, at_s)


def check_directions(aligned: Aligned) -> None:
    """Raise DataError where a counter goes up whichever way its wheel turns."""
    angles = {"left": aligned.left_rad, "right": aligned.right_rad}
    rising = [side for side in SIDES if _never_falls(angles[side])]
    if not rising or same_counts(aligned) or _yaw_flips(aligned):
        return
    travel = needed_travel(aligned)
    if travel is not None:
        _check_direction(travel, rising)


def same_counts(aligned: Aligned) -> bool:
    """Whether both counters always count the same."""
    return float(np.ptp(aligned.right_rad - aligned.left_rad)) < STILL * float(np.ptp(aligned.right_rad))


def flips_of(yaw_rad: Floats, wheels_rad: Floats) -> Bools:
    """Which steps of the yaw (k,) are half a turn beside those of the wheels (k,)."""
    return np.asarray(np.abs(np.abs(yaw_rad - wheels_rad) - np.pi) < FLIP_RAD)


def _yaw_flips(aligned: Aligned) -> bool:
    """Whether the yaw turns round by half a turn more often than by chance: then it says no direction of travel."""
    t_s = np.arange(aligned.heading_t_s[0], aligned.heading_t_s[-1])
    yaw, wheels = np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad), wheel_turn(aligned, t_s)
    return int(flips_of(np.diff(yaw), np.diff(wheels)).sum()) >= FEWEST_FLIPS


def needed_travel(aligned: Aligned) -> NeededTravel | None:
    """Travel of both wheels by yaw and fixes beside their counters; None where the fixes are too coarse."""
    sigma = float(np.median(np.sqrt(aligned.fix_var_east_m2 + aligned.fix_var_north_m2)))
    t_s = np.arange(
        max(aligned.heading_t_s[0], aligned.fix_t_s[0]), min(aligned.heading_t_s[-1], aligned.fix_t_s[-1]), WINDOW_S
    )
    if CLEAR_SIGMAS * sigma > COARSE_M or t_s.size < FEWEST_WINDOWS + 1:
        return None
    place = np.interp(t_s, aligned.fix_t_s, aligned.steady_place_m)
    yaw = np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad)
    turn = np.diff(yaw)
    along = np.diff(place) * np.exp(-0.5j * (yaw[1:] + yaw[:-1]))
    radius = aligned.vehicle.wheel_radius_m
    counted = {
        side: radius * np.diff(np.interp(t_s, aligned.wheel_t_s, angle))
        for side, angle in (("left", aligned.left_rad), ("right", aligned.right_rad))
    }
    straight = (np.abs(turn) < STRAIGHT_RAD) & (np.abs(along) > CLEAR_SIGMAS * sigma)
    if straight.sum() < FEWEST_WINDOWS:
        return None
    axis = np.exp(-0.5j * np.angle(np.sum(along[straight] ** 2)))  # Whichever way it drove.
    forward = np.real(along * axis)
    if float(forward[straight] @ (counted["left"] + counted["right"])[straight]) < 0.0:
        forward = -forward
    half = 0.5 * aligned.vehicle.track_m * turn
    needed = {"left": forward - half, "right": forward + half}
    return NeededTravel(t_s, needed, counted, max(LEAST_M, CLEAR_SIGMAS * sigma))


def _came_back(needed_m: Floats, counted_m: Floats) -> Bools:
    """Windows (k,) that agree with the counts together with a neighbour: fixes stood aside between them."""
    back = np.zeros(needed_m.size, dtype=np.bool_)
    pairs = _alike(needed_m[1:] + needed_m[:-1], counted_m[1:] + counted_m[:-1])
    back[1:] |= pairs
    back[:-1] |= pairs
    return back


def _stops_at(aligned: Aligned, angle_rad: Floats) -> float | None:
    """When a counter last moved, where it stands for STOPPED_S and more at the end."""
    away = np.flatnonzero(np.abs(angle_rad - angle_rad[-1]) > STILL * max(float(np.ptp(angle_rad)), 1e-9))
    if away.size == 0:
        return None
    at_s = float(aligned.wheel_t_s[away[-1]])
    return at_s if aligned.span_s[1] - at_s > STOPPED_S else None


def _never_falls(angle_rad: Floats) -> bool:
    """Whether a counter only goes one way, up to dither."""
    steps = np.diff(angle_rad)
    return float(np.maximum(-steps, 0.0).sum()) < FALLS * float(np.abs(steps).sum())


def _check_stop(aligned: Aligned, travel: NeededTravel, side: str, at_s: float) -> None:
    after = travel.t_s[:-1] > at_s
    needed = np.abs(travel.needed_m[side][after])
    way_m = float(needed[needed > travel.clear_m].sum())
    if way_m < STOPPED_WAY_M:
        return
    angle = aligned.left_rad if side == "left" else aligned.right_rad
    raise DataError(
        f"{ENCODER_FILE}: the {side} counter stops counting at t = {at_s:.1f} s and stays at "
        f"{angle[-1] / (2.0 * np.pi):+.1f} turns from its beginning for the last {aligned.span_s[1] - at_s:.0f} s, "
        f"while yaw and fixes move its wheel by {way_m:.0f} m: it is full (a 16-bit counter ends at 32767 or 65535), "
        "its cable is off, or its reader stopped; cut the log there, or mend the counter and drive again"
    )


def _check_direction(travel: NeededTravel, rising: list[str]) -> None:
    lost: dict[str, Bools] = {}
    seen = kept = 0
    for side in SIDES:
        needed, counted = travel.needed_m[side], travel.counted_m[side]
        clear = np.abs(needed) > travel.clear_m
        kept += int((clear & _alike(needed, counted)).sum())
        seen += int(clear.sum())
        lost[side] = clear & (needed < 0.0) & _alike(-needed, counted) & (side in rising)
        lost[side] &= ~_came_back(needed, counted)
    windows = {side: int(lost[side].sum()) for side in SIDES}
    sides = [side for side in SIDES if windows[side]]
    way_m = {side: float(-travel.needed_m[side][lost[side]].sum()) for side in sides}
    total = sum(windows.values())
    if total < FEWEST_WINDOWS or sum(way_m.values()) < LOST_WAY_M or kept + total < FITS * seen or kept < total:
        return
    first = min(float(travel.t_s[:-1][lost[side]][0]) for side in sides)
    which = f"the {sides[0]} counter goes" if len(sides) == 1 else "both counters go"
    shown = " and ".join(f"{way_m[side]:.1f} m ({side})" for side in sides)
    raise DataError(
        f"{ENCODER_FILE}: {which} up whichever way the wheel turns: no count ever goes back, and by yaw and fixes the "
        f"wheel went back by {shown}, first at t = {first:.0f} s. The counts have no direction (one channel only, or "
        "unsigned steps): use both channels of the encoder, give the counts the sign of the commanded speed, or log "
        "a drive in which no wheel turns backwards"
    )


def _alike(needed_m: Floats, counted_m: Floats) -> Bools:
    """Which counted ways have the sign and about the size of the needed ones."""
    ratio = counted_m / np.where(needed_m == 0.0, np.inf, needed_m)
    return np.asarray((ratio > 1.0 / ALIKE) & (ratio < ALIKE))


def spinning_notices(aligned: Aligned) -> list[Notice]:
    """A doubt about drives that turn on the spot and go nowhere: they show neither radii nor the heading's zero."""
    t_s = np.arange(*aligned.span_s, WINDOW_S)
    way_m = float(np.abs(np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.travel_m))).sum())
    radius = aligned.vehicle.wheel_radius_m
    half = 0.5 * radius * np.interp(t_s, aligned.wheel_t_s, aligned.right_rad - aligned.left_rad)
    turned_m = float(np.abs(np.diff(half)).sum())
    if way_m > LEAST_TRAVEL_M or turned_m < SPINS * way_m:
        return []
    what = (
        f"drive that only turns: the middle between the wheels goes {way_m:.1f} m in all, while each wheel turns about "
        f"it by {turned_m:.1f} m; an antenna off the middle then looks like motion. Drive at least "
        f"{LEAST_TRAVEL_M:.0f} m straight as well"
    )
    doubt = f"the robot only turns, and goes {way_m:.1f} m: drive at least {LEAST_TRAVEL_M:.0f} m straight as well"
    return [Notice(ENCODER_FILE, what, 1, "", "warning", doubt)]


def reverse_notices(aligned: Aligned) -> list[Notice]:
    """A word about drives that are mostly in reverse: wheels exchanged and reversed look the same."""
    t_s = np.arange(*aligned.span_s, WINDOW_S)
    steps = np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.travel_m))
    way_m, back_m = float(np.abs(steps).sum()), float(np.maximum(-steps, 0.0).sum())
    if way_m < LEAST_TRAVEL_M or back_m < BACKWARDS * way_m:
        return []
    what = (
        "% of the way are in reverse by the wheels. If the robot did not drive so, the counters are exchanged and both "
        "reversed (left_ticks is minus the right wheel's): the radii then belong to the other sides, and the heading "
        "offset is 180 degrees off. The log alone cannot tell: push the robot forward, and both counts must rise"
    )
    return [Notice(ENCODER_FILE, what, round(100.0 * back_m / way_m), "", "warning")]
