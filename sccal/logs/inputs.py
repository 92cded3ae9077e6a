"""What a result was made from: every file that reading a run opens, by size and SHA-256."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from sccal.errors import DataError
from sccal.logs.messages.parts import parts_after
from sccal.logs.reference import MANIFEST_FILE, REFERENCE_FILE, beside
from sccal.logs.run import RunSource


@dataclass(frozen=True)
class InputFile:
    """One file of a run."""

    name: str
    """Without its folder, but for the files of a bag's folder."""
    size_bytes: int
    sha256: str


def input_files(source: RunSource) -> tuple[InputFile, ...]:
    """Every file that a run is read from, its vehicle.toml and what `sccal degrade` left beside it among them.

    Raises:
        DataError: a file that cannot be read.
    """
    found = []
    for name, path in input_paths(source):
        try:
            with path.open("rb") as file:
                found.append(InputFile(name, path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest()))
        except OSError as error:
            raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    return tuple(found)


def input_paths(source: RunSource) -> Iterator[tuple[str, Path]]:
    """Name and path of every file that a run is read from; nothing is opened."""
    run = source.path
    if run.is_file():
        yield from ((path.name, path) for path in (run, *parts_after(run)))
    elif source.folder is None:
        yield from ((path.relative_to(run).as_posix(), path) for path in sorted(run.rglob("*")) if path.is_file())
    else:
        yield from ((name, source.folder.file(name)) for name in source.folder.read_files)
    if source.vehicle_toml is not None:
        yield source.vehicle_toml.name, source.vehicle_toml
    yield from ((path.name, path) for name in (REFERENCE_FILE, MANIFEST_FILE) if (path := beside(run, name)).is_file())
