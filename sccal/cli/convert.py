"""``sccal convert``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sccal.cli.app import app
from sccal.cli.messages import tell_failures
from sccal.cli.options import grouped
from sccal.cli.reading import Paths, Reading
from sccal.errors import SccalError, UsageError

if TYPE_CHECKING:
    from sccal.convert.paths import ConvertedRun
    from sccal.logs.run import RunSource


@app.command()
@grouped
def convert(
    paths: Paths,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="Folder for what is written, outside of the logs.", show_default=False),
    ],
    to: Annotated[str, typer.Option(help="mcap or folder; without it, MCAP becomes folders and all else MCAP.")] = "",
    *,
    read: Reading,
) -> None:
    """Runs below PATHS from folders or ROS bags into MCAP, or into folders; nothing that is read is lost."""
    from sccal.convert.paths import convert_paths

    forms: dict[str, Literal["mcap", "folder"] | None] = {"": None, "mcap": "mcap", "folder": "folder"}
    if to not in forms:
        raise UsageError(f"--to {to}: must be mcap or folder")
    converted, failures = convert_paths(paths, out, forms[to], read.options(), _tell_converted)
    tell_failures(failures, len(failures) + len(converted))


def _tell_converted(source: RunSource, result: ConvertedRun | SccalError) -> None:
    if isinstance(result, SccalError):
        print(f"{source.name}: not written", flush=True)
        return
    print(f"{source.name}: {source.path} -> {result.path}", flush=True)
    for notice in result.notices:
        print(f"  {notice}", flush=True)
