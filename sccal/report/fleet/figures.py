"""The figures of a batch: a control chart for each parameter of a vehicle, and a path in a few strokes for each run."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sccal.arrays import Floats
from sccal.report.drawing.style import BLUE, GREY, SKY, VERMILION, full_tick_labels, plain_ticks, styled, svg_text
from sccal.report.fleet.lines import DisplayedParameter, displayed
from sccal.results.summary import Chart, ThinPath

PATH_UNITS = 1000
"""Width and height of the square into which a path is drawn."""
ROUGH_SIGMAS = 4.0
"""A run whose sigma is so many times the median's does not set the limits of a panel."""
_WIDTH_IN = 5.2
_HEIGHT_IN = 2.3
_MARGIN = 0.06


def control_chart(vehicle: str, chart: Chart) -> str:
    """Values ± sigma, centre, limits, runs outside, and the change if there is one."""
    with styled(f"index {vehicle} {chart.key}"):
        figure = Figure(figsize=(_WIDTH_IN, _HEIGHT_IN))
        axes = figure.add_axes((0.135, 0.22, 0.84, 0.67))
        _draw(axes, chart)
        return svg_text(figure)


def path_strokes(path: ThinPath) -> str:
    """The ``d`` of an SVG path in a square of PATH_UNITS, north up; empty where there is nothing to draw."""
    if len(path.east_m) < 2:
        return ""
    east, north = _fitted(path.east_m, path.north_m)
    points = np.column_stack([east, PATH_UNITS - north]).round().astype(int)
    steps = np.diff(points, axis=0)
    steps = steps[(steps != 0).any(axis=1)]
    strokes = "".join(f"l{right} {down}" for right, down in steps.tolist())
    return f"M{points[0, 0]} {points[0, 1]}{strokes}" if strokes else ""


def _fitted(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
    extent = max(float(np.ptp(east_m)), float(np.ptp(north_m)))
    scale = PATH_UNITS * (1.0 - 2.0 * _MARGIN) / extent if extent > 0.0 else 0.0
    return tuple(
        PATH_UNITS / 2 + scale * (values - 0.5 * (values.min() + values.max())) for values in (east_m, north_m)
    )


def _draw(axes: Axes, chart: Chart) -> None:
    parameter = displayed(chart.key)
    at, edges = _abscissa(chart)
    lower, upper = parameter.factor * chart.lower, parameter.factor * chart.upper
    value, sigma = parameter.factor * chart.value, parameter.factor * chart.sigma
    axes.stairs(upper, edges, baseline=lower, fill=True, color=SKY, alpha=0.25, lw=0)
    axes.axhline(parameter.factor * chart.centre, color=GREY, lw=0.9)
    low, high = _panel_limits(value, sigma, lower, upper, chart)
    gaps = np.full_like(value, np.nan)
    bars = np.column_stack([value - sigma, value + sigma, gaps]).ravel()
    axes.plot(np.repeat(at, 3), bars, color=BLUE, lw=0.8, alpha=0.7)
    edge = 0.05 * (high - low)
    place = np.clip(value, low + edge, high - edge)
    for mask, marker, size, colour in ((~chart.outside, "o", 3.6, BLUE), (chart.outside, "D", 4.6, VERMILION)):
        axes.plot(at[mask], place[mask], marker, ms=size, mew=0, color=colour)
    if chart.trend is not None:
        step = chart.trend.shape == "step"
        axes.plot(
            at, parameter.factor * chart.trend.fitted, color=VERMILION, lw=1.4, ls=(0, (5, 2)),
            drawstyle="steps-mid" if step else "default",
        )  # fmt: skip
    axes.set_ylim(low, high)
    axes.set_xlim(edges[0], edges[-1])
    axes.set_title(_title(parameter, chart))
    axes.set_ylabel(parameter.unit)
    plain_ticks(axes, 4)
    if chart.by_date:
        locator = AutoDateLocator(minticks=3, maxticks=6)  # type: ignore[no-untyped-call]
        axes.xaxis_date()
        axes.xaxis.set_major_locator(locator)
        axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
        axes.set_xlabel("date (UTC)")
    else:
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        full_tick_labels(axes)
        axes.set_xlabel("run, in order")


def _abscissa(chart: Chart) -> tuple[Floats, Floats]:
    """Where the runs stand (n,), in days since 1970 or by number, and the borders between them (n + 1,)."""
    if chart.by_date:
        first = np.datetime64(str(chart.started[0])[:19])
        at = first.astype("datetime64[s]").astype(np.int64) / 86400.0 + chart.at
    else:
        at = chart.at + 1.0
    margin = max(0.03 * (at[-1] - at[0]), 1e-3)
    edges = np.concatenate([[at[0] - margin], 0.5 * (at[1:] + at[:-1]), [at[-1] + margin]])
    return at, edges


def _panel_limits(value: Floats, sigma: Floats, lower: Floats, upper: Floats, chart: Chart) -> tuple[float, float]:
    """Room for the usual limits and all runs of some precision that take part; the others stand at the edge."""
    used = ~chart.set_aside & (sigma <= ROUGH_SIGMAS * np.median(sigma))
    low = min(float((value - sigma)[used].min()), float(np.median(lower)))
    high = max(float((value + sigma)[used].max()), float(np.median(upper)))
    margin = max(0.08 * (high - low), 1e-9)
    return low - margin, high + margin


def _title(parameter: DisplayedParameter, chart: Chart) -> str:
    count = int(chart.outside.sum())
    return f"{parameter.name} ({parameter.unit})" + (f", {count} outside" if count else "")
