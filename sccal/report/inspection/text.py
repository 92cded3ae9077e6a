"""An inspection for the terminal: can it be calibrated, what is there, what it shows, what to do. Plain text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sccal.align.accuracy import QUALITY_NAMES
from sccal.report.inspection.lines import (
    STREAM_HEADER,
    clock_text,
    column_lines,
    course_line,
    drive_lines,
    excited_lines,
    fixes_lines,
    run_line,
    standstill_line,
    stream_rows,
    witness_line,
)
from sccal.report.layout import in_columns, labelled, wrapped
from sccal.report.sentences import notice_text
from sccal.results.inspection import FixFacts, Inspection, Shown
from sccal.results.numbers import one_line

NOTICES_SHOWN = 6
_LEAST_NEEDED = (8, 4, 1)
"""Columns of the table of streams to leave out first where the terminal is narrow: step, jitter, file."""
_STRIP: dict[int | None, str] = {4: "█", 8: "█", 5: "▓", 2: "▒", 9: "▒", 3: "▒", 1: "░", None: " "}
_OTHER_QUALITY = "·"
_SAYS: dict[Shown, str] = {"yes": "shows", "weak": "weakly", "no": "not"}


def inspection_text(i: Inspection, width: int = 100) -> str:
    """One log in full."""
    lines = [
        *wrapped(str(i.verdict), width),
        "",
        *wrapped(run_line(i), width),
        "",
        *_streams(i, width),
        "",
        *labelled("fixes", fixes_lines(i.fixes), width),
        *_quality_strip(i.fixes),
        *labelled("clock", [clock_text(i)], width),
        *_three(("drive", "speed", "turning"), drive_lines(i.drive), width),
        *labelled("standing", [standstill_line(i.standstill)], width),
        *labelled("together", [*map(witness_line, i.witnesses), course_line(i.course)], width),
        *labelled("columns", column_lines(i.columns), width),
    ]
    if i.excited:
        lines += ["", *wrapped(f"What this drive shows, by {i.excited_how}:", width)]
        for shown, texts in excited_lines(i):
            lines += labelled(_SAYS[shown], texts, width)
    first = i.verdict.because
    told = [
        f"{'' if finding.weight == 'note' else f'{finding.weight}: '}{finding.text}"
        for finding in i.findings
        if one_line(finding.text) not in first
    ]
    if told:
        lines += ["", *labelled("findings", told, width)]
    lines += _notices(i, width)
    return "\n".join(lines) + "\n"


def _streams(i: Inspection, width: int) -> list[str]:
    rows = [STREAM_HEADER, *stream_rows(i)]
    kept = list(range(len(STREAM_HEADER)))
    for column in _LEAST_NEEDED:
        if max(map(len, in_columns(_chosen(rows, kept), "<" * len(kept)))) <= width:
            break
        kept.remove(column)
    sides = "<<>>>>>><"
    return in_columns(_chosen(rows, kept), "".join(sides[k] for k in kept))


def _chosen(rows: Iterable[Sequence[str]], kept: Sequence[int]) -> list[tuple[str, ...]]:
    return [tuple(row[k] for k in kept) for row in rows]


def _quality_strip(fixes: FixFacts | None) -> list[str]:
    """The quality over the run, one character a cell, and what the characters mean."""
    if fixes is None or not fixes.strip:
        return []
    marks = [_STRIP.get(code, _OTHER_QUALITY) for code in fixes.strip]
    met = {mark: code for code, mark in zip(fixes.strip, marks, strict=True) if code is not None}
    legend = ", ".join(f"{mark} {QUALITY_NAMES.get(code, 'other')}" for mark, code in met.items())
    blank = ", blank: none" if None in fixes.strip else ""
    return [f"         |{''.join(marks)}|", f"         {legend}{blank}"]


def _three(labels: Sequence[str], texts: Sequence[str], width: int) -> list[str]:
    return [
        line for label, text in zip(labels[: len(texts)], texts, strict=True) for line in labelled(label, [text], width)
    ]


def _notices(i: Inspection, width: int) -> list[str]:
    ordered = sorted(i.notices, key=lambda one: one.severity != "warning")
    # What stands under findings need not be told twice.
    found = " ".join(finding.text for finding in i.findings)
    ordered = [notice for notice in ordered if str(notice) not in found]
    lines = [
        ("warning: " if notice.severity == "warning" else "") + notice_text(notice)
        for notice in ordered[:NOTICES_SHOWN]
    ]
    if len(ordered) > NOTICES_SHOWN:
        lines.append(f"… and {len(ordered) - NOTICES_SHOWN} more with --json")
    return ["", *labelled("notices", lines, width)] if lines else []
