"""How far and how fast the fixes went in windows of time, and how well other columns go with that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.align.signs import Slope, slope_through_origin
from sccal.arrays import Bools, Complexes, Floats
from sccal.inspect.coverage import longest_step_s
from sccal.inspect.drive import fix_window_s
from sccal.inspect.place import PlacedFixes, legs
from sccal.inspect.together import there
from sccal.inspect.witnesses import LONGEST_TURN_RAD, SAME_PATH, courses
from sccal.logs.rates import integrated

LONGEST_LEG_S = 30.0
"""From fix to fix: a longer silence hides turns."""
_BITS = (8, 10, 12, 16, 20, 24, 32)
"""Widths of counters, as sccal.logs.counter looks for them."""
FEWEST_WINDOWS = 8
"""As many as sccal.align.signs asks for before it believes a slope."""


@dataclass(frozen=True)
class Moved:
    """Displacements of the fixes between the edges of windows."""

    edge_s: Floats
    """(n + 1)"""
    step_m: Complexes
    """(n) East + i north."""
    known: Bools
    """(n) Whether the fixes cover the window."""


def moved_by(path: PlacedFixes) -> Moved:
    """In windows long enough for a displacement to stand out from the noise, and of two seconds at least."""
    edge_s = np.arange(path.t_s[0], path.t_s[-1], max(2.0, fix_window_s(path)))
    place = np.interp(edge_s, path.t_s, path.east_m) + 1j * np.interp(edge_s, path.t_s, path.north_m)
    known = there(edge_s[:-1], edge_s[1:], path.t_s, longest_step_s(path.t_s))
    return Moved(edge_s, np.diff(place), known)


def summed(t_s: Floats, values: Floats, is_rate: bool) -> Floats:
    """What a column has come to: itself, or its integral where it is a rate."""
    return integrated(t_s, values) if is_rate else values


def share_explained(moved: Moved, t_s: Floats, counted: Floats, sided: bool) -> tuple[float, float]:
    """How well the size of a column's steps explains the displacements, up to 1, and metres per unit of it.

    It is the share of their variance; at a constant speed there is none, and what is left of the displacements
    themselves says it, for columns ``sided`` by their names: any row counter goes on evenly too. A wheel that travels
    an arc in a window goes further than the chord, and a robot that reverses in it too: the slope is a median.
    """
    inside = moved.known & there(moved.edge_s[:-1], moved.edge_s[1:], t_s, longest_step_s(t_s))
    if inside.sum() < FEWEST_WINDOWS:
        return 0.0, 0.0
    x, y = np.abs(np.diff(np.interp(moved.edge_s, t_s, counted)))[inside], np.abs(moved.step_m[inside])
    moving = (y > 0.2 * y.max()) & (x > 0)
    if moving.sum() < FEWEST_WINDOWS:
        return 0.0, 0.0
    slope = float(np.median(y[moving] / x[moving]))
    left = float(np.mean(np.abs(y - slope * x)))
    spread, way = float(np.mean(np.abs(y - np.mean(y)))), float(np.mean(y))
    of_variance = 1.0 - (left / spread) ** 2 if spread > 0 else 0.0
    return max(of_variance, 1.0 - 4.0 * left / way if sided else 0.0), slope


def north_over_east(moved: Moved, t_s: Floats, counted: Floats) -> float:
    """By how much northward metres must be stretched, against eastward ones, for the wheels to go as far every way.

    Least squares of the squared way on both squared displacements; 1 where the drive does not show it.
    """
    inside = moved.known & there(moved.edge_s[:-1], moved.edge_s[1:], t_s, longest_step_s(t_s))
    x, step = np.diff(np.interp(moved.edge_s, t_s, counted))[inside], moved.step_m[inside]
    if x.size < FEWEST_WINDOWS:
        return 1.0
    squares = np.column_stack((step.real**2, step.imag**2))
    (east, north), _, rank, _ = np.linalg.lstsq(squares, x**2, rcond=1e-3)
    return float(np.sqrt(north / east)) if rank == 2 and east > 0 and north > 0 else 1.0


def turns(path: PlacedFixes, t_of: Floats, turned: Floats, wheel_t_s: Floats, travel: Floats) -> Slope:
    """Turns of the path on those of another stream: from window to window, and where that shows none, from leg to leg.

    A robot that turns on the spot only, between two straights, has no windows in which its path turns.
    """
    by_windows = slope_through_origin(*courses(path, t_of, turned))
    if by_windows.clear:
        return by_windows
    return slope_through_origin(*_leg_turns(path, t_of, turned, wheel_t_s, travel))


def _leg_turns(
    path: PlacedFixes, t_of: Floats, turned: Floats, wheel_t_s: Floats, travel: Floats
) -> tuple[Floats, Floats]:
    """Change of another stream, and of the direction in which the robot points by its path, from leg to leg.

    On a leg that the wheels drive backwards it points against its course; one on which they go both ways has none.
    """
    at = legs(path.east_m, path.north_m, path.leg_m)
    place, t_s = (path.east_m + 1j * path.north_m)[at], path.t_s[at]
    if at.size < 3:
        return np.zeros(0), np.zeros(0)
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(travel)))))
    net, whole = (np.diff(np.interp(t_s, wheel_t_s, one)) for one in (travel, way))
    along, one_way = np.diff(place) * np.sign(net), np.abs(net) >= SAME_PATH * whole
    middle_s = 0.5 * (t_s[1:] + t_s[:-1])
    course, other = np.angle(along[1:] * np.conj(along[:-1])), np.diff(np.interp(middle_s, t_of, turned))
    inside = there(t_s[:-2], t_s[2:], t_of, longest_step_s(t_of)) & there(t_s[:-2], t_s[2:], path.t_s, LONGEST_LEG_S)
    use = inside & one_way[1:] & one_way[:-1] & (np.abs(course) < LONGEST_TURN_RAD)
    return other[use], course[use]


def unwrapped(values: Floats) -> Floats:
    """Counts (n) without the falls of a register of so many bits as they fill; anything else as it is."""
    if values.size < 2 or not (values == np.round(values)).all():
        return values
    jump = float(np.abs(np.diff(values)).max())
    for bits in _BITS:
        size = 2.0**bits
        fills = (values.min() >= 0 and values.max() < size) or (values.min() >= -size / 2 and values.max() < size / 2)
        if fills and jump > size / 2:
            steps = np.diff(values)
            return np.concatenate((values[:1], values[0] + np.cumsum(steps - size * np.round(steps / size))))
    return values
