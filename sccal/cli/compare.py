"""``sccal compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sccal.cli.app import app
from sccal.cli.messages import columns
from sccal.errors import DataError, Exit


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(help="A result's JSON file, or the folder that holds it.", show_default=False)],
    b: Annotated[Path, typer.Argument(help="The result to set beside it.", show_default=False)],
    sigmas: Annotated[float, typer.Option(help="What differs by more sigmas than this has changed.", min=0.1)] = 3.0,
    fail_on_change: Annotated[
        bool, typer.Option("--fail-on-change", help="Exit with 1 where anything has changed.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="JSON on standard output, and nothing else.")] = False,
) -> None:
    """What changed from A to B beyond its uncertainty: two calibrations, or two diagnoses."""
    from sccal.compare.read import compare_paths

    comparison = compare_paths(a, b, sigmas)
    if as_json:
        from sccal.results.converter import document_of, json_text

        print(json_text(document_of(comparison)), end="")
    else:
        from sccal.report.comparison.text import compare_text

        print(compare_text(comparison, columns()), end="")
    if not comparison.comparable:
        raise DataError(f"{a} and {b}: no parameter is estimated in both, so that nothing can be compared")
    if fail_on_change and comparison.changed:
        raise typer.Exit(int(Exit.GATE_FAILED))
