"""Random numbers that stay where they are, and the errors made of them.

Every source of noise has its own named stream, so that changing one setting leaves all other noise as it was. The
first-order Gauss-Markov process with standard deviation σ and correlation time τ, sampled every Δ, is exactly

    e₀ = σ w₀      eₖ = φ eₖ₋₁ + σ √(1 − φ²) wₖ      φ = exp(−Δ/τ)      w white, N(0, 1)

Where samples may be missing or asked for in any order (rows of a log that one program reads and another does not),
numbers belong to keys instead of to places in a sequence: the same seed, name and key give the same number, whatever
else is asked for. The Gauss-Markov process at given times then runs over a grid of such numbers; between the two points
of the grid around it, α after a and β before b (α + β = Δ), it is the process tied to both:

    e = (e_a sinh(β/τ) + e_b sinh(α/τ)) / sinh(Δ/τ) + σ √(2 sinh(α/τ) sinh(β/τ) / sinh(Δ/τ)) w

Keys are mixed with the finaliser of splitmix64 (Steele, Lea and Flood 2014, Fast splittable pseudorandom number
generators), normal numbers made of pairs by Box and Muller's transform.
"""

from __future__ import annotations

import math
import zlib
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Floats, Ints

_GRID_S = 0.05
_DAY_S = 86400.0
_FINEST = 64
_CELLS_A_DAY = round(_DAY_S / _GRID_S) * _FINEST
_MOST_CELLS = 4_000_000
_CELLS_A_TIME = 16
"""The grid has at least so many points in a correlation time, unless that makes too many in all."""
_MEMORY_TIMES = 20.0
"""After so many correlation times nothing is left of a value (2e-9)."""
_KEYS_PER_S = 10_000


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
    return _recursion(drive, phi)


def random_walk(rng: np.random.Generator, steps: Floats, sigma_per_root: float) -> Floats:
    """A walk whose variance grows by sigma² per unit of |step|, from 0; one longer than ``steps``."""
    moves = rng.standard_normal(steps.size) * (sigma_per_root * np.sqrt(np.abs(steps)))
    return np.concatenate(([0.0], np.cumsum(moves)))


def time_keys(t_s: Floats) -> Ints:
    """Keys (n,) that name times to 0.1 ms within the day, so that they need no date; 0 where a time is not finite."""
    within = np.where(np.isfinite(t_s), t_s, 0.0) % _DAY_S
    return np.round(within * _KEYS_PER_S).astype(np.int64) % round(_DAY_S * _KEYS_PER_S)


def uniforms_at(seed: int, name: str, keys: Ints) -> Floats:
    """Numbers (n,) of (0, 1) that belong to the keys (n,)."""
    return _uniforms(seed, name, keys, 0)


def normals_at(seed: int, name: str, keys: Ints) -> Floats:
    """Independent pairs (n, 2) of N(0, 1) that belong to the keys (n,)."""
    radius = np.sqrt(-2.0 * np.log(_uniforms(seed, name, keys, 0)))
    angle = 2.0 * math.pi * _uniforms(seed, name, keys, 1)
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle)))


def gauss_markov_at(seed: int, name: str, t_s: Floats, time_s: float) -> Floats:
    """Two independent Gauss-Markov processes of σ = 1 at finite times ``t_s`` (n,) in any order: (n, 2).

    Which other times are asked for does not matter beyond 1e-8, as long as they lie within the same day or so.
    """
    order = np.argsort(t_s, kind="stable")
    sorted_s = t_s[order]
    memory_s = min(_MEMORY_TIMES * time_s, _DAY_S)
    breaks = np.flatnonzero(np.diff(sorted_s) > memory_s) + 1
    stretches = [part for part in np.split(sorted_s, breaks) if part.size]
    spent_s = sum(float(part[-1] - part[0]) + memory_s for part in stretches)
    cells = _FINEST
    while cells > 1 and _GRID_S * cells / _FINEST > time_s / _CELLS_A_TIME:
        cells //= 2
    while spent_s / (_GRID_S * cells / _FINEST) > _MOST_CELLS:
        cells *= 2
    values = np.empty((t_s.size, 2))
    done = 0
    for part in stretches:
        values[order[done : done + part.size]] = _tied(seed, name, part, time_s, memory_s, cells)
        done += part.size
    return values


def _tied(seed: int, name: str, t_s: Floats, time_s: float, memory_s: float, cells: int) -> Floats:
    step_s = _GRID_S * cells / _FINEST
    t_s = np.round((t_s - np.floor(t_s[0] / _DAY_S) * _DAY_S) * _KEYS_PER_S) / _KEYS_PER_S
    cell = np.floor((t_s + 1e-6) / step_s).astype(np.int64)
    first = int(cell[0]) - math.ceil(memory_s / step_s)
    grid = np.arange(first, int(cell[-1]) + 2)
    phi = math.exp(-step_s / time_s)
    drive = normals_at(seed, f"{name}.grid", grid * cells % _CELLS_A_DAY) * math.sqrt(1.0 - phi * phi)
    drive[0] /= math.sqrt(1.0 - phi * phi)
    errors = np.column_stack([_recursion(drive[:, axis], phi) for axis in range(2)])
    after = np.clip(t_s - cell * step_s, 0.0, step_s) / time_s
    before = step_s / time_s - after
    whole = -math.expm1(-2.0 * step_s / time_s)
    to_a = np.exp(-after) * -np.expm1(-2.0 * before) / whole
    to_b = np.exp(-before) * -np.expm1(-2.0 * after) / whole
    loose = np.sqrt(np.expm1(-2.0 * after) * np.expm1(-2.0 * before) / whole)
    own = normals_at(seed, f"{name}.between", time_keys(t_s))
    at = cell - first
    tied: Floats = to_a[:, None] * errors[at] + to_b[:, None] * errors[at + 1] + loose[:, None] * own
    return tied


def _recursion(drive: Floats, phi: float) -> Floats:
    return np.array(list(accumulate(drive.tolist(), lambda error, push: phi * error + push)), dtype=float)


def _uniforms(seed: int, name: str, keys: Ints, lane: int) -> Floats:
    salt = np.random.SeedSequence(seed, spawn_key=(zlib.crc32(name.encode()),)).generate_state(4, np.uint64)
    words = _mixed(keys.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + salt[2 * lane])
    words = _mixed(words + salt[2 * lane + 1])
    uniforms: Floats = ((words >> np.uint64(11)).astype(np.float64) + 0.5) * 2.0**-53
    return uniforms


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))
