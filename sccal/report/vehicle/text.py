"""A vehicle on the terminal: its runs line by line, then the numbers of all of them, then what limits them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sccal.report.layout import in_columns, labelled, notice_lines, shortened, wrapped
from sccal.report.rows import effect_rows, parameter_rows
from sccal.report.run.text import parameter_table
from sccal.report.sentences import (
    LEARNT,
    fixes_line,
    headings_line,
    held_out_line,
    missing_line,
    outage_line,
    recoveries_line,
    reference_lines,
    unseen_in_all,
    unseen_line,
)
from sccal.results.calibration import Calibration, Estimate, Parameters, Status, VehicleCalibration
from sccal.results.numbers import duration, one_line, plain, short, value_and_sigma

REASONS_SHOWN = 8
NARROWEST_NAME = 12
"""Columns for the names of runs below which the table does without its last column, the verdict."""
_MARKS: dict[Status, str] = {"estimated": "", "unobserved": "?", "at_bound": "!", "held": "="}
_MARKS_MEAN = {"?": "? not observed", "!": "! at bound", "=": "= held"}


def vehicle_text(v: VehicleCalibration, width: int = 100) -> str:
    """Several runs: one line per run, then the vehicle."""
    chi2 = v.consistency_chi2_per_dof
    distance = plain(sum(c.drive.distance_m for c in v.runs))
    time = duration(sum(c.drive.duration_s for c in v.runs))
    notices = [("", n) for n in v.notices] + [(c.run, n) for c in v.runs for n in c.notices]
    lines = [
        *wrapped(str(v.verdict), width),
        "",
        *_run_table(v.runs, width),
        "",
        *wrapped(f"{v.vehicle.name}: {len(v.runs)} run{'' if len(v.runs) == 1 else 's'}, {time}, {distance} m", width),
        "",
        *parameter_table((*parameter_rows(v.parameters), *effect_rows(v.effects)), width),
        "",
        *labelled("runs", [] if chi2 is None else [f"agree to chi2 per dof {short(chi2, 3)} (1 is consistent)"], width),
        *labelled("fixes", [fixes_line(v.fit)], width),
        *labelled("heading", [headings_line(v.fit)], width),
        *labelled("filter", [recoveries_line(v.fit)], width),
        *labelled("drift", [held_out_line(v.held_out, v.outage.window_s), outage_line(v.outage)], width),
        *labelled("lacks", [missing_line(v.missing)], width),
        *labelled("judged", _judged_runs(v.runs), width),
        *labelled("unseen", [unseen_line(unseen_in_all([c.unseen for c in v.runs]))], width),
        *labelled("notices", notice_lines(notices, "the runs' calibration.json"), width),
    ]
    return "\n".join(lines) + "\n"


def _judged_runs(runs: Sequence[Calibration]) -> list[str]:
    lines = [f"{shortened(one_line(c.run), 40)}: {line}" for c in runs for line in reference_lines(c.against_reference)]
    if len(lines) > REASONS_SHOWN:
        lines[REASONS_SHOWN:] = [f"… and {len(lines) - REASONS_SHOWN} more in the runs' calibration.json"]
    return lines


def _run_table(runs: Sequence[Calibration], width: int) -> list[str]:
    header = ("R_right mm", "R_left mm", "track mm", "offset deg", "drift m", "verdict")
    cells = [(*_compact(c.parameters), _drift(c), c.verdict.level) for c in runs]
    columns = [_flush(column) for column in zip(header, *cells, strict=True)]
    room = width - _width_of(columns)
    if room < NARROWEST_NAME:
        columns = columns[:-1]
        room = max(width - _width_of(columns), 1)
    names = ("run", *(shortened(one_line(c.run), room) for c in runs))
    lines = in_columns(list(zip(names, *columns, strict=True)), "<>>>>><"[: 1 + len(columns)])
    statuses = {row.estimate.status for c in runs for row in parameter_rows(c.parameters)}
    legend = [_MARKS_MEAN[mark] for status, mark in _MARKS.items() if mark and status in statuses]
    legend.append(f"drift m: {LEARNT.removeprefix('drift ')}")
    lines.append(", ".join(legend))
    return [*lines, *_run_doubts(runs, width)]


def _run_doubts(runs: Sequence[Calibration], width: int) -> list[str]:
    """What limits the runs that are not good: each one's verdict, then what to do about it."""
    doubts = []
    for c in runs:
        name = shortened(one_line(c.run), 40)
        verdict = c.verdict
        if verdict.level != "good":
            doubts.append(f"{name}: {verdict}")
        doubts += [f"{name}: {row.name}: {row.reason}" for row in parameter_rows(c.parameters) if row.reason]
    lines = [""] if doubts else []
    for doubt in doubts[:REASONS_SHOWN]:
        lines += wrapped(doubt, width, "  ")
    if len(doubts) > REASONS_SHOWN:
        lines.append(f"  … and {len(doubts) - REASONS_SHOWN} more in the runs' calibration.json")
    return lines


def _compact(parameters: Parameters) -> tuple[str, ...]:
    """``80.83 ±0.12``: lengths in mm, so that four of them and a name fit 80 columns."""
    return tuple(_marked(row.estimate, 1e3 if row.unit == "m" else 1.0) for row in parameter_rows(parameters))


def _marked(estimate: Estimate, scale: float) -> str:
    if estimate.status == "unobserved":
        return _MARKS["unobserved"]
    value, sigma = value_and_sigma(scale * estimate.value, scale * estimate.sigma)
    return f"{value} ±{sigma}{_MARKS[estimate.status]}"


def _drift(c: Calibration) -> str:
    return "-" if c.outage.end_rms_m is None else plain(c.outage.end_rms_m, 2)


def _flush(column: Sequence[str]) -> list[str]:
    """A blank in place of each absent mark, so that the digits stand below each other."""
    marks = tuple(_MARKS_MEAN)
    if not any(cell.endswith(marks) for cell in column):
        return list(column)
    return [cell if cell.endswith(marks) else f"{cell} " for cell in column]


def _width_of(columns: Iterable[Sequence[str]]) -> int:
    return sum(2 + max(map(len, column)) for column in columns)
