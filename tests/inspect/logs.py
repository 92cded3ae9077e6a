"""Simulated runs on disk, and ways to spoil them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from sccal.inspect.inspect import inspect_run
from sccal.logs.run import discover
from sccal.results.inspection import Finding, Inspection, StreamFacts, Witness


def inspected(folder: Path) -> Inspection:
    """The only run in a folder."""
    (source,) = discover([folder])
    return inspect_run(source)


def copied(run: Path, to: Path) -> Path:
    """A copy to be spoilt, in a folder of its own."""
    return Path(shutil.copytree(run, to / "log"))


def rows(path: Path, change: Callable[[float, list[str]], list[str] | None]) -> None:
    """Rewrite a CSV file row by row; the change sees the seconds since the first row, and drops a row by None."""
    header, *lines = path.read_text().splitlines()
    cells = [line.split(",") for line in lines]
    first = float(cells[0][0])
    changed = [change(float(row[0]) - first, row) for row in cells]
    path.write_text("\n".join([header, *(",".join(row) for row in changed if row is not None)]) + "\n")


def stream(i: Inspection, name: str) -> StreamFacts:
    """The facts of one stream."""
    return next(one for one in i.streams if one.name == name)


def witness(i: Inspection, what: str) -> Witness:
    """The witness whose name begins so."""
    return next(one for one in i.witnesses if one.what.startswith(what))


def said(i: Inspection, words: str) -> Finding | None:
    """The first finding that holds these words."""
    return next((one for one in i.findings if words in one.text), None)


def shown(i: Inspection) -> dict[str, str]:
    """yes, weak or no by name."""
    return {one.name: one.shown for one in i.excited}
