"""A first-order low-pass along uneven times, exact for what goes straight from one sample to the next.

With x straight over each step Δ, e = exp(−Δ/τ) and k = (1 − e) τ/Δ, the answer of τ dy/dt = x − y from y₀ = x₀ is

    yᵢ = e yᵢ₋₁ + (k − e) xᵢ₋₁ + (1 − k) xᵢ

It is compiled: an hour of readings takes a millisecond, and sccal.compiled keeps the machine code.
"""

from __future__ import annotations

import math

import numpy as np

from sccal.arrays import Floats
from sccal.compiled import compiled


def low_passed(values: Floats, t_s: Floats, tau_s: float) -> Floats:
    """``values`` (n, …) at the times ``t_s`` (n,) after a first-order filter that begins at the first of them."""
    if tau_s <= 0.0 or t_s.size == 0:
        return values
    rows = np.ascontiguousarray(values, dtype=np.float64).reshape(t_s.size, -1)
    return np.asarray(_recursion(rows, np.ascontiguousarray(t_s, dtype=np.float64), tau_s).reshape(values.shape))


@compiled
def _recursion(x: Floats, t_s: Floats, tau_s: float) -> Floats:
    y = np.empty_like(x)
    y[0] = x[0]
    for i in range(1, x.shape[0]):
        steps = max(t_s[i] - t_s[i - 1], 0.0) / tau_s
        kept = math.exp(-steps)
        mean = -math.expm1(-steps) / steps if steps > 0.0 else 1.0
        for j in range(x.shape[1]):
            y[i, j] = kept * y[i - 1, j] + (mean - kept) * x[i - 1, j] + (1.0 - mean) * x[i, j]
    return y
