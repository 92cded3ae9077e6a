"""A run's folder, listed once, and each of its streams read from the file that holds it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from sccal.errors import DataError
from sccal.logs.formats import FIXES, HEADINGS, RUN_FILES, WHEELS, are_of_a_bag, foreign_fixes, run_files_in
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, GNSS_FILE, NMEA_FILE, VEHICLE_FILE
from sccal.logs.streams import FixStream, HeadingStream, Notice, Vehicle, WheelStream

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

    def file(self, name: str) -> Path:
        """Where a run file is."""
        return self.path / self.spelled.get(name, name)

    @property
    def fix_file(self) -> str:
        """The file that the fixes are read from; empty where there is none."""
        return self._first(FIXES) or self.foreign

    @property
    def wheel_path(self) -> Path:
        """The file that the wheels are read from."""
        return self.file(self._first(WHEELS) or self._lacking(ENCODER_FILE))

    def require_all(self) -> None:
        """Raise DataError with what the folder lacks for a calibration."""
        missing = [name for name in (ENCODER_FILE, AHRS_FILE) if name not in self.there]
        if missing == [AHRS_FILE] and self._first(HEADINGS):
            missing = []
        if not self.fix_file:
            missing.append(_ANY_FIXES)
        if missing:
            found = ", ".join(self.there) or "none of the run files"
            odd = f"; not a regular file: {', '.join(self.odd)}" if self.odd else ""
            others = f"; not read: {', '.join(self.others)}" if self.others else ""
            raise DataError(f"{self.path}: lacks {', '.join(missing)}; found {found}{odd}{others}")

    def wheels(self, vehicle: Vehicle) -> tuple[WheelStream, tuple[Notice, ...]]:
        """The wheels, repaired by what the vehicle declares."""
        path = self.wheel_path
        wheels, notices = WHEELS[self._first(WHEELS)](path, vehicle)
        require_rows(path, wheels.t_s.size, notices)
        return wheels, notices

    def heading(self) -> tuple[HeadingStream, tuple[Notice, ...]]:
        """The heading: of the AHRS, and where there is none the receiver's own."""
        name = self._first(HEADINGS) or self._lacking(AHRS_FILE)
        try:
            heading, notices = HEADINGS[name](self.file(name))
        except DataError as error:
            if name == AHRS_FILE:
                raise
            found = f"{self.path}: lacks {AHRS_FILE}; found {', '.join(self.there)}"
            raise DataError(f"{found}, and no heading stands in for it: {error}") from error
        require_rows(self.path / heading.source, heading.t_s.size, notices)
        return heading, notices

    def fixes(self) -> tuple[FixStream, tuple[Notice, ...]]:
        """The fixes; a second file with fixes is told, and not read."""
        name = self.fix_file or self._lacking(_ANY_FIXES)
        fixes, notices = (foreign_fixes(name) or FIXES[name])(self.file(name))
        others = [other for other in self.there if other in FIXES and other != name]
        notices = (*(Notice(other, f"file not read because {name} is there too", 1) for other in others), *notices)
        require_rows(self.path / name, fixes.lat_deg.size, notices)
        return fixes, notices

    def _first(self, readers: Iterable[str]) -> str:
        return next((name for name in readers if name in self.there), "")

    def _lacking(self, name: str) -> NoReturn:
        raise DataError(f"{self.path}: lacks {name}")


def listed_folder(path: Path) -> RunFolder:
    """List a run's folder; capitals in the names of its files do not matter."""
    names = {entry.name for entry in path.iterdir()}
    actual = run_files_in(names)
    regular = {name: (path / actual[name]).is_file() for name in RUN_FILES if name in actual}
    there = tuple(name for name in regular if regular[name])
    odd = tuple(actual[name] for name in regular if not regular[name])
    spelled = {name: theirs for name, theirs in actual.items() if theirs != name}
    known = {*actual.values(), *_OWN}
    others = tuple(sorted(name for name in names - known if (path / name).is_file() and not name.startswith(".")))
    foreign = [name for name in others if foreign_fixes(name) is not None]
    only = foreign[0] if len(foreign) == 1 else ""
    return RunFolder(path, there, odd, not there and are_of_a_bag(names), spelled, others[:_MOST_OTHERS], only)


def require_rows(path: Path | str, usable: int, notices: Sequence[Notice]) -> None:
    """Raise DataError where a file has too few rows to be a stream, with why."""
    if usable < _FEWEST_ROWS:
        why = "; ".join(f"{notice.count} {notice.what}" for notice in notices) or "the file holds no more"
        raise DataError(f"{path}: {usable} usable rows, at least {_FEWEST_ROWS} are needed: {why}")
