"""Random numbers that stay where they are, and the errors made of them.

Every source of noise has its own named stream, so that changing one setting leaves all other noise as it was. The
first-order Gauss-Markov process with standard deviation σ and correlation time τ, sampled every Δ, is exactly

    e₀ = σ w₀      eₖ = φ eₖ₋₁ + σ √(1 − φ²) wₖ      φ = exp(−Δ/τ)      w white, N(0, 1)
"""

from __future__ import annotations

import math
import zlib
from itertools import accumulate

import numpy as np

from sccal.arrays import Floats


def random_stream(seed: int, name: str) -> np.random.Generator:
    """The stream of random numbers that belongs to one source of noise under one seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()),)))


def gauss_markov(rng: np.random.Generator, count: int, step_s: float, sigma: float, time_s: float) -> Floats:
    """``count`` samples, ``step_s`` apart, of the process above, stationary from the first one on.

    A plain loop: an hour of AHRS takes 50 ms, and importing scipy.signal for its filter takes a second or two.
    """
    phi = math.exp(-step_s / time_s)
    drive = rng.standard_normal(count) * (sigma * math.sqrt(1.0 - phi * phi))
    if count:
        drive[0] /= math.sqrt(1.0 - phi * phi)
    return np.array(list(accumulate(drive.tolist(), lambda error, push: phi * error + push)), dtype=float)


def random_walk(rng: np.random.Generator, steps: Floats, sigma_per_root: float) -> Floats:
    """A walk whose variance grows by sigma² per unit of |step|, from 0; one longer than ``steps``."""
    moves = rng.standard_normal(steps.size) * (sigma_per_root * np.sqrt(np.abs(steps)))
    return np.concatenate(([0.0], np.cumsum(moves)))


def in_order(stamps_s: Floats, gap_s: float) -> Floats:
    """Arrival times with the queue kept: none comes less than ``gap_s`` after the one before it."""
    ahead = np.arange(stamps_s.size) * gap_s
    return np.asarray(np.maximum.accumulate(stamps_s - ahead) + ahead)
