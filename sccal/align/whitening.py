"""What of a series is new at each step, once a first-order memory and an autoregression are known."""

from __future__ import annotations

from sccal.arrays import Floats
from sccal.compiled import compiled


@compiled
def innovations(steps: Floats, lam: float, ar: Floats) -> Floats:
    """w_n = s_n + λ w_n−1 down the rows, then w_n − Σ ar_k w_n−k; what is before the first row is zero."""
    white = steps.copy()
    for n in range(1, steps.shape[0]):
        for column in range(steps.shape[1]):
            white[n, column] += lam * white[n - 1, column]
    if ar.shape[0] == 0:
        return white
    left = white.copy()
    for n in range(1, steps.shape[0]):
        for k in range(min(n, ar.shape[0])):
            for column in range(steps.shape[1]):
                left[n, column] -= ar[k] * white[n - 1 - k, column]
    return left
