"""summary.csv: one row a run, also for those that gave no result; RFC 4180, for spreadsheets and data frames.

A spreadsheet takes a cell that begins with ``=``, ``+``, ``-`` or ``@`` for a formula. Texts from outside that begin so
get an apostrophe in front, which a spreadsheet reads as "this is text" (CWE-1236); numbers stay as they are.
"""

from __future__ import annotations

import csv
import io
import math

from sccal.results.calibration import PARAMETERS, Estimate, Fit
from sccal.results.converter import document_of, entries_of
from sccal.results.summary import FailedRun, RunLine, Summary

FORMULA_MARKS = ("=", "+", "-", "@", "\t", "\r", "\n", "\0", "＝", "＋", "－", "＠")
_FIRST = ("run", "vehicle", "started", "verdict", "duration_s", "distance_m")
_OUTAGE = (
    "outage_window_s",
    "outage_windows",
    "outage_rms_m",
    "outage_end_rms_m",
    "outage_percent_of_distance",
)
_LAST = ("warnings", "exit_code", "reason")

Cell = str | float | int | None


def summary_csv(summary: Summary) -> str:
    """Lengths in m, angles in degrees; an empty cell is a number that is not there.

    Of every parameter the value, ``<key>_sigma`` and ``<key>_status``. ``reason`` comes last: why there is no result,
    or what the verdict rests on.
    """
    keys = [*PARAMETERS, *dict.fromkeys(key for run in summary.runs for key in _effects(run))]
    fit = [one.key for one in entries_of(Fit)] if summary.runs else []
    header = [
        *_FIRST,
        *(name for key in keys for name in (key, f"{key}_sigma", f"{key}_status")),
        *fit,
        *_OUTAGE,
        *_LAST,
    ]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\r\n")
    writer.writerow([_text(name) for name in header])
    for run in summary.runs:
        writer.writerow([_cell(cell) for cell in _run(run, keys)])
    for failed in summary.failures:
        writer.writerow([_cell(cell) for cell in _failed(failed, len(header))])
    return buffer.getvalue()


def _run(run: RunLine, keys: list[str]) -> list[Cell]:
    estimates = {**run.parameters, **_effects(run)}
    cells: list[Cell] = [run.run, run.vehicle, run.started, run.verdict.level, run.duration_s, run.distance_m]
    for key in keys:
        one = estimates.get(key)
        cells += [None, None, None] if one is None else [one.value, one.sigma, one.status]
    cells += document_of(run.fit).values()
    o = run.outage
    cells += [o.window_s, o.count, o.rms_m, o.end_rms_m, o.percent_of_distance]
    return [*cells, len(run.warnings), 0, "; ".join(run.verdict.because)]


def _failed(failed: FailedRun, columns: int) -> list[Cell]:
    first: list[Cell] = [failed.run, None, None, "failed"]
    return [*first, *[None] * (columns - len(first) - 2), failed.exit_code, failed.reason]


def _effects(run: RunLine) -> dict[str, Estimate]:
    return {f"{effect}.{name}": estimate for effect, named in run.effects.items() for name, estimate in named.items()}


def _cell(cell: Cell) -> str:
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return ""
    return _text(cell) if isinstance(cell, str) else repr(cell)


def _text(text: str) -> str:
    encodable = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return f"'{encodable}" if encodable.startswith(FORMULA_MARKS) else encodable
