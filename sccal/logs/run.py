"""Runs in folders: finding them, and reading one into its streams."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sccal.errors import DataError, Failure, UsageError
from sccal.logs.ahrs import read_ahrs
from sccal.logs.encoder import read_encoder
from sccal.logs.gnss_csv import read_gnss_csv
from sccal.logs.nmea import read_nmea, read_nmea_heading
from sccal.logs.reference import read_reference
from sccal.logs.streams import HeadingStream, Notice, Run
from sccal.logs.vehicle import MINIMAL_VEHICLE, read_vehicle

RUN_FILES = ("encoder.csv", "ahrs.csv", "gnss.nmea", "gnss.csv")
"""Any of these makes a folder a run."""
_FEWEST_ROWS = 2


@dataclass(frozen=True)
class RunSource:
    """A run found, not yet read."""

    name: str
    """Unique within one call; may hold '/'."""
    path: Path
    vehicle_toml: Path | None
    """The vehicle.toml that applies: the run's own or the nearest parent's, up to the path given."""
    searched_up_to: Path | None = None
    """The path given on the command line, where the search for vehicle.toml ended; None for the folder itself."""


def discover(paths: Sequence[Path]) -> list[RunSource]:
    """All runs below the given paths, each once, in natural order within each path.

    Raises:
        UsageError: no path, or one that does not exist.
        DataError: a path that holds no run.
    """
    if not paths:
        raise UsageError("no path given; name a run's folder or a folder of runs")
    found: list[RunSource] = []
    seen: set[Path] = set()
    for path in paths:
        root = _root(path)
        sources = [
            RunSource(_name_below(root, folder), folder, _nearest_vehicle(folder, root), root)
            for folder in sorted(_run_folders(root), key=lambda folder: _natural(folder.relative_to(root)))
        ]
        if not sources:
            raise DataError(f"{path}: no run in this folder or below; a run's folder holds {', '.join(RUN_FILES)}")
        found += [source for source in sources if source.path.resolve() not in seen]
        seen |= {source.path.resolve() for source in sources}
    return _with_unique_names(found)


def find_runs(paths: Sequence[Path]) -> tuple[list[RunSource], list[Failure]]:
    """All runs below the paths; a path that holds none is a failure of its own, not of the others.

    Raises UsageError where a path does not exist.
    """
    fruitful: list[Path] = []
    failures: list[Failure] = []
    for path in paths:
        try:
            discover([path])
        except DataError as error:
            failures.append(Failure(str(path), error))
        else:
            fruitful.append(path)
    return (discover(fruitful) if fruitful else []), failures


def read_run(source: RunSource) -> Run:
    """Read a run's vehicle, wheels, heading and fixes, with the notices of all readers.

    Raises:
        DataError: a file is missing or cannot be used.
    """
    there = [name for name in RUN_FILES if (source.path / name).is_file()]
    missing = [name for name in ("encoder.csv", "ahrs.csv") if name not in there]
    if missing == ["ahrs.csv"] and "gnss.nmea" in there:
        missing = []
    if not {"gnss.nmea", "gnss.csv"} & set(there):
        missing.append("gnss.nmea (or gnss.csv)")
    if missing:
        raise DataError(
            f"{source.path}: lacks {', '.join(missing)}; found {', '.join(there) or 'none of the run files'}"
        )
    if source.vehicle_toml is None:
        raise DataError(
            f"{source.path}: no vehicle.toml here or above, up to {source.searched_up_to or source.path}; "
            f"add one with {MINIMAL_VEHICLE}"
        )
    vehicle, notices = read_vehicle(source.vehicle_toml)
    wheels, wheel_notices = read_encoder(source.path / "encoder.csv", vehicle)
    _require_rows(source.path / "encoder.csv", wheels.t_s.size, wheel_notices)
    heading, heading_notices = _read_heading(source.path, there)
    _require_rows(source.path / heading.source, heading.t_s.size, heading_notices)
    if "gnss.nmea" in there:
        fixes, fix_notices = read_nmea(source.path / "gnss.nmea")
        if "gnss.csv" in there:
            fix_notices = (Notice("gnss.csv", "file not read because gnss.nmea is there too", 1), *fix_notices)
    else:
        fixes, fix_notices = read_gnss_csv(source.path / "gnss.csv")
    gnss = "gnss.nmea" if "gnss.nmea" in there else "gnss.csv"
    _require_rows(source.path / gnss, fixes.lat_deg.size, fix_notices)
    return Run(
        name=source.name,
        path=source.path,
        vehicle=vehicle,
        wheels=wheels,
        heading=heading,
        fixes=fixes,
        notices=(*notices, *wheel_notices, *heading_notices, *fix_notices),
        reference=read_reference(source.path, fixes),
    )


def _read_heading(folder: Path, there: Sequence[str]) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """From ahrs.csv; where there is none, from the receiver's own headings."""
    if "ahrs.csv" in there:
        return read_ahrs(folder / "ahrs.csv")
    try:
        return read_nmea_heading(folder / "gnss.nmea")
    except DataError as error:
        raise DataError(
            f"{folder}: lacks ahrs.csv; found {', '.join(there)}, and no heading stands in for it: {error}"
        ) from error


def _require_rows(path: Path, usable: int, notices: Sequence[Notice]) -> None:
    if usable < _FEWEST_ROWS:
        why = "; ".join(f"{notice.count} {notice.what}" for notice in notices) or "the file holds no more"
        raise DataError(f"{path}: {usable} usable rows, at least {_FEWEST_ROWS} are needed: {why}")


def _root(path: Path) -> Path:
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    if path.is_dir():
        return path
    if path.name in (*RUN_FILES, "vehicle.toml"):
        return path.parent
    raise DataError(f"{path}: is not a run folder; name a folder that holds {', '.join(RUN_FILES)}")


def _run_folders(root: Path) -> Iterator[Path]:
    visited: set[str] = set()
    for folder, below, files in os.walk(root, followlinks=True):
        real = os.path.realpath(folder)
        if real in visited:
            below.clear()
            continue
        visited.add(real)
        below[:] = sorted(name for name in below if not name.startswith("."))
        if "calibration.json" in files and "encoder.csv" not in files:
            continue
        if any(name in files for name in RUN_FILES):
            yield Path(folder)


def _nearest_vehicle(folder: Path, root: Path) -> Path | None:
    """Up to the path given; where that is a run itself, its campaign's folder just above counts too."""
    if folder == root and not (folder / "vehicle.toml").is_file():
        above = root.resolve().parent / "vehicle.toml"
        return above if above.is_file() else None
    while True:
        if (folder / "vehicle.toml").is_file():
            return folder / "vehicle.toml"
        if folder == root or folder == folder.parent:
            return None
        folder = folder.parent


def _name_below(root: Path, folder: Path) -> str:
    relative = folder.relative_to(root).as_posix()
    return relative if relative != "." else root.resolve().name or "run"


def _natural(path: Path) -> list[list[tuple[int, int, str]]]:
    """A key that sorts run2 before run10."""
    return [
        [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"([0-9]+)", name) if part]
        for name in path.parts
    ]


def _with_unique_names(sources: list[RunSource]) -> list[RunSource]:
    names = [source.name for source in sources]
    taken: set[str] = set()
    unique = []
    for source in sources:
        name = source.name
        if names.count(name) > 1:
            root = source.searched_up_to or source.path
            name = f"{root.resolve().name}/{name}" if root.resolve().name and source.path != root else name
        candidate, number = name, 2
        while candidate in taken:
            candidate, number = f"{name}-{number}", number + 1
        taken.add(candidate)
        unique.append(replace(source, name=candidate))
    return unique
