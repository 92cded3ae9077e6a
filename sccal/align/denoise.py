"""The wheels' motion without the part that is only slip: what the constants' sensitivities are computed from.

A robot held on its path by a controller moves smoothly; its wheels turn a little more here and less there, because
they slip. A filter that takes every such wiggle of the wheels for a turn sees turns that the robot never made,
concludes that turns by the wheels mean little, and grows a track that is too wide, with a sigma that is too small: the
classical attenuation by errors in the regressor. On a straight line it would "measure" the track out of slip alone.

Prediction keeps the raw wheel angles. Only the derivatives by R_r, R_l and L, and the weights of the slip, use the
motion that stands out of the noise: sum and difference of the wheels' travel as piecewise constant shares of the
distance travelled (straight lines, arcs and pivots are exactly that, at any speed), segmented by penalised least
squares (optimal partitioning, Jackson et al. 2005), and zero where a segment's share is not clear of the noise. The
noise level per root of distance comes from differences of neighbouring steps.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.compiled import compiled

GRID_S = 0.1
PENALTY = 25.0
"""Cost of one more segment in units of χ²: a change must show at 5 σ."""
CLEAR_SIGMAS = 4.0
LONGEST = 300
"""Steps of one segment at first: bounds the work. Neighbours that are one motion are joined afterwards."""
FEWEST_STEPS = 8
NORMAL_MAD = 1.4826


def denoised_angles(
    wheel_t_s: Floats, right_rad: Floats, left_rad: Floats, right_over_left: float
) -> tuple[Floats, Floats, Floats]:
    """Every k-th time of the wheels (g,) and the cumulative right and left angles there, freed of noise.

    On samples, not between them: interpolation would make neighbouring steps share noise. right_over_left is R_r/R_l
    as far as known: with it, straight driving has no turn at any speed.
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
    """Steps (g,) as piecewise constant shares of the distance travelled, where these stand out of the noise."""
    moving = travelled > 0
    x, d = steps[moving], travelled[moving]
    if x.size < FEWEST_STEPS:
        return steps
    rough = np.diff(x / d) / np.sqrt(1.0 / d[1:] + 1.0 / d[:-1])
    level2 = max(NORMAL_MAD * float(np.median(np.abs(rough))), 1e-12) ** 2
    bounds = np.append(_joined(_segments(x, d, level2, PENALTY, LONGEST), x, d, level2, PENALTY), x.size)
    total, length = np.add.reduceat(x, bounds[:-1]), np.add.reduceat(d, bounds[:-1])
    share = np.where(total**2 > CLEAR_SIGMAS**2 * level2 * length, total / length, 0.0)
    clear = np.zeros(steps.size)
    clear[moving] = np.repeat(share, np.diff(bounds)) * d
    return clear


@compiled
def _segments(x: Floats, d: Floats, level2: float, penalty: float, longest: int) -> Ints:
    """First indices of the segments that minimise Σ (x − κ d)²/(level2 d) + penalty per segment (dynamic programming).

    The sum of a segment's cost is −(Σx)²/(level2 Σd) up to a constant, so cumulative sums give it at once.
    """
    n = x.shape[0]
    cx = np.zeros(n + 1)
    cd = np.zeros(n + 1)
    for i in range(n):
        cx[i + 1] = cx[i] + x[i]
        cd[i + 1] = cd[i] + d[i]
    best = np.zeros(n + 1)
    came_from = np.zeros(n + 1, dtype=np.int64)
    costs = np.empty(longest)
    for end in range(1, n + 1):
        begin = max(0, end - longest)
        before, from_x, from_d = best[begin:end], cx[begin:end], cd[begin:end]
        # A loop of its own without branches, so that several are computed at once.
        for k in range(end - begin):
            sum_x = cx[end] - from_x[k]
            costs[k] = before[k] - sum_x * sum_x / (level2 * (cd[end] - from_d[k])) + penalty
        least, first = costs[0], 0
        for k in range(1, end - begin):
            if costs[k] < least:
                least, first = costs[k], k
        best[end] = least
        came_from[end] = begin + first
    count = 0
    at = n
    while at > 0:
        at = came_from[at]
        count += 1
    starts = np.empty(count, dtype=np.int64)
    at = n
    while at > 0:
        at = came_from[at]
        count -= 1
        starts[count] = at
    return starts


@compiled
def _joined(first: Ints, x: Floats, d: Floats, level2: float, penalty: float) -> Ints:
    """The segments with each joined to the one before it where that costs less than a segment.

    Only a cut at the length limit can be joined: any other was found worth its price.
    """
    count = first.shape[0]
    starts = first.copy()
    kept = 1
    sum_x, sum_d = 0.0, 0.0
    for k in range(count):
        end = first[k + 1] if k + 1 < count else x.shape[0]
        own_x, own_d = x[first[k] : end].sum(), d[first[k] : end].sum()
        if k > 0:
            apart = sum_x / sum_d - own_x / own_d
            cost = apart * apart / (1.0 / sum_d + 1.0 / own_d) / level2
            if cost < penalty:
                sum_x += own_x
                sum_d += own_d
                continue
            starts[kept] = first[k]
            kept += 1
        sum_x, sum_d = own_x, own_d
    return starts[:kept]
