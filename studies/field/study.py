"""All field cases in one table: wanted, got, and how far the numbers are from the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from studies.cases import Outcome, PoolOptions, run_cases
from studies.field.catalogue import CASES
from studies.field.judging import Mark, judge
from studies.field.wanted import SIGMAS, FieldCase
from studies.tables import percent, table

SHORT = {"radius_right_m": "R", "radius_left_m": "L", "track_m": "B", "heading_offset_deg": "O"}


def work(name: str, folder: Path) -> Mark:
    """One case, by its name: the functions that build logs do not travel between processes."""
    return judge(case_of(name), folder)


def case_of(name: str) -> FieldCase:
    """The case of a name."""
    return next(case for case in CASES if case.name == name)


def chosen(wanted: Sequence[str], part: str) -> list[str]:
    """Names of the cases of a part that were asked for by number, name or beginning of a name; all where none was."""
    names = [case.name for case in CASES if part in ("", case.part)]
    if not wanted:
        return names
    numbered = {str(number): case.name for number, case in enumerate(CASES)}
    asked = tuple(numbered.get(word, word) for word in wanted)
    return [name for name in names if name.startswith(asked)]


def run(wanted: Sequence[str], part: str, options: PoolOptions) -> tuple[str, dict[str, Any]]:
    """The whole study: the report as Markdown, and every case as data."""
    outcomes = run_cases(work, chosen(wanted, part), replace(options, only=()))
    data = [
        {"case": outcome.case, "error": outcome.error, "seconds": outcome.seconds}
        | ({} if outcome.result is None else asdict(outcome.result))
        for outcome in outcomes
    ]
    return report(outcomes), {"study": "field", "cases": data}


def report(outcomes: Sequence[Outcome[str, Mark]]) -> str:
    """Shares first, then a line for each case."""
    parts = ["# Field cases", ""]
    for part in ("known", "further"):
        of_part = [outcome for outcome in outcomes if case_of(outcome.case).part == part]
        if of_part:
            right = sum(outcome.result is not None and outcome.result.ok for outcome in of_part)
            parts.append(f"* {part}: as wanted in {percent(right, len(of_part))}")
    parts += [
        "",
        "Numbers are errors over stated sigmas of right radius (R), left radius (L), track (B) and heading offset (O), "
        "where estimated.",
        "",
        table(["case", "part", "kind", "wanted", "got", "σ", "", "why not"], [_row(outcome) for outcome in outcomes]),
    ]
    return "\n".join(parts)


def _row(outcome: Outcome[str, Mark]) -> list[str]:
    case, mark = case_of(outcome.case), outcome.result
    wanted = " or ".join(way.name for way in case.ways) + ("" if case.diagnosis is None else ", diagnosis")
    if mark is None:
        return [case.name, case.part, case.kind, wanted, "", "", "not ok", outcome.error.splitlines()[-1]]
    numbers = " ".join(f"{SHORT[name]} {mark.scores[name]:+.1f}" for name in SIGMAS if name in mark.scores)
    ok = "ok" if mark.ok else "not ok"
    return [
        case.name,
        case.part,
        case.kind,
        wanted,
        _cut(mark.got, 140),
        numbers,
        ok,
        _cut("; ".join(mark.faults), 400).replace("](", "] ("),  # no link of Markdown
    ]


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 1] + "…"
