"""The map of a run: fixes by quality, the estimated path, stretches without fixes, scale and north."""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats
from sccal.report.drawing.panel import SIZE, SMALL, Mark, Panel, Sheet, labels, limits, ticks
from sccal.report.drawing.plan import Plan
from sccal.report.drawing.style import (
    BLUE,
    CLOUD_POINTS,
    INK,
    PAPER,
    POINTS,
    PURPLE,
    SOFT,
    VERMILION,
    by_quality,
    strided,
)
from sccal.results.calibration import Calibration, OutageWindow
from sccal.results.numbers import plain, short

WINDOWS_SHOWN = 400
OUTER = 0.005
"""Share of the fixes on each side of the map that do not set its limits: single ones may lie far off."""
_LEFT, _RIGHT, _BOTTOM, _TOP = 38.0, 10.0, 34.0, 44.0


def path_plan(c: Calibration) -> Plan:
    """The map, with what its marks mean."""
    caption = (
        "Fixes as they were used, coloured by quality, and the estimated path of the middle between the wheels; an "
        "antenna mounted elsewhere draws a path of its own."
    )
    if c.outage.windows:
        caption += (
            f" Rings: where each of the {len(c.outage.windows)} windows of {short(c.outage.window_s)} s begins in "
            "which the filter was tested without fixes; the pink band is the one with the largest drift at its end."
        )
    if _losses(c):
        caption += " Red bands: fixes lost or withheld."
    return Plan("path", "Path", caption, 360.0, lambda sheet: draw_path(sheet, c))


def draw_path(sheet: Sheet, c: Calibration) -> None:
    """Equal scales, north up."""
    box = (_LEFT, _BOTTOM, sheet.width - _LEFT - _RIGHT, sheet.height - _BOTTOM - _TOP)
    panel = Panel(sheet, box, *_limits(c, box[2] / box[3]))
    panel.frame(x_label="east (m)", most=(7, 7))
    sheet.text(0.0, _BOTTOM + box[3] + 6.0, "north (m)", SMALL, SOFT)
    key: list[tuple[Mark, str, str]] = []
    path = c.trajectory
    for windows, colour, name in (
        (_worst(c.outage.windows), PURPLE, _drift_name(c)),
        (_losses(c), VERMILION, "fixes lost or withheld"),
    ):
        for window in windows[:WINDOWS_SHOWN]:
            inside = np.flatnonzero((path.t_s >= window.start_s) & (path.t_s <= window.end_s))
            every = inside[strided(len(inside), POINTS)]
            panel.line(path.east_m[every], path.north_m[every], colour, 7.0, 0.4, bold_ends=True)
        if windows:
            key.append(("band", colour, name))
    every_n = strided(len(path.t_s), POINTS)
    panel.line(path.east_m[every_n], path.north_m[every_n], SOFT, 1.1)
    key.append(("line", SOFT, "estimated path"))
    for mask, label, colour in by_quality(c.fixes.quality):
        every_n = strided(int(mask.sum()), CLOUD_POINTS)
        panel.dots(c.fixes.east_m[mask][every_n], c.fixes.north_m[mask][every_n], colour, 2.6)
        key.append(("dot", colour, label))
    _begin_marks(panel, c)
    if c.outage.windows and len(path.t_s):
        key.append(("ring", INK, "window begins"))
    if len(path.t_s):
        east, north = path.east_m, path.north_m
        for k, mark, colour, name in ((0, "dot", BLUE, "start"), (-1, "square", PURPLE, "end")):
            x, y = panel.points(east[k : k + 1 or None], north[k : k + 1 or None])[0]
            sheet.mark(mark, x, y, colour, 4.2, PAPER)  # type: ignore[arg-type]
            key.append((mark, colour, name))  # type: ignore[arg-type]
    _scale_and_north(sheet, panel)
    sheet.key(sheet.height - 9.0, key)


def _limits(c: Calibration, aspect: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """The path and nearly all fixes, at one scale, in the middle of a box of that width over height."""
    ranges = []
    for path, fixes in ((c.trajectory.east_m, c.fixes.east_m), (c.trajectory.north_m, c.fixes.north_m)):
        known = fixes[np.isfinite(fixes)]
        usual = np.quantile(known, (OUTER, 1.0 - OUTER)) if len(known) else np.empty(0)
        ranges.append(limits([path, usual], 0.06))
    (west, east), (south, north) = ranges
    height = max((east - west) / aspect, north - south, 0.5)
    x, y = 0.5 * (west + east), 0.5 * (south + north)
    return (x - 0.5 * height * aspect, x + 0.5 * height * aspect), (y - 0.5 * height, y + 0.5 * height)


def _worst(windows: tuple[OutageWindow, ...]) -> tuple[OutageWindow, ...]:
    return (max(windows, key=lambda window: window.end_drift_m),) if windows else ()


def _drift_name(c: Calibration) -> str:
    worst = _worst(c.outage.windows)
    return f"largest drift, {plain(worst[0].end_drift_m, 2)} m" if worst else ""


def _losses(c: Calibration) -> tuple[OutageWindow, ...]:
    judged = c.against_reference
    return () if judged is None or judged.losses is None else judged.losses.windows


def _begin_marks(panel: Panel, c: Calibration) -> None:
    path = c.trajectory
    if not len(path.t_s):
        return
    begins = np.array([window.start_s for window in c.outage.windows[:WINDOWS_SHOWN]])
    at: Floats = panel.points(np.interp(begins, path.t_s, path.east_m), np.interp(begins, path.t_s, path.north_m))
    for x, y in at:
        panel.sheet.mark("ring", x, y, INK, 3.0)


def _scale_and_north(sheet: Sheet, panel: Panel) -> None:
    """Beside the map, where no path can cross them."""
    left, bottom, width, height = panel.box
    span = panel.x[1] - panel.x[0]
    length = float(ticks(0.0, 0.3 * span, 1)[-1]) or 0.2 * span
    points = length / span * width
    right, y = left + width, 6.0
    ends = [(right - points, y + 3.0), (right - points, y), (right, y), (right, y + 3.0)]
    sheet.path(np.array(ends), stroke=INK, width=1.3)
    sheet.text(right - points - 4.0, y - 1.5, f"{labels(np.array([length]))[0]} m", SMALL, INK, "right")
    x, y = right - 5.0, bottom + height + 3.0
    sheet.path(np.array([(x, y + 13.0), (x - 4.0, y), (x, y + 3.0), (x + 4.0, y), (x, y + 13.0)]), fill=INK)
    sheet.text(x - 8.0, y + 2.0, "N", SIZE, INK, "right", bold=True)
