"""index.html: a batch on one self-contained page. What a fleet's keeper must know comes first."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import quote

import numpy as np

from sccal import __version__
from sccal.report.fleet.figures import control_chart, path_strokes
from sccal.report.fleet.lines import (
    LEVEL_MARKS,
    DisplayedParameter,
    chart_line,
    day,
    displayed,
    headline,
    total_line,
    vehicle_line,
    versions_line,
)
from sccal.report.page import page
from sccal.report.rows import STATUS_WORDS
from sccal.results.calibration import PARAMETERS, VEHICLE_RUN, Estimate
from sccal.results.gates import GateResult
from sccal.results.numbers import duration, one_line, plain
from sccal.results.summary import Chart, RunLine, Summary, VehicleSummary

MOST_FIGURES = 12
"""Vehicles whose charts are drawn: those that change first, then those with most runs."""
MOST_PATHS = 1000
MOST_EFFECT_COLUMNS = 6
_STATUS_WORDS: Mapping[str, str] = {str(status): words for status, words in STATUS_WORDS.items()}


@dataclass(frozen=True)
class Cell:
    """One cell of the table of runs; ``key`` is what it is sorted by, empty where nothing is known."""

    text: str
    key: str
    tag: str = ""
    """The status of a parameter that was not estimated."""


@dataclass(frozen=True)
class TableRow:
    """One run."""

    name: str
    link: str
    cells: tuple[Cell, ...]
    level: str
    mark: str
    why: str
    """Empty where the verdict is good."""
    warnings: int


@dataclass(frozen=True)
class SmallPath:
    """One of the small multiples."""

    name: str
    link: str
    strokes: str
    extent: str
    level: str
    mark: str


@dataclass(frozen=True)
class ChartPart:
    """One parameter of a vehicle: its chart, and what stands below it."""

    name: str
    value: str
    says: str
    change: str
    svg: str


@dataclass(frozen=True)
class VehiclePart:
    """One vehicle's section."""

    label: str
    line: str
    link: str
    charts: tuple[ChartPart, ...]
    without: tuple[tuple[str, str], ...]
    drawn: bool


@dataclass(frozen=True)
class GateLine:
    """One gate over the batch; the runs that failed it."""

    expression: str
    counts: str
    level: str
    failed: tuple[str, ...]


def index_html(summary: Summary) -> str:
    """The page; it links to each run's own page, ``<run>/report.html``."""
    columns = _columns(summary)
    many = len(summary.vehicles) > 1
    t = summary.totals
    return page(
        "index.html.j2",
        verdict=headline(summary),
        total=total_line(t),
        counts=[
            (mark, level, count)
            for (level, mark), count in zip(LEVEL_MARKS.items(), (t.good, t.partial, t.doubtful, t.failed), strict=True)
        ],
        gates=_gates(summary.gates),
        vehicles=[_vehicle(vehicle, rank < MOST_FIGURES) for rank, vehicle in enumerate(_ranked(summary.vehicles))],
        headers=[
            *(["vehicle"] if many else []),
            "started",
            "duration",
            "distance (m)",
            *(f"{column.name} ({column.unit})" if column.unit else column.name for column in columns),
            "drift without fixes (m)",
            "drift (%)",
        ],
        text_columns=1 + many + 1,
        rows=[_row(run, columns, many) for run in summary.runs],
        window=_window(summary.runs),
        paths=[_small(run) for run in summary.runs[:MOST_PATHS] if len(run.path.east_m) > 1],
        paths_left=max(len(summary.runs) - MOST_PATHS, 0),
        failures=[(one_line(failure.run), one_line(failure.reason), failure.exit_code) for failure in summary.failures],
        versions=versions_line(summary.runs),
        version=__version__,
    )  # fmt: skip


def _columns(summary: Summary) -> list[DisplayedParameter]:
    effects = Counter(
        f"{effect}.{name}" for run in summary.runs for effect, named in run.effects.items() for name in named
    )
    return [displayed(key) for key in (*PARAMETERS, *list(effects)[:MOST_EFFECT_COLUMNS])]


def _row(run: RunLine, columns: Sequence[DisplayedParameter], with_vehicle: bool) -> TableRow:
    effects = {
        f"{effect}.{name}": estimate for effect, named in run.effects.items() for name, estimate in named.items()
    }
    estimates = {**run.parameters, **effects}
    return TableRow(
        name=one_line(run.run),
        link=_link(run.run),
        cells=(
            *([Cell(one_line(run.vehicle), one_line(run.vehicle))] if with_vehicle else []),
            Cell(day(run.started), run.started or ""),
            Cell(duration(run.duration_s), _key(run.duration_s)),
            Cell(plain(run.distance_m), _key(run.distance_m)),
            *(_estimate(column, estimates.get(column.key)) for column in columns),
            Cell("–" if run.outage.end_rms_m is None else plain(run.outage.end_rms_m, 2), _key(run.outage.end_rms_m)),
            Cell(
                "–" if run.outage.percent_of_distance is None else plain(run.outage.percent_of_distance, 2),
                _key(run.outage.percent_of_distance),
            ),
        ),
        level=run.verdict.level,
        mark=LEVEL_MARKS[run.verdict.level],
        why="" if run.verdict.level == "good" else one_line("; ".join(run.verdict.because)),
        warnings=len(run.warnings),
    )


def _estimate(column: DisplayedParameter, estimate: Estimate | None) -> Cell:
    if estimate is None:
        return Cell("–", "")
    tag = "" if estimate.status == "estimated" else _STATUS_WORDS.get(estimate.status, one_line(estimate.status))
    known = estimate.status != "unobserved"
    return Cell(column.text(estimate), _key(column.factor * estimate.value) if known else "", tag)


def _key(number: float | None) -> str:
    return "" if number is None or not math.isfinite(number) else f"{number:.8g}"


def _small(run: RunLine) -> SmallPath:
    extent = f"{plain(float(np.ptp(run.path.east_m)), 2)} × {plain(float(np.ptp(run.path.north_m)), 2)} m"
    level = run.verdict.level
    return SmallPath(one_line(run.run), _link(run.run), path_strokes(run.path), extent, level, LEVEL_MARKS[level])


def _vehicle(vehicle: VehicleSummary, drawn: bool) -> VehiclePart:
    stem = None if vehicle.file is None else vehicle.file.removesuffix(".json")
    return VehiclePart(
        label=one_line(vehicle.label),
        line=vehicle_line(vehicle),
        link="" if stem is None or vehicle.runs < 2 else "./" + quote(f"{stem}.html", errors="replace"),
        charts=tuple(_chart(vehicle, chart, drawn) for chart in vehicle.charts),
        without=tuple((displayed(one.key).name, one_line(one.reason)) for one in vehicle.no_charts),
        drawn=drawn,
    )


def _chart(vehicle: VehicleSummary, chart: Chart, drawn: bool) -> ChartPart:
    parameter = displayed(chart.key)
    shared = vehicle.parameters.get(chart.key)
    value = ""
    if shared is not None and shared.status == "estimated":
        value = f"{parameter.text(shared)} {parameter.unit} over all runs"
    return ChartPart(
        name=parameter.name,
        value=value,
        says=chart_line(chart),
        change="" if chart.trend is None else chart.trend.sentence,
        svg=control_chart(vehicle.label, chart) if drawn else "",
    )


def _ranked(vehicles: Sequence[VehicleSummary]) -> list[VehicleSummary]:
    """What changes first, then what has most runs."""

    def rank(vehicle: VehicleSummary) -> tuple[int, int]:
        return -sum(chart.trend is not None for chart in vehicle.charts), -vehicle.runs

    return sorted(vehicles, key=rank)


def _gates(gates: Sequence[GateResult]) -> list[GateLine]:
    lines = []
    for expression in dict.fromkeys(gate.expression for gate in gates):
        its = [gate for gate in gates if gate.expression == expression]
        counted = Counter(gate.outcome for gate in its)
        failed = tuple(
            f"{one_line(gate.vehicle if gate.run == VEHICLE_RUN else gate.run)}: {one_line(gate.reason)}"
            for gate in its
            if gate.outcome == "failed"
        )
        level = "failed" if failed else "passed" if counted["passed"] else "skipped"
        counts = ", ".join(
            f"{counted[outcome]} {outcome}" for outcome in ("passed", "failed", "skipped") if counted[outcome]
        )
        lines.append(GateLine(one_line(expression), counts, level, failed))
    return lines


def _window(runs: Sequence[RunLine]) -> str:
    windows = {run.outage.window_s for run in runs if run.outage.window_s is not None and run.outage.windows}
    return f"after {plain(windows.pop(), 2)} s" if len(windows) == 1 else "at the end of the windows"


def _link(run: str) -> str:
    return "./" + quote(run, errors="replace") + "/report.html"
