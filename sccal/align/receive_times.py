"""The receiver's epochs on the logging clock, through the receive times of the lines.

Lines arrive late, never early: buffers are flushed seconds later, several lines at once. What is late for sure is left
out, the rest is fitted robustly by a continuous, piecewise linear delay, and the fit is moved onto the earliest lines.
How many corners it has is decided by the Bayesian information criterion. Where the delay jumps for good (a receiver
that learns of leap seconds, a clock that is set), the fit has a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from sccal.arrays import Bools, Floats

SEGMENTS_S = (120.0, 60.0, 30.0, 15.0, 8.0)
JITTER_CORRELATION_S = 0.5
HUBER_ROUNDS = 8
EARLIEST = 0.02
HURRY_SPREADS = 6.0
"""Lines arrive late, never early: the mapping is laid through the earliest of them, which hurried most."""
CORNER_COST = 1.5
"""Times what the criterion asks: the corners' places are chosen too, if only from a few grids."""
LATE_S = 0.25
"""A line that took so much longer than the fastest one nearby was kept in a buffer."""
NEARBY_S = 5.0
STEP_S = 0.5
"""Jumps of the delay below this are left to the corners."""
STEP_WINDOW_S = 10.0
LEAP_TOLERANCE_S = 0.3
"""Where the epochs leap by about the step, the step is there."""
EARLY_S = 0.2
"""More than clocks drift within STEP_WINDOW_S, and than the fastest lines differ."""
FEWEST_BESIDE = 5
MOST_LATE = 0.9


@dataclass(frozen=True)
class Delay:
    """Receive time minus epoch, without jitter."""

    knot_s: Floats
    """Epochs of the corners (k,)."""
    value_s: Floats
    """The delay there (k,), without the steps."""
    step_at_s: Floats
    """Epochs from which on another step counts (j,)."""
    step_s: Floats
    """What each adds (j,)."""
    jitter_s: float
    """Robust spread of the lines that are not late."""
    late: int
    """Lines left out."""
    sigma_offset_s: float
    """In the middle of the run; of what the earliest lines took nothing is known."""
    sigma_skew: float

    def at(self, utc_s: Floats) -> Floats:
        """The delay of epochs (n,)."""
        steps = np.concatenate(([0.0], np.cumsum(self.step_s)))
        return np.asarray(
            np.interp(utc_s, self.knot_s, self.value_s) + steps[np.searchsorted(self.step_at_s, utc_s, side="right")]
        )

    @property
    def skew(self) -> float:
        """Mean slope, steps left out."""
        span = float(self.knot_s[-1] - self.knot_s[0])
        return float(self.value_s[-1] - self.value_s[0]) / span if span > 0 else 0.0


def fit_delay(utc_s: Floats, delay_s: Floats) -> Delay:
    """The delay of lines with epochs utc_s (n,), increasing, that arrived delay_s (n,) later by the logging clock."""
    step_at_s, step_s = _steps(utc_s, delay_s)
    flat = delay_s - np.concatenate(([0.0], np.cumsum(step_s)))[np.searchsorted(step_at_s, utc_s, side="right")]
    on_time = _on_time(utc_s, flat)
    knots, values, spread, residual = _fit(utc_s[on_time], flat[on_time])
    sigma_offset, sigma_skew = _sigmas(utc_s[on_time], residual, spread, knots.size)
    late = int((~on_time).sum())
    return Delay(knots, values, step_at_s, step_s, spread, late, sigma_offset, sigma_skew)


def _least(values: Floats, first: np.ndarray, last: np.ndarray) -> Floats:
    """Least of values[first:last] for windows that only move forward (n,); inf where there are none."""
    padded = np.append(values, np.inf)
    bounds = np.column_stack((first, np.maximum(last, first))).ravel()
    least = np.minimum.reduceat(padded, np.minimum(bounds, values.size))[::2]
    return np.where(last > first, least, np.inf)


def _on_time(utc_s: Floats, delay_s: Floats) -> Bools:
    """Which lines (n,) were not kept back, as far as the lines nearby can tell."""
    first = np.searchsorted(utc_s, utc_s - NEARBY_S)
    last = np.searchsorted(utc_s, utc_s + NEARBY_S, side="right")
    on_time = delay_s - _least(delay_s, first, last) <= LATE_S
    return on_time if on_time.sum() >= max(2.0, (1.0 - MOST_LATE) * utc_s.size) else np.ones(utc_s.size, dtype=bool)


def _steps(utc_s: Floats, delay_s: Floats) -> tuple[Floats, Floats]:
    """Epochs from which on the delay of the fastest lines differs for good, and by how much."""
    usual_s = max(float(np.median(np.diff(utc_s))), 1e-3)
    beside = max(FEWEST_BESIDE, round(STEP_WINDOW_S / usual_s))
    index = np.arange(utc_s.size)
    before = _least(delay_s, np.maximum(index - beside, 0), index)
    after = _least(delay_s, index, np.minimum(index + beside, utc_s.size))
    inner = (index >= FEWEST_BESIDE) & (utc_s.size - index >= FEWEST_BESIDE)
    jump = np.zeros(utc_s.size)
    jump[inner] = after[inner] - before[inner]
    rows = np.flatnonzero(np.abs(jump) >= STEP_S)
    if rows.size == 0:
        return np.zeros(0), np.zeros(0)
    at, size = [], []
    for group in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        first, last = max(int(group[0]) - beside, 0), min(int(group[-1]) + beside, utc_s.size)
        low, high = before[group[0]], after[group[-1]]
        beyond_s = np.diff(utc_s[first:last]) - usual_s
        leaps = first + 1 + np.flatnonzero(np.abs(beyond_s + (high - low)) < LEAP_TOLERANCE_S)
        if leaps.size == 1:
            row = int(leaps[0])
        else:
            # No line is early: one below the upper level stands on the lower level's side of the step.
            lower = first + np.flatnonzero(delay_s[first:last] < max(low, high) - EARLY_S)
            row = int(lower[-1]) + 1 if high > low else int(lower[0])
        if 0 < row < utc_s.size:
            at.append(row)
            size.append(float(high - low))
    return utc_s[np.array(at, dtype=np.int64)], np.array(size)


def _sigmas(utc_s: Floats, residual: Floats, spread: float, knots: int) -> tuple[float, float]:
    """Standard deviations of offset (middle) and skew, taking lines closer than JITTER_CORRELATION_S as one."""
    span = max(float(np.ptp(utc_s)), 1e-9)
    independent = max(min(float(utc_s.size), span / JITTER_CORRELATION_S), 2.0)
    of_one = 1.2533 * spread
    low, high = np.quantile(residual, [0.5 * EARLIEST, 2.0 * EARLIEST])
    quantile = np.sqrt(EARLIEST * (1.0 - EARLIEST) / independent) * float(high - low) / (1.5 * EARLIEST)
    local = independent / max(knots - 1, 1)
    offset = float(np.hypot(of_one / np.sqrt(local), quantile))
    skew = of_one / np.sqrt(independent) * np.sqrt(12.0) / span if knots == 2 else 2.0 * of_one / np.sqrt(local) / span
    return offset, float(skew)


def _fit(utc_s: Floats, delay_s: Floats) -> tuple[Floats, Floats, float, Floats]:
    """Continuous piecewise linear fit of the delay: its corners' times and values, the jitter, and what is left."""
    reference = float(np.median(delay_s))
    values = delay_s - reference
    span = float(np.ptp(utc_s))
    rate = utc_s.size / max(span, 1e-9)
    independent = utc_s.size / max(1.0, rate * JITTER_CORRELATION_S)
    best: tuple[float, Floats, Floats, float, Floats] | None = None
    for segment_s in (np.inf, *SEGMENTS_S):
        count = 2 if np.isinf(segment_s) else round(span / segment_s) + 1
        if count < 2 or (best is not None and count <= best[1].size) or count > independent / 4 + 2:
            continue
        knots = np.linspace(utc_s.min(), utc_s.max(), count)
        fitted, residual = _robust_hat_fit(utc_s, values, knots)
        spread = max(1.4826 * float(np.median(np.abs(residual))), 1e-5)
        laplace = max(float(np.mean(np.abs(residual))), 1e-5)
        score = 2.0 * independent * np.log(laplace) + CORNER_COST * count * np.log(max(independent, 2.0))
        if best is None or score < best[0]:
            best = (score, knots, fitted, spread, residual)
    assert best is not None
    _, knots, fitted, spread, residual = best
    return knots, fitted + reference + _earliest(residual, spread), spread, residual


def _earliest(residual: Floats, spread: float) -> float:
    """How much before the middle the earliest lines come; stamps of a clock that stepped are no lines in a hurry."""
    return float(np.quantile(residual[np.abs(residual) <= HURRY_SPREADS * spread], EARLIEST))


def _robust_hat_fit(t_s: Floats, values: Floats, knots: Floats) -> tuple[Floats, Floats]:
    """Least absolute deviations by reweighting, on hat functions at the knots; (values at knots, residuals)."""
    left = np.clip(np.searchsorted(knots, t_s, side="right") - 1, 0, knots.size - 2)
    upper = (t_s - knots[left]) / (knots[left + 1] - knots[left])
    lower = 1.0 - upper
    weight = np.ones(t_s.size)
    fitted = np.full(knots.size, float(np.median(values)))
    residual = values - fitted[0]
    for _ in range(HUBER_ROUNDS):
        diagonal = np.bincount(left, weight * lower * lower, knots.size)
        diagonal += np.bincount(left + 1, weight * upper * upper, knots.size)
        beside = np.bincount(left, weight * lower * upper, knots.size)[:-1]
        right_side = np.bincount(left, weight * lower * values, knots.size)
        right_side += np.bincount(left + 1, weight * upper * values, knots.size)
        banded = np.array([np.concatenate(([0.0], beside)), diagonal + 1e-9 * diagonal.max()])
        fitted = solveh_banded(banded, right_side)
        residual = values - (lower * fitted[left] + upper * fitted[left + 1])
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-6)
        weight = 1.0 / np.maximum(np.abs(residual), 0.5 * scale)
    return fitted, residual
