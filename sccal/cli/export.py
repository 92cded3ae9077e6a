"""``sccal export``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from sccal.cli.app import app
from sccal.errors import DataError, UsageError


@app.command()
def export(
    name: Annotated[str, typer.Argument(metavar="FORMAT", help="One of the list.", show_default=False)] = "",
    result: Annotated[
        Path | None,
        typer.Argument(
            help="A run's folder of results, as OUT/run; for formats of parameters also vehicle.json or model.json.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write; without it, standard output.", show_default=False)
    ] = None,
    listed: Annotated[bool, typer.Option("--list", help="List the formats.")] = False,
) -> None:
    """Results in the format of another tool; without a format, the list of them."""
    from sccal.export.catalogue import FORMATS, format_named, left_out
    from sccal.export.result import read_result
    from sccal.logs.write import write_text

    if listed or not name:
        width = max(map(len, FORMATS))
        for one in FORMATS.values():
            print(f"{one.name:{width}}  {one.purpose}")
        return
    chosen = format_named(name)
    if result is None:
        raise UsageError(f"export {name}: name the results too, as OUT/run")
    read = read_result(result)
    text = chosen.write(read)
    for line in left_out(chosen, read):
        print(f"sccal: {name}: {line}", file=sys.stderr)
    if out is None:
        sys.stdout.write(text)
        return
    try:
        write_text(out, text)
    except OSError as error:
        raise DataError(f"{out}: cannot be written ({error.strerror or error})") from error
