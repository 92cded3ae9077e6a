"""Two streams at a time: do they turn the same way, and do they travel equally far?

Turning has three witnesses: the wheels, the yaw, and the course of the fixes. Two that oppose each other show that a
sign is wrong, and the third shows whose. All three have one rate in common when the track is right as well.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sccal.align.signs import Slope, slope_through_origin
from sccal.arrays import Floats
from sccal.inspect.coverage import longest_step_s
from sccal.inspect.drive import fix_window_s
from sccal.inspect.place import PlacedFixes, legs
from sccal.inspect.together import Together, there
from sccal.logs.streams import Vehicle
from sccal.results.inspection import CourseFacts, Witness

TURN_WINDOW_S = 1.0
LEAST_TURN_RAD = np.radians(30.0)
LONGEST_TURN_RAD = 2.5
"""A course that changes by more between two windows is a robot that reversed."""
LEAST_LEGS = 8
LEG_FACTOR = 4.0
COURSE_LEG_M = 2.0
NEARLY_STRAIGHT_RAD = np.radians(25.0)
BOTH_SIDES = 0.4
WANDER_S = 40.0
"""Time over which the error of a fix usually stays the same."""
SAME_PATH = 0.9
"""A leg of the fixes much shorter than the wheels' way between its ends went there and back."""


def witnesses(together: Together, vehicle: Vehicle | None) -> tuple[Witness, ...]:
    """Every pair of streams that share time; the vehicle as it is declared, for what would make them agree."""
    found = []
    if together.meets("wheels", "heading") and together.turn_rad.size:
        yaw = _turning("yaw against wheels", *_turns(together))
        if yaw.clear and yaw.slope > 0 and vehicle is not None:
            yaw = replace(yaw, meaning=_track_that_agrees(together, vehicle.track_m / yaw.slope))
        found.append(yaw)
    if together.fixes is not None and together.meets("fixes"):
        for name, t_of, turned, what in (
            ("wheels", together.wheel_t_s, together.turn_rad, "course of the fixes against wheels"),
            ("heading", together.yaw_t_s, together.yaw_rad, "course of the fixes against yaw"),
        ):
            if together.meets(name) and turned.size:  # type: ignore[arg-type]
                found.append(_turning(what, *courses(together.fixes, t_of, turned)))
        if together.meets("wheels"):
            distance = _distance(together, together.fixes)
            if distance.clear and vehicle is not None:
                radius_m = vehicle.wheel_radius_m * distance.slope
                distance = replace(distance, meaning=f"a wheel radius of about {radius_m:.4g} m would agree")
            found.append(distance)
    return tuple(found)


def _track_that_agrees(together: Together, track_m: float) -> str:
    """Empty where the robot turned mostly to one side: then unequal wheels look like another track."""
    turns = np.diff(together.turn_rad)
    left, right = float(turns[turns > 0].sum()), -float(turns[turns < 0].sum())
    both = min(left, right) > BOTH_SIDES * max(left, right)
    return f"a track of about {track_m:.3g} m would agree" if both else ""


def course_facts(together: Together) -> CourseFacts | None:
    """Does the yaw keep its distance to where the robot goes, on legs that are nearly straight?

    None where wheels, yaw and fixes do not share enough straight legs.
    """
    fixes = together.fixes
    if fixes is None or not together.meets("wheels", "heading", "fixes"):
        return None
    inside = (fixes.t_s >= together.wheel_t_s[0]) & (fixes.t_s <= together.wheel_t_s[-1])
    z, t_s = (fixes.east_m + 1j * fixes.north_m)[inside], fixes.t_s[inside]
    leg_m = max(LEG_FACTOR * fixes.leg_m, COURSE_LEG_M)
    at = legs(z.real, z.imag, leg_m)
    if at.size < LEAST_LEGS + 1:
        return None
    begin, end = t_s[at][:-1], t_s[at][1:]
    use = np.ones(begin.size, dtype=np.bool_)
    for stamps in (together.wheel_t_s, together.yaw_t_s, fixes.t_s):
        use &= there(begin, end, stamps, longest_step_s(stamps))
    use &= np.abs(np.diff(np.interp(t_s[at], together.yaw_t_s, together.yaw_rad))) < NEARLY_STRAIGHT_RAD
    travel = np.diff(np.interp(t_s[at], together.wheel_t_s, together.travel_m))
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(together.travel_m)))))
    use &= np.abs(travel) >= SAME_PATH * np.diff(np.interp(t_s[at], together.wheel_t_s, way))
    use &= travel != 0.0
    if use.sum() < LEAST_LEGS:
        return None
    # The yaw as it is on the whole of the leg, not only in its middle.
    grid = begin[:, None] + (end - begin)[:, None] * (np.arange(5) + 0.5) / 5
    yaw = np.interp(grid, together.yaw_t_s, together.yaw_rad).mean(axis=1)
    apart = (np.exp(1j * yaw) * np.conj(np.diff(z[at]) * np.sign(travel)))[use]
    apart /= np.abs(apart)
    offset = float(np.angle(apart.mean()))
    spread = 1.4826 * float(np.median(np.abs(np.angle(apart * np.exp(-1j * offset)))))
    sigma = fixes.sigma_m[np.isfinite(fixes.sigma_m)]
    wander = float(np.median(sigma)) if sigma.size else 0.0
    changes2 = wander**2 * (1.0 - np.exp(-float(np.median((end - begin)[use])) / WANDER_S))
    changes2 += 0.0 if np.isnan(fixes.white_m) else fixes.white_m**2
    return CourseFacts(int(use.sum()), offset, spread, float(np.sqrt(2.0 * changes2) / leg_m))


def _turns(together: Together) -> tuple[Floats, Floats]:
    first = max(together.wheel_t_s[0], together.yaw_t_s[0])
    last = min(together.wheel_t_s[-1], together.yaw_t_s[-1])
    t_s = np.arange(first, last, TURN_WINDOW_S)
    both = there(t_s[:-1], t_s[1:], together.wheel_t_s, longest_step_s(together.wheel_t_s))
    both &= there(t_s[:-1], t_s[1:], together.yaw_t_s, longest_step_s(together.yaw_t_s))
    wheels = np.diff(np.interp(t_s, together.wheel_t_s, together.turn_rad))
    yaw = np.diff(np.interp(t_s, together.yaw_t_s, together.yaw_rad))
    return wheels[both], yaw[both]


def courses(fixes: PlacedFixes, t_of: Floats, turned: Floats) -> tuple[Floats, Floats]:
    """Change of the other stream, and of the fixes' course, between the middles of neighbouring windows."""
    window = max(2.0, fix_window_s(fixes))
    t_s = np.arange(fixes.t_s[0], fixes.t_s[-1], window)
    z = np.interp(t_s, fixes.t_s, fixes.east_m) + 1j * np.interp(t_s, fixes.t_s, fixes.north_m)
    moves = np.diff(z)
    good = there(t_s[:-1], t_s[1:], fixes.t_s, longest_step_s(fixes.t_s)) & (np.abs(moves) > fixes.leg_m)
    middle = 0.5 * (t_s[:-1] + t_s[1:])
    course = np.angle(moves[1:] * np.conj(moves[:-1]))
    other = np.diff(np.interp(middle, t_of, turned))
    inside = there(middle[:-1], middle[1:], t_of, longest_step_s(t_of))
    use = good[1:] & good[:-1] & inside & (np.abs(course) < LONGEST_TURN_RAD) & (np.abs(other) < LONGEST_TURN_RAD)
    return other[use], course[use]


def _turning(what: str, x: Floats, y: Floats) -> Witness:
    slope = slope_through_origin(x, y)
    enough = min(np.abs(x).sum(), np.abs(y).sum()) > LEAST_TURN_RAD if x.size else False
    return _witness(what, slope, bool(enough and slope.clear))


def _distance(together: Together, fixes: PlacedFixes) -> Witness:
    """Displacement of the fixes on the wheels' travel, over legs that are nearly straight."""
    what = "distance by fixes against wheels"
    inside = (fixes.t_s >= together.wheel_t_s[0]) & (fixes.t_s <= together.wheel_t_s[-1])
    z, t_s = (fixes.east_m + 1j * fixes.north_m)[inside], fixes.t_s[inside]
    at = legs(z.real, z.imag, LEG_FACTOR * fixes.leg_m)
    if at.size < 2:
        return Witness(what, np.nan, 0.0, 0, False)
    moves = np.diff(z[at])
    begin, end = t_s[at][:-1], t_s[at][1:]
    travel = np.abs(np.diff(np.interp(t_s[at], together.wheel_t_s, together.travel_m)))
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(together.travel_m)))))
    whole = np.diff(np.interp(t_s[at], together.wheel_t_s, way))
    use = there(begin, end, together.wheel_t_s, longest_step_s(together.wheel_t_s))
    use &= there(begin, end, fixes.t_s, longest_step_s(fixes.t_s)) & (travel >= SAME_PATH * whole) & (travel > 0)
    if together.meets("heading"):
        use &= np.abs(np.diff(np.interp(t_s[at], together.yaw_t_s, together.yaw_rad))) < np.radians(45.0)
    x, y = travel[use], np.abs(moves[use])
    slope = slope_through_origin(x, y)
    return _witness(what, slope, bool(slope.windows >= LEAST_LEGS and slope.correlation > SAME_PATH))


def _witness(what: str, slope: Slope, clear: bool) -> Witness:
    return Witness(what, float(slope.value), float(slope.correlation), slope.windows, clear)
