"""Logs that sccal converted to MCAP, read as the tables that they were made of.

Standard messages cannot say everything that a table says: counts, a GGA quality, an angle that is not there. What they
cannot is beside them, each column as a topic of Float64 with the same times; and a metadata record, ``sccal.convert``,
names the columns, the topics and the decimals. With it the columns come back bit by bit: a yaw of 12.34 degrees that
went through a quaternion is taken to two decimals again where it is within a billionth of them, and as it is where
something has changed it since. Without the record the log is read like any other.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np

from sccal.arrays import Floats
from sccal.logs.messages.heading import euler, in_convention
from sccal.logs.messages.topics import Messages
from sccal.logs.quality import quality_of
from sccal.logs.streams import Convention, Notice
from sccal.logs.table import Table
from sccal.logs.timeline import order_in_time

CONVERTED = "sccal.convert"
"""Name of the metadata record."""
SCHEMA = "sccal.convert/1"
LEFT_JOINT, RIGHT_JOINT = "left_wheel_joint", "right_wheel_joint"
TableKind = Literal["encoder", "ahrs", "gnss"]
_MOST_PLACES = 8
_NEAR = 1e-9


@dataclass(frozen=True)
class TableNote:
    """How one table went into messages."""

    topic: str
    """Of the standard messages, one for each row."""
    columns: Mapping[str, int | None]
    """All columns but t in their order, with their decimals; None where they have as many as they need."""
    side: Mapping[str, str]
    """Topic by column, of the columns that are not in the standard messages."""
    time_places: int | None = None
    ticks_per_rev: float | None = None
    """What turned ticks into the joints' radians."""
    whole_turn: bool = False
    """The yaw is written from 0 to 360 degrees, not from −180 to 180."""


@dataclass(frozen=True)
class ConversionNote:
    """What the metadata record says."""

    tables: Mapping[str, TableNote] = field(default_factory=dict)
    nmea_topic: str = ""
    nmea_places: int | None = None
    log_ahead_ns: int = 0
    """What was added to times for the log times, which cannot be negative."""
    notices: tuple[Notice, ...] = ()

    def as_metadata(self) -> dict[str, str]:
        """The record's entries."""
        return {
            "schema": SCHEMA,
            "tables": json.dumps({kind: asdict(one) for kind, one in self.tables.items()}, ensure_ascii=False),
            "nmea": json.dumps({"topic": self.nmea_topic, "places": self.nmea_places}),
            "log_ahead_ns": str(self.log_ahead_ns),
            "notices": json.dumps([asdict(notice) for notice in self.notices], ensure_ascii=False),
        }

    @property
    def side_topics(self) -> set[str]:
        """Topics that hold columns of the tables."""
        return {topic for one in self.tables.values() for topic in one.side.values()}


def note_of(metadata: Mapping[str, Mapping[str, str]]) -> ConversionNote | None:
    """What a log's metadata say about its conversion; None where it was not converted, or by a later version."""
    entries = metadata.get(CONVERTED)
    if entries is None or entries.get("schema") != SCHEMA:
        return None
    try:
        nmea = json.loads(entries["nmea"])
        return ConversionNote(
            tables={kind: TableNote(**one) for kind, one in json.loads(entries["tables"]).items()},
            nmea_topic=str(nmea["topic"]),
            nmea_places=nmea["places"],
            log_ahead_ns=int(entries["log_ahead_ns"]),
            notices=tuple(Notice(**one) for one in json.loads(entries["notices"])),
        )
    except (KeyError, TypeError, ValueError):
        return None


def table_of(
    kind: TableKind, note: ConversionNote, found: Mapping[str, Messages], source: str, convention: Convention
) -> Table | None:
    """The table ``kind`` of a converted log, rows in order of time; None where its messages are not there."""
    one = note.tables.get(kind)
    messages = None if one is None else found.get(one.topic)
    if one is None or messages is None:
        return None
    columns = recovered(kind, one, messages.column, convention)
    needed = [column for name, column in columns.items() if name not in one.side][: 2 if kind != "ahrs" else 1]
    usable = np.isfinite(messages.t_s)
    for column in needed:
        usable &= np.isfinite(column)
    rows = np.flatnonzero(usable)
    if rows.size == 0:
        return None
    all_t_s = _whole_decimals(messages.t_s, one.time_places)
    order, notices = order_in_time(all_t_s[rows], messages.number[rows], f"{source} {one.topic}")
    rows = rows[order]
    t_s = all_t_s[rows]
    columns = {"t": t_s, **{name: column[rows] for name, column in columns.items()}}
    for name, topic in one.side.items():
        columns[name] = _at_times(found.get(topic), t_s, one.time_places)
    return Table(f"{source} {one.topic}", columns, messages.number[rows], messages.t_s.size, notices)


def _whole_decimals(t_s: Floats, places: int | None) -> Floats:
    """Times as the table's decimals say them, which nanoseconds may have moved by a last bit."""
    if places is None:
        return t_s
    near = np.round(t_s, places)
    return np.where(np.abs(near - t_s) <= 2 * np.spacing(np.abs(t_s)), near, t_s)


def _at_times(side: Messages | None, t_s: Floats, places: int | None) -> Floats:
    """A side topic's numbers at the rows of exactly their times; NaN at the others."""
    column = np.full(t_s.size, np.nan)
    values = None if side is None else side.values.get("+data")
    if side is None or values is None or t_s.size == 0:
        return column
    side_t_s = _whole_decimals(side.t_s, places)
    at = np.minimum(np.searchsorted(t_s, side_t_s), t_s.size - 1)
    same = t_s[at] == side_t_s
    column[at[same]] = values[same]
    return column


def recovered(
    kind: TableKind, note: TableNote, number: Callable[[str], Floats], convention: Convention
) -> dict[str, Floats]:
    """The table's columns (n) as its messages hold them; those that they cannot hold are NaN.

    ``number`` gives the messages' fields (n) by the reader's names for them.
    """
    return {
        name: _snapped(values, note.columns[name]) for name, values in _RECOVER[kind](note, number, convention).items()
    }


def _snapped(values: Floats, places: int | None) -> Floats:
    if places is None or places > _MOST_PLACES:
        return values
    with np.errstate(invalid="ignore"):
        near = np.round(values, places)
        return np.where(np.abs(near - values) <= _NEAR * np.maximum(1.0, np.abs(values)), near, values)


def _encoder(note: TableNote, number: Callable[[str], Floats], _convention: Convention) -> dict[str, Floats]:
    columns = {}
    for name in note.columns:
        if name in ("left_rad", "right_rad", "left_ticks", "right_ticks"):
            angle = number(f"position {LEFT_JOINT if name.startswith('left') else RIGHT_JOINT}")
            columns[name] = angle * (note.ticks_per_rev / (2 * np.pi)) if note.ticks_per_rev else angle
        else:
            columns[name] = np.full(number(f"position {LEFT_JOINT}").size, np.nan)
    return columns


def _ahrs(note: TableNote, number: Callable[[str], Floats], convention: Convention) -> dict[str, Floats]:
    yaw, pitch, roll = euler(*(number(axis) for axis in "xyzw"))
    yaw = in_convention(yaw, "enu", convention)
    turn = 2 * np.pi
    yaw = yaw % turn if note.whole_turn else np.pi - (np.pi - yaw) % turn
    variance = number("cov_yaw")
    held = {
        "yaw": yaw,
        "pitch": -pitch,
        "roll": roll,
        "yaw_sigma": np.sqrt(np.where(variance > 0, variance, np.nan)),
        "gyro_z": number("gyro_z"),
    }
    columns = {}
    for name in note.columns:
        quantity, _, unit = name.rpartition("_")
        values = held.get(quantity, np.full(yaw.size, np.nan))
        columns[name] = np.degrees(values) if unit in ("deg", "dps") else values
    return columns


def _gnss(note: TableNote, number: Callable[[str], Floats], _convention: Convention) -> dict[str, Floats]:
    east, north = number("cov_ee"), number("cov_nn")
    stated = (east > 0) & (north > 0) & (number("cov_type") != 0)
    sigma_east, sigma_north = (np.sqrt(np.where(stated, variance, np.nan)) for variance in (east, north))
    held = {
        "lat_deg": number("latitude"),
        "lon_deg": number("longitude"),
        "alt_m": number("altitude"),
        "fix_quality": quality_of(number("status"), np.maximum(sigma_east, sigma_north)).astype(np.float64),
        "sigma_m": sigma_east,
        "sigma_east_m": sigma_east,
        "sigma_north_m": sigma_north,
        "cov_en_m2": np.where(stated, number("cov_en"), 0.0),
    }
    return {name: held.get(name, np.full(east.size, np.nan)) for name in note.columns}


_RECOVER: Mapping[TableKind, Callable[[TableNote, Callable[[str], Floats], Convention], dict[str, Floats]]] = {
    "encoder": _encoder,
    "ahrs": _ahrs,
    "gnss": _gnss,
}
