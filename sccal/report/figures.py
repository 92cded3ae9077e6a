"""The figures of the pages, as SVG text: path, parameters over time, residuals, drift without fixes, runs compared.

Made through ``matplotlib.figure.Figure``, never pyplot, and the same bytes for the same result. Nothing is estimated
here; long series are only thinned, lines by keeping the lowest and highest value of each stretch of time.
Colours: Okabe and Ito's palette, which colour-blind readers can tell apart.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from sccal.arrays import Bools, Floats, Ints
from sccal.calibration.result import Calibration, Estimate, Outage, VehicleCalibration
from sccal.report.numbers import one_line, plain, short
from sccal.report.rows import parameter_rows

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#888888",
)  # fmt: skip
QUALITIES: tuple[tuple[int, str, str], ...] = (
    (1, "autonomous", VERMILION),
    (2, "differential", SKY),
    (5, "RTK float", ORANGE),
    (4, "RTK fixed", GREEN),
    (-1, "quality not given", GREY),
)
POINTS = 1200
"""Most points of one series in a figure; keeps each SVG well under 400 kB."""
CLOUD_POINTS = 800
"""As POINTS, for clouds: a dot costs several times what a corner of a line costs."""
SETTLED_FROM = 0.25
"""Share of the run after which a parameter's history sets the limits of its panel."""
RUNS_SHOWN = 40

_WIDTH_IN = 5.6
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.titlepad": 5.0,
    "axes.labelsize": 9.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.4,
    "legend.columnspacing": 1.2,
    "lines.solid_joinstyle": "round",
    "path.simplify": True,
}
_UNUSED_ID = re.compile(r' id="[A-Za-z0-9.]+_\d+"')
_SURPLUS_DECIMALS = re.compile(r"(?<![\d.(])(\d+\.\d\d)\d+")
"""Beyond a hundredth of a point; an opening bracket before it would be a glyph's scale."""
_OUTER_BLANKS = re.compile(r"^[ \t]+|[ \t]+$", re.MULTILINE)


@dataclass(frozen=True)
class Drawing:
    """One figure, ready to stand in a page."""

    name: str
    caption: str
    svg: str


def run_drawings(c: Calibration) -> tuple[Drawing, ...]:
    """Every figure of a run that has data to show."""
    drawings = [
        Drawing(
            "path",
            "The fixes as they were used, and the path of the middle between the wheels; an antenna mounted elsewhere "
            "draws a path of its own.",
            path_map(c),
        ),
        Drawing(
            "parameters",
            "What the filter had learnt by each moment, starting from the nominal values, with a band of ±1σ; the line "
            "across is the final value.",
            parameter_history(c),
        ),
        Drawing(
            "residuals",
            "Measured minus predicted; about 95 of 100 points belong inside the band of ±2σ, and a pattern over time "
            "is something that the model lacks. Points beyond a panel stand at its edge; where there are too many to "
            "draw, the darker band is their range.",
            residual_series(c),
        ),
    ]
    if c.outage.windows:
        drawings.append(_outage_drawing(c.outage))
    return tuple(drawings)


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
        drawings.append(_outage_drawing(v.outage))
    return tuple(drawings)


def path_map(c: Calibration) -> str:
    """Fixes by quality, the trajectory, start and end; equal scales."""
    with styled("path"):
        figure = Figure(figsize=(_WIDTH_IN, 5.4))
        axes = figure.add_axes((0.13, 0.1, 0.84, 0.74))
        every = strided(len(c.trajectory.t_s), POINTS)
        east, north = c.trajectory.east_m[every], c.trajectory.north_m[every]
        axes.plot(east, north, color="#bbbbbb", lw=2.0, label="estimated path")
        for mask, label, colour in by_quality(c.fixes.quality):
            every = strided(int(mask.sum()), POINTS)
            axes.plot(
                c.fixes.east_m[mask][every], c.fixes.north_m[mask][every], ".", ms=3.0, mew=0, color=colour, label=label
            )
        if len(east):
            ends: dict[str, Any] = {"mec": "white", "mew": 0.8, "ls": "none", "zorder": 5}
            axes.plot(east[:1], north[:1], "o", ms=8, color=BLUE, label="start", **ends)
            axes.plot(east[-1:], north[-1:], "s", ms=7, color=PURPLE, label="end", **ends)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.06)
        axes.set_xlabel("east (m)")
        axes.set_ylabel("north (m)")
        plain_ticks(axes, 6)
        axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.01), ncols=3, markerscale=1.0, borderaxespad=0.0)
        return svg_text(figure)


def parameter_history(c: Calibration) -> str:
    """Four panels over one time axis."""
    h = c.history
    rows = parameter_rows(c.parameters)
    series = (
        (h.radius_right_m, h.sigma_radius_right_m),
        (h.radius_left_m, h.sigma_radius_left_m),
        (h.track_m, h.sigma_track_m),
        (offset_on_turn_deg(h.heading_offset_rad, rows[3].estimate.value), np.degrees(h.sigma_heading_offset_rad)),
    )
    with styled("parameters"):
        figure, panels = _stacked(4, 6.4)
        time, label = elapsed(h.t_s, _start_s(c), _end_s(c))
        for axes, row, (values, sigmas) in zip(panels, rows, series, strict=True):
            every = thinned(values, POINTS)
            t, value, sigma = time[every], values[every], sigmas[every]
            axes.fill_between(t, value - sigma, value + sigma, color=SKY, alpha=0.35, lw=0)
            axes.plot(t, value, color=BLUE, lw=1.0)
            _level(axes, row.estimate.value, color=BLACK, lw=0.9)
            limits = _history_limits(values, sigmas, row.estimate)
            axes.set_ylim(limits)
            title = f"{row.name} ({row.unit}), {row.status}"
            nominal = row.estimate.nominal
            if nominal is not None:
                if limits[0] <= nominal <= limits[1]:
                    _level(axes, nominal, color=VERMILION, lw=0.9, ls=(0, (4, 3)))
                    title += " – dashed: nominal"
                else:
                    title += f" – nominal {short(nominal)} {'below' if nominal < limits[0] else 'above'}"
            axes.set_title(title)
            plain_ticks(axes, 4)
        panels[-1].set_xlabel(label)
        return svg_text(figure)


def residual_series(c: Calibration) -> str:
    """Heading, east and north innovations with their ±2σ bands."""
    r = c.residuals
    fixes = (r.fix_t_s, r.fix_accepted)
    panels_of = (
        (
            "heading (deg)",
            r.heading_t_s,
            r.heading_accepted,
            np.degrees(r.heading_rad),
            np.degrees(r.heading_sigma_rad),
        ),
        ("fix east (m)", *fixes, r.fix_east_m, r.fix_sigma_east_m),
        ("fix north (m)", *fixes, r.fix_north_m, r.fix_sigma_north_m),
    )
    with styled("residuals"):
        figure, panels = _stacked(3, 6.0, top=0.91)
        label = ""
        for axes, (name, t_s, accepted, residual, sigma) in zip(panels, panels_of, strict=True):
            time, label = elapsed(t_s, _start_s(c), _end_s(c))
            axes.set_title(f"{name}: {int(accepted.sum())} accepted, {int((~accepted).sum())} rejected")
            _draw_residuals(axes, time, accepted, residual, sigma)
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="upper left", bbox_to_anchor=(0.1, 1.0), ncols=3)
        panels[-1].set_xlabel(label)
        return svg_text(figure)


def outage_drift(outage: Outage) -> str:
    """Each window's drift since the window began; the rms at the windows' end where there is one."""
    with styled("outage"):
        figure = Figure(figsize=(_WIDTH_IN, 3.9))
        axes = figure.add_axes((0.13, 0.125, 0.84, 0.76))
        budget = max(20, 4 * POINTS // max(len(outage.windows), 1))
        alpha = 0.75 if len(outage.windows) <= 12 else 0.35
        for k, window in enumerate(outage.windows):
            every = thinned(window.drift_m, budget)
            axes.plot(
                (window.t_s - window.start_s)[every],
                window.drift_m[every],
                color=BLUE,
                lw=0.9,
                alpha=alpha,
                label="one window" if k == 0 else None,
            )
        if outage.end_rms_m is not None and math.isfinite(outage.end_rms_m):
            axes.plot(
                [outage.window_s], [outage.end_rms_m], "D", ms=7, color=VERMILION, mec="white", mew=0.8, clip_on=False,
                zorder=5, label=f"rms at the end: {plain(outage.end_rms_m, 2)} m",
            )  # fmt: skip
        axes.set_xlim(0.0, outage.window_s)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("time without fixes (s)")
        axes.set_ylabel("drift (m)")
        plain_ticks(axes, 6)
        if outage.windows:
            axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.01), ncols=2, borderaxespad=0.0)
        return svg_text(figure)


def runs_compared(v: VehicleCalibration) -> str:
    """One panel a parameter, one line a run; the first RUNS_SHOWN runs."""
    runs = v.runs[:RUNS_SHOWN]
    with styled("runs"):
        height = 0.75 + 0.26 * len(runs)
        figure = Figure(figsize=(2 * _WIDTH_IN, height))
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
            axes.plot([place], [k], "o", ms=5, color=GREY, mfc="white", clip_on=False)
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


def _draw_residuals(axes: Axes, time: Floats, accepted: Bools, residual: Floats, sigma: Floats) -> None:
    limit = _residual_limit(accepted, residual, sigma)
    every = thinned(sigma, POINTS // 2)
    bound = np.clip(2.0 * sigma[every], 0.0, limit)
    axes.fill_between(time[every], -bound, bound, color=SKY, alpha=0.35, lw=0, label="±2σ")
    edge = 0.97 * limit
    t, value = time[accepted], np.clip(residual[accepted], -edge, edge)
    every_n = strided(len(t), CLOUD_POINTS)
    if len(t) > CLOUD_POINTS:
        lowest, highest, middle = _ranges(t, value, CLOUD_POINTS // 4)
        axes.fill_between(middle, lowest, highest, color=BLUE, alpha=0.25, lw=0)
    axes.plot(t[every_n], value[every_n], ".", ms=2.4, mew=0, color=BLUE, label="accepted")
    t, value = time[~accepted], np.clip(residual[~accepted], -edge, edge)
    every = thinned(value, CLOUD_POINTS // 4)
    axes.plot(t[every], value[every], "x", ms=4, mew=0.9, color=VERMILION, clip_on=False, label="rejected")
    axes.set_ylim(-limit, limit)
    plain_ticks(axes, 5)


def _outage_drawing(outage: Outage) -> Drawing:
    return Drawing(
        "outage",
        f"How far dead reckoning strayed in each {short(outage.window_s)} s without fixes; "
        f"{one_line(outage.how).rstrip('.')}.",
        outage_drift(outage),
    )


def by_quality(quality: Ints) -> list[tuple[Bools, str, str]]:
    """Rows of each GGA quality that is there (n,), with its name and colour."""
    groups = [(quality == code, label, colour) for code, label, colour in QUALITIES]
    groups.append((~np.isin(quality, [code for code, _, _ in QUALITIES]), "other quality", PURPLE))
    return [group for group in groups if group[0].any()]


def _history_limits(values: Floats, sigmas: Floats, final: Estimate) -> tuple[float, float]:
    """Readable where it has converged: what the settled part spans with its band, nominal only if it is near."""
    settled = slice(int(SETTLED_FROM * len(values)), None)
    spread = np.where(np.isfinite(sigmas[settled]), sigmas[settled], 0.0)
    candidates = np.concatenate([values[settled] - spread, values[settled] + spread, [final.value]])
    finite = candidates[np.isfinite(candidates)]
    if not len(finite):
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    if final.nominal is not None and low - (high - low) < final.nominal < high + (high - low):
        low, high = min(low, final.nominal), max(high, final.nominal)
    margin = max(0.12 * (high - low), 1e-6 * max(abs(low), abs(high)), 1e-9)
    return low - margin, high + margin


def _residual_limit(accepted: Bools, residual: Floats, sigma: Floats) -> float:
    """Room for nearly all accepted residuals and their band; a bad start must not flatten the rest."""
    usable = np.abs(residual[accepted & np.isfinite(residual)])
    band = 2.0 * sigma[np.isfinite(sigma)]
    largest = max(float(np.quantile(of, 0.97)) if len(of) else 0.0 for of in (usable, band))
    return 1.6 * largest or 1.0


def offset_on_turn_deg(history_rad: Floats, final_deg: float) -> Floats:
    """Continuous, and on the turn on which the final value stands."""
    degrees = np.degrees(history_rad)
    finite = np.isfinite(degrees)
    if finite.any() and math.isfinite(final_deg):
        degrees[finite] = np.unwrap(degrees[finite], period=360.0)
        degrees[finite] += 360.0 * round((final_deg - degrees[finite][-1]) / 360.0)
    return degrees


def strided(count: int, most: int) -> slice:
    """An even choice of at most so many out of a series: for clouds."""
    return slice(None, None, max(1, math.ceil(count / most)))


def thinned(values: Floats, most: int) -> Ints:
    """Indices (k,) that keep the lowest and highest value of each stretch, and both ends, in order of time."""
    count = len(values)
    if count <= most:
        return np.arange(count)
    stretches = max(1, most // 2 - 1)
    length = math.ceil(count / stretches)
    first = np.arange(0, count, length)
    table = np.pad(values, (0, len(first) * length - count), mode="edge").reshape(-1, length)
    lowest = first + np.where(np.isnan(table), np.inf, table).argmin(axis=1)
    highest = first + np.where(np.isnan(table), -np.inf, table).argmax(axis=1)
    return np.unique(np.concatenate([[0], lowest, highest, [count - 1]]))


def _ranges(t: Floats, values: Floats, stretches: int) -> tuple[Floats, Floats, Floats]:
    """Lowest and highest value of each stretch, and the time of its middle: what a thinned cloud leaves out."""
    length = math.ceil(len(t) / stretches)
    first = np.arange(0, len(t), length)
    middle = t[np.minimum(first + length // 2, len(t) - 1)]
    return np.fmin.reduceat(values, first), np.fmax.reduceat(values, first), middle


def _start_s(c: Calibration) -> float:
    starts = [t[0] for t in (c.trajectory.t_s, c.history.t_s, c.residuals.heading_t_s) if len(t)]
    return float(min(starts, default=0.0))


def _end_s(c: Calibration) -> float:
    ends = [t[-1] for t in (c.trajectory.t_s, c.history.t_s, c.residuals.heading_t_s) if len(t)]
    return float(max(ends, default=1.0))


def elapsed(t_s: Floats, start_s: float, end_s: float) -> tuple[Floats, str]:
    """Times from the start, in minutes where the whole is long, and the label of their axis."""
    if end_s - start_s > 600.0:
        return (t_s - start_s) / 60.0, "time since the start (min)"
    return t_s - start_s, "time since the start (s)"


def _label(run: str) -> str:
    name = one_line(run)
    return name if len(name) <= 24 else f"…{name[-23:]}"


def _stacked(count: int, height_in: float, top: float = 0.955) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(_WIDTH_IN, height_in))
    panels = list(figure.subplots(count, 1, sharex=True))
    figure.subplots_adjust(left=0.145, right=0.97, bottom=0.48 / height_in, top=top, hspace=0.3)
    return figure, panels


def _level(axes: Axes, value: float, **style: Any) -> None:
    if math.isfinite(value):
        axes.axhline(value, **style)


def plain_ticks(axes: Axes, most: int) -> None:
    """At most so many ticks upwards, with labels in full."""
    axes.yaxis.set_major_locator(MaxNLocator(most))
    full_tick_labels(axes)


def full_tick_labels(axes: Axes) -> None:
    """Tick labels in full: never 1e-5 + 8.08e-2 in a corner."""
    for axis in (axes.xaxis, axes.yaxis):
        if isinstance(axis.get_major_formatter(), ScalarFormatter):
            formatter = ScalarFormatter(useOffset=False)
            formatter.set_scientific(False)
            axis.set_major_formatter(formatter)


def styled(name: str) -> AbstractContextManager[None]:
    """The look of all figures; the name makes the ids within the SVG its own, and the same each time."""
    return matplotlib.rc_context({**_STYLE, "svg.hashsalt": f"sccal {name}"})


def svg_text(figure: Figure) -> str:
    """Without XML prologue, date, or ids that nothing refers to: several figures share one page."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue()
    text = _UNUSED_ID.sub("", text[text.index("<svg") :])
    return _OUTER_BLANKS.sub("", _SURPLUS_DECIMALS.sub(r"\1", text))
