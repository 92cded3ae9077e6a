"""Two streams at a time: do they turn the same way, and do they travel equally far?

Turning has three witnesses: the wheels, the yaw, and the course of the fixes. Two that oppose each other show that a
sign is wrong, and the third shows whose. All three have one rate in common when the track is right as well.
"""

from __future__ import annotations

import numpy as np

from sccal.align.signs import Slope, slope_through_origin
from sccal.arrays import Floats
from sccal.inspect.coverage import longest_step_s
from sccal.inspect.drive import fix_window_s
from sccal.inspect.place import PlacedFixes, legs
from sccal.inspect.result import Witness
from sccal.inspect.together import Together, there

TURN_WINDOW_S = 1.0
LEAST_TURN_RAD = np.radians(30.0)
LONGEST_TURN_RAD = 2.5
"""A course that changes by more between two windows is a robot that reversed."""
LEAST_LEGS = 8
LEG_FACTOR = 4.0
SAME_PATH = 0.9
"""A leg of the fixes much shorter than the wheels' way between its ends went there and back."""


def witnesses(together: Together) -> tuple[Witness, ...]:
    """Every pair of streams that share time."""
    found = []
    if together.meets("wheels", "heading") and together.turn_rad.size:
        found.append(_turning("yaw against wheels", *_turns(together)))
    if together.fixes is not None and together.meets("fixes"):
        for name, t_of, turned, what in (
            ("wheels", together.wheel_t_s, together.turn_rad, "course of the fixes against wheels"),
            ("heading", together.yaw_t_s, together.yaw_rad, "course of the fixes against yaw"),
        ):
            if together.meets(name) and turned.size:  # type: ignore[arg-type]
                found.append(_turning(what, *_courses(together.fixes, t_of, turned)))
        if together.meets("wheels"):
            found.append(_distance(together, together.fixes))
    return tuple(found)


def _turns(together: Together) -> tuple[Floats, Floats]:
    first = max(together.wheel_t_s[0], together.yaw_t_s[0])
    last = min(together.wheel_t_s[-1], together.yaw_t_s[-1])
    t_s = np.arange(first, last, TURN_WINDOW_S)
    both = there(t_s[:-1], t_s[1:], together.wheel_t_s, longest_step_s(together.wheel_t_s))
    both &= there(t_s[:-1], t_s[1:], together.yaw_t_s, longest_step_s(together.yaw_t_s))
    wheels = np.diff(np.interp(t_s, together.wheel_t_s, together.turn_rad))
    yaw = np.diff(np.interp(t_s, together.yaw_t_s, together.yaw_rad))
    return wheels[both], yaw[both]


def _courses(fixes: PlacedFixes, t_of: Floats, turned: Floats) -> tuple[Floats, Floats]:
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
    return Witness(what, slope.value, slope.correlation, slope.windows, clear)
