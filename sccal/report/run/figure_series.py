"""A run over time: what the filter learnt, what its predictions missed, and whether by as much as they should."""

from __future__ import annotations

import math

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.report.drawing.panel import Panel, Sheet
from sccal.report.drawing.plan import Plan
from sccal.report.drawing.style import (
    BLUE,
    CLOUD_POINTS,
    INK,
    POINTS,
    SKY,
    VERMILION,
    elapsed,
    offset_on_turn_deg,
    strided,
    thinned,
)
from sccal.report.rows import parameter_rows
from sccal.results.calibration import Calibration, Consistency, Estimate
from sccal.results.numbers import short

SETTLED_FROM = 0.25
"""Share of the run after which a parameter's history sets the limits of its panel."""
NIS_HIGHEST = 4.0
"""Means beyond stand at the panel's edge."""
_LEFT, _RIGHT, _BOTTOM = 48.0, 8.0, 28.0
_GAP = 25.0
"""Between stacked panels: the upper one's ticks are left out, the lower one's title stands there."""


def parameters_plan(c: Calibration) -> Plan:
    """How the parameters were learnt."""
    return Plan(
        "parameters",
        "Parameters over time",
        "What the filter had learnt by each moment, starting from the nominal values, with a band of ±1σ. The line "
        "across is the final value, dashed the nominal one.",
        365.0,
        lambda sheet: draw_parameters(sheet, c),
    )


def residuals_plan(c: Calibration) -> Plan:
    """What the predictions missed."""
    return Plan(
        "residuals",
        "Residuals over time",
        "Measured minus predicted; about 95 of 100 points belong inside the band of ±2σ, and a pattern over time is "
        "something that the model lacks. Points beyond a panel stand at its edge; where there are too many to draw, "
        "the darker band is their range.",
        340.0,
        lambda sheet: draw_residuals(sheet, c),
    )


def consistency_plan(c: Calibration) -> Plan:
    """Whether they missed by as much as expected."""
    return Plan(
        "consistency",
        "Normalised innovations (NIS)",
        "Squared residuals over their predicted variance, averaged over stretches of the run; 1 is expected, and 95 of "
        "100 stretches belong inside the band. Above it the measurements, or the model, are worse than the filter "
        "believes; below, better.",
        120.0 * len(c.consistency) + 10.0,
        lambda sheet: draw_consistency(sheet, c),
    )


def draw_parameters(sheet: Sheet, c: Calibration) -> None:
    """Four panels over one time axis."""
    h = c.history
    rows = parameter_rows(c.parameters)
    series = (
        (h.radius_right_m, h.sigma_radius_right_m),
        (h.radius_left_m, h.sigma_radius_left_m),
        (h.track_m, h.sigma_track_m),
        (offset_on_turn_deg(h.heading_offset_rad, rows[3].estimate.value), np.degrees(h.sigma_heading_offset_rad)),
    )
    time, x, label = _time(c, h.t_s)
    for k, (row, (values, sigmas)) in enumerate(zip(rows, series, strict=True)):
        nominal = row.estimate.nominal
        y = _history_limits(values, sigmas, row.estimate)
        note = row.status
        if nominal is not None and not y[0] <= nominal <= y[1]:
            note += f"; nominal {short(nominal)} is {'below' if nominal < y[0] else 'above'}"
        panel = _stacked(sheet, k, 4, x, y, f"{row.name} ({row.unit})", label, note)
        every = thinned(values, POINTS // 2)
        t, value, sigma = time[every], values[every], sigmas[every]
        panel.band(t, value - sigma, value + sigma, SKY)
        panel.line(t, value, BLUE)
        panel.level(row.estimate.value)
        if nominal is not None:
            panel.level(nominal, VERMILION, dashes=(4.0, 3.0))


def draw_residuals(sheet: Sheet, c: Calibration) -> None:
    """Heading, east and north innovations with their ±2σ bands."""
    r = c.residuals
    fixes = (r.fix_t_s, r.fix_accepted)
    every = (
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
    sheet.key(sheet.height - 9.0, (("band", SKY, "±2σ"), ("dot", BLUE, "accepted"), ("cross", VERMILION, "rejected")))
    for k, (name, t_s, accepted, residual, sigma) in enumerate(every):
        time, x, label = _time(c, t_s)
        limit = _residual_limit(accepted, residual, sigma)
        note = f"{int(accepted.sum())} accepted, {int((~accepted).sum())} rejected"
        panel = _stacked(sheet, k, 3, x, (-limit, limit), name, label, note, top=36.0)
        rows = thinned(sigma, POINTS // 4)
        bound = np.clip(2.0 * sigma[rows], 0.0, limit)
        panel.band(time[rows], -bound, bound, SKY)
        edge = 0.97 * limit
        t, value = time[accepted], np.clip(residual[accepted], -edge, edge)
        if len(t) > CLOUD_POINTS:
            lowest, highest, middle = _ranges(t, value, CLOUD_POINTS // 4)
            panel.band(middle, lowest, highest, BLUE, 0.25)
        some = strided(len(t), CLOUD_POINTS)
        panel.dots(t[some], value[some], BLUE, 1.7)
        t, value = time[~accepted], np.clip(residual[~accepted], -edge, edge)
        rows = thinned(value, CLOUD_POINTS // 4)
        panel.crosses(t[rows], value[rows], VERMILION)


def draw_consistency(sheet: Sheet, c: Calibration) -> None:
    """A panel for each kind of measurement."""
    for k, stretches in enumerate(c.consistency):
        time, x, label = _time(c, stretches.t_s)
        high = min(NIS_HIGHEST, 1.15 * float(max(stretches.nis.max(), stretches.high.max(), 1.5)))
        note = f"{100.0 * stretches.inside:.1f} % within their 95 % region"
        panel = _stacked(
            sheet,
            k,
            len(c.consistency),
            x,
            (0.0, high),
            f"{stretches.measured}: NIS per degree of freedom",
            label,
            note,
        )
        panel.band(time, stretches.low, stretches.high, SKY)
        panel.level(1.0, INK)
        values = np.minimum(stretches.nis, 0.985 * high)
        panel.line(time, values, BLUE, 0.9)
        panel.dots(time, values, BLUE, 3.4)
        beyond = _beyond(stretches)
        panel.dots(time[beyond], values[beyond], VERMILION, 3.8)


def _beyond(one: Consistency) -> Bools:
    return np.asarray((one.nis < one.low) | (one.nis > one.high))


def _stacked(
    sheet: Sheet,
    k: int,
    count: int,
    x: tuple[float, float],
    y: tuple[float, float],
    title: str,
    x_label: str,
    note: str,
    top: float = 20.0,
) -> Panel:
    """The k-th of several panels from above, with its frame; the last one carries the axis of time."""
    height = (sheet.height - top - _BOTTOM - (count - 1) * _GAP) / count
    bottom = _BOTTOM + (count - 1 - k) * (height + _GAP)
    panel = Panel(sheet, (_LEFT, bottom, sheet.width - _LEFT - _RIGHT, height), x, y)
    last = k == count - 1
    panel.frame(title, x_label if last else "", (7, 4), x_ticks=last, note=note)
    return panel


def _time(c: Calibration, t_s: Floats) -> tuple[Floats, tuple[float, float], str]:
    """Times since the run's start, the axis's limits, and its label."""
    every = [t for t in (c.trajectory.t_s, c.history.t_s, c.residuals.heading_t_s) if len(t)]
    start = float(min((t[0] for t in every), default=0.0))
    end = float(max((t[-1] for t in every), default=start + 1.0))
    (first, last), label = elapsed(np.array([start, end if end > start else start + 1.0]), start, end)
    return elapsed(t_s, start, end)[0], (float(first), float(last)), label


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


def _ranges(t: Floats, values: Floats, stretches: int) -> tuple[Floats, Floats, Floats]:
    """Lowest and highest value of each stretch, and the time of its middle: what a thinned cloud leaves out."""
    length = math.ceil(len(t) / stretches)
    first = np.arange(0, len(t), length)
    middle = t[np.minimum(first + length // 2, len(t) - 1)]
    return np.fmin.reduceat(values, first), np.fmax.reduceat(values, first), middle
