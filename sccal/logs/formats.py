"""Every form that a log may have, once: its name or ending, how it is recognised, what reads it, what it forgives.

A run is a folder of files with fixed names, a file of messages, or the folder of a ROS 2 bag. This table is light: what
reads a form is loaded when it is first called, so that the command line can go by names before anything heavy is there.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from sccal.logs.compressed import is_packed, plain_name
from sccal.logs.csv_header import require_csv
from sccal.logs.messages.mcap_magic import require_mcap
from sccal.logs.names import AHRS_FILE, BAG_FILE, ENCODER_FILE, GNSS_FILE, NMEA_FILE

if TYPE_CHECKING:
    from sccal.logs.messages.mcap_file import OpenChannel
    from sccal.logs.streams import FixStream, HeadingStream, Notice, Vehicle, WheelStream

Look = Callable[[Path], None]
"""Raises DataError where a file's first bytes show that it has not the form that its name says."""


@dataclass(frozen=True)
class FolderFile:
    """A file that makes its folder a run, and what reads each stream that it holds."""

    name: str
    forgives: str
    look: Look | None = None
    wheels: Callable[[Path, Vehicle], tuple[WheelStream, tuple[Notice, ...]]] | None = None
    heading: Callable[[Path], tuple[HeadingStream, tuple[Notice, ...]]] | None = None
    fixes: Callable[[Path], tuple[FixStream, tuple[Notice, ...]]] | None = None


@dataclass(frozen=True)
class MessageFormat:
    """Files that are runs on their own; ``read`` hands their messages to sinks and keeps an MCAP file's metadata."""

    suffix: str
    forgives: str
    read: Callable[[Path, OpenChannel, dict[str, dict[str, str]]], tuple[Notice, ...]]
    look: Look | None = None


def _encoder(path: Path, vehicle: Vehicle) -> tuple[WheelStream, tuple[Notice, ...]]:
    from sccal.logs.encoder import read_encoder

    return read_encoder(path, vehicle)


def _ahrs(path: Path) -> tuple[HeadingStream, tuple[Notice, ...]]:
    from sccal.logs.ahrs import read_ahrs

    return read_ahrs(path)


def _nmea_heading(path: Path) -> tuple[HeadingStream, tuple[Notice, ...]]:
    from sccal.logs.nmea import read_nmea_heading

    return read_nmea_heading(path)


def _nmea_fixes(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    from sccal.logs.gpsd import looks_like_gpsd, read_gpsd
    from sccal.logs.nmea import read_nmea

    return read_gpsd(path) if looks_like_gpsd(path) else read_nmea(path)


def _gnss_csv(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    from sccal.logs.gnss_csv import read_gnss_csv

    return read_gnss_csv(path)


def _pos(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    from sccal.logs.rtklib_pos import read_pos

    return read_pos(path)


def _gpsd(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    from sccal.logs.gpsd import read_gpsd

    return read_gpsd(path)


def _mcap(path: Path, open_channel: OpenChannel, metadata: dict[str, dict[str, str]]) -> tuple[Notice, ...]:
    from sccal.logs.messages.mcap_file import read_mcap

    return read_mcap(path, open_channel, metadata)


def _ros1(path: Path, open_channel: OpenChannel, _: dict[str, dict[str, str]]) -> tuple[Notice, ...]:
    from sccal.logs.messages.bags import read_ros1_bag

    return read_ros1_bag(path, open_channel)


def _ros2(path: Path, open_channel: OpenChannel, _: dict[str, dict[str, str]]) -> tuple[Notice, ...]:
    from sccal.logs.messages.bags import read_ros2_bag

    return read_ros2_bag(path, open_channel)


_ROWS = "rows that cannot be read, are doubled or out of order, and a cut last line"
_LINES = "sentences with a wrong checksum or cut, and whatever else stands between them"
_BREAK = "a file that breaks off: all before is read"

ENCODER = FolderFile(ENCODER_FILE, f"{_ROWS}; counters that wrap, reset or jump", require_csv, wheels=_encoder)
AHRS = FolderFile(AHRS_FILE, f"{_ROWS}; yaws that no AHRS gives", require_csv, heading=_ahrs)
NMEA = FolderFile(NMEA_FILE, _LINES, heading=_nmea_heading, fixes=_nmea_fixes)
GNSS = FolderFile(GNSS_FILE, f"{_ROWS}; rows without a position", require_csv, fixes=_gnss_csv)
FOLDER_FILES = (ENCODER, AHRS, NMEA, GNSS)
"""Where several hold a stream, the first that is there is read."""
RUN_FILES = tuple(one.name for one in FOLDER_FILES)
"""Any of these makes a folder a run."""
WHEELS = {one.name: one.wheels for one in FOLDER_FILES if one.wheels is not None}
HEADINGS = {one.name: one.heading for one in FOLDER_FILES if one.heading is not None}
FIXES = {one.name: one.fixes for one in FOLDER_FILES if one.fixes is not None}
"""What reads each stream, by the file's name."""

FOREIGN_FIXES = {".pos": _pos, "gpsd.json": _gpsd, ".gpsd": _gpsd}
"""What reads the fixes of other programs, by the ends of their files' names, where no run file holds them."""

MCAP = MessageFormat(".mcap", f"{_BREAK}; chunks that are damaged", _mcap, require_mcap)
ROS2 = MessageFormat(".db3", _BREAK, _ros2)
ROS1 = MessageFormat(".bag", _BREAK, _ros1)
MESSAGE_FORMATS = (MCAP, ROS2, ROS1)
MESSAGE_SUFFIXES = tuple(one.suffix for one in MESSAGE_FORMATS)

NO_LOGS = {
    ".bin": "an autopilot's log (ArduPilot .bin) is not read: write its wheel encoders, heading and fixes as the files "
    "above",
    ".ulg": "an autopilot's log (PX4 .ulg) is not read: write its wheels, heading and fixes as the files above",
    ".bag.active": "a ROS 1 bag that was not closed: `rosbag reindex` mends it, then name it .bag",
    ".gz": "compressed, and not one of the files above by its name: `gunzip` it first",
    ".bz2": "compressed, and not one of the files above by its name: `bunzip2` it first",
    ".xz": "compressed, and not one of the files above by its name: `unxz` it first",
    ".zst": "compressed, and not one of the files above by its name: `zstd -d` it first",
    ".zstd": "compressed: `zstd -d` it first, and name the result .mcap or .db3",
    ".gpx": "a .gpx track holds too few decimals and no quality: log NMEA, or write gnss.csv",
}
"""What to do about files that are no runs, by the ends of their names."""


def message_suffix(name: str) -> str:
    """The ending of a file's name that says which messages it holds, compressed or not."""
    return PurePath(plain_name(name)).suffix.lower()


TABLE_SUFFIXES = (".csv", ".txt", ".tsv", ".log", ".dat", ".asc")
"""Ends of the names under which loggers write tables."""
_NO_TABLES = ("reference.csv", "trajectory.csv", "requirements.txt", "cmakelists.txt")


def may_be_table(name: str) -> bool:
    """Whether a file of this name may be a table of a user's own columns."""
    plain = name.lower()
    return plain.endswith(TABLE_SUFFIXES) and plain not in _NO_TABLES and not name.startswith(".")


def message_format(path: Path) -> MessageFormat | None:
    """The row of a file that is a run on its own; None for any other file and for folders."""
    suffix = message_suffix(path.name)
    return next((one for one in MESSAGE_FORMATS if one.suffix == suffix and path.is_file()), None)


def run_files_in(names: Collection[str]) -> dict[str, str]:
    """Which of a folder's names are run files, by the contract's name; capitals do not matter, an exact name does.

    A compressed file counts where no other one of the name is there.
    """
    found = {plain_name(name).lower(): name for name in sorted(names, key=lambda name: (not is_packed(name), name))}
    return {name: name if name in names else found[name] for name in RUN_FILES if name in found}


def foreign_fixes(name: str) -> Callable[[Path], tuple[FixStream, tuple[Notice, ...]]] | None:
    """What reads the fixes of a file of another program; None for any other file."""
    return next((read for end, read in FOREIGN_FIXES.items() if plain_name(name).lower().endswith(end)), None)


def are_of_a_bag(names: Collection[str]) -> bool:
    """Whether files of these names make their folder one ROS 2 run in SQLite."""
    return BAG_FILE in names and any(name.lower().endswith(ROS2.suffix) for name in names)
