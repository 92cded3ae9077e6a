"""report.pdf: what the page of a run says, typeset on A4 by matplotlib; the same bytes for the same result.

A machine that has only Python and pip can write it: nothing but matplotlib is needed.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from sccal import __version__
from sccal.arrays import Floats
from sccal.report.drawing.panel import Sheet
from sccal.report.drawing.plan import Plan
from sccal.report.drawing.style import FACE, GREEN, GRID, INK, ORANGE, SOFT, VERMILION, styled
from sccal.report.rows import Row, effect_rows, parameter_rows
from sccal.report.run.advice import advice_on
from sccal.report.run.facts import driven_lines, fit_facts, narrowed_lines, origin_lines, started, variant
from sccal.report.run.figures import run_plans
from sccal.report.sentences import clock_line, drive_line, noise_facts, notice_text, warnings_first
from sccal.results.calibration import Calibration
from sccal.results.numbers import one_line

A4 = (595.28, 841.89)
MARGIN = 42.0
TEXT, NOTE, HEADING, TITLE = 9.0, 7.5, 12.0, 17.0
LEADING = 1.38
LEAST_HEIGHT = 0.75
"""Of a drawing's own height."""
COLOURS = {"good": GREEN, "partial": ORANGE, "doubtful": VERMILION, "unusable": VERMILION}
_WIDTH = A4[0] - 2.0 * MARGIN


def run_pdf(c: Calibration) -> bytes:
    """The whole document."""
    buffer = io.BytesIO()
    facts = {
        "Title": one_line(f"{c.run} – calibration"),
        "Creator": f"sccal {__version__}",
        "Producer": None,
        "CreationDate": None,
        "ModDate": None,
    }
    with styled("pdf"), PdfPages(buffer, metadata=facts) as file:
        paper = _Paper(file, one_line(f"{c.run} · sccal {__version__}"))
        _opening(paper, c)
        for plan in run_plans(c):
            paper.figure(plan)
        _tables(paper, c)
        paper.turn()
    return buffer.getvalue()


def _opening(paper: _Paper, c: Calibration) -> None:
    verdict = c.verdict
    advice = advice_on(c, verdict)
    paper.paragraph(one_line(c.run), TITLE, bold=True)
    date = started(c)
    paper.paragraph(
        " · ".join(part for part in (one_line(c.vehicle.name), date, drive_line(c.drive)) if part), TEXT, SOFT
    )
    paper.space(6.0)
    paper.paragraph(advice.title, HEADING, COLOURS[advice.level], bold=True)
    for reason in verdict.because:
        paper.paragraph(one_line(reason), TEXT, indent=0.0 if len(verdict.because) == 1 else 8.0)
    paper.paragraph(f"Next: {advice.next_step}", TEXT)
    paper.heading("Parameters")
    rows = (*parameter_rows(c.parameters), *effect_rows(c.effects))
    paper.table(("parameter", "value", "nominal", "change", "status"), [_cells(row) for row in rows], "lrrrl")
    for row in rows:
        if row.reason:
            paper.paragraph(f"{row.name}: {row.reason}", NOTE, SOFT)


def _tables(paper: _Paper, c: Calibration) -> None:
    paper.heading("Fit and drift without fixes")
    paper.facts(fit_facts(c))
    paper.heading("Noise and clock")
    paper.facts((*noise_facts(c.noise), ("clock", clock_line(c.clock))))
    paper.heading("What the drive excited")
    shown = [(line.name, line.before, line.after, line.times) for line in narrowed_lines(c)]
    paper.table(("parameter", "sigma before", "sigma after", "times better"), shown, "lrrr")
    driven = [(line.kind, line.time, line.distance, line.turned, line.speed) for line in driven_lines(c.manoeuvres)]
    if driven:
        paper.space(8.0)
        paper.table(("driven", "time", "distance", "turned", "speed"), driven, "lrrrr")
    if c.notices:
        paper.heading("Notices")
        for notice in warnings_first(c.notices):
            paper.paragraph(f"{notice.severity}: {notice_text(notice)}", TEXT)
    if c.provenance is not None:
        paper.heading("Provenance")
        for one in c.provenance.inputs:
            paper.paragraph(f"{one_line(one.name)}, {one.size_bytes} bytes", TEXT)
            paper.paragraph(f"SHA-256 {one.sha256}", NOTE, SOFT, indent=8.0)
        paper.facts(origin_lines(c.provenance))
    paper.space(8.0)
    origin = f"origin {c.origin.lat_deg:.7f}, {c.origin.lon_deg:.7f}"
    paper.paragraph(f"sccal {__version__} · {variant(c.with_offset)} · {origin}", NOTE, SOFT)


def _cells(row: Row) -> tuple[str, ...]:
    value = row.value_with_sigma + (f" {row.unit}" if row.seen else "")
    return row.name, value, f"{row.nominal} {row.unit}" if row.nominal else "–", row.change or "–", row.status


@dataclass
class _Paper:
    """Pages filled from above; what does not fit begins the next one."""

    file: PdfPages
    footer: str
    sheet: Sheet | None = None
    y: float = 0.0
    number: int = field(default=0)

    def room(self, height: float) -> Sheet:
        """A sheet with so much room below the cursor."""
        if self.sheet is None or self.y - height < MARGIN + 14.0:
            self.turn()
            self.number += 1
            self.sheet = Sheet(Figure(figsize=(A4[0] / 72.0, A4[1] / 72.0), dpi=72), MARGIN, 0.0, _WIDTH, A4[1])
            self.sheet.text(0.0, MARGIN - 14.0, fitting(self.footer, NOTE, _WIDTH - 60.0), NOTE, SOFT)
            self.sheet.text(_WIDTH, MARGIN - 14.0, str(self.number), NOTE, SOFT, "right")
            self.y = A4[1] - MARGIN
        return self.sheet

    def turn(self) -> None:
        """The page is full."""
        if self.sheet is not None:
            self.file.savefig(self.sheet.figure)  # type: ignore[no-untyped-call]
            self.sheet = None

    def space(self, height: float) -> None:
        self.y -= height

    def paragraph(self, text: str, size: float, colour: str = INK, bold: bool = False, indent: float = 0.0) -> None:
        for line in wrapped(text, size, _WIDTH - indent, bold):
            sheet = self.room(size * LEADING)
            self.y -= size * LEADING
            sheet.text(indent, self.y, line, size, colour, bold=bold)

    def heading(self, text: str) -> None:
        self.room(70.0)
        self.space(10.0)
        self.paragraph(text, HEADING, bold=True)
        self.space(3.0)

    def table(self, head: Sequence[str], rows: Sequence[Sequence[str]], sides: str) -> None:
        """Columns as wide as their widest cell, the rest of the width between them; l and r are the cells' sides."""
        widths = [max(width_of(row[k], TEXT) for row in (head, *rows)) for k in range(len(head))]
        gap = max(8.0, min(40.0, (_WIDTH - sum(widths)) / max(len(head) - 1, 1)))
        for number, row in enumerate((head, *rows)):
            sheet = self.room(TEXT * 1.7)
            self.y -= TEXT * 1.7
            left = 0.0
            for cell, width, side in zip(row, widths, sides, strict=True):
                place = left + width if side == "r" else left
                size, colour = (NOTE, SOFT) if number == 0 else (TEXT, INK)
                sheet.text(place, self.y, cell, size, colour, "right" if side == "r" else "left")
                left += width + gap
            sheet.path(_rule(self.y - 4.0), stroke=GRID, width=0.6)

    def facts(self, pairs: Iterable[tuple[str, str]]) -> None:
        for name, text in pairs:
            for k, line in enumerate(wrapped(text, TEXT, _WIDTH - 64.0)):
                sheet = self.room(TEXT * LEADING)
                self.y -= TEXT * LEADING
                if k == 0:
                    sheet.text(0.0, self.y, name, TEXT, SOFT)
                sheet.text(64.0, self.y, line, TEXT)

    def figure(self, plan: Plan) -> None:
        """Title, drawing and caption on one page; a drawing that nearly fits is made less high."""
        beside = HEADING * LEADING + 16.0 + len(wrapped(plan.caption, NOTE, _WIDTH)) * NOTE * LEADING
        left = self.y - MARGIN - 14.0 - beside if self.sheet is not None else 0.0
        height = left if LEAST_HEIGHT * plan.height < left < plan.height else plan.height
        sheet = self.room(height + beside)
        self.space(8.0)
        self.paragraph(plan.title, HEADING, bold=True)
        self.space(height + 2.0)
        plan.draw(Sheet(sheet.figure, MARGIN, self.y, _WIDTH, height))
        self.paragraph(plan.caption, NOTE, SOFT)
        self.space(4.0)


def wrapped(text: str, size: float, width: float, bold: bool = False) -> list[str]:
    """Lines no wider than so many points; a word that is wider is broken."""
    lines: list[str] = []
    line, used = "", 0.0
    blank = width_of("n n", size, bold) - width_of("nn", size, bold)
    for word in text.split():
        needed = width_of(word, size, bold)
        if line and used + blank + needed <= width:
            line, used = f"{line} {word}", used + blank + needed
            continue
        if line:
            lines.append(line)
        while needed > width:
            head = fitting(word, size, width, bold)
            lines.append(head)
            word = word[len(head) :]
            needed = width_of(word, size, bold)
        line, used = word, needed
    return [*lines, line] if line else lines


def fitting(text: str, size: float, width: float, bold: bool = False) -> str:
    """As much of its beginning as fits, one character at least."""
    kept = len(text)
    while kept > 1 and width_of(text[:kept], size, bold) > width:
        kept -= 1
    return text[:kept]


@lru_cache(maxsize=4096)
def width_of(text: str, size: float, bold: bool = False) -> float:
    """Points, as it is set."""
    font = FontProperties(family=FACE, size=size, weight="bold" if bold else "normal")
    width, _, _ = text_to_path.get_text_width_height_descent(text, font, ismath=False)
    return float(width)


def _rule(y: float) -> Floats:
    return np.array([(0.0, y), (_WIDTH, y)])
