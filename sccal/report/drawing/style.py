"""What all figures share: colours, style, the text of an SVG, and how long series are thinned.

Figures are made through ``matplotlib.figure.Figure``, never pyplot, and give the same bytes for the same result.
Nothing is estimated here; long series are only thinned, lines by keeping the lowest and highest value of each stretch
of time. Colours: Okabe and Ito's palette, which colour-blind readers can tell apart. In a page, every colour of
PAGE_COLOURS is a variable of the page's style sheet, so that figures follow it into the dark.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from sccal.arrays import Bools, Floats, Ints

ORANGE, SKY, GREEN, BLUE, VERMILION, PURPLE, GREY = (
    "#e69f00", "#56b4e9", "#009e73", "#0072b2", "#d55e00", "#cc79a7", "#888888",
)  # fmt: skip
INK, SOFT, GRID, PAPER = "#1b1f24", "#5b6570", "#dde1e6", "#fefefe"
"""Text and lines of reference, labels of ticks, grid, and what is to look like the paper below."""
BLACK = INK
PAGE_COLOURS: Mapping[str, str] = {
    INK: "ink", SOFT: "soft", GRID: "line", PAPER: "paper", BLUE: "blue", "#e9e9ee": "shade",
}  # fmt: skip
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

FACE = "DejaVu Sans"
"""Comes with matplotlib, and is wider than what a page is read in: what fits here fits there."""
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": FACE,
    "font.size": 9.0,
    "text.color": INK,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "axes.edgecolor": SOFT,
    "axes.labelcolor": SOFT,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.titlepad": 5.0,
    "axes.labelsize": 9.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.4,
    "legend.columnspacing": 1.2,
    "lines.solid_joinstyle": "round",
    "path.simplify": True,
}
_UNUSED_ID = re.compile(r' id="[A-Za-z0-9.]+_\d+"')
_PLACES = re.compile(r' (?:d|x|y)="[^"]*"')
_SURPLUS_DECIMALS = re.compile(r"(\d\.\d\d)\d+")
"""Beyond a hundredth of a point."""
_IDS = re.compile(r'(\bid="|#)([mp][0-9a-f]{10}\b)')
_OUTER_BLANKS = re.compile(r"^[ \t]+|[ \t]+$", re.MULTILINE)
_STYLE_OF_ALL = re.compile(r"<defs>\s*<style[^>]*>[^<]*</style>\s*</defs>")
"""Would hold for the whole page that the SVG stands in."""


@dataclass(frozen=True)
class Drawing:
    """One figure, ready to stand in a page."""

    name: str
    caption: str
    svg: str

    def in_page(self) -> str:
        """The SVG with ids of its own: two figures of one kind would else share them."""
        return _IDS.sub(rf"\1{self.name}-\2", self.svg)


def by_quality(quality: Ints) -> list[tuple[Bools, str, str]]:
    """Rows of each GGA quality that is there (n,), with its name and colour."""
    groups = [(quality == code, label, colour) for code, label, colour in QUALITIES]
    groups.append((~np.isin(quality, [code for code, _, _ in QUALITIES]), "other quality", PURPLE))
    return [group for group in groups if group[0].any()]


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


def elapsed(t_s: Floats, start_s: float, end_s: float) -> tuple[Floats, str]:
    """Times from the start, in minutes where the whole is long, and the label of their axis."""
    if end_s - start_s > 600.0:
        return (t_s - start_s) / 60.0, "time since the start (min)"
    return t_s - start_s, "time since the start (s)"


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


def svg_text(figure: Figure, rounded: bool = False) -> str:
    """Without XML prologue, date, or ids that nothing refers to: several figures share one page and its colours.

    ``rounded``: every place in the figure is at a hundredth of a point already.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = buffer.getvalue()
    text = _STYLE_OF_ALL.sub("", text[text.index("<svg") :], count=1)
    text = _OUTER_BLANKS.sub("", _UNUSED_ID.sub("", text))
    if not rounded:
        text = _PLACES.sub(lambda places: _SURPLUS_DECIMALS.sub(r"\1", places[0]), text)
    for colour, name in PAGE_COLOURS.items():
        text = text.replace(colour, f"var(--{name},{colour})")
    return text.replace(f"'{FACE}'", "var(--face,sans-serif)")
