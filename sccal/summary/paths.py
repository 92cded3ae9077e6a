"""The corners that show a path: points left out lie within a tolerance of the line drawn.

The rule is that of Ramer (1972) and of Douglas and Peucker (1973), all pieces of one level at once.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.results.files import read_trajectory
from sccal.results.summary import ThinPath

ROWS_READ = 600
"""Of a trajectory; more would not show in a picture of this size."""
TOLERANCE = 1 / 250
"""Of the path's larger extent: under half a pixel where the picture is drawn."""


def thin_path(folder: Path, most: int) -> ThinPath:
    """At most so many corners of the path in a folder of results; none where its trajectory is missing or damaged."""
    try:
        path = read_trajectory(folder, ROWS_READ)
    except DataError:
        return ThinPath(np.empty(0), np.empty(0))
    usable = np.isfinite(path.east_m) & np.isfinite(path.north_m)
    east, north = path.east_m[usable], path.north_m[usable]
    kept = corners(east, north, most)
    return ThinPath(east[kept], north[kept])


def corners(east_m: Floats, north_m: Floats, most: int) -> Bools:
    """Which of the points (n,) to keep, at most so many; both ends are always kept."""
    count = len(east_m)
    if count <= 2:
        return np.ones(count, dtype=bool)
    tolerance = TOLERANCE * float(max(np.ptp(east_m), np.ptp(north_m)))
    while True:
        kept = _within(east_m, north_m, tolerance)
        if kept.sum() <= max(most, 2):
            return kept
        tolerance *= 1.5


def _within(east_m: Floats, north_m: Floats, tolerance: float) -> Bools:
    kept = np.zeros(len(east_m), dtype=bool)
    kept[[0, -1]] = True
    while True:
        ends = np.flatnonzero(kept)
        first, last = ends[:-1], ends[1:]
        piece = np.minimum(np.cumsum(kept) - 1, len(first) - 1)
        along_east, along_north = (east_m[last] - east_m[first])[piece], (north_m[last] - north_m[first])[piece]
        from_east, from_north = east_m - east_m[first][piece], north_m - north_m[first][piece]
        length2 = along_east**2 + along_north**2
        share = np.clip((from_east * along_east + from_north * along_north) / np.where(length2, length2, 1.0), 0.0, 1.0)
        distance = np.hypot(from_east - share * along_east, from_north - share * along_north)
        distance[kept] = 0.0
        farthest = np.maximum.reduceat(distance, first)
        split = (distance > tolerance) & (distance == farthest[piece])
        if not split.any():
            return kept
        kept |= split
