"""Markdown tables, shares with their binomial errors, and the coverage of stated sigmas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

WITHIN_1 = 0.683
WITHIN_2 = 0.954


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def percent(part: int, whole: int) -> str:
    """A share with what it is a share of."""
    return f"{100.0 * part / whole:.1f} % ({part}/{whole})" if whole else "—"


def coverage(scores: Sequence[float]) -> tuple[str, str, str]:
    """Of errors over stated sigmas: the shares within one and two, and their root mean square.

    Beside each share stands the binomial error that an honest sigma would leave it with.
    """
    count = len(scores)
    if count == 0:
        return "—", "—", "—"
    cells = []
    for limit, expected in ((1.0, WITHIN_1), (2.0, WITHIN_2)):
        share = sum(abs(score) <= limit for score in scores) / count
        error = math.sqrt(expected * (1.0 - expected) / count)
        cells.append(f"{100.0 * share:.0f} ± {100.0 * error:.0f} %")
    return cells[0], cells[1], f"{math.sqrt(sum(score * score for score in scores) / count):.2f}"


def median(values: Sequence[float]) -> float:
    """The middle value, NaN of none."""
    ordered = sorted(values)
    if not ordered:
        return math.nan
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])


def rounded(value: float | None, digits: int = 3) -> str:
    """A number with some significant digits, or a dash."""
    return "—" if value is None or math.isnan(value) else f"{value:.{digits}g}"


def publish(text: str, out: Path | None) -> None:
    """Print a report, and write it where a file is asked for."""
    print(text)
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text + "\n", encoding="utf-8")
