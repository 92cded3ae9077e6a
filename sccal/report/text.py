"""What the terminal shows: the verdict, then the numbers, then what limits them. Plain text, 80 columns and more."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence

from sccal.logs.streams import Notice
from sccal.report.rows import Row, effect_rows, parameter_rows
from sccal.report.summary import (
    LEARNT,
    clock_line,
    drive_line,
    fixes_line,
    headings_line,
    held_out_line,
    missing_line,
    noise_facts,
    notice_text,
    outage_line,
    recoveries_line,
    reference_lines,
    unseen_in_all,
    unseen_line,
)
from sccal.results.calibration import Calibration, Estimate, Parameters, Status, VehicleCalibration
from sccal.results.noise import Noise
from sccal.results.numbers import duration, one_line, plain, short, value_and_sigma

NOTICES_SHOWN = 5
REASONS_SHOWN = 8
NARROWEST_NAME = 12
"""Columns for the names of runs below which the table does without its last column, the verdict."""
_LABEL = 9
NUMBER_AND_UNIT = re.compile(r"(\d) (?=(?:m|m/s|s|ms|deg|ppm|%|min|h|windows?|runs?)(?:\W|$))")
_SIGN_AND_NUMBER = re.compile(r"(?<=[±σ=]) (?=[=\d])")
_MARKS: dict[Status, str] = {"estimated": "", "unobserved": "?", "at_bound": "!", "held": "="}
_MARKS_MEAN = {"?": "? not observed", "!": "! at bound", "=": "= held"}


def run_text(c: Calibration, width: int = 100) -> str:
    """One run in full."""
    lines = [
        *wrapped(str(c.verdict), width),
        "",
        *wrapped(f"{c.run} ({c.vehicle.name}): {drive_line(c.drive)}", width),
        "",
        *_parameter_table((*parameter_rows(c.parameters), *effect_rows(c.effects)), width),
        "",
        *labelled("fixes", [fixes_line(c.fit)], width),
        *labelled("heading", [headings_line(c.fit)], width),
        *labelled("filter", [recoveries_line(c.fit)], width),
        *labelled("drift", [held_out_line(c.held_out, c.outage.window_s), outage_line(c.outage)], width),
        *labelled("lacks", [missing_line(c.missing)], width),
        *labelled("judged", reference_lines(c.against_reference), width),
        *labelled("unseen", [unseen_line(c.unseen)], width),
        *labelled("noise", _noise(c.noise), width),
        *labelled("clock", [clock_line(c.clock)], width),
        *labelled("notices", notice_lines([("", n) for n in c.notices], "calibration.json"), width),
    ]
    return "\n".join(lines) + "\n"


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
        *_parameter_table((*parameter_rows(v.parameters), *effect_rows(v.effects)), width),
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


def _parameter_table(rows: Sequence[Row], width: int) -> list[str]:
    header = ("parameter", "value", "", "unit", "nominal", "change", "status")
    cells = [
        (
            row.name,
            row.value,
            f"± {row.sigma}" if row.sigma else "",
            row.unit,
            row.nominal or "-",
            row.change or "-",
            row.status,
        )
        for row in rows
    ]
    lines = in_columns([header, *cells], "<><<>><")
    reasons = [(row.name, row.reason) for row in rows if row.reason]
    if reasons:
        lines.append("")
    for name, reason in reasons:
        lines += wrapped(f"{name}: {reason}", width, "  ")
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


def shortened(name: str, room: int) -> str:
    """Cut in the middle: runs in one folder differ at the end, folders at the beginning."""
    if len(name) <= room:
        return name
    head = (room - 1) // 3 if room >= 16 else 0
    return f"{name[:head]}…{name[len(name) - (room - 1 - head) :]}"


def notice_lines(notices: Iterable[tuple[str, Notice]], rest_in: str) -> list[str]:
    """One line each, of (run or empty, notice); warnings first, the surplus by its number and where it stands."""
    ordered = sorted(notices, key=lambda pair: pair[1].severity != "warning")
    lines = [
        ("warning: " if notice.severity == "warning" else "")
        + (f"{shortened(one_line(run), 40)}: " if run else "")
        + notice_text(notice)
        for run, notice in ordered
    ]
    shown = lines[:NOTICES_SHOWN]
    if len(lines) > NOTICES_SHOWN:
        shown.append(f"… and {len(lines) - NOTICES_SHOWN} more in {rest_in}")
    return shown


def _noise(noise: Noise) -> list[str]:
    *facts, (_, source) = noise_facts(noise)
    return [", ".join(f"{subject} {fact}" for subject, fact in facts) + f" ({source})"]


def in_columns(table: Sequence[Sequence[str]], alignment: str) -> list[str]:
    """Cells padded to their column, two blanks between columns; ``<`` left, ``>`` right."""
    widths = [max(len(row[i]) for row in table) for i in range(len(alignment))]
    return [
        "  ".join(
            cell.ljust(size) if side == "<" else cell.rjust(size)
            for cell, size, side in zip(row, widths, alignment, strict=True)
        ).rstrip()
        for row in table
    ]


def labelled(label: str, texts: Iterable[str], width: int) -> list[str]:
    """A paragraph for each text that is not empty, the label in the margin of the first."""
    lines = [line for text in texts if text for line in wrapped(text, width, " " * _LABEL)]
    if lines:
        lines[0] = label.ljust(_LABEL) + lines[0][_LABEL:]
    return lines


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Broken between words, but never between a number and its unit."""
    glued = NUMBER_AND_UNIT.sub("\\1\u00a0", one_line(text))
    lines = textwrap.wrap(
        glued,
        width,
        initial_indent=indent,
        subsequent_indent=indent + "  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace("\u00a0", " ") for line in lines]


def sentence(text: str, stop: bool = True) -> str:
    """With a capital at the beginning and a full stop at the end; names of effects keep their small letters."""
    text = one_line(text)
    first = text.partition(" ")[0]
    if text and "_" not in first and "~" not in first:
        text = text[0].upper() + text[1:]
    text = _SIGN_AND_NUMBER.sub("\u00a0", NUMBER_AND_UNIT.sub("\\1\u00a0", text))
    return text if not stop or not text or text[-1] in ".!?…" else f"{text}."
