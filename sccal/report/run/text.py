"""A run on the terminal: the verdict, then the numbers, then what limits them. Plain text, 80 columns and more."""

from __future__ import annotations

from collections.abc import Sequence

from sccal.report.layout import in_columns, labelled, notice_lines, wrapped
from sccal.report.rows import Row, effect_rows, parameter_rows
from sccal.report.sentences import (
    clock_line,
    drive_line,
    fixes_line,
    headings_line,
    held_out_line,
    missing_line,
    noise_facts,
    outage_line,
    recoveries_line,
    reference_lines,
    unseen_line,
)
from sccal.results.calibration import Calibration
from sccal.results.noise import Noise


def run_text(c: Calibration, width: int = 100) -> str:
    """One run in full."""
    lines = [
        *wrapped(str(c.verdict), width),
        "",
        *wrapped(f"{c.run} ({c.vehicle.name}): {drive_line(c.drive)}", width),
        "",
        *parameter_table((*parameter_rows(c.parameters), *effect_rows(c.effects)), width),
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


def parameter_table(rows: Sequence[Row], width: int) -> list[str]:
    """One line for each, and below them why some are not estimated."""
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


def _noise(noise: Noise) -> list[str]:
    *facts, (_, source) = noise_facts(noise)
    return [", ".join(f"{subject} {fact}" for subject, fact in facts) + f" ({source})"]
