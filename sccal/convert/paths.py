"""All runs of one call, converted one by one, in the layout in which they were found.

A run found at LOGS/a/b becomes OUT/a/b.mcap or the folder OUT/a/b, and the vehicle.toml that applies to it goes to the
place that corresponds. Where another vehicle's stands there, the run gets a folder of its own: OUT/a/b/b.mcap.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from sccal import __version__
from sccal.convert.from_folder import tables_of_folder
from sccal.convert.from_messages import tables_of_messages
from sccal.convert.tables import NOTE_FILE, RunTables
from sccal.convert.to_folder import write_folder_of
from sccal.convert.to_mcap import LIBRARY, write_mcap_of
from sccal.errors import DataError, Failure, SccalError, UsageError
from sccal.logs.formats import MCAP, RUN_FILES, message_format
from sccal.logs.messages.converted import SCHEMA
from sccal.logs.messages.mcap_file import library_of
from sccal.logs.options import ReadOptions
from sccal.logs.outputs import Note, each_run, require_apart, vehicle_place
from sccal.logs.reference import MANIFEST_FILE, REFERENCE_FILE, beside
from sccal.logs.run import RunSource, find_runs, vehicle_of
from sccal.logs.streams import Notice
from sccal.logs.write import write_bytes

Form = Literal["mcap", "folder"]


@dataclass(frozen=True)
class ConvertedRun:
    """What was written for one run."""

    name: str
    path: Path
    notices: tuple[Notice, ...]


def convert_paths(
    paths: Sequence[Path],
    out: Path,
    form: Form | None,
    options: ReadOptions,
    tell: Callable[[RunSource, ConvertedRun | SccalError], None],
) -> tuple[list[ConvertedRun], list[Failure]]:
    """Convert every run below the paths into out; gives what was written, and what could not be.

    ``form`` None: folders and ROS bags become MCAP, MCAP becomes a folder. ``tell`` is called after each run.

    Raises:
        UsageError: a path that does not exist, or a place for the results that overlaps with the logs.
    """
    sources, failures = find_runs(paths)
    require_apart(out, sources, paths)
    inputs = {source.path.resolve() for source in sources}

    def convert(source: RunSource) -> ConvertedRun:
        return _convert(source, out, form or _other_form(source), options, inputs)

    return each_run(sources, convert, failures, tell), failures


def _other_form(source: RunSource) -> Form:
    return "folder" if message_format(source.path) is MCAP else "mcap"


def _convert(source: RunSource, out: Path, form: Form, options: ReadOptions, inputs: Collection[Path]) -> ConvertedRun:
    target = _target(source, out, form)
    if target.resolve() in inputs:
        raise UsageError(f"--out {out}: {target} is one of the logs to convert; name another folder")
    tables = tables_of_messages(source, options) if source.folder is None else tables_of_folder(source)
    try:
        write = _into_mcap if form == "mcap" else _into_folder
        write(tables, source, out, target)
    except OSError as error:
        raise DataError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from error
    return ConvertedRun(source.name, target, tables.notices)


def _target(source: RunSource, out: Path, form: Form) -> Path:
    vehicle_of(source)
    if form == "folder":
        return out / source.name
    _, own = vehicle_place(source, out, out / source.name)
    return out / source.name / f"{Path(source.name).name}{MCAP.suffix}" if own else out / f"{source.name}{MCAP.suffix}"


def _into_mcap(tables: RunTables, source: RunSource, out: Path, target: Path) -> None:
    vehicle, _ = vehicle_place(source, out, out / source.name)
    if target.exists() and (not target.is_file() or library_of(target) != LIBRARY):
        raise UsageError(f"{target}: is there and was not written by sccal convert; name another folder")
    target.parent.mkdir(parents=True, exist_ok=True)
    write_mcap_of(tables, target)
    _write_missing(vehicle, tables.vehicle_text)
    _copy_reference(source.path, target)


def _into_folder(tables: RunTables, source: RunSource, out: Path, target: Path) -> None:
    with _NOTE.staged(target) as staging:
        vehicle, _ = vehicle_place(source, out, target)
        write_folder_of(tables, staging)
        _copy_reference(source.path, staging)
        note = {
            "schema": SCHEMA,
            "sccal": __version__,
            "run": source.name,
            "source": str(source.path),
            "files": sorted(path.name for path in staging.iterdir()),
            "notices": [asdict(notice) for notice in tables.notices],
        }
        write_bytes(staging / NOTE_FILE, (json.dumps(note, indent=2, ensure_ascii=False) + "\n").encode())
    _write_missing(vehicle, tables.vehicle_text)


def _write_missing(path: Path, text: bytes) -> None:
    if not path.exists() or path.read_bytes() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, text)


def _copy_reference(run: Path, target: Path) -> None:
    """A degraded log's reference and manifest go along, so that what judges it is not lost."""
    for name in (REFERENCE_FILE, MANIFEST_FILE):
        there, here = beside(run, name), beside(target, name)
        if there.is_file():
            write_bytes(here, there.read_bytes())
        else:
            here.unlink(missing_ok=True)


def _files_noted(document: Any) -> list[str]:
    if document["schema"] != SCHEMA:
        raise ValueError(document["schema"])
    return [name for name in document["files"] if name in (*RUN_FILES, REFERENCE_FILE, MANIFEST_FILE)]


_NOTE = Note(NOTE_FILE, "note", "convert", _files_noted)
