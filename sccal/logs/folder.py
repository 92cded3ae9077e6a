"""A run's folder, listed once, and each of its streams read from the file that holds it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from sccal.errors import DataError
from sccal.logs.formats import (
    FIXES,
    HEADINGS,
    RUN_FILES,
    WHEELS,
    are_of_a_bag,
    foreign_fixes,
    may_be_table,
    run_files_in,
)
from sccal.logs.mapping import NMEA_FORMAT, FileMapping, StreamKey, shown
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, GNSS_FILE, NMEA_FILE, VEHICLE_FILE
from sccal.logs.streams import FixStream, HeadingStream, Notice, Vehicle, WheelStream

if TYPE_CHECKING:
    from sccal.logs.mapped import MappedFile
    from sccal.logs.table import Table

_FEWEST_ROWS = 2
_MOST_OTHERS = 8
_OWN = (VEHICLE_FILE, "truth.json", "convert.json", "degrade.json", "reference.csv")
"""Files beside a run that are no logs."""
_ANY_FIXES = f"{NMEA_FILE} (or {GNSS_FILE})"


@dataclass(frozen=True)
class RunFolder:
    """The run files in a folder. What reads a stream raises DataError where it is missing or cannot be used."""

    path: Path
    there: tuple[str, ...]
    """Regular files, in the order of RUN_FILES."""
    odd: tuple[str, ...] = ()
    """Run files that are no regular files, and are not opened."""
    is_bag: bool = False
    """Whether the folder is one ROS 2 bag, and none of the run files is there."""
    spelled: Mapping[str, str] = field(default_factory=dict)
    """How the folder spells a run file's name, where not as the contract does."""
    others: tuple[str, ...] = ()
    """Files that may be logs under other names, for messages."""
    foreign: str = ""
    """A file of another program that its fixes are read from, where none of the run files holds them."""
    mapped: Mapping[StreamKey, MappedFile] = field(default_factory=dict)
    """The user's own files that vehicle.toml maps to streams, and that are here; they come before the run files."""
    mapping: FileMapping | None = None

    def file(self, name: str) -> Path:
        """Where a run file is."""
        return self.path / self.spelled.get(name, name)

    @property
    def fix_file(self) -> str:
        """The file that the fixes are read from; empty where there is none."""
        own = self.mapped.get("gnss")
        return own.path.name if own is not None else self._first(FIXES) or self.foreign

    @property
    def read_files(self) -> tuple[str, ...]:
        """Names of the files that the run is read from, each once."""
        own = (one.path.name for one in self.mapped.values())
        return tuple(dict.fromkeys((*own, *self.there)))

    def wheel_table(self, radius_m: float = 1.0) -> Table:
        """The wheels' rows before any repair; travel in metres is turned into that of wheels of the radius."""
        own = self.mapped.get("encoder")
        if own is not None:
            return own.wheel_table(radius_m)
        from sccal.logs.encoder import encoder_table

        return encoder_table(self.file(self._first(WHEELS) or self._lacking(ENCODER_FILE)))

    def require_all(self) -> None:
        """Raise DataError with what the folder lacks for a calibration."""
        wanted: tuple[tuple[StreamKey, str], ...] = (("encoder", ENCODER_FILE), ("ahrs", AHRS_FILE))
        lacking = [name for key, name in wanted if key not in self.mapped and name not in self.there]
        if lacking == [AHRS_FILE] and (self._first(HEADINGS) or self._nmea is not None):
            lacking = []
        missing = [self._wanted(key, name) for key, name in wanted if name in lacking]
        if not self.fix_file:
            missing.append(self._wanted("gnss", _ANY_FIXES))
        if missing:
            found = ", ".join(self.read_files) or "none of the run files"
            odd = f"; not a regular file: {', '.join(self.odd)}" if self.odd else ""
            others = f"; not read: {', '.join(self.others)}" if self.others else ""
            if any(may_be_table(name) for name in self.others):
                others += f"; `sccal init {self.path}` proposes a mapping"
            raise DataError(f"{self.path}: lacks {', '.join(missing)}; found {found}{odd}{others}")

    def require_contract(self, what: str) -> None:
        """Raise DataError where the run is read from files of the user's own."""
        if self.mapped:
            names = ", ".join(one.path.name for one in self.mapped.values())
            raise DataError(
                f"{self.path}: files that {VEHICLE_FILE} maps ({names}) are calibrated and diagnosed as they are, "
                f"and not {what}"
            )

    def wheels(self, vehicle: Vehicle) -> tuple[WheelStream, tuple[Notice, ...]]:
        """The wheels, repaired by what the vehicle declares."""
        own = self.mapped.get("encoder")
        if own is not None:
            path, (wheels, notices) = own.path, own.wheels(vehicle)
        else:
            name = self._first(WHEELS) or self._lacking(ENCODER_FILE)
            path = self.file(name)
            wheels, notices = WHEELS[name](path, vehicle)
        require_rows(path, wheels.t_s.size, notices)
        return wheels, notices

    def heading(self) -> tuple[HeadingStream, tuple[Notice, ...]]:
        """The heading: of the AHRS, and where there is none the receiver's own."""
        own = self.mapped.get("ahrs")
        if own is not None:
            heading, notices = own.heading()
            require_rows(own.path, heading.t_s.size, notices)
            return heading, notices
        nmea = None if self._first(HEADINGS) else self._nmea
        name = NMEA_FILE if nmea is not None else self._first(HEADINGS) or self._lacking(AHRS_FILE)
        try:
            heading, notices = HEADINGS[name](nmea or self.file(name))
        except DataError as error:
            if name == AHRS_FILE:
                raise
            found = f"{self.path}: lacks {self._wanted('ahrs', AHRS_FILE)}; found {', '.join(self.read_files)}"
            raise DataError(f"{found}, and no heading stands in for it: {error}") from error
        require_rows(self.path / heading.source, heading.t_s.size, notices)
        return heading, notices

    def fixes(self) -> tuple[FixStream, tuple[Notice, ...]]:
        """The fixes; a second file with fixes is told, and not read."""
        name = self.fix_file or self._lacking(_ANY_FIXES)
        own = self.mapped.get("gnss")
        fixes, notices = own.fixes() if own is not None else (foreign_fixes(name) or FIXES[name])(self.file(name))
        others = [other for other in self.there if other in FIXES and other != name]
        notices = (*(Notice(other, f"file not read because {name} is there too", 1) for other in others), *notices)
        require_rows(self.path / name, fixes.lat_deg.size, notices)
        return fixes, notices

    @property
    def _nmea(self) -> Path | None:
        """The user's own file of NMEA sentences, which may hold the receiver's heading too."""
        own = self.mapped.get("gnss")
        return own.path if own is not None and own.section.format == NMEA_FORMAT else None

    def _wanted(self, stream: StreamKey, name: str) -> str:
        """A file that is missing, under the name that vehicle.toml gives it, if it does."""
        section = None if self.mapping is None else self.mapping.sections.get(stream)
        return name if section is None else f"{shown(section.file)} ([files.{stream}] of {VEHICLE_FILE})"

    def _first(self, readers: Iterable[str]) -> str:
        return next((name for name in readers if name in self.there), "")

    def _lacking(self, name: str) -> NoReturn:
        raise DataError(f"{self.path}: lacks {name}")


def listed_folder(path: Path, mapping: FileMapping | None = None) -> RunFolder:
    """List a run's folder; capitals in the names of its files do not matter.

    Raises DataError where the mapping means several files of the folder by one name.
    """
    names = {entry.name for entry in path.iterdir()}
    own = _mapped(path, names, mapping)
    actual = run_files_in(names)
    regular = {name: (path / actual[name]).is_file() for name in RUN_FILES if name in actual}
    there = tuple(name for name in regular if regular[name])
    odd = tuple(actual[name] for name in regular if not regular[name])
    spelled = {name: theirs for name, theirs in actual.items() if theirs != name}
    known = {*actual.values(), *_OWN, *(one.path.name for one in own.values())}
    others = tuple(sorted(name for name in names - known if (path / name).is_file() and not name.startswith(".")))
    foreign = [name for name in others if foreign_fixes(name) is not None]
    only = foreign[0] if len(foreign) == 1 else ""
    bag = not there and not own and are_of_a_bag(names)
    return RunFolder(path, there, odd, bag, spelled, others[:_MOST_OTHERS], only, own, mapping)


def _mapped(path: Path, names: Collection[str], mapping: FileMapping | None) -> dict[StreamKey, MappedFile]:
    """The files of a folder that vehicle.toml maps to streams."""
    if mapping is None or not mapping.sections:
        return {}
    from sccal.logs.mapped import MappedFile

    regular = [name for name in names if (path / name).is_file()]
    files = {stream: mapping.file_of(stream, regular) for stream in mapping.sections}
    return {stream: MappedFile(path / name, mapping, stream) for stream, name in files.items() if name is not None}


def require_rows(path: Path | str, usable: int, notices: Sequence[Notice]) -> None:
    """Raise DataError where a file has too few rows to be a stream, with why."""
    if usable < _FEWEST_ROWS:
        why = "; ".join(f"{notice.count} {notice.what}" for notice in notices) or "the file holds no more"
        raise DataError(f"{path}: {usable} usable rows, at least {_FEWEST_ROWS} are needed: {why}")
