"""Runs: finding them in folders, and reading one into its streams. A file of messages is a run on its own."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path, PurePath

from sccal.errors import DataError, Failure, UsageError
from sccal.logs.compressed import is_packed, plain_name
from sccal.logs.csv_header import header_in_words
from sccal.logs.folder import RunFolder, listed_folder, require_rows
from sccal.logs.formats import (
    MCAP,
    MESSAGE_SUFFIXES,
    NO_LOGS,
    ROS2,
    RUN_FILES,
    are_of_a_bag,
    may_be_table,
    message_format,
    message_suffix,
    run_files_in,
)
from sccal.logs.mapping import FileMapping
from sccal.logs.messages.mcap_file import RESULT_LIBRARY, library_of
from sccal.logs.messages.parts import later_parts
from sccal.logs.messages.read import read_message_log
from sccal.logs.names import BAG_FILE, ENCODER_FILE, VEHICLE_FILE, natural_key
from sccal.logs.one_clock import on_one_clock
from sccal.logs.options import ReadOptions
from sccal.logs.reference import read_reference
from sccal.logs.streams import Run
from sccal.logs.vehicle import MINIMAL_VEHICLE, read_mapping, read_vehicle

_LISTED = 8


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

    @cached_property
    def folder(self) -> RunFolder | None:
        """The folder that the run is, listed when first asked for; None for a log of messages.

        Raises DataError where the run is neither.
        """
        if message_format(self.path) is not None:
            return None
        if not self.path.is_dir():
            raise DataError(f"{self.path}: is not a regular file, and is not opened; copy the log itself here")
        folder = listed_folder(self.path, self._mapping())
        return None if folder.is_bag else folder

    def _mapping(self) -> FileMapping | None:
        """What vehicle.toml says of the files; where it is broken, what has the contract's names is still read."""
        try:
            return None if self.vehicle_toml is None else read_mapping(self.vehicle_toml)
        except DataError:
            if run_files_in([entry.name for entry in self.path.iterdir()]):
                return None
            raise


def discover(paths: Sequence[Path]) -> list[RunSource]:
    """All runs below the given paths, each once, in natural order within each path.

    Raises:
        UsageError: no path, or one that does not exist.
        DataError: a path that holds no run.
    """
    if not paths:
        raise UsageError("no path given; name a run's folder or a folder of runs")
    found, failures = find_runs(paths)
    if failures:
        raise failures[0].error
    return found


def find_runs(paths: Sequence[Path]) -> tuple[list[RunSource], list[Failure]]:
    """All runs below the paths; a path that holds none is a failure of its own, not of the others.

    Raises UsageError where a path does not exist.
    """
    found: list[RunSource] = []
    failures: list[Failure] = []
    seen: set[str] = set()
    for path in paths:
        try:
            sources = _below(path)
        except DataError as error:
            failures.append(Failure(str(path), error))
            continue
        found += [source for source in sources if os.path.realpath(source.path) not in seen]
        seen |= {os.path.realpath(source.path) for source in sources}
    return _with_unique_names(found), failures


def _below(path: Path) -> list[RunSource]:
    """The runs below one path. Raises DataError where there is none."""
    root = _root(path)
    places = [path] if message_format(path) is not None else _run_places(root)
    sources = [
        RunSource(_name_below(root, place), place, _nearest_vehicle(_folder_of(place), root), root)
        for place in sorted(places, key=lambda place: natural_key(place.relative_to(root)))
    ]
    if not sources:
        raise DataError(
            f"{path}: no run in this folder or below; a run's folder holds {', '.join(RUN_FILES)}, "
            f"and {', '.join('*' + suffix for suffix in MESSAGE_SUFFIXES)} are runs on their own{_lying_in(root)}"
        )
    return sources


def _lying_in(root: Path) -> str:
    """What lies in a folder without a run, and what can be done with it where that is known."""
    walked = islice(os.walk(root), _LISTED)
    places = (Path(folder, name).relative_to(root).as_posix() for folder, _, files in walked for name in sorted(files))
    names = [name for name in places if PurePath(name).name not in (VEHICLE_FILE, BAG_FILE)]
    if not names:
        return ""
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    advice = [text for ending, text in NO_LOGS.items() if any(name.lower().endswith(ending) for name in names)]
    tables = [name for name in names if may_be_table(PurePath(name).name)]
    if tables:
        advice += [f"{tables[0]} {header_in_words(root / tables[0])}", f"`sccal init {root}` proposes a mapping"]
    first = [*tables, *(name for name in names if name not in tables)][:_LISTED]
    return "; ".join([f"; found {', '.join(first)}{more}", *advice])


def read_run(source: RunSource, options: ReadOptions | None = None) -> Run:
    """Read a run's vehicle, wheels, heading and fixes, with the notices of all readers.

    ``options`` are for logs of messages.

    Raises:
        DataError: a file is missing or cannot be used.
    """
    folder = source.folder
    if folder is None:
        return _read_message_run(source, options or ReadOptions())
    folder.require_all()
    vehicle, notices = read_vehicle(vehicle_of(source))
    wheels, wheel_notices = folder.wheels(vehicle)
    heading, heading_notices = folder.heading()
    fixes, fix_notices = folder.fixes()
    heading, fixes, clock_notices = on_one_clock(wheels, heading, fixes)
    return Run(
        name=source.name,
        path=source.path,
        vehicle=vehicle,
        wheels=wheels,
        heading=heading,
        fixes=fixes,
        notices=(*notices, *wheel_notices, *heading_notices, *fix_notices, *clock_notices),
        reference=read_reference(source.path, fixes),
    )


def _read_message_run(source: RunSource, options: ReadOptions) -> Run:
    vehicle, notices = read_vehicle(vehicle_of(source))
    wheels, heading, fixes, found = read_message_log(source.path, vehicle, options)
    for what, count in (("wheels", wheels.t_s), ("heading", heading.t_s), ("fixes", fixes.lat_deg)):
        require_rows(f"{source.path} ({what})", count.size, found)
    reference = read_reference(source.path, fixes)
    return Run(source.name, source.path, vehicle, wheels, heading, fixes, (*notices, *found), reference)


def vehicle_of(source: RunSource) -> Path:
    """The vehicle.toml that applies to a run. Raises DataError where there is none."""
    if source.vehicle_toml is None:
        raise DataError(
            f"{source.path}: no {VEHICLE_FILE} here or above, up to {source.searched_up_to or source.path}; "
            f"add one with {MINIMAL_VEHICLE}"
        )
    return source.vehicle_toml


def _root(path: Path) -> Path:
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    if path.is_dir():
        return path
    if plain_name(path.name).lower() in (*RUN_FILES, VEHICLE_FILE) or message_format(path) is not None:
        return path.parent
    raise DataError(
        f"{path}: is not a run folder; name a folder that holds {', '.join(RUN_FILES)}, "
        f"or a file {', '.join('*' + suffix for suffix in MESSAGE_SUFFIXES)}"
    )


def _folder_of(place: Path) -> Path:
    return place if place.is_dir() else place.parent


def _run_places(root: Path) -> Iterator[Path]:
    """Folders and files that are runs."""
    visited: set[str] = set()
    mapped = _Mappings(root)
    for folder, below, files in os.walk(root, followlinks=True):
        real = os.path.realpath(folder)
        if real in visited:
            below.clear()
            continue
        visited.add(real)
        below[:] = sorted(name for name in below if not name.startswith("."))
        if "calibration.json" in files and ENCODER_FILE not in files:
            continue
        bag = are_of_a_bag(files)
        if bag or run_files_in(files) or mapped.claims(Path(folder), files):
            yield Path(folder)
        later = later_parts(Path(folder), files)
        for name in files:
            suffix = message_suffix(name)
            if (
                name not in later
                and not _unpacked_beside(name, files)
                and suffix in MESSAGE_SUFFIXES
                and not name.startswith(".")
                and not (suffix == ROS2.suffix and (bag or (is_packed(name) and BAG_FILE in files)))
            ):
                path = Path(folder) / name
                if message_format(path) is not MCAP or library_of(path) != RESULT_LIBRARY:
                    yield path


def _unpacked_beside(name: str, files: Sequence[str]) -> bool:
    """Whether a compressed file stands beside itself unpacked: the same drive is not read twice."""
    return is_packed(name) and plain_name(name) in files


@dataclass
class _Mappings:
    """What the vehicle.toml files below a root say of the runs' files, each read once."""

    root: Path
    read: dict[Path, FileMapping | None] = field(default_factory=dict)

    def claims(self, folder: Path, files: Sequence[str]) -> bool:
        """Whether a folder's files are a run by the vehicle.toml that applies to it.

        Where that cannot be read, whatever could be a table is: reading it then says why it is none.
        """
        vehicle = _nearest_vehicle(folder, self.root)
        if vehicle is None:
            return False
        if vehicle not in self.read:
            try:
                self.read[vehicle] = read_mapping(vehicle)
            except DataError:
                self.read[vehicle] = None
        mapping = self.read[vehicle]
        return any(may_be_table(name) for name in files) if mapping is None else mapping.claims(files)


def _nearest_vehicle(folder: Path, root: Path) -> Path | None:
    """Up to the path given; where that is a run itself, its campaign's folder just above counts too."""
    if folder == root and not (folder / VEHICLE_FILE).is_file():
        above = root.resolve().parent / VEHICLE_FILE
        return above if above.is_file() else None
    while True:
        if (folder / VEHICLE_FILE).is_file():
            return folder / VEHICLE_FILE
        if folder == root or folder == folder.parent:
            return None
        folder = folder.parent


def _name_below(root: Path, place: Path) -> str:
    relative = place.relative_to(root).as_posix()
    if place.is_file():
        return relative[: -len(place.name)] + Path(plain_name(place.name)).stem
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
