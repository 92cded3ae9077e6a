"""One clock for all streams: the logging computer's.

A receiver stamps its epoch in UTC, exactly; the logging computer stamps the arrival, late and with jitter. Where the
log has both, the epochs are mapped onto the logging clock by a continuous, piecewise linear function through the
receive times: the jitter is gone, and a logging clock that its time daemon was steering (up to 500 ppm, tenths of a
second within minutes) is followed. How many corners the function has is decided by the Bayesian information criterion.
What the fastest lines take to arrive stays in the mapping; it cannot be told from a latency of the receiver.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import solveh_banded

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.streams import FixStream

DAY_S = 86400.0
SEGMENTS_S = (120.0, 60.0, 30.0, 15.0, 8.0)
JITTER_CORRELATION_S = 0.5
HUBER_ROUNDS = 8
EARLIEST = 0.02
HURRY_SPREADS = 6.0
"""Lines arrive late, never early: the mapping is laid through the earliest of them, which hurried most."""
CORNER_COST = 1.5
"""Times what the criterion asks: the corners' places are chosen too, if only from a few grids."""


@dataclass(frozen=True)
class Clock:
    """How the fixes' times were put on the logging computer's clock."""

    source: Literal["host", "utc", "utc_mapped", "motion"]
    """host: receive times as logged (gnss.csv); utc: the logging clock is Unix time; utc_mapped: the receiver's epochs
    mapped onto the logging clock through the receive times; motion: any of these, and then moved to where fixes and
    wheels move together."""
    offset_s: float
    """Logging clock minus UTC at the median time of the fixes. For receive times alone, and unless moved: 0; if moved:
    the wheels' clock minus the one that stamped the fixes."""
    skew_ppm: float
    """Mean rate of the logging clock against UTC, minus one."""
    jitter_s: float
    """Robust spread (1.4826 × median absolute deviation) of the receive times around the mapping."""
    knots: int
    """Corners of the mapping; 2 is a straight line, more mean that the logging clock was being steered."""
    sigma_offset_s: float = 0.0
    """Standard deviations of offset and skew; 0 where they are not estimated but taken as logged."""
    sigma_skew_ppm: float = 0.0


def fixes_on_host_clock(fixes: FixStream, span_s: tuple[float, float]) -> tuple[Floats, Bools, Clock]:
    """Times of the fixes on the logging clock (n,), which of them have one (n,), and how that was done.

    span_s is the first and last time of the wheel stream, for logs whose clocks must already agree.
    Raises DataError where the clocks cannot be brought together.
    """
    host, utc = fixes.host_t_s, fixes.utc_s
    both = np.isfinite(host) & np.isfinite(utc)
    if both.sum() >= 2 and np.ptp(utc[both]) > 0:
        centre = float(np.median(utc[both]))
        delay = host - utc
        mapping_t, mapping_v, jitter = _fit_delay(utc[both] - centre, delay[both])
        t_s = np.where(np.isfinite(utc), utc + np.interp(utc - centre, mapping_t, mapping_v), host)
        span = float(mapping_t[-1] - mapping_t[0])
        skew = float(mapping_v[-1] - mapping_v[0]) / span if span > 0 else 0.0
        clock = Clock("utc_mapped", float(np.interp(0.0, mapping_t, mapping_v)), 1e6 * skew, jitter, mapping_t.size)
        return t_s, np.isfinite(t_s), clock
    if np.isfinite(host).any():
        return host, np.isfinite(host), Clock("host", 0.0, 0.0, 0.0, 2)
    t_s = utc if fixes.utc_has_date else _on_the_day_of(utc, span_s)
    return t_s, np.isfinite(t_s), Clock("utc", 0.0, 0.0, 0.0, 2)


def require_overlap(t_s: Floats, span_s: tuple[float, float], clock: Clock, what: str) -> None:
    """Raise DataError where a stream shares no time with the wheels."""
    if t_s.size and t_s[-1] >= span_s[0] and t_s[0] <= span_s[1]:
        return
    seen = f"{t_s[0]:.3f} … {t_s[-1]:.3f} s" if t_s.size else "no usable rows"
    advice = (
        "without receive times before the NMEA lines, t in encoder.csv and ahrs.csv must be Unix time (UTC)"
        if clock.source == "utc"
        else "all streams must share the logging computer's clock"
    )
    raise DataError(f"{what} ({seen}) and encoder.csv ({span_s[0]:.3f} … {span_s[1]:.3f} s) do not overlap: {advice}")


def _on_the_day_of(time_of_day_s: Floats, span_s: tuple[float, float]) -> Floats:
    """Times of day put on the day that brings them nearest to the wheels' span."""
    middle = 0.5 * (span_s[0] + span_s[1])
    days = np.round((middle - np.nanmedian(time_of_day_s)) / DAY_S)
    return np.asarray(time_of_day_s + days * DAY_S)


def _fit_delay(utc_s: Floats, delay_s: Floats) -> tuple[Floats, Floats, float]:
    """Continuous piecewise linear fit of the delay: its corners' times and values, and the jitter around it."""
    reference = float(np.median(delay_s))
    values = delay_s - reference
    span = float(np.ptp(utc_s))
    rate = utc_s.size / max(span, 1e-9)
    independent = utc_s.size / max(1.0, rate * JITTER_CORRELATION_S)
    best: tuple[float, Floats, Floats, float, float] | None = None
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
            best = (score, knots, fitted, spread, _earliest(residual, spread))
    assert best is not None
    return best[1], best[2] + reference + best[4], best[3]


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
