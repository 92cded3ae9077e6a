"""Runs: finding them in folders, and reading one into its streams. A file of messages is a run on its own."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sccal.errors import DataError, Failure, UsageError
from sccal.logs.ahrs import read_ahrs
from sccal.logs.encoder import read_encoder
from sccal.logs.gnss_csv import read_gnss_csv
from sccal.logs.messages.bags import bag_folder_files
from sccal.logs.messages.mcap_file import RESULT_LIBRARY, library_of
from sccal.logs.messages.read import MESSAGE_SUFFIXES, read_message_log
from sccal.logs.names import natural_key
from sccal.logs.nmea import read_nmea, read_nmea_heading
from sccal.logs.options import ReadOptions
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
    """A folder, or a file of messages."""
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
    seen: set[str] = set()
    for path in paths:
        root = _root(path)
        places = [path] if is_message_file(path) else _run_places(root)
        sources = [
            RunSource(_name_below(root, place), place, _nearest_vehicle(_folder_of(place), root), root)
            for place in sorted(places, key=lambda place: natural_key(place.relative_to(root)))
        ]
        if not sources:
            raise DataError(
                f"{path}: no run in this folder or below; a run's folder holds {', '.join(RUN_FILES)}, "
                f"and {', '.join('*' + suffix for suffix in MESSAGE_SUFFIXES)} are runs on their own"
            )
        found += [source for source in sources if os.path.realpath(source.path) not in seen]
        seen |= {os.path.realpath(source.path) for source in sources}
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


def read_run(source: RunSource, options: ReadOptions | None = None) -> Run:
    """Read a run's vehicle, wheels, heading and fixes, with the notices of all readers.

    ``options`` are for logs of messages.

    Raises:
        DataError: a file is missing or cannot be used.
    """
    if is_message_log(source.path):
        return _read_message_run(source, options or ReadOptions())
    if not source.path.is_dir():
        raise DataError(f"{source.path}: is not a regular file, and is not opened; copy the log itself here")
    there = [name for name in RUN_FILES if (source.path / name).is_file()]
    missing = [name for name in ("encoder.csv", "ahrs.csv") if name not in there]
    if missing == ["ahrs.csv"] and "gnss.nmea" in there:
        missing = []
    if not {"gnss.nmea", "gnss.csv"} & set(there):
        missing.append("gnss.nmea (or gnss.csv)")
    if missing:
        odd = [name for name in RUN_FILES if name not in there and os.path.lexists(source.path / name)]
        raise DataError(
            f"{source.path}: lacks {', '.join(missing)}; found {', '.join(there) or 'none of the run files'}"
            + (f"; not a regular file: {', '.join(odd)}" if odd else "")
        )
    vehicle, notices = read_vehicle(vehicle_of(source))
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


def _read_message_run(source: RunSource, options: ReadOptions) -> Run:
    vehicle, notices = read_vehicle(vehicle_of(source))
    wheels, heading, fixes, found = read_message_log(source.path, vehicle, options)
    for what, count in (("wheels", wheels.t_s), ("heading", heading.t_s), ("fixes", fixes.lat_deg)):
        _require_rows(f"{source.path} ({what})", count.size, found)
    reference = read_reference(source.path, fixes)
    return Run(source.name, source.path, vehicle, wheels, heading, fixes, (*notices, *found), reference)


def vehicle_of(source: RunSource) -> Path:
    """The vehicle.toml that applies to a run. Raises DataError where there is none."""
    if source.vehicle_toml is None:
        raise DataError(
            f"{source.path}: no vehicle.toml here or above, up to {source.searched_up_to or source.path}; "
            f"add one with {MINIMAL_VEHICLE}"
        )
    return source.vehicle_toml


def _require_rows(path: Path | str, usable: int, notices: Sequence[Notice]) -> None:
    if usable < _FEWEST_ROWS:
        why = "; ".join(f"{notice.count} {notice.what}" for notice in notices) or "the file holds no more"
        raise DataError(f"{path}: {usable} usable rows, at least {_FEWEST_ROWS} are needed: {why}")


def _root(path: Path) -> Path:
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    if path.is_dir():
        return path
    if path.name in (*RUN_FILES, "vehicle.toml") or is_message_file(path):
        return path.parent
    raise DataError(
        f"{path}: is not a run folder; name a folder that holds {', '.join(RUN_FILES)}, "
        f"or a file {', '.join('*' + suffix for suffix in MESSAGE_SUFFIXES)}"
    )


def is_message_log(path: Path) -> bool:
    """Whether a run's path is a log of messages (a file, or a bag's folder), not a folder of CSV and NMEA files."""
    return is_message_file(path) or is_bag_folder(path)


def is_message_file(path: Path) -> bool:
    """Whether a path is a file that is a run on its own."""
    return path.suffix.lower() in MESSAGE_SUFFIXES and path.is_file()


def is_bag_folder(path: Path) -> bool:
    """Whether a path is a rosbag2 folder."""
    return (
        path.is_dir()
        and not any((path / name).is_file() for name in RUN_FILES)
        and bag_folder_files([file.name for file in path.iterdir()])
    )


def _folder_of(place: Path) -> Path:
    return place if place.is_dir() else place.parent


def _run_places(root: Path) -> Iterator[Path]:
    """Folders and files that are runs."""
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
        if any(name in files for name in RUN_FILES) or bag_folder_files(files):
            yield Path(folder)
        bag = bag_folder_files(files)
        for name in files:
            suffix = Path(name).suffix.lower()
            if suffix in MESSAGE_SUFFIXES and not name.startswith(".") and not (bag and suffix == ".db3"):
                path = Path(folder) / name
                if suffix != ".mcap" or not path.is_file() or library_of(path) != RESULT_LIBRARY:
                    yield path


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


def _name_below(root: Path, place: Path) -> str:
    relative = place.relative_to(root).as_posix()
    if place.is_file():
        return relative[: -len(place.suffix)]
    return relative if relative != "." else root.resolve().name or "run"


def _with_unique_names(sources: list[RunSource]) -> list[RunSource]:
    roots: dict[str, set[Path | None]] = {}
    for source in sources:
        roots.setdefault(source.name, set()).add(source.searched_up_to)
    taken: set[str] = set()
    unique = []
    for source in sources:
        name = source.name
        if len(roots[name]) > 1:
            root = source.searched_up_to or source.path
            name = f"{root.resolve().name}/{name}" if root.resolve().name and source.path != root else name
        if name in taken and source.path.is_file():
            name += source.path.suffix
        candidate, number = name, 2
        while candidate in taken:
            candidate, number = f"{name}-{number}", number + 1
        taken.add(candidate)
        unique.append(replace(source, name=candidate))
    return unique
