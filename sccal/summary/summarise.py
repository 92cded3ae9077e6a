"""From the files of many results to one summary; each trajectory is thinned while it is read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

from sccal.errors import Failure
from sccal.logs.names import natural_key
from sccal.results.saved import Saved
from sccal.results.summary import Chart, FailedRun, NoChart, Outage, RunLine, Summary, Totals, VehicleSummary
from sccal.summary.charts import DatedRun, charts_of, dated
from sccal.summary.paths import thin_path
from sccal.summary.trends import significant

MOST_CORNERS = 160
"""Of one path."""
CORNERS_IN_ALL = 100_000
"""Of all paths; what keeps a page of a thousand runs small."""


def summarise(runs: Sequence[Saved], vehicles: Sequence[Saved], failures: Sequence[Failure]) -> Summary:
    """The summary of a batch: results of runs and of vehicles as read again, and what gave no result.

    A run belongs to the vehicle whose file names it, else to those of the same name. Runs and failures come out in
    the order of their names, whatever the order in which they were done.
    """
    ordered = [dated(saved) for saved in sorted(runs, key=lambda saved: natural_key(PurePosixPath(saved.run)))]
    members = _by_vehicle(ordered, vehicles)
    label_of = {run.saved.run: label for label, (_, its_runs) in members.items() for run in its_runs}
    most = max(8, min(MOST_CORNERS, CORNERS_IN_ALL // max(len(ordered), 1)))
    lines = tuple(_line(run, label_of[run.saved.run], most) for run in ordered)
    charts = {label: charts_of(its_runs) for label, (_, its_runs) in members.items()}
    told = _told([chart for made, _ in charts.values() for chart in made])
    return Summary(
        runs=lines,
        failures=tuple(
            sorted(
                (FailedRun(one.name, str(one.error), int(one.error.exit_code)) for one in failures),
                key=lambda failed: natural_key(PurePosixPath(failed.run)),
            )
        ),
        vehicles=tuple(
            _vehicle(label, file, len(its_runs), [told.get(id(chart), chart) for chart in charts[label][0]],
                     charts[label][1])
            for label, (file, its_runs) in members.items()
        ),
        totals=_totals(lines, len(failures)),
    )  # fmt: skip


def _by_vehicle(runs: Sequence[DatedRun], vehicles: Sequence[Saved]) -> dict[str, tuple[Saved | None, list[DatedRun]]]:
    """By a label of each vehicle: its file and its runs."""
    groups: list[tuple[str, Saved | None, list[DatedRun]]] = []
    of_run: dict[str, int] = {}
    for file in sorted(vehicles, key=lambda saved: (saved.vehicle, saved.path.name)):
        of_run.update({str(one.get("run")): len(groups) for one in file.document.get("runs") or []})
        groups.append((file.vehicle, file, []))
    without_file: dict[str, int] = {}
    for run in runs:
        place = of_run.get(run.saved.run)
        if place is None:
            place = without_file.setdefault(run.saved.vehicle, len(groups))
            if place == len(groups):
                groups.append((run.saved.vehicle, None, []))
        groups[place][2].append(run)
    labelled: dict[str, tuple[Saved | None, list[DatedRun]]] = {}
    for name, its_file, its_runs in groups:
        count, label = 1, name
        while label in labelled:
            count += 1
            label = f"{name} ({count})"
        labelled[label] = its_file, its_runs
    return labelled


def _told(charts: Sequence[Chart]) -> dict[int, Chart]:
    """By identity: charts whose trend is not told, without it."""
    tested = [chart for chart in charts if chart.trend is not None]
    holds = significant([chart.trend.p_value for chart in tested if chart.trend is not None])
    return {id(chart): replace(chart, trend=None) for chart, kept in zip(tested, holds, strict=True) if not kept}


def _vehicle(
    label: str, file: Saved | None, runs: int, charts: Sequence[Chart], no_charts: Sequence[NoChart]
) -> VehicleSummary:
    return VehicleSummary(
        label=label,
        file=None if file is None else file.path.name,
        verdict="" if file is None else file.verdict,
        parameters={} if file is None else file.parameters,
        runs=runs,
        charts=tuple(charts),
        no_charts=tuple(no_charts),
    )


def _line(run: DatedRun, vehicle: str, most_corners: int) -> RunLine:
    document = run.saved.document
    drive, outage = _block(document, "drive"), _block(document, "outage")
    provenance = _block(document, "provenance")
    windows = _finite(outage.get("windows"))
    return RunLine(
        run=run.saved.run,
        vehicle=vehicle,
        started=run.started,
        level=run.saved.verdict.partition(":")[0],
        verdict=run.saved.verdict,
        duration_s=_finite(drive.get("duration_s")),
        distance_m=_finite(drive.get("distance_m")),
        parameters=run.saved.parameters,
        effects=run.saved.effects,
        fit=_block(document, "fit"),
        outage=Outage(
            window_s=_finite(outage.get("window_s")),
            windows=0 if windows is None else int(windows),
            rms_m=_finite(outage.get("rms_m")),
            end_rms_m=_finite(outage.get("end_rms_m")),
            percent_of_distance=_finite(outage.get("percent_of_distance")),
        ),
        warnings=tuple(
            str(notice.get("text", ""))
            for notice in document.get("notices") or []
            if notice.get("severity") == "warning"
        ),
        inputs=tuple((str(one.get("name")), str(one.get("sha256"))) for one in provenance.get("inputs") or []),
        versions={str(name): str(version) for name, version in _block(provenance, "versions").items()},
        path=thin_path(run.saved, most_corners),
    )


def _totals(lines: Sequence[RunLine], failed: int) -> Totals:
    levels = [line.level for line in lines]
    return Totals(
        runs=len(lines) + failed,
        good=levels.count("good"),
        partial=levels.count("partial"),
        doubtful=len(levels) - levels.count("good") - levels.count("partial"),
        failed=failed,
        duration_s=math.fsum(line.duration_s or 0.0 for line in lines),
        distance_m=math.fsum(line.distance_m or 0.0 for line in lines),
    )


def _block(document: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    block = document.get(key)
    return block if isinstance(block, Mapping) else {}


def _finite(number: object) -> float | None:
    return float(number) if isinstance(number, int | float) and math.isfinite(number) else None
