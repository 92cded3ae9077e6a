"""inspect.html: one log on one self-contained page."""

from __future__ import annotations

from dataclasses import dataclass

from sccal import __version__
from sccal.report.inspection.figures import inspection_drawings
from sccal.report.inspection.lines import (
    STREAM_HEADER,
    clock_text,
    column_lines,
    course_line,
    drive_lines,
    fixes_lines,
    run_line,
    sigmas_text,
    standstill_line,
    stream_rows,
    witness_line,
)
from sccal.report.page import page
from sccal.report.sentences import warnings_first
from sccal.results.inspection import Excited, Inspection, Shown, Weight
from sccal.results.numbers import one_line

_TAGS: dict[Shown, str] = {"yes": "good", "weak": "partial", "no": "doubtful"}
_WEIGHTS: dict[Weight, str] = {"refused": "doubtful", "warning": "partial", "note": ""}


@dataclass(frozen=True)
class ExcitedRow:
    """One line of the table of what the drive shows."""

    name: str
    title: str
    shown: str
    tag: str
    sigmas: str
    says: str


def inspection_html(i: Inspection) -> str:
    """The page."""
    labels = ("drive", "speed", "turning")
    return page(
        "inspect.html.j2",
        i=i,
        verdict=i.verdict,
        title=one_line(i.run),
        sub=run_line(i),
        header=STREAM_HEADER,
        streams=stream_rows(i),
        drawings=inspection_drawings(i),
        facts=(
            *zip(("fixes", "receiver"), fixes_lines(i.fixes), strict=False),
            ("clock", clock_text(i)),
            *zip(labels, drive_lines(i.drive), strict=False),
            ("standing", standstill_line(i.standstill)),
        ),
        together=[line for line in (*map(witness_line, i.witnesses), course_line(i.course)) if line],
        columns=column_lines(i.columns),
        excited=[_row(quantity) for shown in _TAGS for quantity in i.excited if quantity.shown == shown],
        findings=[(finding.weight, _WEIGHTS[finding.weight], one_line(finding.text)) for finding in i.findings],
        notices=warnings_first(i.notices),
        version=__version__,
    )


def _row(one: Excited) -> ExcitedRow:
    says = "" if one.shown == "yes" else one.advice
    if one.same_as:
        says = f"here the same as {', '.join(one.same_as)}: {says or one.advice}"
    return ExcitedRow(one.name, one.title, one.shown, _TAGS[one.shown], sigmas_text(one), says)
