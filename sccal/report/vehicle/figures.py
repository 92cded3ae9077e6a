"""The figures of a vehicle's page: its runs compared, and how far dead reckoning strayed in all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sccal.report.drawing.plan import drawn
from sccal.report.drawing.style import BLUE, GREY, PAPER, VERMILION, Drawing, full_tick_labels, styled, svg_text
from sccal.report.rows import parameter_rows
from sccal.report.run.figure_outage import outage_plan
from sccal.results.calibration import Estimate, VehicleCalibration
from sccal.results.numbers import one_line

RUNS_SHOWN = 40
_WIDTH_IN = 11.2


def vehicle_drawings(v: VehicleCalibration) -> tuple[Drawing, ...]:
    """Every figure of a vehicle."""
    drawings = [
        Drawing(
            "runs",
            "Each run on its own with ±1σ, against the vehicle's value (line and band); hollow points are parameters "
            "that the run did not estimate, at the panel's edge if beyond.",
            runs_compared(v),
        )
    ]
    if v.outage.windows:
        drawings.append(drawn(outage_plan(v.outage)))
    return tuple(drawings)


def runs_compared(v: VehicleCalibration) -> str:
    """One panel a parameter, one line a run; the first RUNS_SHOWN runs."""
    runs = v.runs[:RUNS_SHOWN]
    with styled("runs"):
        height = 0.75 + 0.26 * len(runs)
        figure = Figure(figsize=(_WIDTH_IN, height))
        panels = figure.subplots(1, 4, sharey=True)
        figure.subplots_adjust(left=0.16, right=0.985, bottom=0.3 / height, top=1.0 - 0.35 / height, wspace=0.2)
        for k, axes in enumerate(panels):
            row = parameter_rows(v.parameters)[k]
            own = [parameter_rows(c.parameters)[k].estimate for c in runs]
            if row.unit == "deg":
                own = [_on_the_turn_of(row.estimate, estimate) for estimate in own]
            _compare_runs(axes, row.estimate, own)
            axes.set_title(f"{row.name} ({row.unit})")
            axes.xaxis.set_major_locator(MaxNLocator(3))
            full_tick_labels(axes)
        panels[0].set_yticks(range(len(runs)), [_label(c.run) for c in runs])
        panels[0].set_ylim(len(runs) - 0.5, -0.5)
        return svg_text(figure)


def _compare_runs(axes: Axes, shared: Estimate, own: Sequence[Estimate]) -> None:
    trusted = [e for e in (shared, *own) if e.status == "estimated" and math.isfinite(e.value)]
    ends = [e.value + side * (e.sigma if math.isfinite(e.sigma) else 0.0) for e in trusted for side in (-1.0, 1.0)]
    low, high = min(ends, default=shared.value), max(ends, default=shared.value)
    margin = max(0.1 * (high - low), 1e-6 * abs(high), 1e-9)
    low, high = low - margin, high + margin
    for k, estimate in enumerate(own):
        if not math.isfinite(estimate.value):
            continue
        if estimate.status == "estimated":
            sigma = estimate.sigma if math.isfinite(estimate.sigma) else 0.0
            axes.errorbar(estimate.value, k, xerr=sigma, fmt="o", ms=5, color=BLUE, elinewidth=1.2)
        else:
            place = min(max(estimate.value, low), high)
            axes.plot([place], [k], "o", ms=5, color=GREY, mfc=PAPER, clip_on=False)
    if math.isfinite(shared.value):
        axes.axvline(shared.value, color=VERMILION, lw=1.0, zorder=1)
        if math.isfinite(shared.sigma):
            axes.axvspan(shared.value - shared.sigma, shared.value + shared.sigma, color=VERMILION, alpha=0.15, lw=0)
        axes.set_xlim(low, high)


def _on_the_turn_of(shared: Estimate, own: Estimate) -> Estimate:
    """Directions of −179 and +179 degrees stand next to each other."""
    if not (math.isfinite(own.value) and math.isfinite(shared.value)):
        return own
    return replace(own, value=own.value + 360.0 * round((shared.value - own.value) / 360.0))


def _label(run: str) -> str:
    name = one_line(run)
    return name if len(name) <= 24 else f"…{name[-23:]}"
