"""``[files]`` of ``vehicle.toml``: a user's own files, which of their columns hold what, and in which unit.

Every key is checked: one that is not known is refused with those that are like it, and every refusal names the line.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal, get_args

from sccal.errors import DataError

StreamKey = Literal["encoder", "ahrs", "gnss"]
STREAM_KEYS: tuple[StreamKey, ...] = get_args(StreamKey)
"""In the order in which a file that several share gives its further columns to one of them."""
ISO = "iso"
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, ISO: math.nan}
"""Seconds in one of each; none for dates and times in words of ISO 8601."""
ANGLE_UNITS = {
    **{"deg": math.radians(1.0), "rad": 1.0, "turns": math.tau, "gon": math.tau / 400.0},
    **{"cdeg": math.radians(0.01), "ddeg": math.radians(0.1), "mrad": 1e-3},
}
"""Radians in one of each; cdeg and ddeg are hundredths and tenths of a degree."""
PLACE_UNITS = {"deg": 1.0, "1e-7 deg": 1e-7, "rad": math.degrees(1.0)}
"""Degrees in one of each."""
LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
TURN_RATE_UNITS = {"deg/s": math.radians(1.0), "rad/s": 1.0}
COUNT_UNITS = ("ticks", "rad", "m")
RATE_UNITS = ("rpm", "rad/s", "m/s", "ticks/s")
"""Of wheels: rates are integrated."""
LOCAL = "local"
"""A plane of metres that lies nowhere in particular, instead of an EPSG code."""
NMEA_FORMAT = "nmea"
_NO_UNIT = {"": 1.0}
_WHEEL_UNITS = dict.fromkeys((*COUNT_UNITS, *RATE_UNITS), 1.0)
_SHOWN = 12
_LONGEST_SHOWN = 40
_LONGEST_NAME = 200


@dataclass(frozen=True)
class _Key:
    """What a key of a section may say: its units, the first of which needs no words where ``plain``."""

    units: Mapping[str, float]
    plain: bool = True
    may_be_reversed: bool = False
    columns: int = 1


_KEYS: Mapping[StreamKey, Mapping[str, _Key]] = {
    "encoder": {
        "time": _Key(TIME_UNITS),
        "left": _Key(_WHEEL_UNITS, plain=False, may_be_reversed=True),
        "right": _Key(_WHEEL_UNITS, plain=False, may_be_reversed=True),
    },
    "ahrs": {
        "time": _Key(TIME_UNITS),
        "heading": _Key(ANGLE_UNITS, plain=False),
        "quaternion": _Key(_NO_UNIT, columns=4),
        "pitch": _Key(ANGLE_UNITS, plain=False),
        "roll": _Key(ANGLE_UNITS, plain=False),
        "sigma": _Key(ANGLE_UNITS, plain=False),
        "turn_rate": _Key(TURN_RATE_UNITS, plain=False),
    },
    "gnss": {
        "time": _Key(TIME_UNITS),
        "latitude": _Key(PLACE_UNITS),
        "longitude": _Key(PLACE_UNITS),
        "east": _Key(LENGTH_UNITS),
        "north": _Key(LENGTH_UNITS),
        "height": _Key(LENGTH_UNITS),
        "quality": _Key(_NO_UNIT),
        "sigma": _Key(LENGTH_UNITS),
        "sigma_east": _Key(LENGTH_UNITS),
        "sigma_north": _Key(LENGTH_UNITS),
    },
}
_NEEDED: Mapping[StreamKey, tuple[tuple[str, ...], ...]] = {
    "encoder": (("time", "left", "right"),),
    "ahrs": (("time", "heading"), ("time", "quaternion")),
    "gnss": (("time", "latitude", "longitude"), ("time", "east", "north")),
}
"""What a section must name: one of these in full, and no key of another."""
_OWN_KEYS: Mapping[StreamKey, tuple[str, ...]] = {"encoder": (), "ahrs": (), "gnss": ("crs", "format")}


@dataclass(frozen=True)
class Use:
    """Which column (four for a quaternion: x, y, z, w) holds something, and in which unit."""

    columns: tuple[str, ...]
    unit: str
    reversed: bool = False
    """Whether it counts backwards when the robot goes forwards."""
    line: int = 0
    """Where ``vehicle.toml`` says so."""


@dataclass(frozen=True)
class Section:
    """What ``[files.encoder]``, ``[files.ahrs]`` or ``[files.gnss]`` says."""

    stream: StreamKey
    file: str
    """A name, or a pattern with * and ?, of one file in each run's folder."""
    uses: Mapping[str, Use]
    """By key."""
    crs: str = ""
    """Of east and north: an EPSG code or ``local``."""
    format: str = ""
    line: int = 0

    def matches(self, name: str) -> bool:
        """Whether a file's name is meant; capitals do not matter."""
        return fnmatchcase(name.lower(), self.file.lower())

    def unit(self, key: str) -> float:
        """What one unit of a key's column is in the unit of the inside (s, rad, deg of places, m)."""
        return _KEYS[self.stream][key].units[self.uses[key].unit]


@dataclass(frozen=True)
class FileMapping:
    """All sections of a vehicle's ``[files]``, by stream."""

    path: Path
    """The vehicle.toml that declares them."""
    sections: Mapping[StreamKey, Section] = field(default_factory=dict)

    def claims(self, names: Collection[str]) -> bool:
        """Whether a folder with files of these names holds any of the mapped ones."""
        return any(section.matches(name) for section in self.sections.values() for name in names)

    def file_of(self, stream: StreamKey, names: Collection[str]) -> str | None:
        """The file among a folder's names that a stream is read from; None where no file is meant.

        Raises DataError where several are.
        """
        section = self.sections.get(stream)
        found = sorted(name for name in names if section is not None and section.matches(name))
        if section is None or not found:
            return None
        if len(found) > 1:
            raise DataError(
                f'{self.path}, line {section.line}: [files.{stream}] file = "{shown(section.file)}" means '
                f"{len(found)} files of one folder: {listed(found)}; a run's folder holds one of them: name it, or "
                "give each run its own folder"
            )
        return found[0]

    def used_elsewhere(self, stream: StreamKey, file: str) -> frozenset[str]:
        """Columns of a file that other sections use."""
        others = (one for key, one in self.sections.items() if key != stream and one.matches(file))
        return frozenset(name for one in others for use in one.uses.values() for name in use.columns)

    def takes_further_columns(self, stream: StreamKey, file: str) -> bool:
        """Whether a file's further columns go with this stream: with the first of those that share it."""
        sharing = (key for key in STREAM_KEYS if key in self.sections and self.sections[key].matches(file))
        return next(sharing, stream) == stream


def mapping_in(document: Mapping[str, Any], text: str, path: Path) -> FileMapping:
    """The mapping that a vehicle.toml declares, of which ``text`` is the whole; empty where it declares none.

    Raises DataError for whatever is not understood.
    """
    tables = document.get("files", {})
    reader = _Reader(path, text)
    if not isinstance(tables, dict):
        raise reader.refused("files", None, "must be tables: [files.encoder], [files.ahrs], [files.gnss]")
    for name in tables:
        if name not in STREAM_KEYS:
            told = f"is not known; there are {', '.join(STREAM_KEYS)}{near(name, STREAM_KEYS)}"
            raise reader.refused("files", name, told)
    return FileMapping(path, {key: reader.section(key, tables[key]) for key in STREAM_KEYS if key in tables})


@dataclass(frozen=True)
class _Reader:
    """Reads sections of one file, and says where what it refuses stands."""

    path: Path
    text: str

    def section(self, stream: StreamKey, table: Any) -> Section:
        place = f"files.{stream}"
        if not isinstance(table, dict):
            raise self.refused("files", stream, f"must be a table: put its keys below a line [{place}]")
        keys, own = _KEYS[stream], ("file", *_OWN_KEYS[stream])
        for key in table:
            if key not in keys and key not in own:
                told = f"is not known; there are {', '.join((*own, *keys))}{near(key, (*own, *keys))}"
                if key == "convention":
                    told = 'stands below [ahrs]: convention = "enu" or "ned"'
                raise self.refused(place, key, told)
        uses = {key: self._use(place, key, table[key], keys[key]) for key in keys if key in table}
        section = Section(
            stream,
            self._file(place, table),
            uses,
            self._crs(place, table),
            self._format(place, table),
            self._line(place, None),
        )
        self._require_whole(section, place)
        return section

    def refused(self, place: str, key: str | None, what: str) -> DataError:
        """An error that names file, line and key."""
        name = f"[{place}]" if key is None else f"[{place}] {shown(key)}"
        return DataError(f"{self.path}, line {self._line(place, key)}: {name} {what}")

    def _file(self, place: str, table: Mapping[str, Any]) -> str:
        name = table.get("file")
        if not isinstance(name, str) or not name.strip():
            raise self.refused(place, "file" if "file" in table else None, 'needs a file: file = "wheel.csv"')
        if re.search(r"[/\\]", name) or len(name) > _LONGEST_NAME:
            told = f'= "{shown(name)}" must be a name or a pattern such as "wheel*.csv", without a folder'
            raise self.refused(place, "file", told)
        return name.strip()

    def _crs(self, place: str, table: Mapping[str, Any]) -> str:
        value = table.get("crs", "")
        text = value.strip() if isinstance(value, str) else "?"
        if text and text != LOCAL and not re.fullmatch(r"(?i:EPSG):\d{4,6}", text):
            told = (
                f'= {shown(str(value))} must be an EPSG code such as "EPSG:32633", or "{LOCAL}" for a plane of metres'
            )
            raise self.refused(place, "crs", told)
        return text

    def _format(self, place: str, table: Mapping[str, Any]) -> str:
        value = table.get("format", "")
        if value not in ("", NMEA_FORMAT):
            raise self.refused(
                place, "format", f'= {shown(str(value))} must be "{NMEA_FORMAT}", or left out for a table'
            )
        return str(value)

    def _use(self, place: str, key: str, value: Any, known: _Key) -> Use:
        """What a key says: ``"name"``, or ``{ column = "name", unit = "ms" }``."""
        if isinstance(value, str | int) and not isinstance(value, bool):
            value = {"column": value}
        named = "column" if known.columns == 1 else "columns"
        options = (named, "unit", *(("reversed",) if known.may_be_reversed else ()))
        unit = f', unit = "{next(iter(known.units))}"' if len(known.units) > 1 else ""
        example = f'{{ column = "name"{unit} }}' if named == "column" else '{ columns = ["qx", "qy", "qz", "qw"] }'
        if not isinstance(value, dict) or named not in value:
            raise self.refused(place, key, f"must name its {named}: {key} = {example}")
        for option in value:
            if option not in options:
                told = f"has no option {shown(option)}; there are {', '.join(options)}{near(option, options)}"
                raise self.refused(place, key, told)
        columns = value[named] if isinstance(value[named], list) else [value[named]]
        names = tuple(str(one) for one in columns if isinstance(one, str | int) and not isinstance(one, bool))
        if len(names) != known.columns or len(set(names)) < len(names) or len(names) < len(columns):
            raise self.refused(place, key, f"must name {known.columns} of the header: {key} = {example}")
        flag = value.get("reversed", False)
        if not isinstance(flag, bool):
            raise self.refused(place, key, "reversed must be true or false")
        return Use(names, self._unit(place, key, value, known), flag, self._line(place, key))

    def _unit(self, place: str, key: str, value: Mapping[str, Any], known: _Key) -> str:
        unit = value.get("unit", next(iter(known.units)) if known.plain else None)
        units = [name for name in known.units if name]
        if unit is None:
            raise self.refused(place, key, f"needs a unit, one of {', '.join(units)}")
        if not isinstance(unit, str) or unit not in known.units:
            text = str(unit)
            told = f"has unit = {shown(text)}, which is none of {', '.join(units)}{near(text, units)}"
            raise self.refused(place, key, told if units else "has no unit")
        return unit

    def _require_whole(self, section: Section, place: str) -> None:
        """Refuse a section that names too little, or one thing twice."""
        if section.format == NMEA_FORMAT:
            if section.uses or section.crs:
                told = f'has format = "{NMEA_FORMAT}", whose sentences have no columns: leave out the other keys'
                raise self.refused(place, None, told)
            return
        choices = _NEEDED[section.stream]
        keys = section.uses.keys()
        given = [choice for choice in choices if set(choice) <= keys]
        if not given:
            wanted = " or ".join(", ".join(choice) for choice in choices)
            raise self.refused(place, None, f"must name {wanted}; it names {', '.join(keys) or 'no column'}")
        several = {key for choice in choices if choice not in given for key in choice} - {*given[0]}
        if len(given) > 1 or several & keys:
            told = " or ".join(", ".join(choice) for choice in choices)
            raise self.refused(place, None, f"must name {told}, and not both")
        self._require_of_one_kind(section, place)

    def _require_of_one_kind(self, section: Section, place: str) -> None:
        uses = section.uses
        if "east" in uses and not section.crs:
            told = f'names east and north and needs crs = "EPSG:32633" (whichever it is), or crs = "{LOCAL}"'
            raise self.refused(place, None, told)
        if section.crs and "east" not in uses:
            raise self.refused(place, "crs", "belongs to east and north, and this section names latitude and longitude")
        for one, other in (("left", "right"), ("latitude", "longitude"), ("east", "north")):
            if one in uses and uses[one].unit != uses[other].unit:
                told = f'has unit = "{uses[other].unit}", and {one} has "{uses[one].unit}": both must have the same'
                raise self.refused(place, other, told)
        names = [name for use in uses.values() for name in use.columns]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise self.refused(place, None, f'names the column "{shown(twice)}" twice')

    def _line(self, place: str, key: str | None) -> int:
        """The line, from 1, on which a key of a table stands; of the table itself where that cannot be told."""
        table, found = "", 0
        for number, line in enumerate(self.text.splitlines(), 1):
            header = re.match(r"\s*\[\s*([^\]]*?)\s*\]", line)
            if header:
                table = re.sub(r"\s*\.\s*", ".", header[1])
            if not found and (table == place or table.startswith(f"{place}.")):
                found = number
            begins = key is not None and re.match(rf'\s*"?{re.escape(key)}"?\s*[=.]', line)
            if (table == place and begins) or (key is not None and header and table == f"{place}.{key}"):
                return number
        return found or 1


def shown(text: str) -> str:
    """A name of a log or a file of settings for a message: printable, and not endless."""
    plain = "".join(mark if mark.isprintable() else "?" for mark in text)
    return plain if len(plain) <= _LONGEST_SHOWN else plain[: _LONGEST_SHOWN - 1] + "…"


def listed(names: Collection[str]) -> str:
    """Some names for a message, and how many more there are."""
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(shown(name) for name in list(names)[:_SHOWN]) + more


def near(name: str, names: Collection[str]) -> str:
    """``; did you mean A?``, or nothing."""
    lower = {one.lower(): one for one in names}
    close = difflib.get_close_matches(name.lower()[:_LONGEST_NAME], list(lower), n=2, cutoff=0.5)
    return f"; did you mean {' or '.join(shown(lower[one]) for one in close)}?" if close else ""
