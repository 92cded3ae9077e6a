"""How far and how fast the fixes went in windows of time, and how well other columns go with that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.inspect.coverage import longest_step_s
from sccal.inspect.drive import fix_window_s
from sccal.inspect.place import PlacedFixes
from sccal.inspect.together import there
from sccal.logs.rates import integrated

FEWEST_WINDOWS = 8
"""As many as sccal.align.signs asks for before it believes a slope."""


@dataclass(frozen=True)
class Moved:
    """Displacements of the fixes between the edges of windows."""

    edge_s: Floats
    """(n + 1)"""
    moved_m: Floats
    """(n)"""
    known: Bools
    """(n) Whether the fixes cover the window."""


def moved_by(path: PlacedFixes) -> Moved:
    """In windows long enough for a displacement to stand out from the noise, and of two seconds at least."""
    edge_s = np.arange(path.t_s[0], path.t_s[-1], max(2.0, fix_window_s(path)))
    place = np.interp(edge_s, path.t_s, path.east_m) + 1j * np.interp(edge_s, path.t_s, path.north_m)
    known = there(edge_s[:-1], edge_s[1:], path.t_s, longest_step_s(path.t_s))
    return Moved(edge_s, np.abs(np.diff(place)), known)


def summed(t_s: Floats, values: Floats, is_rate: bool) -> Floats:
    """What a column has come to: itself, or its integral where it is a rate."""
    return integrated(t_s, values) if is_rate else values


def share_explained(moved: Moved, t_s: Floats, counted: Floats) -> tuple[float, float]:
    """Which share of the displacements' variance the size of a column's steps explains, and metres per unit of it.

    A wheel that travels an arc in a window goes further than the chord, and windows in which the robot reversed do not
    count the other way: the slope is a median, and the share is of medians too.
    """
    inside = moved.known & there(moved.edge_s[:-1], moved.edge_s[1:], t_s, longest_step_s(t_s))
    if inside.sum() < FEWEST_WINDOWS:
        return 0.0, 0.0
    x, y = np.abs(np.diff(np.interp(moved.edge_s, t_s, counted)))[inside], moved.moved_m[inside]
    moving = (y > 0.2 * y.max()) & (x > 0)
    if moving.sum() < FEWEST_WINDOWS:
        return 0.0, 0.0
    slope = float(np.median(y[moving] / x[moving]))
    left, spread = np.abs(y - slope * x), np.abs(y - np.mean(y))
    return 1.0 - float(np.mean(left) / np.mean(spread)) ** 2, slope
