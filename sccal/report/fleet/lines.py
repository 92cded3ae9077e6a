"""What the page of a batch says in words: a sentence for each change, a line for each chart, the headline."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from sccal.report.rows import effect_rows
from sccal.results.calibration import Estimate
from sccal.results.numbers import duration, one_line, plain, value_and_sigma
from sccal.results.summary import Chart, RunLine, Summary, Totals, Trend, VehicleSummary

LEVEL_MARKS = {"good": "✓", "partial": "◐", "doubtful": "▲", "failed": "✕"}
"""A verdict is told by more than its colour."""
ROUGH_BELOW = 20
"""Runs below which the limits of a chart are told to be rough."""

BY_NAME = "(in the order of their names, for want of dates)"


@dataclass(frozen=True)
class DisplayedParameter:
    """How a parameter is shown: lengths of the model in mm, where their sigmas have readable digits."""

    key: str
    name: str
    unit: str
    factor: float
    """From the file's unit to the one shown."""

    def text(self, estimate: Estimate) -> str:
        """Value ± sigma without unit, rounded together; ``–`` where it is only the prior."""
        if estimate.status == "unobserved" or not math.isfinite(estimate.value):
            return "–"
        value, sigma = value_and_sigma(self.factor * estimate.value, self.factor * estimate.sigma)
        return f"{value} ± {sigma}"


@dataclass(frozen=True)
class FleetHeadline:
    """What stands at the top of the page."""

    level: str
    because: tuple[str, ...]


_OF_MODEL = {
    "radius_right_m": DisplayedParameter("radius_right_m", "right radius", "mm", 1e3),
    "radius_left_m": DisplayedParameter("radius_left_m", "left radius", "mm", 1e3),
    "track_m": DisplayedParameter("track_m", "track", "mm", 1e3),
    "heading_offset_deg": DisplayedParameter("heading_offset_deg", "heading offset", "deg", 1.0),
}


def displayed(key: str) -> DisplayedParameter:
    """Of a chart's key: one of the model's four, or an effect, a dot and a parameter."""
    if key in _OF_MODEL:
        return _OF_MODEL[key]
    effect, _, parameter = key.partition(".")
    row = effect_rows({effect: {parameter: Estimate(0.0, 0.0, "estimated")}})[0]
    return DisplayedParameter(key, one_line(row.name), row.unit, 1.0)


def with_sentences(summary: Summary) -> Summary:
    """The summary with every change told in words."""

    def told(vehicle: str, chart: Chart) -> Chart:
        if chart.trend is None:
            return chart
        return replace(chart, trend=replace(chart.trend, sentence=change_sentence(vehicle, chart)))

    return replace(
        summary,
        vehicles=tuple(
            replace(vehicle, charts=tuple(told(vehicle.label, chart) for chart in vehicle.charts))
            for vehicle in summary.vehicles
        ),
    )


def changes(summary: Summary) -> list[str]:
    """One sentence for each parameter that changes, vehicle by vehicle."""
    charts = (chart for vehicle in summary.vehicles for chart in vehicle.charts)
    return [chart.trend.sentence for chart in charts if chart.trend is not None]


def change_sentence(vehicle: str, chart: Chart) -> str:
    """``The left radius of robot-7 has been shrinking since 2026-05-03: -0.40 ± 0.07 mm in 60 days (5.7 sigma, …).``"""
    trend = chart.trend
    assert trend is not None
    parameter = displayed(chart.key)
    subject = f"The {parameter.name} of {one_line(vehicle)}"
    change = _change(trend, parameter)
    sure = f"({plain(abs(trend.change) / trend.sigma, 2)} sigma, {int((~chart.set_aside).sum())} runs)"
    if trend.shape == "step":
        before, after = _moments(chart, trend)
        order = "" if chart.by_date else f" {BY_NAME}"
        return f"{subject} changed between {before} and {after} by {change} {sure}{order}."
    lengths = parameter.unit in ("mm", "m")
    falls = trend.change < 0.0
    verb = ("shrinking" if falls else "growing") if lengths else ("falling" if falls else "rising")
    since, until = _moments(chart, trend)
    onset = f" was steady until {since}, and" if trend.shape == "onset" else ""
    time = "since" if trend.shape == "onset" else f"since {since}"
    if chart.by_date:
        return f"{subject}{onset} has been {verb} {time}: {change} in {_span(trend.days)} {sure}."
    return f"{subject}{onset} has been {verb} {time}: {change} until {until} {sure} {BY_NAME}."


def headline(summary: Summary) -> FleetHeadline:
    """The changes first, then what failed; and what could not be asked."""
    told = changes(summary)
    charts = sum(len(vehicle.charts) for vehicle in summary.vehicles)
    failed = f"{_count(summary.totals.failed, 'run')} gave no result; the reasons stand below."
    also = [failed] if summary.totals.failed else []
    if told:
        return FleetHeadline(f"changing: {_count(len(told), 'parameter')}", (*told, *also))
    if not summary.runs:
        return FleetHeadline("no results", tuple(also) or ("There was no run.",))
    if charts:
        tested = sum(chart.tested for vehicle in summary.vehicles for chart in vehicle.charts)
        steady = (
            f"No parameter changes over the runs beyond what chance explains ({_count(tested, 'chart')} looked at)."
        )
        few = "A chart needs 5 runs at different times to show a change; none has them."
        return FleetHeadline("steady" if tested else "too few runs", (steady if tested else few, *also))
    return FleetHeadline("too few runs", ("No parameter has enough runs for a chart over time.", *also))


def chart_line(chart: Chart) -> str:
    """Centre, scatter, runs outside, and what did not take part."""
    parameter = displayed(chart.key)
    outside = [run for run, out in zip(chart.runs, chart.outside, strict=True) if out]
    parts = [_count(len(chart.runs), "run")]
    if chart.left_out:
        parts.append(f"{chart.left_out} without an estimate" + (" or a date" if chart.by_date else ""))
    if not chart.by_date:
        parts.append("in the order of their names, for want of dates")
    parts.append(
        f"scatter between runs {plain(parameter.factor * chart.scatter, 2)} {parameter.unit}"
        if chart.scatter
        else "their own sigmas explain the scatter"
    )
    if outside:
        parts.append(f"outside: {_names(outside)}")
    if len(chart.runs) < ROUGH_BELOW:
        parts.append("rough limits")
    return "; ".join(parts)


def total_line(totals: Totals) -> str:
    """How many runs, how long, how far."""
    return f"{_count(totals.runs, 'run')} · {duration(totals.duration_s)} · {plain(totals.distance_m)} m"


def versions_line(runs: Iterable[RunLine]) -> str:
    """What computed the runs; where it differs between them, for how many."""
    counted = Counter(", ".join(f"{name} {version}" for name, version in run.versions.items()) for run in runs)
    counted.pop("", None)
    if len(counted) == 1:
        return one_line(next(iter(counted)))
    return "; ".join(f"{_count(count, 'run')} by {one_line(text)}" for text, count in sorted(counted.items()))


def vehicle_line(vehicle: VehicleSummary) -> str:
    """Its runs and its verdict."""
    return _count(vehicle.runs, "run") + (f" · {one_line(str(vehicle.verdict))}" if vehicle.verdict else "")


def day(started: str | None) -> str:
    """The date of an ISO time; ``–`` without."""
    return "–" if started is None else started[:10]


def _moments(chart: Chart, trend: Trend) -> tuple[str, str]:
    if not chart.by_date:
        return one_line(chart.runs[trend.before]), one_line(chart.runs[trend.after])
    before, after = chart.started[trend.before], chart.started[trend.after]
    if day(before) != day(after):
        return day(before), day(after)
    return _minute(before), _minute(after)


def _minute(started: str | None) -> str:
    return "–" if started is None else datetime.fromisoformat(started).strftime("%Y-%m-%d %H:%M")


def _span(days: float | None) -> str:
    if days is None:
        return ""
    return f"{days:.0f} days" if days >= 2.0 else duration(86400.0 * days)


def _change(trend: Trend, parameter: DisplayedParameter) -> str:
    value, sigma = value_and_sigma(parameter.factor * trend.change, parameter.factor * trend.sigma)
    return f"{'' if value.startswith('-') else '+'}{value} ± {sigma} {parameter.unit}".rstrip()


def _names(runs: Sequence[str], most: int = 4) -> str:
    listed = ", ".join(one_line(run) for run in runs[:most])
    return listed + (f" and {len(runs) - most} more" if len(runs) > most else "")


def _count(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
