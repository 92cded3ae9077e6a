"""The figures of the paper's experiments, as SVG text: errors compared, paths, errors and parameters over time.

In the style of the other figures. Orange-red is without, blue with offset estimation, black the truth, grey the fixes
and amber the time of the fault, in every figure. Series are thinned to what a screen can show.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from sccal.arrays import Bools, Floats
from sccal.report.drawing.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PAPER,
    SKY,
    VERMILION,
    Drawing,
    elapsed,
    full_tick_labels,
    offset_on_turn_deg,
    plain_ticks,
    strided,
    styled,
    svg_text,
)
from sccal.report.experiments.text import lines_of
from sccal.report.layout import sentence, shortened
from sccal.results.experiments import TOLERANCE_PERCENT, VARIANTS, Cell, Experiments, Trial, Variant
from sccal.results.numbers import short

COLOURS: dict[Variant, str] = {"without": VERMILION, "with": BLUE}
WORDS: dict[Variant, str] = {"without": "without offset estimation", "with": "with offset estimation"}
SHOWN_S = 120.0
"""Of a path under noise: its last part, or hundreds of metres would lie over each other."""
LINE_POINTS = 240
"""Of a line in a page with dozens of figures."""
CLOUD = 200
NAMES = ("right radius", "left radius", "track", "heading offset")
FAR = 4.0
"""A figure makes room for what is up to so many times as far off as what it is about."""
_WIDE_IN, _NARROW_IN = 9.6, 5.6
_FAULT: dict[str, Any] = {"color": ORANGE, "alpha": 0.14, "lw": 0}


def _drawing(name: str, caption: str, svg: str) -> Drawing:
    return Drawing(name, sentence(caption), svg)


def overview_drawing(e: Experiments) -> Drawing | None:
    """All cells below each other; None where there are none."""
    if not e.cells:
        return None
    return _drawing(
        "overview",
        "Position error while the fault lasts (rms): median over the seeds as a dot, 5 to 95 % as a bar. The numbers "
        "are the ratio of the two, with its 95 % interval.",
        overview(e),
    )


def cell_drawings(cell: Cell, key: str) -> tuple[Drawing, ...]:
    """Path, error over time, final parameters, and for the general path and measured runs their convergence."""
    known = "truth" if not cell.measured else "undisturbed calibration"
    seed = f"Seed {cell.seeds[0]}" if len(cell.seeds) > 1 else "One seed"
    drawings = [
        _drawing(f"{key}-path", f"{seed}. {_path_caption(cell)}", path_map(cell)),
        _drawing(
            f"{key}-error",
            "Distance of the forward filter's position from "
            + ("the truth" if not cell.measured else "the undisturbed fixes")
            + (": median, and 5 to 95 % of the seeds." if len(cell.seeds) > 1 else "."),
            error_over_time(cell),
        ),
    ]
    if cell.truth is not None:
        drawings.append(
            _drawing(
                f"{key}-parameters",
                f"Final parameters minus {known}, one dot per seed with ±1σ; green: within {TOLERANCE_PERCENT:g} %. "
                f"Triangles stand for values beyond the edge.",
                final_parameters(cell),
            )
        )
    if cell.truth is not None and (cell.measured or cell.path == "general"):
        wander = cell.shown.offset_wander_rad is not None
        drawings.append(
            _drawing(
                f"{key}-convergence",
                f"{seed}: what the filters had learnt by each moment, the band is ±1σ; dashed: {known}."
                + (
                    " The magnetometer's offset wanders (grey); the filter's state stands for its mean (dashed)."
                    if wander
                    else ""
                ),
                convergence(cell),
            )
        )
    return tuple(drawings)


def overview(e: Experiments) -> str:
    """One row per drive below its fault; errors on a logarithmic scale."""
    rows, place, groups = [], 0.0, []
    for fault, lines in lines_of(e):
        groups.append((place, fault.title))
        rows += [(place + 1.0 + k, line) for k, line in enumerate(lines)]
        place += len(lines) + 1.4
    with styled("experiments overview"):
        height = 0.95 + 0.235 * place
        figure = Figure(figsize=(_WIDE_IN, height))
        axes = figure.add_axes((0.2, 0.48 / height, 0.63, 1.0 - 0.85 / height))
        axes.set_xscale("log")
        for y, line in rows:
            spreads = [(variant, line.cell.figures[variant].rms_spread_m) for variant in VARIANTS]
            axes.plot([s.median for _, s in spreads], [y, y], color="#cccccc", lw=1.0, zorder=1)
            for variant, spread in spreads:
                axes.plot([spread.low, spread.high], [y, y], color=COLOURS[variant], lw=4.5, alpha=0.35, zorder=2,
                          solid_capstyle="butt")  # fmt: skip
                axes.plot([spread.median], [y], "o", ms=6, color=COLOURS[variant], mec=PAPER, mew=0.7, zorder=3)
            axes.annotate(f"× {line.ratio}", (1.02, y), xycoords=axes.get_yaxis_transform(), va="center", fontsize=8.5)
        for y, title in groups:
            axes.annotate(title, (-0.29, y), xycoords=axes.get_yaxis_transform(), va="center", fontweight="bold")
        axes.set_yticks([y for y, _ in rows], [shortened(line.name, 22) for _, line in rows])
        axes.set_ylim(place - 0.7, -0.7)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
        axes.spines["left"].set_visible(False)
        _log_labels(axes, "x")
        axes.set_xlabel("position error while the fault lasts, rms (m)")
        handles = [
            Line2D([], [], marker="o", ms=6, color=COLOURS[v], lw=4.5, alpha=0.8, label=WORDS[v]) for v in VARIANTS
        ]
        figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.19, 1.0), ncols=2)
        return svg_text(figure)


def path_map(cell: Cell) -> str:
    """Truth, both estimates and the fixes; equal scales."""
    trial = cell.shown
    begin, end = _fault_s(trial)
    part = (max(begin, end - SHOWN_S) if not cell.experiment.is_loss else begin, end)
    with styled("experiment path"):
        figure = Figure(figsize=(_NARROW_IN, 5.6))
        axes = figure.add_axes((0.13, 0.09, 0.84, 0.77))
        fixes = _within(trial.fix_t_s, (begin, end))
        every = strided(int(fixes.sum()), CLOUD)
        axes.plot(trial.fix_east_m[fixes][every], trial.fix_north_m[fixes][every], ".", ms=4.2, mew=0, color=GREY,
                  alpha=0.55, zorder=1)  # fmt: skip
        every = strided(trial.t_s.size, LINE_POINTS * 2)
        axes.plot(trial.true_east_m[every], trial.true_north_m[every], color="#bdbdbd", lw=0.8, zorder=2,
                  label="whole drive")  # fmt: skip
        inside = _within(trial.t_s, part)
        axes.plot(trial.true_east_m[inside], trial.true_north_m[inside], color=BLACK, lw=1.3, zorder=3,
                  label="undisturbed fixes" if cell.measured else "truth")  # fmt: skip
        for variant in VARIANTS:
            path = trial.of(variant).path
            inside = _within(path.t_s, part)
            every = strided(int(inside.sum()), LINE_POINTS)
            axes.plot(path.east_m[inside][every], path.north_m[inside][every], color=COLOURS[variant], lw=1.3,
                      label=WORDS[variant], zorder=4)  # fmt: skip
        for at, marker, size, label in ((begin, "D", 8.0, "fault begins"), (end, "s", 4.5, "fault ends")):
            k = int(np.argmin(np.abs(trial.t_s - at)))
            axes.plot(trial.true_east_m[k], trial.true_north_m[k], marker, ms=size, color=ORANGE, mec=BLACK, mew=0.8,
                      ls="none", label=label, zorder=5)  # fmt: skip
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.05)
        axes.set_xlabel("east (m)")
        axes.set_ylabel("north (m)")
        plain_ticks(axes, 6)
        handles, _ = axes.get_legend_handles_labels()
        if fixes.any():
            handles.append(Line2D([], [], marker=".", ms=7.0, mew=0, color=GREY, ls="none", label="noised fixes"))
        axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(-0.02, 1.01), ncols=3, borderaxespad=0.0)
        return svg_text(figure)


def error_over_time(cell: Cell) -> str:
    """Median and range over the seeds of both variants, logarithmic."""
    with styled("experiment error"):
        figure = Figure(figsize=(_NARROW_IN, 3.3))
        axes = figure.add_axes((0.13, 0.15, 0.84, 0.71))
        every = strided(cell.t_s.size, LINE_POINTS)
        end_s = float(cell.t_s[-1]) if cell.t_s.size else 1.0
        time, label = elapsed(cell.t_s[every], 0.0, end_s)
        axes.set_yscale("log")
        _shade(axes, cell.shown, end_s)
        levels = []
        for variant in VARIANTS:
            median, low, high = (np.maximum(of[every], 1e-4) for of in cell.figures[variant].error_over_time_m)
            if len(cell.seeds) > 1:
                axes.fill_between(time, low, high, color=COLOURS[variant], alpha=0.22, lw=0)
            axes.plot(time, median, color=COLOURS[variant], lw=1.3, label=WORDS[variant])
            levels += [low, high]
        axes.set_ylim(_log_limits(np.concatenate(levels)))
        axes.set_xlim(0.0, float(time[-1]) if time.size else 1.0)
        axes.set_xlabel(label)
        axes.set_ylabel("position error (m, log scale)")
        axes.xaxis.set_major_locator(MaxNLocator(7))
        _log_labels(axes, "y")
        handles, _ = axes.get_legend_handles_labels()
        axes.legend(handles=[*handles, Patch(**_FAULT, label="fault")], loc="lower left", bbox_to_anchor=(-0.02, 1.01),
                    ncols=3, borderaxespad=0.0)  # fmt: skip
        return svg_text(figure)


def final_parameters(cell: Cell) -> str:
    """Errors of the four, a dot per seed: radii and track in percent, the offset in degrees."""
    assert cell.truth is not None
    with styled("experiment parameters"):
        figure = Figure(figsize=(_NARROW_IN, 3.0))
        above = figure.add_axes((0.2, 0.42, 0.77, 0.44))
        below = figure.add_axes((0.2, 0.13, 0.77, 0.13))
        true = np.array(cell.truth[:3])
        errors = {v: 100.0 * (cell.figures[v].values[:, :3] / true - 1.0) for v in VARIANTS}
        sigmas = {v: 100.0 * cell.figures[v].sigmas[:, :3] / true for v in VARIANTS}
        limit = _room(errors["with"], sigmas["with"], errors["without"], 1.5 * TOLERANCE_PERCENT)
        above.axvspan(-TOLERANCE_PERCENT, TOLERANCE_PERCENT, color=GREEN, alpha=0.14, lw=0)
        for k in range(3):
            for variant, shift in (("without", -0.2), ("with", 0.2)):
                _dots(above, k + shift, errors[variant][:, k], sigmas[variant][:, k], limit, COLOURS[variant])  # type: ignore[index]
        above.set_yticks(range(3), NAMES[:3])
        above.set_ylim(2.5, -0.5)
        above.set_xlabel("error (%)", labelpad=1.0)
        offset = np.remainder(cell.figures["with"].values[:, 3] - cell.truth[3] + 180.0, 360.0) - 180.0
        sigma = cell.figures["with"].sigmas[:, 3]
        limit_deg = _room(offset, sigma, np.zeros(0), 1.0)
        _dots(below, 0.0, offset, sigma, limit_deg, COLOURS["with"])
        below.set_yticks([0.0], [NAMES[3]])
        below.set_ylim(0.6, -0.6)
        below.set_xlabel("error (deg)", labelpad=1.0)
        for axes, most in ((above, limit), (below, limit_deg)):
            axes.axvline(0.0, color=BLACK, lw=0.8, zorder=1)
            axes.set_xlim(-most, most)
            axes.tick_params(axis="y", length=0)
            axes.grid(axis="y", visible=False)
            axes.spines["left"].set_visible(False)
            axes.xaxis.set_major_locator(MaxNLocator(7, steps=(1, 2, 5, 10)))
            full_tick_labels(axes)
        handles = [Line2D([], [], marker="o", ms=4.5, color=COLOURS[v], lw=1.1, label=WORDS[v]) for v in VARIANTS]
        figure.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.18, 1.0), ncols=2)
        return svg_text(figure)


def convergence(cell: Cell) -> str:
    """The paper's four plots: radii, track and offset over time, against the truth."""
    trial = cell.shown
    truth = cell.truth
    assert truth is not None
    h, other = trial.of("with").history, trial.of("without").history
    series = (
        (h.radius_right_m, h.sigma_radius_right_m, other.radius_right_m),
        (h.radius_left_m, h.sigma_radius_left_m, other.radius_left_m),
        (h.track_m, h.sigma_track_m, other.track_m),
        (offset_on_turn_deg(h.heading_offset_rad, truth[3]), np.degrees(h.sigma_heading_offset_rad), None),
    )
    end_s = float(trial.t_s[-1]) if trial.t_s.size else 1.0
    with styled("experiment convergence"):
        figure = Figure(figsize=(_WIDE_IN, 4.9))
        panels = list(figure.subplots(2, 2, sharex=True).flat)
        others_shown = False
        figure.subplots_adjust(left=0.08, right=0.985, bottom=0.1, top=0.87, hspace=0.26, wspace=0.17)
        for axes, name, true, (values, sigmas, without) in zip(panels, NAMES, truth, series, strict=True):
            _shade(axes, trial, end_s)
            wandering = None
            if without is None and trial.offset_wander_rad is not None:
                wandering = true + np.degrees(trial.offset_wander_rad)
                every = strided(trial.t_s.size, LINE_POINTS)
                axes.plot(elapsed(trial.t_s[every], 0.0, end_s)[0], wandering[every], color="#777777", lw=0.8, zorder=2)
            every = strided(values.size, LINE_POINTS)
            time, label = elapsed(h.t_s[every], 0.0, end_s)
            value, few = values[every], strided(values.size, LINE_POINTS // 2)
            edges = values[few] - sigmas[few], values[few] + sigmas[few]
            axes.fill_between(elapsed(h.t_s[few], 0.0, end_s)[0], *edges, color=SKY, alpha=0.35, lw=0, zorder=1)
            axes.plot(time, value, color=BLUE, lw=1.3, zorder=4)
            axes.axhline(true, color=BLACK, lw=1.0, ls=(0, (5, 3)), zorder=5)
            limits, beyond = _history_limits(values, sigmas, true, without, wandering)
            axes.set_ylim(limits)
            if without is not None and not beyond:
                some = strided(without.size, LINE_POINTS)
                axes.plot(elapsed(other.t_s[some], 0.0, end_s)[0], without[some], color=VERMILION, lw=0.9, zorder=3)
                others_shown = True
            axes.set_title(f"{name} ({'deg' if name == NAMES[3] else 'm'}){beyond}")
            axes.set_xlim(0.0, elapsed(np.array([end_s]), 0.0, end_s)[0][0])
            axes.xaxis.set_major_locator(MaxNLocator(7))
            plain_ticks(axes, 5)
        for axes in panels[2:]:
            axes.set_xlabel(label)
        handles: list[Any] = [
            Line2D([], [], color=BLUE, lw=1.3, label=f"{WORDS['with']}, ±1σ"),
            *([Line2D([], [], color=VERMILION, lw=0.9, label=WORDS["without"])] if others_shown else []),
            Line2D(
                [], [], color=BLACK, lw=1.0, ls=(0, (5, 3)), label="undisturbed" if cell.measured else "truth (mean)"
            ),
        ]
        if trial.offset_wander_rad is not None:
            handles.append(Line2D([], [], color="#777777", lw=0.8, label="true offset at the time"))
        figure.legend(handles=[*handles, Patch(**_FAULT, label="fault")], loc="upper left", bbox_to_anchor=(0.065, 1.0),
                      ncols=5)  # fmt: skip
        return svg_text(figure)


def _path_caption(cell: Cell) -> str:
    whole = "the undisturbed fixes" if cell.measured else "the true path"
    if cell.experiment.is_loss:
        return f"The paths over the stretch without fixes; pale: {whole} of the whole drive."
    begin, end = _fault_s(cell.shown)
    part = "the fault" if end - begin <= SHOWN_S else f"the fault's last {short(SHOWN_S)} s"
    return f"The paths over {part}; pale: {whole} of the whole drive; dots: a choice of the noised fixes."


def _fault_s(trial: Trial) -> tuple[float, float]:
    times = trial.t_s[trial.judged]
    return (float(times[0]), float(times[-1])) if times.size else (0.0, 0.0)


def _within(t_s: Floats, span_s: tuple[float, float]) -> Bools:
    return (t_s >= span_s[0]) & (t_s <= span_s[1])


def _shade(axes: Axes, trial: Trial, end_s: float) -> None:
    (begin, end), _ = elapsed(np.array(_fault_s(trial)), 0.0, end_s)
    axes.axvspan(begin, end, **_FAULT, zorder=0)


def _dots(axes: Axes, place: float, errors: Floats, sigmas: Floats, limit: float, colour: str) -> None:
    """Seeds side by side around the place, from above to below; triangles at the edge for what lies beyond."""
    spread = 0.3 * (np.arange(errors.size) - 0.5 * (errors.size - 1)) / max(errors.size, 4)
    y = place + spread
    inside = np.abs(errors) < limit
    axes.hlines(
        y[inside], errors[inside] - sigmas[inside], errors[inside] + sigmas[inside], color=colour, lw=0.7, alpha=0.5
    )
    axes.plot(errors[inside], y[inside], "o", ms=3.2, mew=0, color=colour, zorder=3)
    for side, marker in ((-1.0, "<"), (1.0, ">")):
        beyond = ~inside & (np.sign(errors) == side)
        axes.plot(
            np.full(int(beyond.sum()), 0.98 * side * limit), y[beyond], marker, ms=4.5, mew=0, color=colour, zorder=3
        )


def _room(errors: Floats, sigmas: Floats, others: Floats, least: float) -> float:
    """Half the width of an axis around zero: for errors and bars, and for the others unless they are far beyond."""
    ends = np.abs(errors) + np.where(
        np.isfinite(sigmas), np.minimum(sigmas, 5.0 * np.abs(errors).max(initial=least)), 0.0
    )
    own = 1.08 * max(float(np.nanmax(ends, initial=0.0)), least)
    near = np.abs(others[np.abs(others) < FAR * own])
    return max(own, 1.08 * float(near.max(initial=0.0)))


def _history_limits(
    values: Floats, sigmas: Floats, true: float, without: Floats | None, wandering: Floats | None
) -> tuple[tuple[float, float], str]:
    """Limits from where it started to where it went, with the other variant unless it is far off; then a remark."""
    later = slice(values.size // 10, None)
    ends = [values, values[later] - sigmas[later], values[later] + sigmas[later], np.array([true])]
    if wandering is not None:
        ends.append(wandering)
    every = np.concatenate(ends)
    every = every[np.isfinite(every)]
    low, high = float(every.min()), float(every.max())
    remark = ""
    if without is not None and without.size:
        settled = without[without.size // 10 :]
        settled = settled[np.isfinite(settled)]
        below, above = float(settled.min(initial=low)), float(settled.max(initial=high))
        if above - below < FAR * (high - low):
            low, high = min(low, below), max(high, above)
        else:
            remark = " – without: far off"
    margin = max(0.06 * (high - low), 1e-9)
    return (low - margin, high + margin), remark


def _log_limits(values: Floats) -> tuple[float, float]:
    """Room for nearly all of it: a moment of no error must not take decades."""
    known = values[np.isfinite(values)]
    if not known.size:
        return 0.01, 1.0
    low = max(float(np.quantile(known, 0.02)) / 1.5, 1e-3)
    return low, max(1.25 * float(known.max()), 3.0 * low)


def _log_labels(axes: Axes, side: str) -> None:
    """Metres in plain digits: 0.1, not a power of ten; in between where there is less than two decades."""
    low, high = axes.get_xlim() if side == "x" else axes.get_ylim()
    axis = axes.xaxis if side == "x" else axes.yaxis
    decades = math.log10(high / low)
    subs: Sequence[float] = (1.0, 2.0, 5.0) if decades < 2.5 else (1.0, 3.0) if decades < 3.5 else (1.0,)
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    axis.set_major_locator(FixedLocator([s * 10.0**x for x in exponents for s in subs if low <= s * 10.0**x <= high]))
    axis.set_minor_locator(LogLocator(subs=tuple(np.arange(2.0, 10.0))))
    axis.set_major_formatter(FuncFormatter(lambda value, _: short(float(value), 2)))
    axis.set_minor_formatter(NullFormatter())
