"""How coarse are the digits of a column? A reading rounded to steps of q errs by up to q/2 whatever else it is.

    variance of rounding = q² / 12        (an even distribution over one step)

Steps are found from the values: rounded ones lie on a grid, so their smallest difference, or a small fraction of it,
measures all others. Values that lie on none (full floating point) have no step.
"""

from __future__ import annotations

import math

import numpy as np

from sccal.arrays import Floats

MOST_VALUES = 5_000
"""Enough to meet neighbouring steps; sorting all of an hour's readings would cost more than the rest of the work."""
FRACTIONS = (1, 2, 3, 4, 5)
"""Of the smallest difference seen: few values may never meet at one step's distance."""
OFF_GRID = 0.05
"""Of a step. Values on no grid are off by a quarter on average; five differences are so near by chance once in 10⁵."""
FEWEST_DIFFERENCES = 6
LARGEST_MULTIPLE = 1e5
"""Of a step: beyond, floating point cannot tell a multiple of it from what lies between."""
OF_ROUNDING = 1.0 / math.sqrt(12.0)
"""Standard deviation of an even distribution, as a share of its width."""


def step_of(values: Floats) -> float:
    """The step (in the values' unit) to which values (n,) were rounded; 0 where they lie on no grid."""
    finite = values[np.isfinite(values)]
    distinct = np.unique(finite[:: max(1, finite.size // MOST_VALUES)])
    if distinct.size < 2:
        return 0.0
    apart = np.diff(distinct)
    smallest_seen = 16.0 * float(np.spacing(np.abs(distinct).max()))
    apart = apart[apart > smallest_seen]
    if apart.size < FEWEST_DIFFERENCES:
        return 0.0
    least = float(apart.min())
    apart = apart[apart < LARGEST_MULTIPLE * least]
    for fraction in FRACTIONS:
        multiple = apart * (fraction / least)
        if float(np.abs(multiple - np.round(multiple)).max()) < OFF_GRID:
            return least / fraction
    return 0.0
