"""``sccal inspect``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from sccal.cli.app import app
from sccal.cli.messages import columns, tell_failures
from sccal.cli.options import grouped
from sccal.cli.reading import Paths, Reading


@app.command("inspect")
@grouped
def inspect_(
    paths: Paths,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for a page and JSON of each run.", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")] = False,
    *,
    read: Reading,
) -> None:
    """What is in the logs below PATHS before anything is estimated, and what their drives can show."""
    from sccal.batch.inspecting import inspect_paths
    from sccal.report.inspection.text import inspection_text
    from sccal.results.converter import document_of, json_text
    from sccal.results.inspection import InspectFailure, Inspections

    inspected, failures = inspect_paths(paths, out, read.options())
    if as_json:
        failed = tuple(InspectFailure(one.name, str(one.error)) for one in failures)
        print(json_text(document_of(Inspections(tuple(one for one, _ in inspected), failed))), end="")
    else:
        for number, (one, page) in enumerate(inspected):
            print(("\n" if number else "") + inspection_text(one, columns()), end="")
            if page is not None:
                print(f"\nreport: {page}")
    if inspected:
        for failure in failures:
            print(f"sccal: {failure.name}: {failure.error}", file=sys.stderr)
    else:
        tell_failures(failures, len(failures))
