"""The wheels' motion without the part that is only slip: what the constants' sensitivities are computed from.

A robot held on its path by a controller moves smoothly; its wheels turn a little more here and less there, because
they slip. A filter that takes every such wiggle of the wheels for a turn sees turns that the robot never made,
concludes that turns by the wheels mean little, and grows a track that is too wide, with a sigma that is too small: the
classical attenuation by errors in the regressor. On a straight line it would "measure" the track out of slip alone.

Prediction keeps the raw wheel angles. Only the derivatives by R_r, R_l and L use the motion that stands out of the
noise: sum and difference of the wheels' travel, thresholded in Haar wavelets averaged over shifts (Donoho and Johnstone
1994; Coifman and Donoho 1995), the noise level per root of distance taken from the finest scale.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats

GRID_S = 0.1
SHIFTS = 8
THRESHOLD_SIGMAS = 5.0
NORMAL_MAD = 1.4826


def denoised_angles(
    wheel_t_s: Floats, right_rad: Floats, left_rad: Floats, right_over_left: float
) -> tuple[Floats, Floats, Floats]:
    """Every k-th time of the wheels (g,) and the cumulative right and left angles there, freed of noise.

    On samples, not between them: interpolation would make neighbouring steps share noise.

    right_over_left is R_r/R_l as far as known: with it, straight driving has no turn at any speed.
    """
    every = max(round(GRID_S / float(np.median(np.diff(wheel_t_s)))), 1)
    chosen = np.append(np.arange(0, wheel_t_s.size - 1, every), wheel_t_s.size - 1)
    grid = wheel_t_s[chosen]
    right = np.diff(right_rad[chosen]) * right_over_left
    left = np.diff(left_rad[chosen])
    travelled = np.abs(right) + np.abs(left)
    both = _denoise(right + left, travelled)
    difference = _denoise(right - left, travelled)
    zero = np.zeros(1)
    return (
        grid,
        right_rad[0] + np.concatenate((zero, np.cumsum(0.5 * (both + difference)))) / right_over_left,
        left_rad[0] + np.concatenate((zero, np.cumsum(0.5 * (both - difference)))),
    )


def _denoise(steps: Floats, travelled: Floats) -> Floats:
    """Steps (g,) with their noise, of variance proportional to the distance travelled, thresholded away."""
    scaled = np.diff(steps)[::2]
    base = (travelled[:-1] + travelled[1:])[: scaled.size * 2 : 2]
    moving = base > 0
    if moving.sum() < 8:
        return steps
    level = NORMAL_MAD * float(np.median(np.abs(scaled[moving]) / np.sqrt(base[moving])))
    size = 1 << int(np.ceil(np.log2(steps.size)))
    shifts = (np.arange(SHIFTS) * size) // SHIFTS + np.arange(SHIFTS)
    rows = (np.arange(size)[None, :] - shifts[:, None]) % size
    padded = np.zeros((2, size))
    padded[0, : steps.size] = steps
    padded[1, : steps.size] = level**2 * travelled
    kept = _haar_threshold(padded[0][rows], padded[1][rows])
    back = (np.arange(steps.size)[None, :] + shifts[:, None]) % size
    return np.asarray(np.take_along_axis(kept, back, axis=1).mean(axis=0))


def _haar_threshold(values: Floats, variance: Floats) -> Floats:
    """Hard threshold of the orthonormal Haar coefficients of each row (s, 2^k), given their noise variance (s, 2^k).

    What stands above a kept coefficient is kept too: without it, a lone pivot would be turned back over the whole run.
    """
    details: list[Floats] = []
    smooth, smooth_variance = values, variance
    kept = np.zeros(values.shape, dtype=np.bool_)
    while smooth.shape[1] > 1:
        detail = (smooth[:, ::2] - smooth[:, 1::2]) / np.sqrt(2.0)
        smooth = (smooth[:, ::2] + smooth[:, 1::2]) / np.sqrt(2.0)
        smooth_variance = 0.5 * (smooth_variance[:, ::2] + smooth_variance[:, 1::2])
        kept = kept[:, ::2] | kept[:, 1::2] | (detail**2 > THRESHOLD_SIGMAS**2 * smooth_variance)
        details.append(np.where(kept, detail, 0.0))
    smooth = np.where(kept | (smooth**2 > THRESHOLD_SIGMAS**2 * smooth_variance), smooth, 0.0)
    for detail in reversed(details):
        finer = np.empty((detail.shape[0], 2 * detail.shape[1]))
        finer[:, ::2] = (smooth + detail) / np.sqrt(2.0)
        finer[:, 1::2] = (smooth - detail) / np.sqrt(2.0)
        smooth = finer
    return smooth
