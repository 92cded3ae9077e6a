"""The figures of an inspection, as SVG text: every stream on one axis of time, and a map of the fixes.

In the style of the other figures and, like them, through ``matplotlib.figure.Figure``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from sccal.arrays import Floats, Ints
from sccal.report.drawing.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    PAPER,
    POINTS,
    PURPLE,
    QUALITIES,
    VERMILION,
    Drawing,
    by_quality,
    elapsed,
    full_tick_labels,
    plain_ticks,
    strided,
    styled,
    svg_text,
    thinned,
)
from sccal.results.inspection import Inspection, StreamFacts

STANDSTILLS_SHOWN = 200
SPANS_SHOWN = 400
_WIDE_IN, _MAP_IN = 9.6, 5.6
_STANDING = "#e9e9ee"
_BAR = 0.62


def inspection_drawings(i: Inspection) -> tuple[Drawing, ...]:
    """The timeline, and the map where there are fixes."""
    drawings = [
        Drawing(
            "timeline",
            "What was logged when: a bar for each stream, white where it has a gap; the quality of the fixes; speed "
            "and turning by every stream that tells of them, which should lie on each other (fixes show no sign: it "
            "is the wheels'). Grey: the robot stands.",
            timeline(i),
        )
    ]
    if len(i.series.fix_east_m):
        drawings.append(
            Drawing("map", "The fixes as they were logged, by quality; from the first one, in metres.", fix_map(i))
        )
    return tuple(drawings)


def timeline(i: Inspection) -> str:
    """Streams, quality, speed and turning over one axis of time; panels without data are left out."""
    s = i.series
    speeds = [
        ("wheels", s.speed_wheels_mps, BLUE),
        ("fixes", s.speed_fixes_mps, ORANGE),
    ]
    turns = [
        ("yaw", np.degrees(s.turn_yaw_radps), VERMILION),
        ("wheels", np.degrees(s.turn_wheels_radps), BLUE),
    ]
    curves = [
        (title, drawn)
        for title, every in (("speed (m/s)", speeds), ("turning (deg/s), to the left positive", turns))
        if (drawn := [column for column in every if np.isfinite(column[1]).any()])
    ]
    start, end = i.span_s
    with styled("timeline"):
        heights = [0.32 + 0.25 * max(len(i.streams), 1) + (0.25 if i.fixes else 0.0), *(1.45 for _ in curves)]
        height = sum(heights) + 0.75 + 0.42 * len(curves)
        figure = Figure(figsize=(_WIDE_IN, height))
        panels = list(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0])
        figure.subplots_adjust(
            left=0.075,
            right=0.985,
            bottom=0.46 / height,
            top=1.0 - 0.3 / height,
            hspace=0.42 * len(heights) / height * 1.6,
        )
        _bars(panels[0], i)
        for axes, (title, every) in zip(panels[1:], curves, strict=True):
            _standing(axes, i)
            for label, values, colour in every:
                time, _ = elapsed(s.t_s, start, end)
                rows = _rows(values)
                axes.plot(time[rows], values[rows], color=colour, lw=0.9, label=label)
            axes.set_title(title)
            axes.set_ylim(_limits([values for _, values, _ in every]))
            plain_ticks(axes, 5)
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=3, borderaxespad=0.0, borderpad=0.1)
        (first, last), label = elapsed(np.array([start, end]), start, end)
        panels[-1].set_xlim(first, last if last > first else first + 1.0)
        panels[-1].xaxis.set_major_locator(MaxNLocator(12))
        panels[-1].set_xlabel(label)
        full_tick_labels(panels[-1])
        return svg_text(figure)


def fix_map(i: Inspection) -> str:
    """Fixes by quality; equal scales."""
    s = i.series
    with styled("fix map"):
        figure = Figure(figsize=(_MAP_IN, 5.0))
        axes = figure.add_axes((0.13, 0.1, 0.84, 0.82))
        for mask, label, colour in by_quality(s.fix_quality):
            every = strided(int(mask.sum()), POINTS)
            axes.plot(s.fix_east_m[mask][every], s.fix_north_m[mask][every], ".", ms=3.0, mew=0, color=colour)
            axes.plot([], [], "o", ms=5.0, mew=0, color=colour, label=label)
        ends: dict[str, Any] = {"mec": PAPER, "mew": 0.8, "ls": "none", "zorder": 5}
        axes.plot(s.fix_east_m[:1], s.fix_north_m[:1], "o", ms=8, color=BLUE, label="start", **ends)
        axes.plot(s.fix_east_m[-1:], s.fix_north_m[-1:], "s", ms=7, color=PURPLE, label="end", **ends)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.06)
        axes.set_xlabel("east (m)")
        axes.set_ylabel("north (m)")
        plain_ticks(axes, 6)
        axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.01), ncols=3, borderaxespad=0.0)
        return svg_text(figure)


def _bars(axes: Axes, i: Inspection) -> None:
    """A bar for each stream with its gaps, and one for the quality of the fixes below them."""
    start, end = i.span_s
    names: list[str] = []
    for one in i.streams:
        place = len(names)
        time, _ = elapsed(np.array(_pieces(one, start)), start, end)
        axes.broken_barh(
            [(a, b - a) for a, b in time.tolist()], (place - 0.5 * _BAR, _BAR),
            color=BLACK if one.shares_time else GREY, alpha=0.75 if one.shares_time else 0.45, lw=0,
        )  # fmt: skip
        if not one.shares_time:
            axes.annotate(
                f"on a time of its own: begins at {one.first_s:.0f} s", (float(time[0, 0]), place), (6, 0),
                textcoords="offset points", va="center", fontsize=8.0, color=BLACK,
            )  # fmt: skip
        names.append(one.name)
    if i.fixes is not None and i.fixes.spans:
        pieces = _quality_pieces(i)
        for code in sorted({code for _, _, code in pieces}):
            time, _ = elapsed(np.array([(a, b) for a, b, one in pieces if one == code]), start, end)
            axes.broken_barh(
                [(a, b - a) for a, b in time.tolist()], (len(names) - 0.5 * _BAR, _BAR), color=_colour(code), lw=0
            )
        shown = sorted({quality.code for quality in i.fixes.qualities})
        handles = [Patch(color=colour, label=label) for _, label, colour in by_quality(np.array(shown))]
        axes.legend(
            handles=handles, loc="lower right", bbox_to_anchor=(1.0, 0.99), ncols=5, borderaxespad=0.0, borderpad=0.1
        )
        names.append("quality")
    axes.set_ylim(len(names) - 0.45, -0.55)
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)
    axes.set_title("streams")


def _quality_pieces(i: Inspection) -> list[tuple[float, float, int]]:
    """Begin, end and code of each stretch of one quality; of equal parts of the run where there are too many."""
    fixes = i.fixes
    assert fixes is not None
    start, end = i.span_s
    own = next((stream for stream in i.streams if stream.name == "fixes"), None)
    shift = _shift(own, start)
    if len(fixes.spans) <= SPANS_SHOWN:
        return [(s.start_s + shift, s.end_s + shift, s.code) for s in fixes.spans if s.code is not None]
    if own is not None and not own.shares_time:
        end = start + own.last_s - own.first_s
    width = (end - start) / len(fixes.fine_strip)
    pieces: list[tuple[float, float, int]] = []
    for k, code in enumerate(fixes.fine_strip):
        begin = start + k * width
        if code is None:
            continue
        if pieces and pieces[-1][2] == code and begin - pieces[-1][1] < 0.5 * width:
            begin = pieces.pop()[0]
        pieces.append((begin, start + (k + 1) * width, code))
    return pieces


def _pieces(one: StreamFacts, start_s: float) -> list[tuple[float, float]]:
    """Stretches between the gaps, a stream on a time of its own moved to the start."""
    shift = _shift(one, start_s)
    ends = sorted((gap.start_s, gap.start_s + gap.length_s) for gap in one.gaps)
    begins = [one.first_s, *(end for _, end in ends)]
    stops = [*(begin for begin, _ in ends), one.last_s]
    return [(a + shift, b + shift) for a, b in zip(begins, stops, strict=True)]


def _shift(one: StreamFacts | None, start_s: float) -> float:
    return 0.0 if one is None or one.shares_time else start_s - one.first_s


def _colour(code: int) -> str:
    return next((colour for known, _, colour in QUALITIES if known == code), PURPLE)


def _standing(axes: Axes, i: Inspection) -> None:
    start, end = i.span_s
    for span in i.series.standing_s[:STANDSTILLS_SHOWN]:
        (first, last), _ = elapsed(span, start, end)
        axes.axvspan(first, last, color=_STANDING, lw=0, zorder=0)


def _rows(values: Floats) -> Ints:
    """Thinned by extremes, with the first of every stretch of NaN, so that gaps stay gaps."""
    missing = np.isnan(values)
    edges = np.flatnonzero(missing[1:] != missing[:-1])
    return np.unique(np.concatenate((thinned(values, POINTS), edges, np.minimum(edges + 1, len(values) - 1))))


def _limits(every: Sequence[Floats]) -> tuple[float, float]:
    """Room for nearly all of it: a jump of the fixes must not flatten the rest."""
    values = np.concatenate(every)
    values = values[np.isfinite(values)]
    low, high = (float(q) for q in np.quantile(values, (0.002, 0.998))) if len(values) else (0.0, 1.0)
    low, high = min(low, 0.0), max(high, 0.0)
    margin = 0.08 * (high - low) or 1.0
    if not math.isfinite(margin):
        return -1.0, 1.0
    return low - margin, high + margin
