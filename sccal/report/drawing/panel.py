"""Panels for the figures of a run: scales, ticks and marks straight on a ``matplotlib.figure.Figure``.

A page has some twenty panels, and a matplotlib Axes costs several times what is drawn in it. Here a panel is a few
paths and texts in points, so that a batch's pages cost less than its filters. What a sheet holds may stand in a page of
its own (SVG) or beside others on paper (PDF).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox, IdentityTransform

from sccal.arrays import Bools, Floats
from sccal.report.drawing.style import GRID, INK, SOFT

SIZE = 9.0
SMALL = 8.0
FAR = 20.0
"""Heights of a panel beyond which a line is cut: the coordinates of a bad start would be endless."""
Mark = Literal["line", "band", "dot", "cross", "ring", "square", "diamond"]
Codes = npt.NDArray[np.uint8]
_HERE = IdentityTransform()


@dataclass(frozen=True)
class Sheet:
    """A rectangle of a figure, in points (1/72 inch) from its own lower left corner; what comes later lies on top."""

    figure: Figure
    left: float
    bottom: float
    width: float
    height: float

    def text(
        self,
        x: float,
        y: float,
        text: str,
        size: float = SIZE,
        colour: str = INK,
        side: Literal["left", "center", "right"] = "left",
        bold: bool = False,
    ) -> None:
        """One line of text whose baseline is at y."""
        self._add(
            Text(
                round(self.left + x, 2), round(self.bottom + y, 2), text, fontsize=size, color=colour,
                horizontalalignment=side, verticalalignment="baseline", fontweight="bold" if bold else "normal",
                parse_math=False,
            )
        )  # fmt: skip

    def path(
        self,
        points: Floats,
        codes: Codes | None = None,
        stroke: str | None = None,
        fill: str | None = None,
        width: float = 1.0,
        alpha: float = 1.0,
        dashes: tuple[float, float] | None = None,
        clip: Bbox | None = None,
        round_ends: bool = False,
    ) -> None:
        """Points (n, 2) as lines, or by the codes of a ``matplotlib.path.Path`` (n,)."""
        path = Path(np.round(points + np.array((self.left, self.bottom)), 2), codes)
        path.should_simplify = False
        patch = PathPatch(
            path, fill=fill is not None, facecolor=fill or "none", edgecolor=stroke or "none",
            linewidth=width if stroke else 0.0, alpha=None if alpha == 1.0 else alpha,
            linestyle=(0.0, dashes) if dashes else "solid", capstyle="round" if round_ends else "butt",
            joinstyle="round",
        )  # fmt: skip
        if clip is not None:
            patch.set_clip_box(clip)
        self._add(patch)

    def mark(self, mark: Mark, x: float, y: float, colour: str, size: float = 3.5, paper: str | None = None) -> None:
        """One sign; a paper-coloured rim sets it off."""
        at = np.array([x, y])
        if mark in ("line", "band"):
            thickness = 1.4 if mark == "line" else 7.0
            self.path(at + _DASH, stroke=colour, width=thickness, alpha=1.0 if mark == "line" else 0.4)
        elif mark == "cross":
            self.path(at + size * _CROSS, _PAIRS, stroke=colour, width=1.0)
        else:
            shape = {"square": _SQUARE, "diamond": _DIAMOND}.get(mark, _ROUND)
            self.path(
                at + size * shape, stroke=colour if mark == "ring" else paper, fill=None if mark == "ring" else colour,
                width=1.0,
            )  # fmt: skip

    def key(self, y: float, entries: Iterable[tuple[Mark, str, str]], x: float = 0.0) -> float:
        """Signs with their names (sign, colour, name) in rows downwards from y; returns the last row's y."""
        start = x
        for mark, colour, name in entries:
            needed = 20.0 + text_width(name, SMALL)
            if x > start and x + needed > self.width:
                x, y = start, y - 12.0
            self.mark(mark, x + 6.0, y + 3.0, colour, 2.6 if mark != "dot" else 2.2)
            self.text(x + 15.0, y, name, SMALL, SOFT)
            x += needed + 8.0
        return y

    def _add(self, artist: PathPatch | Text) -> None:
        artist.set_transform(_HERE)
        artist.set_zorder(len(self.figure.patches) + len(self.figure.texts) + len(self.figure.artists))
        self.figure.add_artist(artist)


@dataclass(frozen=True)
class Panel:
    """A box on a sheet with its scales: data outside is cut off at the box."""

    sheet: Sheet
    box: tuple[float, float, float, float]
    """Left, bottom, width and height in the sheet's points."""
    x: tuple[float, float]
    y: tuple[float, float]
    clip: Bbox = field(init=False)

    def __post_init__(self) -> None:
        left, bottom, width, height = self.box
        object.__setattr__(
            self, "clip", Bbox.from_bounds(self.sheet.left + left, self.sheet.bottom + bottom, width, height)
        )

    def frame(
        self,
        title: str = "",
        x_label: str = "",
        most: tuple[int, int] = (6, 4),
        x_ticks: bool = True,
        y_ticks: bool = True,
        note: str = "",
    ) -> None:
        """Grid and ticks, at most so many along each axis; title above, a softer note at its right."""
        left, bottom, width, height = self.box
        across, up = ticks(*self.x, most[0]), ticks(*self.y, most[1])
        xs, ys = self.at_x(across), self.at_y(up)
        grid = [((x, bottom), (x, bottom + height)) for x in xs] + [((left, y), (left + width, y)) for y in ys]
        if grid:
            self.sheet.path(np.array(grid).reshape(-1, 2), _pairs(len(grid)), stroke=GRID, width=0.6)
        self.sheet.path(
            np.array([(left, bottom + height), (left, bottom), (left + width, bottom)]), stroke=SOFT, width=0.7
        )
        for y, label in zip(ys if y_ticks else (), labels(up) if y_ticks else (), strict=True):
            self.sheet.text(left - 4.0, y - 0.35 * SMALL, label, SMALL, SOFT, "right")
        if x_ticks:
            for x, label in zip(xs, labels(across), strict=True):
                self.sheet.text(x, bottom - 11.0, label, SMALL, SOFT, "center")
        if x_label:
            self.sheet.text(left + 0.5 * width, bottom - 23.0, x_label, SMALL, SOFT, "center")
        if title:
            self.sheet.text(left, bottom + height + 5.0, title)
        if note:
            self.sheet.text(left + width, bottom + height + 5.0, note, SMALL, SOFT, "right")

    def at_x(self, x: Floats) -> Floats:
        """Places of values (n,) in the sheet's points."""
        low, high = self.x
        return np.asarray(self.box[0] + self.box[2] * (np.clip(x, *_far(low, high)) - low) / (high - low))

    def at_y(self, y: Floats) -> Floats:
        """As ``at_x``, upwards."""
        low, high = self.y
        return np.asarray(self.box[1] + self.box[3] * (np.clip(y, *_far(low, high)) - low) / (high - low))

    def points(self, x: Floats, y: Floats) -> Floats:
        """(n, 2) in the sheet's points."""
        return np.column_stack((self.at_x(x), self.at_y(y)))

    def line(
        self, x: Floats, y: Floats, colour: str, width: float = 1.0, alpha: float = 1.0, bold_ends: bool = False
    ) -> None:
        """Broken where a value is missing."""
        parts = [part for part in _known(x, y) if part.stop - part.start > 1]
        if parts:
            points = np.concatenate([self.points(x[part], y[part]) for part in parts])
            codes = np.full(len(points), Path.LINETO, dtype=np.uint8)
            codes[np.cumsum([0, *(part.stop - part.start for part in parts[:-1])])] = Path.MOVETO
            self.sheet.path(
                points, codes, stroke=colour, width=width, alpha=alpha, clip=self.clip, round_ends=bold_ends
            )

    def band(self, x: Floats, low: Floats, high: Floats, colour: str, alpha: float = 0.35) -> None:
        """The area between two lines, broken where a value is missing."""
        for part in _known(x, low, high):
            edge = np.concatenate((self.points(x[part], high[part]), self.points(x[part][::-1], low[part][::-1])))
            self.sheet.path(edge, fill=colour, alpha=alpha, clip=self.clip)

    def dots(self, x: Floats, y: Floats, colour: str, size: float = 2.4, alpha: float = 1.0) -> None:
        """All as one path of strokes without length, which their round ends make dots."""
        known = np.isfinite(x) & np.isfinite(y)
        if known.any():
            points = np.repeat(self.points(x[known], y[known]), 2, axis=0)
            self.sheet.path(
                points, _pairs(len(points) // 2), stroke=colour, width=size, alpha=alpha, round_ends=True,
                clip=self.clip,
            )  # fmt: skip

    def crosses(self, x: Floats, y: Floats, colour: str, size: float = 2.0) -> None:
        """As dots; they may stand on the box's edge."""
        known = np.isfinite(x) & np.isfinite(y)
        if known.any():
            points = (self.points(x[known], y[known])[:, None, :] + size * _CROSS).reshape(-1, 2)
            self.sheet.path(points, _pairs(len(points) // 2), stroke=colour, width=0.9)

    def bars(self, x: Floats, y: Floats, sigma: Floats, colour: str, width: float = 1.1) -> None:
        """Upright bars of ± sigma."""
        ends = np.stack((self.points(x, y - sigma), self.points(x, y + sigma)), axis=1).reshape(-1, 2)
        if len(ends):
            self.sheet.path(ends, _pairs(len(x)), stroke=colour, width=width, clip=self.clip)

    def level(self, y: float, colour: str = INK, width: float = 0.9, dashes: tuple[float, float] | None = None) -> None:
        """A line across, where the value is within the box."""
        if self.y[0] <= y <= self.y[1]:
            ends = self.points(np.array(self.x), np.array([y, y]))
            self.sheet.path(ends, stroke=colour, width=width, dashes=dashes)


def ticks(low: float, high: float, most: int) -> Floats:
    """Round values within the limits, at most so many steps."""
    values = np.asarray(MaxNLocator(most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
    slack = 1e-9 * (high - low)
    return values[(values >= low - slack) & (values <= high + slack)]


def labels(values: Floats) -> list[str]:
    """In full, all with the decimals that the step between them needs."""
    if len(values) < 2:
        return [f"{value:g}" for value in values]
    step = float(values[1] - values[0])
    for decimals in range(13):
        if abs(step - round(step, decimals)) < 1e-6 * step:
            break
    whole = [round(float(value), decimals) + 0.0 for value in values]
    return [f"{value:.{decimals}f}".replace("-", "−") for value in whole]


def limits(values: Sequence[Floats], margin: float = 0.08) -> tuple[float, float]:
    """Room for every finite value."""
    every = np.concatenate([np.ravel(value) for value in values]) if values else np.empty(0)
    every = every[np.isfinite(every)]
    if not every.size:
        return 0.0, 1.0
    low, high = float(every.min()), float(every.max())
    room = max(margin * (high - low), 1e-6 * max(abs(low), abs(high)), 1e-9)
    return low - room, high + room


def text_width(text: str, size: float) -> float:
    """Points, generously: most pages are read in a narrower face than the one that is measured here."""
    return 0.58 * size * len(text)


def _known(*columns: Floats) -> list[slice]:
    """Stretches of rows in which every column (n,) is finite."""
    fine: Bools = np.isfinite(columns[0])
    for column in columns[1:]:
        fine = fine & np.isfinite(column)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], fine.astype(np.int8), [0]))))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _far(low: float, high: float) -> tuple[float, float]:
    return low - FAR * (high - low), high + FAR * (high - low)


def _pairs(count: int) -> Codes:
    return np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=np.uint8), count)


def _ring(corners: int, turned: float) -> Floats:
    angle = 2.0 * math.pi * (np.arange(corners + 1) + turned) / corners
    return np.column_stack((np.cos(angle), np.sin(angle)))


_ROUND, _SQUARE, _DIAMOND = _ring(20, 0.0), _ring(4, 0.5) * 1.25, _ring(4, 0.0) * 1.3
_DASH = np.array([(-6.0, 0.0), (6.0, 0.0)])
_CROSS = np.array([(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)])
_PAIRS = _pairs(2)
