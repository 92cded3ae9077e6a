"""Does a parameter change over the runs, and how? A weighted regression on each of three shapes.

    y_i = a + b c(t_i) + between_i + own_i      between ~ (0, τ²), own ~ (0, s_i²), weights w_i = 1/(τ² + s_i²)

``drift``: c = t. ``onset``: c = max(0, t − t_k), steady until run k. ``step``: c = 1 from run k on. τ² comes from the
scatter of the runs about their mean (Paule and Mandel, J. Res. NBS 87, 1982, 377–385): too large where there is a
change, which only makes the weights more alike.

The standard error of b is the larger of two: that of the scatter about the fit (Knapp and Hartung, Statistics in
Medicine 22, 2003, 2693–2710) and that of the runs' own sigmas, stretched where the runs' moving ranges show them too
small. b over it is judged by Student's t with n − 2 degrees of freedom, and charged for the search over the three
shapes and all places of a step or onset (Bonferroni). A change that is gone without one run is none.

Over all charts of a summary the false discovery rate is held at ALARM (Benjamini and Hochberg, J. R. Stat. Soc. B 57,
1995, 289–300), so that of the fleets in which nothing changes less than one in a hundred is told that something does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtr

from sccal.arrays import Bools, Floats
from sccal.results.summary import Shape, Trend

ALARM = 0.01
FEWEST_RUNS = 5
STEP_RUNS = 3
"""Fewest runs on either side of a step."""
ONSET_RUNS = 3
"""Fewest runs in the steady and in the drifting part."""
MEDIAN_OF_A_NORMAL = 0.674489750196
"""Median size of a standard normal number."""
STILL_SEEN = 0.05
"""Chance below which a change is still seen without its weightiest run, not charged for any search."""
PLACES = 200
"""Most places tried for an onset; more runs are tried at evenly chosen ones."""


@dataclass(frozen=True)
class _Shaped:
    shape: Shape
    place: int
    """First run of the drift, of the drifting part, or after the step."""


def best_trend(at: Floats, value: Floats, sigma: Floats, by_date: bool) -> Trend | None:
    """The shape that fits best, with its chance under no change; None for too few runs. Arrays (n,), ``at`` rising."""
    count = len(at)
    if count < FEWEST_RUNS or not at[-1] > at[0]:
        return None
    scale = float(sigma.max())
    y, s = (value - np.median(value)) / scale, sigma / scale
    shapes, columns, charge = _candidates(at)
    t, left_over = _judged(columns, y, s)
    chance = np.minimum(2.0 * stdtr(count - 2, -t) * charge, 1.0)
    best = int(np.argmin(count * np.log(left_over) + 2.0 * np.log(charge)))
    shaped, column = shapes[best], columns[best]
    level, slope, sigma_slope = _fitted(column, y, s)
    rise = float(column[-1] - column[0])
    step = shaped.shape == "step"
    before = shaped.place - 1 if step else shaped.place
    after = shaped.place if step else count - 1
    return Trend(
        shape=shaped.shape,
        change=slope * rise * scale,
        sigma=sigma_slope * rise * scale,
        p_value=float(chance[best]) if _holds_without_one(column, y, s) else 1.0,
        before=before,
        after=after,
        days=float(at[after] - at[before]) if by_date else None,
        fitted=(level + slope * column) * scale + np.median(value),
    )


def significant(p_values: Sequence[float], alarm: float = ALARM) -> Bools:
    """Which of the charts (m,) are told, by Benjamini and Hochberg's rule."""
    p = np.asarray(p_values, dtype=np.float64)
    if not p.size:
        return np.zeros(0, dtype=bool)
    ranked = np.sort(p)
    passes = np.flatnonzero(ranked <= alarm * np.arange(1, p.size + 1) / p.size)
    return p <= (ranked[passes[-1]] if passes.size else -1.0)


def on_all_runs(trend: Trend, used: Bools) -> Trend:
    """A trend found on the runs ``used`` (n,), with the numbers of all runs; between them the fit is interpolated."""
    index = np.flatnonzero(used)
    whole = np.interp(np.arange(len(used)), index, trend.fitted)
    return replace(trend, before=int(index[trend.before]), after=int(index[trend.after]), fitted=whole)


def between_runs(value: Floats, sigma: Floats, column: Floats | None = None) -> float:
    """τ² after Paule and Mandel, about the mean or about a regression on a column (n,)."""
    free = len(value) - (1 if column is None else 2)

    def excess(tau2: float) -> float:
        w = 1.0 / (sigma**2 + tau2)
        y = value - (w @ value) / w.sum()
        left = w @ y**2
        if column is not None:
            c = column - (w @ column) / w.sum()
            left -= (w @ (c * y)) ** 2 / (w @ c**2)
        return float(left - free)

    if free <= 0 or excess(0.0) <= 0.0:
        return 0.0
    low, high = 0.0, float(np.ptp(value) ** 2)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    return high


def stretch(value: Floats, sigma: Floats) -> float:
    """How many times as large as their sigmas (n,) the runs' scatter is, by the median moving range; at least 1."""
    moves = np.abs(np.diff(value)) / np.hypot(sigma[:-1], sigma[1:])
    return max(1.0, float(np.median(moves)) / MEDIAN_OF_A_NORMAL)


def _candidates(at: Floats) -> tuple[list[_Shaped], Floats, Floats]:
    """Shapes, their columns (m, n), and how often each is charged for the search (m,)."""
    count = len(at)
    steps = np.array([k for k in range(STEP_RUNS, count - STEP_RUNS + 1) if at[k] > at[k - 1]], dtype=np.int64)
    onsets = np.array([k for k in range(ONSET_RUNS - 1, count - ONSET_RUNS) if at[k + 1] > at[k]], dtype=np.int64)
    onsets = onsets[:: max(1, math.ceil(len(onsets) / PLACES))]
    shapes = [
        _Shaped("drift", 0),
        *(_Shaped("step", int(k)) for k in steps),
        *(_Shaped("onset", int(k)) for k in onsets),
    ]
    time = (at - at[0]) / (at[-1] - at[0])
    order = np.arange(count)
    columns = np.vstack([
        time[None, :],
        (order[None, :] >= steps[:, None]).astype(np.float64),
        np.maximum(time[None, :] - time[onsets, None], 0.0),
    ])  # fmt: skip
    families = [1, *[len(steps)] * len(steps), *[len(onsets)] * len(onsets)]
    return shapes, columns, 3.0 * np.array(families, dtype=np.float64)


def _judged(columns: Floats, y: Floats, s: Floats) -> tuple[Floats, Floats]:
    """|b| over its standard error for each column (m, n), and the scatter left over, Σ w r² (m,)."""
    w = 1.0 / (s**2 + between_runs(y, s))
    centred = columns - ((columns @ w) / w.sum())[:, None]
    y = y - (w @ y) / w.sum()
    information = centred**2 @ w
    slope = (centred @ (w * y)) / information
    total = float(w @ y**2)
    left_over = np.maximum(total - slope**2 * information, 1e-12 * total + 1e-300)
    by_scatter = left_over / (len(y) - 2) / information
    by_own = (centred**2 @ (w * s) ** 2) / information**2 * stretch(y, s) ** 2
    return np.abs(slope) / np.sqrt(np.maximum(by_scatter, by_own)), left_over


def _holds_without_one(column: Floats, y: Floats, s: Floats) -> bool:
    """Whether the change is still seen without the run on which it rests most: one run makes no trend."""
    w = 1.0 / (s**2 + between_runs(y, s))
    leverage = w * (column - (w @ column) / w.sum()) ** 2
    rest = np.arange(len(y)) != int(np.argmax(leverage))
    if np.ptp(column[rest]) == 0.0:
        return False
    t, _ = _judged(column[None, rest], y[rest], s[rest])
    return bool(2.0 * stdtr(len(y) - 3, -t[0]) < STILL_SEEN)


def _fitted(column: Floats, y: Floats, s: Floats) -> tuple[float, float, float]:
    """Level where the column is 0, slope, and the slope's sigma, with the scatter about this very fit."""
    w = 1.0 / (s**2 + between_runs(y, s, column))
    mean_c, mean_y = (w @ column) / w.sum(), (w @ y) / w.sum()
    c = column - mean_c
    information = float(w @ c**2)
    slope = float(w @ (c * y)) / information
    scatter = float(w @ (y - mean_y - slope * c) ** 2) / (len(y) - 2)
    return float(mean_y - slope * mean_c), slope, math.sqrt(max(scatter, 1.0) / information)
