"""The summary page of a step in GitHub Actions: Markdown appended to the file that GITHUB_STEP_SUMMARY names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from sccal.errors import UsageError
from sccal.report.fleet.gates import gate_line, gates_count, whose
from sccal.results.calibration import Calibrated, Calibration, Estimate
from sccal.results.gates import BatchOutcome, Outcome
from sccal.results.numbers import MISSING, one_line, plain, value_and_sigma

VARIABLE = "GITHUB_STEP_SUMMARY"
MOST_BYTES = 1024 * 1024
"""What GitHub takes for a step, of all its commands together; it refuses the page where there is more."""
_NOTE = "\n_Cut here: the page of a step may hold 1 MiB. The results are in the files._\n"
_MARKS = re.compile(r"([\\`*_{}\[\]#|~!$])")
_MEANS: Mapping[str, str] = {"good": "✅", "partial": "⚠️", "doubtful": "❌"}


def append_step_summary(outcome: BatchOutcome, environment: Mapping[str, str]) -> Path | None:
    """Append the batch to the page of the step; the file, or None where the variable is not set.

    Raises:
        UsageError: the file cannot be written.
    """
    name = environment.get(VARIABLE, "")
    if not name:
        return None
    path = Path(name)
    try:
        room = MOST_BYTES - (path.stat().st_size if path.exists() else 0)
        content = cut(step_summary(outcome), room)
        with path.open("ab") as file:
            file.write(content)
    except OSError as error:
        raise UsageError(f"{VARIABLE}={name}: cannot be written ({error.strerror or error}); unset it") from error
    return path


def step_summary(outcome: BatchOutcome) -> str:
    """Markdown: what failed, every run, what the model lacks in them, then the gates that were skipped."""
    lines = [f"### sccal: {_headline(outcome)}", ""]
    if outcome.failures:
        lines += _table(("no result", "why"), ((failure.name, str(failure.error)) for failure in outcome.failures))
    lines += _gates(outcome, "failed")
    if outcome.runs:
        header = ("run", "verdict", "R_right mm", "R_left mm", "track mm", "offset deg", "drift %")
        results: list[Calibrated] = [*outcome.runs, *outcome.vehicles.values()]
        lines += _table(header, map(_row, results))
    lines += _lacking(outcome.runs)
    lines += _gates(outcome, "skipped")
    return "\n".join(lines) + "\n"


def _gates(outcome: BatchOutcome, which: Outcome) -> Iterator[str]:
    told = [gate for gate in outcome.gates if gate.outcome == which]
    if told:
        yield from _table((f"gate {which}", "of"), ((gate_line(gate), whose(gate)) for gate in told))


def _lacking(runs: Sequence[Calibration]) -> Iterator[str]:
    rows = [
        (run.run, ", ".join(f"{effect.effect}: {effect.title}" for effect in run.missing))
        for run in runs
        if run.missing
    ]
    if rows:
        yield from _table(("run", "sccal diagnose would name"), rows)


def cut(text: str, most_bytes: int) -> bytes:
    """UTF-8, whole lines only and a note at the end where not all fits; empty where not even the note does."""
    content = text.encode("utf-8", "replace")
    if len(content) <= most_bytes:
        return content
    room = most_bytes - len(_NOTE.encode())
    return content[: content.rfind(b"\n", 0, room) + 1] + _NOTE.encode() if room >= 0 else b""


def _headline(outcome: BatchOutcome) -> str:
    total = len(outcome.runs) + len(outcome.failures)
    parts = [f"{len(outcome.runs)} of {total} run{'' if total == 1 else 's'} calibrated"]
    if outcome.gates:
        parts.append(gates_count(outcome.gates))
    return ", ".join(parts)


def _row(result: Calibrated) -> tuple[str, ...]:
    level, percent = result.verdict.level, result.outage.percent_of_distance
    return (
        f"vehicle {result.vehicle.name}" if result.of_vehicle else result.run,
        f"{_MEANS[level]} {level}",
        *(_value(estimate, 1e3 if key.endswith("_m") else 1.0) for key, estimate in result.parameters.by_key.items()),
        MISSING if percent is None else plain(percent, 2),
    )


def _value(estimate: Estimate, scale: float) -> str:
    if estimate.status == "unobserved":
        return "not observed"
    value, sigma = value_and_sigma(scale * estimate.value, scale * estimate.sigma)
    return f"{value} ± {sigma}" + ("" if estimate.status == "estimated" else f" ({estimate.status.replace('_', ' ')})")


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield _line(header)
    yield _line(["---"] * len(header), escape=False)
    for row in rows:
        yield _line(row)
    yield ""


def _line(cells: Iterable[str], escape: bool = True) -> str:
    return "| " + " | ".join(escaped(cell) if escape else cell for cell in cells) + " |"


def escaped(text: str) -> str:
    """Text that Markdown shows as it is, in one cell of a table."""
    plain_text = one_line(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _MARKS.sub(r"\\\1", plain_text)
