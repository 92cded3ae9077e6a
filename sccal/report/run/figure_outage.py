"""Drift without fixes: window by window over time, and how the windows' ends are distributed."""

from __future__ import annotations

import math

import numpy as np

from sccal.report.drawing.panel import SMALL, Panel, Sheet
from sccal.report.drawing.plan import Plan
from sccal.report.drawing.style import BLUE, POINTS, SOFT, VERMILION, thinned
from sccal.results.calibration import Outage
from sccal.results.numbers import one_line, plain, short

_LEFT, _RIGHT, _BOTTOM, _TOP, _ENDS, _MIDDLE = 40.0, 8.0, 34.0, 40.0, 84.0, 14.0


def outage_plan(outage: Outage) -> Plan:
    """Drift of every window."""
    return Plan(
        "outage",
        "Drift by what was learnt so far",
        f"Left: how far dead reckoning strayed in each {short(outage.window_s)} s without fixes. Right: the drift at "
        f"the windows' ends, from the smallest to the largest. {one_line(outage.how).rstrip('.').capitalize()}.",
        250.0,
        lambda sheet: draw_outage(sheet, outage),
    )


def draw_outage(sheet: Sheet, outage: Outage) -> None:
    """Curves at the left, the sorted ends at the right, on one scale."""
    windows = outage.windows
    most = max((float(np.nanmax(w.drift_m)) for w in windows if np.isfinite(w.drift_m).any()), default=1.0)
    y = (0.0, 1.06 * max(most, outage.end_rms_m or 0.0) or 1.0)
    width = sheet.width - _LEFT - _RIGHT - _ENDS - _MIDDLE
    height = sheet.height - _BOTTOM - _TOP
    curves = Panel(sheet, (_LEFT, _BOTTOM, width, height), (0.0, outage.window_s), y)
    curves.frame("drift (m)", "time without fixes (s)", (6, 6))
    budget = max(20, 3 * POINTS // max(len(windows), 1))
    alpha = 0.75 if len(windows) <= 12 else 0.35
    for window in windows:
        every = thinned(window.drift_m, budget)
        curves.line((window.t_s - window.start_s)[every], window.drift_m[every], BLUE, 0.9, alpha)

    ends = np.sort(np.array([w.end_drift_m for w in windows if math.isfinite(w.end_drift_m)]))
    spread = Panel(sheet, (_LEFT + width + _MIDDLE, _BOTTOM, _ENDS, height), (0.0, 100.0), y)
    spread.frame("at the end", "% of the windows", (2, 6), y_ticks=False)
    share = 100.0 * (np.arange(len(ends)) + 0.5) / max(len(ends), 1)
    spread.line(share, ends, BLUE, 0.9)
    spread.dots(share, ends, BLUE, 4.0 if len(ends) <= 60 else 2.5)
    sheet.key(sheet.height - 9.0, (("line", BLUE, "one window"),))
    if outage.end_rms_m is not None and math.isfinite(outage.end_rms_m):
        rms = f"rms at the end: {plain(outage.end_rms_m, 2)} m"
        for panel in (curves, spread):
            panel.level(outage.end_rms_m, VERMILION, 1.1, (4.0, 3.0))
        sheet.key(sheet.height - 9.0, (("line", VERMILION, rms),), x=84.0)
    if not windows:
        sheet.text(_LEFT + 8.0, _BOTTOM + 0.5 * height, "no window fits into the data", SMALL, SOFT)
