"""From many results to one summary; each trajectory is thinned while it is read from its file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from sccal.errors import Failure
from sccal.logs.names import natural_key
from sccal.results.calibration import Calibration, VehicleCalibration
from sccal.results.summary import Chart, FailedRun, NoChart, RunLine, Summary, ThinPath, Totals, VehicleSummary
from sccal.summary.charts import DatedRun, charts_of, dated
from sccal.summary.paths import thin_path
from sccal.summary.trends import significant

MOST_CORNERS = 160
"""Of one path."""
CORNERS_IN_ALL = 100_000
"""Of all paths; what keeps a page of a thousand runs small."""
_Stored = tuple[str, VehicleCalibration]
"""A file's name and what stands in it."""
_Members = tuple[_Stored | None, list[DatedRun]]


def summarise(
    runs: Sequence[Calibration], vehicles: Mapping[str, VehicleCalibration], failures: Sequence[Failure], out: Path
) -> Summary:
    """The summary of a batch: runs, vehicles by the names of their files in ``out``, and what gave no result.

    A run belongs to the vehicle whose file names it, else to those of the same name. Runs and failures come out in
    the order of their names, whatever the order in which they were done.
    """
    ordered = [dated(run) for run in sorted(runs, key=lambda run: natural_key(PurePosixPath(run.run)))]
    members = _by_vehicle(ordered, vehicles)
    label_of = {run.run.run: label for label, (_, its_runs) in members.items() for run in its_runs}
    most = max(8, min(MOST_CORNERS, CORNERS_IN_ALL // max(len(ordered), 1)))
    lines = tuple(_line(run, label_of[run.run.run], thin_path(out / run.run.run, most)) for run in ordered)
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


def _by_vehicle(runs: Sequence[DatedRun], vehicles: Mapping[str, VehicleCalibration]) -> dict[str, _Members]:
    """By a label of each vehicle: its file and its runs."""
    groups: list[tuple[str, _Stored | None, list[DatedRun]]] = []
    of_run: dict[str, int] = {}
    for file, vehicle in sorted(vehicles.items(), key=lambda stored: (stored[1].vehicle.name, stored[0])):
        of_run |= {one.run: len(groups) for one in vehicle.runs}
        groups.append((vehicle.vehicle.name, (file, vehicle), []))
    without_file: dict[str, int] = {}
    for run in runs:
        place = of_run.get(run.run.run)
        if place is None:
            name = run.run.vehicle.name
            place = without_file.setdefault(name, len(groups))
            if place == len(groups):
                groups.append((name, None, []))
        groups[place][2].append(run)
    labelled: dict[str, _Members] = {}
    for name, stored, its_runs in groups:
        count, label = 1, name
        while label in labelled:
            count += 1
            label = f"{name} ({count})"
        labelled[label] = stored, its_runs
    return labelled


def _told(charts: Sequence[Chart]) -> dict[int, Chart]:
    """By identity: charts whose trend is not told, without it."""
    tested = [chart for chart in charts if chart.trend is not None]
    holds = significant([chart.trend.p_value for chart in tested if chart.trend is not None])
    return {id(chart): replace(chart, trend=None) for chart, kept in zip(tested, holds, strict=True) if not kept}


def _vehicle(
    label: str, stored: _Stored | None, runs: int, charts: Sequence[Chart], no_charts: Sequence[NoChart]
) -> VehicleSummary:
    return VehicleSummary(
        label=label,
        file=None if stored is None else stored[0],
        verdict=None if stored is None else stored[1].verdict,
        parameters={} if stored is None else stored[1].parameters.by_key,
        runs=runs,
        charts=tuple(charts),
        no_charts=tuple(no_charts),
    )


def _line(dated_run: DatedRun, vehicle: str, path: ThinPath) -> RunLine:
    run = dated_run.run
    return RunLine(
        run=run.run,
        vehicle=vehicle,
        started=dated_run.started,
        verdict=run.verdict,
        duration_s=run.drive.duration_s,
        distance_m=run.drive.distance_m,
        parameters=run.parameters.by_key,
        effects=run.effects,
        fit=run.fit,
        outage=run.outage,
        warnings=tuple(str(notice) for notice in run.notices if notice.severity == "warning"),
        inputs=() if run.provenance is None else run.provenance.inputs,
        versions={} if run.provenance is None else run.provenance.versions,
        path=path,
    )


def _totals(lines: Sequence[RunLine], failed: int) -> Totals:
    levels = [line.verdict.level for line in lines]
    return Totals(
        runs=len(lines) + failed,
        good=levels.count("good"),
        partial=levels.count("partial"),
        doubtful=levels.count("doubtful"),
        failed=failed,
        duration_s=math.fsum(line.duration_s for line in lines),
        distance_m=math.fsum(line.distance_m for line in lines),
    )
