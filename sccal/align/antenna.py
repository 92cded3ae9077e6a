"""Where the antenna is, roughly, from the path alone.

A filter that knows of no arm takes the swings of a long one for outliers, and from there no fit finds it. In every
stretch of STRETCH_S the fixes are the wheels' path along the AHRS yaw, turned and scaled, shifted by what went before,
and an arm that turns with the yaw: in complex numbers z = α p + c + β e^(i yaw), by reweighted least squares.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Complexes, Floats, Ints

STRETCH_S = 20.0
"""Long enough for a turn, and short enough that wheels and yaw do not drift much."""
FEWEST = 50
ROUNDS = 8
HUBER = 1.5


def antenna_by_path(t_s: Floats, fixes_m: Complexes, path_m: Complexes, yaw_rad: Floats) -> tuple[float, float] | None:
    """How far ahead and to the left of the middle the antenna is, m; None where there are too few fixes.

    Parameters
    ----------
    t_s
        Times of the fixes (n,).
    fixes_m
        The fixes (n,), east + i north.
    path_m, yaw_rad
        At the same times (n,): where the wheels take the robot along the AHRS yaw, and that yaw.
    """
    if t_s.size < FEWEST:
        return None
    stretch = ((t_s - t_s[0]) / STRETCH_S).astype(np.int64)
    weight = np.ones(t_s.size)
    logged = path_m, np.exp(1j * yaw_rad), fixes_m
    for _ in range(ROUNDS):
        path, arm, fixes = (_less_means(one, weight, stretch) for one in logged)
        root = np.sqrt(weight)
        solved, *_ = np.linalg.lstsq(np.column_stack((path, arm)) * root[:, None], fixes * root, rcond=None)
        left = np.abs(fixes - solved[0] * path - solved[1] * arm)
        weight = 1.0 / np.maximum(left / max(HUBER * float(np.median(left)), 1e-6), 1.0)
    if not abs(solved[0]) > 0.0:
        return None
    found = complex(solved[1] / (solved[0] / abs(solved[0])))
    return found.real, found.imag


def _less_means(values: Complexes, weight: Floats, stretch: Ints) -> Complexes:
    """Values (n,) less the weighted mean of their stretch."""
    total = np.bincount(stretch, weight)
    means = np.bincount(stretch, weight * values.real) + 1j * np.bincount(stretch, weight * values.imag)
    return np.asarray(values - (means / np.maximum(total, 1e-12))[stretch])
