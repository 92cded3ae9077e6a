"""TUM trajectory, for evo: ``t x y z qx qy qz qw``, seconds and metres, x east, y north, yaw from east to north.

Format: vision.in.tum.de/data/datasets/rgbd-dataset/file_formats, github.com/MichaelGrupp/evo/wiki/Formats.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats
from sccal.export.result import Result


def write_tum(result: Result) -> str:
    """The run's path, on the logging clock as in trajectory.csv."""
    path = result.trajectory
    return tum_rows(path.t_s, path.east_m, path.north_m, path.yaw_rad)


def tum_rows(t_s: Floats, east_m: Floats, north_m: Floats, yaw_rad: Floats) -> str:
    """A row for each pose (n,): in the plane, so z = qx = qy = 0, qz = sin θ/2 and qw = cos θ/2."""
    half = 0.5 * yaw_rad
    table = np.column_stack((t_s, east_m, north_m, np.sin(half), np.cos(half)))
    return ("%.6f %.4f %.4f 0 0 0 %.9f %.9f\n" * len(table)) % tuple(table.ravel().tolist())
