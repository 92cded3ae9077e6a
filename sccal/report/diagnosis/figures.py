"""The figures of a diagnosis, as SVG text: a residual against its cause, drift before and after, candidates ranked.

In the style of the other figures and, like them, through ``matplotlib.figure.Figure``. Orange-red is the model without
the effect, blue the model with it, in every figure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sccal.arrays import Bools, Floats
from sccal.report.diagnosis.text import something_added
from sccal.report.drawing.style import (
    BLACK,
    BLUE,
    GREY,
    PAPER,
    SKY,
    SOFT,
    VERMILION,
    Drawing,
    full_tick_labels,
    plain_ticks,
    styled,
    svg_text,
    thinned,
)
from sccal.report.layout import shortened
from sccal.results.calibration import OutageWindow
from sccal.results.diagnosis import Diagnosis, Finding, Judgement, Picture, Ranked, Unexplained
from sccal.results.numbers import one_line, plain, short

RANKED_SHOWN = 8
WINDOWS_SHOWN = 60
BARS_UP_TO = 80
"""Points beyond which error bars would only be a grey cloud: then the points stand alone."""
GRID = 61
"""Moments of a window at which the root mean square over the windows is drawn."""
_WIDE_IN, _NARROW_IN, _HALF_IN = 9.6, 5.6, 5.0
_LABEL_CHARACTERS = 58


def finding_drawings(d: Diagnosis, number: int) -> tuple[Drawing, ...]:
    """What led to a finding: the residual against its cause, where there is a picture, and the candidates."""
    finding = d.findings[number]
    drawings = []
    if finding.picture is not None and _drawable(finding.picture):
        drawings.append(
            Drawing(
                f"residual-{number + 1}",
                "What the model leaves without the effect and with it, averaged over stretches of the quantity that it "
                "follows, with standard errors; the line is what the effect adds there, as fitted. What is explained "
                "lies on zero.",
                residual_pair(finding.picture),
            )
        )
    if finding.ranking:
        drawings.append(
            Drawing(
                f"candidates-{number + 1}",
                "The evidence for each candidate beside what was in the model already: the logarithm of the odds for "
                "it, the price of its own freedom paid. Blue is the one that was added, light blue are others. The "
                "dashed line is what a finding needs, at least.",
                candidates(finding, d.placebo.needed_nats),
            )
        )
    return tuple(drawings)


def unexplained_drawing(left: Unexplained) -> Drawing | None:
    """The residual that has no name; None where there is nothing to draw."""
    if not left.significant or left.picture is None or not _drawable(left.picture):
        return None
    return Drawing(
        "unexplained",
        "What the final model leaves, averaged over stretches of the quantity that it follows, with standard errors; "
        "the line is the pattern as fitted. It has no name yet.",
        residual_pair(left.picture, titles=("left by the final model", "with the pattern taken away")),
    )


def drift_drawing(d: Diagnosis) -> Drawing | None:
    """Drift before and after; None where no window fits into the data."""
    if not d.before.windows and not d.after.windows:
        return None
    return Drawing(
        "drift",
        f"How far dead reckoning strayed in each {short(d.after.window_s)} s without fixes (thin), and its root mean "
        "square over all windows (thick), on data that did not fit the model.",
        drift_before_after(d.before, d.after if something_added(d) else None),
    )


TITLES = ("without the effect", "with the effect")


def residual_plot(picture: Picture, titles: tuple[str, str] = TITLES) -> str:
    """Before with the fitted effect, and after, on one scale; one panel where there is no after."""
    with styled("residual picture"):
        figure = Figure(figsize=(_WIDE_IN, 3.3))
        panels = list(figure.subplots(1, _panels(picture), sharey=True, squeeze=False)[0])
        figure.subplots_adjust(left=0.085, right=0.985, bottom=0.145, top=0.91, wspace=0.06)
        for k, axes in enumerate(panels):
            _residual_panel(axes, picture, k, titles[k])
        panels[0].set_ylabel(one_line(picture.y_label))
        return svg_text(figure)


def residual_pair(picture: Picture, titles: tuple[str, str] = TITLES) -> str:
    """The same for a page: a figure for each panel, beside each other where there is room."""
    figures = []
    for k in range(_panels(picture)):
        with styled(f"residual {k}"):
            figure = Figure(figsize=(_HALF_IN, 3.3))
            axes = figure.add_axes((0.155, 0.145, 0.815, 0.765))
            _residual_panel(axes, picture, k, titles[k])
            axes.set_ylabel(one_line(picture.y_label))
            figures.append(svg_text(figure))
    return f'<div class="pair">{"".join(figures)}</div>'


def _panels(picture: Picture) -> int:
    return 1 + bool(np.isfinite(picture.after).any())


def _residual_panel(axes: Axes, picture: Picture, k: int, title: str) -> None:
    axes.axhline(0.0, color=BLACK, lw=0.7)
    axes.set_xlabel(one_line(picture.x_label))
    axes.xaxis.set_major_locator(MaxNLocator(7))
    if k == 0:
        order = np.argsort(picture.x, kind="stable")
        axes.plot(picture.x[order], picture.model[order], color=BLACK, lw=1.4, label="the effect as fitted")
        _points(axes, picture.x, picture.before, picture.before_sigma, VERMILION)
    else:
        _points(axes, picture.x, picture.after, picture.after_sigma, BLUE)
    axes.set_title(title)
    axes.set_ylim(_limits(picture))
    plain_ticks(axes, 6)


def drift_before_after(before: Judgement, after: Judgement | None) -> str:
    """Each window's drift since it began, and the root mean square over the windows; one model if nothing changed."""
    models = [(before, BLUE, "as it is")] if after is None else [(before, VERMILION, "before"), (after, BLUE, "after")]
    with styled("drift before after"):
        figure = Figure(figsize=(_NARROW_IN, 3.9))
        axes = figure.add_axes((0.13, 0.125, 0.84, 0.76))
        highest = 0.0
        drawn = [(judgement, colour, label) for judgement, colour, label in models if judgement.windows]
        for judgement, colour, label in drawn:
            _thin_lines(axes, judgement.windows, colour)
            grid, rms = _rms_over(judgement.windows, judgement.window_s)
            end = judgement.outage_end_rms_m
            text = label if end is None else f"{label}: {plain(end, 3 if end >= 1.0 else 2)} m rms at the end"
            axes.plot(grid, rms, color=PAPER, lw=4.6, zorder=4)
            axes.plot(grid, rms, color=colour, lw=2.8, zorder=5, label=text)
            highest = max(highest, float(np.nan_to_num(rms).max()))
        axes.set_xlim(0.0, before.window_s)
        most = max((float(w.drift_m.max()) for j, _, _ in drawn for w in j.windows if len(w.drift_m)), default=1.0)
        axes.set_ylim(0.0, 1.05 * min(most, 3.0 * highest or most) or 1.0)
        axes.set_xlabel("time without fixes (s)")
        axes.set_ylabel("drift (m)")
        plain_ticks(axes, 6)
        if drawn:
            axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1.01), ncols=2, borderaxespad=0.0)
        return svg_text(figure)


def candidates(finding: Finding, needed_nats: float) -> str:
    """Horizontal bars, best first, each below its name; the chosen one is always among them."""
    shown = list(finding.ranking[:RANKED_SHOWN])
    if not any(ranked.name == finding.name for ranked in shown):
        shown = [*shown[: RANKED_SHOWN - 1], *(ranked for ranked in finding.ranking if ranked.name == finding.name)]
    gains = [ranked.evidence_nats if math.isfinite(ranked.evidence_nats) else 0.0 for ranked in shown]
    with styled("candidates"):
        height = 0.6 + 0.46 * len(shown)
        figure = Figure(figsize=(_NARROW_IN, height))
        axes = figure.add_axes((0.03, 0.45 / height, 0.94, 1.0 - 0.5 / height))
        places = np.arange(len(shown))
        axes.barh(places, gains, height=0.34, color=[_colour(ranked, finding.name) for ranked in shown], zorder=2)
        span = max(*gains, 0.0) - min(*gains, 0.0) or 1.0
        if math.isfinite(needed_nats) and 0.0 < needed_nats < 1.2 * span:
            axes.axvline(needed_nats, color=VERMILION, lw=1.0, ls=(0, (4, 3)), zorder=1)
        paper = {"boxstyle": "square,pad=0.1", "fc": PAPER, "ec": "none"}
        for place, one, gain in zip(places, shown, gains, strict=True):
            chosen = one.name == finding.name
            axes.annotate(
                _bar_label(one), (0.0, place - 0.2), (2, 3), textcoords="offset points", va="bottom", ha="left",
                color=BLACK if one.named else SOFT, fontsize=8.0, fontweight="bold" if chosen else "normal",
                bbox=paper, zorder=4,
            )  # fmt: skip
            end = max(gain, needed_nats if 0.0 < needed_nats < 0.1 * span and gain < needed_nats else 0.0)
            axes.annotate(
                plain(one.evidence_nats, 3 if abs(gain) >= 100.0 else 2), (end, place),
                (4, 0), textcoords="offset points", va="center", fontsize=8.0, zorder=4,
            )  # fmt: skip
        axes.set_xlim(min(*gains, 0.0) - 0.02 * span, max(*gains, 0.0) + 0.14 * span)
        axes.set_ylim(len(shown) - 0.65, -0.8)
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        axes.grid(axis="y", visible=False)
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.set_xlabel("evidence (nats)")
        full_tick_labels(axes)
        return svg_text(figure)


def _drawable(picture: Picture) -> bool:
    return bool((np.isfinite(picture.x) & np.isfinite(picture.before)).any())


def _points(axes: Axes, x: Floats, y: Floats, sigma: Floats, colour: str) -> None:
    known: Bools = np.isfinite(x) & np.isfinite(y)
    if int(known.sum()) > BARS_UP_TO:
        axes.plot(x[known], y[known], "o", ms=3.0, mew=0, color=colour, alpha=0.6)
        return
    bars = np.where(np.isfinite(sigma), sigma, 0.0)
    axes.errorbar(x[known], y[known], yerr=bars[known], fmt="o", ms=4.5, color=colour, elinewidth=1.1, capsize=0)


def _limits(picture: Picture) -> tuple[float, float]:
    """Room for all points and the line, but not for the bars of the worst known ones."""
    values = [picture.before, picture.after, picture.model]
    for points, sigma in ((picture.before, picture.before_sigma), (picture.after, picture.after_sigma)):
        finite = sigma[np.isfinite(sigma)]
        usual = 3.0 * float(np.median(finite)) if len(finite) else 0.0
        bars = np.clip(np.nan_to_num(sigma), 0.0, usual)
        values += [points - bars, points + bars]
    every = np.concatenate([np.zeros(1), *values])
    every = every[np.isfinite(every)]
    low, high = float(every.min()), float(every.max())
    margin = 0.08 * (high - low) or 1.0
    return low - margin, high + margin


def _thin_lines(axes: Axes, windows: Sequence[OutageWindow], colour: str) -> None:
    every = max(1, math.ceil(len(windows) / WINDOWS_SHOWN))
    shown = windows[::every]
    alpha = 0.45 if len(shown) <= 12 else 0.22
    for window in shown:
        kept = thinned(window.drift_m, 60)
        axes.plot((window.t_s - window.start_s)[kept], window.drift_m[kept], color=colour, lw=0.8, alpha=alpha)


def _rms_over(windows: Sequence[OutageWindow], window_s: float) -> tuple[Floats, Floats]:
    """Root mean square of the windows' drift at the moments of a grid, of those that have fixes around it."""
    grid = np.linspace(0.0, window_s, GRID)
    total, count = np.zeros(GRID), np.zeros(GRID)
    for window in windows:
        elapsed = window.t_s - window.start_s
        if not len(elapsed):
            continue
        reached = grid <= elapsed[-1] + 0.5 * window_s / (GRID - 1)
        total += np.where(reached, np.interp(grid, elapsed, window.drift_m) ** 2, 0.0)
        count += reached
    return grid, np.sqrt(np.where(count > 0, total / np.maximum(count, 1.0), np.nan))


def _colour(one: Ranked, chosen: str) -> str:
    if one.name == chosen:
        return BLUE
    return SKY if one.named else GREY


def _bar_label(one: Ranked) -> str:
    return shortened(one_line(f"{one.name}: {one.title}" if one.named else one.title), _LABEL_CHARACTERS)
