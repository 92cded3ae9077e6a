"""What several commands print in the same way."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence

import typer

from sccal.errors import Failure


def tell_failures(failures: Sequence[Failure], total: int) -> None:
    """A line for every run that gave nothing, and the exit code of the worst."""
    if not failures:
        return
    if total > 1:
        print()
    for failure in failures:
        print(f"sccal: {failure.name}: {failure.error}", file=sys.stderr)
    if total > 1:
        print(f"sccal: {len(failures)} of {total} gave no result", file=sys.stderr)
    raise typer.Exit(int(max(failure.error.exit_code for failure in failures)))


def columns() -> int:
    """How many to print in: the terminal's, within what tables need and eyes can follow."""
    return min(max(shutil.get_terminal_size((100, 24)).columns, 60), 120)


def tell_line(line: str) -> None:
    """At once, wherever the output goes."""
    print(line, flush=True)
