"""The array types and the two small numerical tools that several modules share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Effects = dict[str, dict[str, float]]
"""Every effect that a robot has, by name, with the values of its parameters in the units of the file formats."""


def floats(values: ArrayLike) -> FloatArray:
    """Any numbers as an array of floats."""
    return np.asarray(values, dtype=np.float64)


def stream(seed: int, name: str) -> np.random.Generator:
    """A random generator of its own for each use, so that a change of one draw leaves all the others as they were."""
    return np.random.default_rng([seed, *name.encode()])


def recursive(driven: FloatArray, decay: float, start: float) -> FloatArray:
    """The first-order recursion y_k = decay · y_(k−1) + driven_k, with y_(−1) = start."""
    out = []
    last = start
    for value in driven.tolist():
        last = decay * last + value
        out.append(last)
    return np.array(out)


def gauss_markov(normal: FloatArray, step_s: float, sigma: float, tau_s: float) -> FloatArray:
    """A stationary first-order Gauss-Markov process, exact at any step: variance σ², correlation exp(−|Δt|/τ)."""
    if sigma == 0.0 or normal.size == 0:
        return np.zeros_like(normal)
    decay = float(np.exp(-step_s / tau_s))
    driven = sigma * np.sqrt(1.0 - decay * decay) * normal
    driven[0] = 0.0
    return recursive(driven, decay, sigma * float(normal[0]) / decay)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """One number whose logarithm is uniform between those of the limits."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def pick_sign(rng: np.random.Generator, positive_share: float = 0.5) -> float:
    """Plus or minus one."""
    return 1.0 if rng.random() < positive_share else -1.0


def wrap_degrees(angle_deg: FloatArray) -> FloatArray:
    """Angles brought into [−180, 180)."""
    return (angle_deg + 180.0) % 360.0 - 180.0
