"""Control charts: where a parameter of a vehicle belongs, run by run.

An individuals chart (Shewhart; Montgomery, Introduction to Statistical Quality Control, section 6.4) with a scatter
from the median moving range, which neither a drift nor a bad run inflates: the median of |y_i+1 − y_i| is 0.954 times
one run's standard deviation. Here every run has a sigma of its own, so the scatter τ between the runs solves

    median |y_i+1 − y_i| / √(s_i² + s_i+1² + 2 τ²) = 0.6745

and each run has its own limits, centre ± 3 √(τ² + s_i²), about the weighted median.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import PurePosixPath

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.logs.names import natural_key
from sccal.results.calibration import PARAMETERS, Calibration, Estimate, named_estimates
from sccal.results.summary import Chart, NoChart
from sccal.summary.trends import MEDIAN_OF_A_NORMAL, best_trend, on_all_runs

FEWEST_RUNS = 4
LIMIT_SIGMAS = 3.0
APART_SIGMAS = 6.0
"""A run so far from the median of the five runs around it is set aside."""
APART_FROM_RUNS = 8
"""Fewest runs of which one can be set aside."""
OFFSET_OF_THE_RUN_DEG = 5.0
"""Heading offsets that differ by more than this belong to the runs, not to the vehicle."""
SHORTEST_SPAN_S = 600.0
"""Runs that all begin within this stand in the order of their names: their dates say nothing."""
_SECONDS_PER_DAY = 86400.0


@dataclass(frozen=True)
class DatedRun:
    """A run and when it started."""

    run: Calibration
    started: str | None
    started_s: float | None
    """Unix time; None without a date."""


def dated(run: Calibration) -> DatedRun:
    """A run and when it started; a date that cannot be read is none."""
    try:
        moment = datetime.fromisoformat(str(run.started))
        moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        return DatedRun(run, run.started, moment.timestamp())
    except (ValueError, OverflowError):
        return DatedRun(run, None, None)


def charts_of(runs: Sequence[DatedRun]) -> tuple[list[Chart], list[NoChart]]:
    """Every parameter of one vehicle that enough runs estimated; effects after the four of the model."""
    charts: list[Chart] = []
    without: list[NoChart] = []
    of_run = [_flat(run.run) for run in runs]
    keys = dict.fromkeys([*PARAMETERS, *(key for estimates in of_run for key in estimates)])
    for key in keys:
        if key.endswith("at_s"):
            continue
        taking_part = [
            (run, estimates[key])
            for run, estimates in zip(runs, of_run, strict=True)
            if key in estimates and _usable(estimates[key])
        ]
        made = _chart(key, taking_part, len(runs))
        if isinstance(made, Chart):
            charts.append(made)
        else:
            without.append(made)
    return charts, without


def scatter_between(value: Floats, sigma: Floats) -> float:
    """τ of the module's equation for values (n,) in order; 0 where their own sigmas explain the moving ranges."""
    moves = np.abs(np.diff(value))
    own2 = sigma[:-1] ** 2 + sigma[1:] ** 2

    def too_wide(tau: float) -> bool:
        return bool(np.median(moves / np.sqrt(own2 + 2.0 * tau**2)) > MEDIAN_OF_A_NORMAL)

    if not len(moves) or not too_wide(0.0):
        return 0.0
    low, high = 0.0, float(moves.max()) / MEDIAN_OF_A_NORMAL
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if too_wide(middle) else (low, middle)
    return high


def set_aside(value: Floats, sigma: Floats, scatter: float) -> Bools:
    """Runs far from those around them, before and after; a step or a drift sets none aside. At most one in five."""
    count = len(value)
    if count < APART_FROM_RUNS:
        return np.zeros(count, dtype=bool)
    first = np.clip(np.arange(count) - 2, 0, count - 5)
    around = np.median(value[first[:, None] + np.arange(5)], axis=1)
    apart = np.abs(value - around) / np.hypot(sigma, scatter)
    far = apart > APART_SIGMAS
    return far if far.sum() <= count // 5 else np.zeros(count, dtype=bool)


def weighted_median(value: Floats, weight: Floats) -> float:
    """The value with half of the weight on either side."""
    order = np.argsort(value, kind="stable")
    below = np.cumsum(weight[order])
    first = int(np.searchsorted(below, 0.5 * below[-1] * (1.0 - 1e-12)))
    at_half = math.isclose(below[first], 0.5 * below[-1]) and first + 1 < len(value)
    return float(value[order[first : first + 1 + at_half]].mean())


def _chart(key: str, runs: Sequence[tuple[DatedRun, Estimate]], of_all: int) -> Chart | NoChart:
    dates = [run for run in runs if run[0].started_s is not None]
    moments_s = [run.started_s for run, _ in dates if run.started_s is not None]
    by_date = len(dates) >= max(FEWEST_RUNS, len(runs) / 2) and max(moments_s) - min(moments_s) > SHORTEST_SPAN_S
    if by_date:
        runs = sorted(dates, key=lambda run: (run[0].started_s or 0.0, natural_key(PurePosixPath(run[0].run.run))))
    if len(runs) < FEWEST_RUNS:
        return NoChart(key, f"{len(runs)} of {of_all} runs estimated it; a chart needs {FEWEST_RUNS}")
    value = np.array([estimate.value for _, estimate in runs])
    sigma = np.array([estimate.sigma for _, estimate in runs])
    if key == "heading_offset_deg":
        value = on_one_turn_deg(value)
        spread = float(np.ptp(value))
        if spread > OFFSET_OF_THE_RUN_DEG:
            return NoChart(key, f"it differs by up to {spread:.0f}° between the runs: it belongs to each run")
    moments = np.array([run.started_s if by_date else k for k, (run, _) in enumerate(runs)], dtype=np.float64)
    at = (moments - moments[0]) / (_SECONDS_PER_DAY if by_date else 1.0)
    scatter = scatter_between(value, sigma)
    apart = set_aside(value, sigma, scatter)
    used = ~apart
    spread_of_run = np.hypot(sigma, scatter)
    centre = weighted_median(value[used], spread_of_run[used] ** -2.0)
    lower, upper = centre - LIMIT_SIGMAS * spread_of_run, centre + LIMIT_SIGMAS * spread_of_run
    trend = best_trend(at[used], value[used], sigma[used], by_date)
    return Chart(
        key=key,
        runs=tuple(dated_run.run.run for dated_run, _ in runs),
        started=tuple(run.started for run, _ in runs),
        by_date=by_date,
        at=at,
        value=value,
        sigma=sigma,
        centre=centre,
        scatter=scatter,
        lower=lower,
        upper=upper,
        outside=(value < lower) | (value > upper),
        set_aside=apart,
        left_out=of_all - len(runs),
        tested=trend is not None,
        trend=None if trend is None else on_all_runs(trend, used),
    )


def on_one_turn_deg(value_deg: Floats) -> Floats:
    """Directions (n,) about their mean direction: −179° and 179° stand next to each other."""
    radians = np.radians(value_deg)
    mean_deg = math.degrees(math.atan2(float(np.sin(radians).sum()), float(np.cos(radians).sum())))
    return mean_deg + np.remainder(value_deg - mean_deg + 180.0, 360.0) - 180.0


def _flat(run: Calibration) -> Mapping[str, Estimate]:
    return {
        name.removeprefix("parameters.").removeprefix("effects."): one for name, one in named_estimates(run).items()
    }


def _usable(estimate: Estimate) -> bool:
    return (
        estimate.status == "estimated"
        and math.isfinite(estimate.value)
        and math.isfinite(estimate.sigma)
        and estimate.sigma > 0.0
    )
