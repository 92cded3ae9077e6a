"""experiments.html: the paper's experiments on one self-contained page, the answer first."""

from __future__ import annotations

from dataclasses import dataclass

from sccal import __version__
from sccal.experiments.magnetometer import WANDER_DEG, WANDER_TIME_S
from sccal.report.drawing.style import Drawing
from sccal.report.experiments.figures import WORDS, cell_drawings, overview_drawing
from sccal.report.experiments.text import (
    WITHIN,
    Line,
    answers,
    cell_name,
    drive_name,
    fault_clause,
    headline,
    lines_of,
    reading,
    setting,
    whole_offset_deg,
)
from sccal.report.layout import sentence
from sccal.report.page import page
from sccal.report.rows import STATUS_WORDS
from sccal.results.calibration import PARAMETERS
from sccal.results.experiments import TOLERANCE_PERCENT, Cell, Experiments
from sccal.results.numbers import one_line, short, value_and_sigma

_ROWS = ("right radius (m)", "left radius (m)", "track (m)", "heading offset (deg)")


@dataclass(frozen=True)
class Answer:
    """What stands at the top of the page."""

    level: str
    because: tuple[str, ...]


@dataclass(frozen=True)
class ShownDrive:
    """One drive under one fault as the page shows it."""

    key: str
    name: str
    line: Line
    why_not: str
    drawings: dict[str, Drawing]
    parameters: tuple[tuple[str, str, str, str], ...]
    """Name, true value, and the first seed's without and with; empty without truth."""
    truth: str
    """What stands for it."""
    seed: int


@dataclass(frozen=True)
class Section:
    """One fault."""

    key: str
    title: str
    clause: str
    drives: tuple[ShownDrive, ...]


def experiments_html(e: Experiments) -> str:
    """The page."""
    return page(
        "experiments.html.j2",
        verdict=Answer(headline(e), tuple(map(sentence, answers(e)))),
        setting=setting(e),
        reading=sentence(reading()),
        overview=overview_drawing(e),
        sections=_sections(e),
        words=WORDS,
        within=WITHIN,
        truths=any(cell.truth is not None for cell in e.cells),
        whys=[(cell_name(cell), sentence(cell.why_not)) for cell in e.cells if cell.why_not],
        failed=[(one_line(failure.name), sentence(failure.reason)) for failure in e.failed],
        measured=any(cell.measured for cell in e.cells),
        offset="" if (offset := whole_offset_deg(e)) is None else f"{short(offset)}\u00a0deg",
        wander=f"σ\u00a0{WANDER_DEG:g}\u00a0deg, correlated over {WANDER_TIME_S:g}\u00a0s",
        tolerance=f"{TOLERANCE_PERCENT:g}\u00a0%",
        version=__version__,
    )


def _sections(e: Experiments) -> list[Section]:
    return [
        Section(
            key=fault.key,
            title=sentence(fault.title, stop=False),
            clause=sentence(fault_clause(fault)),
            drives=tuple(_shown(line, f"{fault.key}-{number + 1}") for number, line in enumerate(lines)),
        )
        for fault, lines in lines_of(e)
    ]


def _shown(line: Line, key: str) -> ShownDrive:
    cell = line.cell
    return ShownDrive(
        key=key,
        name=sentence(drive_name(cell), stop=False) if not cell.measured else drive_name(cell),
        line=line,
        why_not=sentence(cell.why_not),
        drawings={drawing.name.removeprefix(f"{key}-"): drawing for drawing in cell_drawings(cell, key)},
        parameters=_parameters(cell),
        truth="undisturbed" if cell.measured else "truth",
        seed=cell.seeds[0],
    )


def _parameters(cell: Cell) -> tuple[tuple[str, str, str, str], ...]:
    if cell.truth is None:
        return ()
    return tuple(
        (name, short(cell.truth[k]), _value(cell, "without", k), _value(cell, "with", k))
        for k, name in enumerate(_ROWS[: len(PARAMETERS)])
    )


def _value(cell: Cell, variant: str, k: int) -> str:
    figures = cell.figures["with" if variant == "with" else "without"]
    status = figures.statuses[0][k]
    if status in ("held", "unobserved"):
        return "held at 0" if status == "held" and figures.values[0, k] == 0.0 else STATUS_WORDS[status]
    value, sigma = value_and_sigma(float(figures.values[0, k]), float(figures.sigmas[0, k]))
    return f"{value} ± {sigma}" if status == "estimated" else f"{value}, {STATUS_WORDS[status]}"
