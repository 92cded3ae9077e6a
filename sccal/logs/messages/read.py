"""A run out of a log of messages: which topics are its wheels, heading and fixes, and which are further columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError, UsageError
from sccal.logs.ahrs import heading_of_table
from sccal.logs.compressed import plain_file
from sccal.logs.encoder import repaired_wheels
from sccal.logs.formats import ROS2, message_format
from sccal.logs.gnss_csv import fixes_of_table
from sccal.logs.messages.converted import ConversionNote, TableKind, note_of, table_of
from sccal.logs.messages.fixes import (
    fixes_of_positions,
    fixes_of_sentences,
    has_headings,
    has_positions,
    heading_of_sentences,
    lines_of_sentences,
)
from sccal.logs.messages.heading import has_orientation, heading_of_field, heading_of_path, heading_of_quaternions
from sccal.logs.messages.parts import parts_after
from sccal.logs.messages.poses import POSE_KINDS, fixes_of_poses, is_measured, require_level, turns
from sccal.logs.messages.topics import FIELDS, Messages, Topics
from sccal.logs.messages.wheels import (
    joint_names,
    joints_of,
    of_messages,
    wheels_of_joints,
    wheels_of_odometry,
    wheels_of_paths,
    with_series,
)
from sccal.logs.options import ReadOptions
from sccal.logs.streams import FixStream, HeadingStream, Notice, Vehicle, WheelStream
from sccal.logs.table import Table

_PATH_OPTIONS = ("left_ticks", "right_ticks", "left_rad", "right_rad", "yaw", "latitude", "longitude")
_LISTED = 40
Stream = TypeVar("Stream", WheelStream, HeadingStream, FixStream)


@dataclass(frozen=True)
class _Log:
    """A log read, before anything is chosen."""

    path: Path
    options: ReadOptions
    vehicle: Vehicle
    seen: Mapping[str, str]
    """Type by topic."""
    found: Mapping[str, Messages]
    note: ConversionNote | None = None
    """Of a log that sccal converted."""

    def table(self, kind: TableKind, *choices: str) -> Table | None:
        """A converted log's table, unless any of the ``choices`` asks for something else."""
        if self.note is None or any(choices):
            return None
        return table_of(kind, self.note, self.found, self.path.name, self.vehicle.convention)

    def where(self, topic: str) -> str:
        """The topic as errors name it."""
        return f"{self.path} {topic}"

    def source(self, topic: str) -> str:
        """The topic as notices name it."""
        return f"{self.path.name} {topic}"

    def messages(self, topic: str) -> Messages | None:
        """A topic's messages; the first slash of its name may be left out."""
        return next((m for name, m in self.found.items() if name.lstrip("/") == topic.lstrip("/")), None)

    def listed(self) -> str:
        """All topics with their types."""
        topics = [f"{topic} ({kind})" for topic, kind in sorted(self.seen.items())]
        more = f" and {len(topics) - _LISTED} more" if len(topics) > _LISTED else ""
        return (", ".join(topics[:_LISTED]) + more) or "none"


def read_message_log(
    path: Path, vehicle: Vehicle, options: ReadOptions
) -> tuple[WheelStream, HeadingStream, FixStream, tuple[Notice, ...]]:
    """The streams of an .mcap, .db3 or .bag file, or of a rosbag2 folder.

    Raises:
        DataError: the file cannot be read, or lacks a stream, or holds several and nothing says which.
        UsageError: an option that is no ``TOPIC:path``, or half of a pair.
    """
    log, notices = _opened(path, vehicle, options)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # whatever numbers broken bytes hold
            wheels, wheel_notices, wheel_topics = _wheels(log)
            heading, heading_notices, heading_topics = _heading(log)
            fixes, fix_notices, fix_topics = _fixes(log)
    except DataError as error:
        lost = "; ".join(str(notice) for notice in notices)
        raise DataError(f"{error} ({lost})") if lost else error from None
    _require_common_time(log, wheel_topics[0], heading_topics[0], fix_topics[0])
    own = log.note.side_topics if log.note else set()
    wheels = with_series(wheels, _further_columns({name: m for name, m in log.found.items() if name not in own}))
    return wheels, heading, fixes, (*notices, *wheel_notices, *heading_notices, *fix_notices)


@dataclass(frozen=True)
class LooseStreams:
    """What could be read of a log of messages, stream by stream; None for what could not, with why."""

    wheels: WheelStream | None
    heading: HeadingStream | None
    fixes: FixStream | None
    unread: Mapping[str, str]
    """Why, by wheels, heading or fixes."""
    notices: tuple[Notice, ...]


def read_loose_streams(path: Path, vehicle: Vehicle, options: ReadOptions) -> LooseStreams:
    """Each stream of a log of messages on its own, as far as it can be read.

    Raises:
        DataError: the file cannot be read at all.
        UsageError: as read_message_log.
    """
    log, notices = _opened(path, vehicle, options)
    told = list(notices)
    unread: dict[str, str] = {}

    def tried(what: str, read: Callable[[_Log], tuple[Stream, tuple[Notice, ...], tuple[str, ...]]]) -> Stream | None:
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                stream, own, _ = read(log)
        except DataError as error:
            unread[what] = str(error)
            return None
        told.extend(own)
        return stream

    wheels, heading, fixes = tried("wheels", _wheels), tried("heading", _heading), tried("fixes", _fixes)
    return LooseStreams(wheels, heading, fixes, unread, tuple(told))


def _opened(path: Path, vehicle: Vehicle, options: ReadOptions) -> tuple[_Log, tuple[Notice, ...]]:
    topics = Topics(_asked_paths(options))
    metadata: dict[str, dict[str, str]] = {}
    form, parts = message_format(path) or ROS2, parts_after(path) if path.is_file() else ()
    with plain_file(path) as plain:
        notices = form.read(plain, topics.open, metadata)
    for part in parts:
        notices += form.read(part, topics.open, metadata)
    if parts:
        notices += (Notice(path.name, f"further files of the same drive read, up to {parts[-1].name}", len(parts)),)
    if not topics.seen:
        why = "; ".join(str(notice) for notice in notices) or "it holds no channel"
        raise DataError(f"{path}: no message can be read: {why}")
    note = note_of(metadata)
    found, unread = topics.messages(path.name, options.time, note.log_ahead_ns if note else 0)
    told = note.notices if note else ()
    return _Log(path, options, vehicle, topics.seen, found, note), (*notices, *unread, *told)


@dataclass(frozen=True)
class LoggedTables:
    """What a log of messages holds as it was before any repair; None for what it holds in another form."""

    encoder: Table | None
    ahrs: Table | None
    gnss: Table | None
    nmea: bytes | None
    """The lines of the topic that the fixes are read from."""
    note: ConversionNote
    """What was noted when the log was converted; empty for others."""


def read_tables(path: Path, vehicle: Vehicle, options: ReadOptions) -> LoggedTables:
    """The tables of a log that sccal converted, and the NMEA lines of any, as read_message_log takes them.

    Raises:
        DataError, UsageError: as read_message_log.
    """
    log, _ = _opened(path, vehicle, options)
    _, _, (topic,) = _fixes(log)
    messages = log.found[topic]
    sentences = messages.kind == "Sentence"
    return LoggedTables(
        encoder=_encoder_table(log),
        ahrs=_ahrs_table(log),
        gnss=None if sentences else _gnss_table(log),
        nmea=lines_of_sentences(messages, _places(log, topic)) if sentences else None,
        note=log.note or ConversionNote(),
    )


def _encoder_table(log: _Log) -> Table | None:
    options = log.options
    return log.table("encoder", options.wheels_topic, options.left_joint, options.left_ticks, options.left_rad)


def _ahrs_table(log: _Log) -> Table | None:
    options = log.options
    return log.table("ahrs", options.heading_topic, options.yaw, options.orientation.removeprefix("enu"))


def _gnss_table(log: _Log) -> Table | None:
    return log.table("gnss", log.options.fix_topic, log.options.latitude)


def _asked_paths(options: ReadOptions) -> dict[str, list[str]]:
    asked: dict[str, list[str]] = {}
    for name in _PATH_OPTIONS:
        value = getattr(options, name)
        if value:
            topic, path = _split(name, value)
            asked.setdefault(topic.lstrip("/"), []).append(path)
    for pair in (("left_ticks", "right_ticks"), ("left_rad", "right_rad"), ("latitude", "longitude")):
        given = [name for name in pair if getattr(options, name)]
        if len(given) == 1:
            missing = pair[1] if given[0] == pair[0] else pair[0]
            raise UsageError(f"{_option(given[0])} needs {_option(missing)} beside it")
    if options.left_ticks and options.left_rad:
        raise UsageError("--left-ticks and --left-rad name the same wheel; give one of them")
    return asked


def _split(name: str, value: str) -> tuple[str, str]:
    topic, _, path = value.rpartition(":")
    if not topic or not path:
        raise UsageError(f"{_option(name)} {value}: must be TOPIC:path, such as /wheels/left:ticks")
    return topic, path


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def _asked_column(log: _Log, name: str) -> tuple[Messages, str]:
    """The messages and column that an option names."""
    topic, path = _split(name, getattr(log.options, name))
    messages = log.messages(topic)
    if messages is None:
        raise DataError(f"{log.path}: {_option(name)}: no messages on {topic}; the log has {log.listed()}")
    if f":{path}" not in messages.values:
        there = ", ".join(sorted(name[1:] for name in messages.values if name.startswith("+")))
        more = f"; its further numbers are {there}" if there else ""
        raise DataError(f"{log.path}: {_option(name)}: no number {path} in {topic} ({messages.type_name}){more}")
    return messages, f":{path}"


def _chosen(
    log: _Log, what: str, option: str, asked: str, ranks: Sequence[tuple[str, Callable[[Messages], bool]]], instead: str
) -> tuple[Messages, tuple[Notice, ...]]:
    """The topic asked for, else the only usable one of the first kind that has any.

    Raises DataError with the candidates, and the option that chooses among them.
    """
    if asked:
        messages = log.messages(asked)
        if messages is None:
            raise DataError(f"{log.path}: {option} {asked}: no such topic with messages; the log has {log.listed()}")
        if messages.kind not in [kind for kind, _ in ranks]:
            kinds = ", ".join(kind for kind, _ in ranks)
            raise DataError(
                f"{log.path}: {option} {asked} is a {messages.type_name}, from which no {what} can be read ({kinds}); "
                f"name its field with {instead}"
            )
        return messages, ()
    candidates: list[Messages] = []
    for kind, usable in ranks:
        of_kind = [m for m in log.found.values() if m.kind == kind and usable(m)]
        if len(of_kind) > 1 and not candidates:
            names = ", ".join(f"{m.topic} ({m.type_name}, {m.t_s.size} messages)" for m in of_kind)
            raise DataError(f"{log.path}: {len(of_kind)} topics may be the {what}: {names}; choose one with {option}")
        candidates += of_kind
    if not candidates:
        kinds = ", ".join(kind for kind, _ in ranks)
        raise DataError(
            f"{log.path}: no topic holds the {what} ({kinds}); the log has {log.listed()}; "
            f"{_left_alone(log, option)}name a field with {instead}"
        )
    others = ", ".join(m.topic for m in candidates[1:])
    source = log.source(candidates[0].topic)
    tell = (Notice(source, f"other topics for the {what} not read: {others}; {option} chooses", len(candidates) - 1),)
    return candidates[0], tell if others else ()


def _left_alone(log: _Log, option: str) -> str:
    """Which poses are there and not taken by themselves, and how they are asked for."""
    poses = [m.topic for m in log.found.values() if m.kind in POSE_KINDS]
    shown = ", ".join(sorted(poses)[:_LISTED])
    return (
        f"poses that rest, or whose topic names a goal or a filter, are taken with {option} ({shown}); "
        if poses
        else ""
    )


def _always(_: Messages) -> bool:
    return True


def _wheels(log: _Log) -> tuple[WheelStream, tuple[Notice, ...], tuple[str, ...]]:
    options = log.options
    for unit in ("ticks", "rad"):
        if getattr(options, f"left_{unit}"):
            left, right = (_asked_column(log, f"{side}_{unit}") for side in ("left", "right"))
            topic = left[0].topic
            stream, notices = wheels_of_paths(left, right, unit, log.vehicle, log.where(topic), log.source(topic))
            return stream, notices, (topic, right[0].topic)
    table = _encoder_table(log)
    if table is not None and log.note is not None:
        topic = log.note.tables["encoder"].topic
        stream, notices = repaired_wheels(table, log.where(topic), log.vehicle)
        return stream, of_messages(notices), (topic,)
    joints = [m for m in log.found.values() if m.kind == "JointState"]
    ranks = [("JointState", lambda m: joints_of(m, options) is not None), ("Odometry", _always)]
    ranks.append(("TwistStamped", lambda m: "cmd" not in m.topic.casefold()))
    instead = "--left-ticks TOPIC:path and --right-ticks TOPIC:path"
    if joints and not options.wheels_topic and not any(joints_of(m, options) for m in joints):
        names = "; ".join(f"{m.topic} has {', '.join(joint_names(m)[:20])}" for m in joints)
        asked = f"joints {options.left_joint or 'left'}, {options.right_joint or 'right'}"
        raise DataError(
            f"{log.path}: no joint state names one left and one right wheel ({asked}): {names}; "
            "choose with --left-joint and --right-joint"
        )
    messages, tell = _chosen(log, "wheels", "--wheels-topic", options.wheels_topic, ranks, instead)
    where, source = log.where(messages.topic), log.source(messages.topic)
    if messages.kind in ("Odometry", "TwistStamped"):
        stream, notices = wheels_of_odometry(messages, log.vehicle, where, source)
    else:
        names_there = joints_of(messages, options)
        if names_there is None:
            raise DataError(
                f"{where}: its joints are {', '.join(joint_names(messages)[:20])}; "
                "choose the wheels' with --left-joint and --right-joint"
            )
        stream, notices = wheels_of_joints(messages, names_there, log.vehicle, where, source)
    return stream, (*tell, *notices), (messages.topic,)


def _heading(log: _Log) -> tuple[HeadingStream, tuple[Notice, ...], tuple[str, ...]]:
    options = log.options
    if options.yaw:
        messages, name = _asked_column(log, "yaw")
        stream, notices = heading_of_path(
            messages, name, log.vehicle, log.where(messages.topic), log.source(messages.topic)
        )
        return stream, notices, (messages.topic,)

    table = _ahrs_table(log)
    if table is not None and log.note is not None:
        stream, notices = heading_of_table(table)
        return stream, of_messages(notices), (log.note.tables["ahrs"].topic,)

    def oriented(messages: Messages) -> bool:
        return bool(has_orientation(messages).any())

    ranks = [("Imu", oriented), ("QuaternionStamped", oriented), ("MagneticField", _always)]
    ranks += [("Sentence", has_headings), *((kind, turns) for kind in POSE_KINDS)]
    messages, tell = _chosen(log, "heading", "--heading-topic", options.heading_topic, ranks, "--yaw TOPIC:path")
    where, source = log.where(messages.topic), log.source(messages.topic)
    if messages.kind == "Sentence":
        stream, notices = heading_of_sentences(messages, where, source, _places(log, messages.topic))
    elif messages.kind == "MagneticField":
        stream, notices = heading_of_field(messages, _levelling_imu(log), log.vehicle, where, source)
    else:
        if messages.kind in POSE_KINDS:
            require_level(messages, where)
        stream, notices = heading_of_quaternions(messages, options.orientation, log.vehicle, where, source)
    return stream, (*tell, *notices), (messages.topic,)


def _levelling_imu(log: _Log) -> Messages | None:
    """The IMU that says how the magnetometer stood: one with an orientation before one with accelerations only."""
    imus = sorted((m for m in log.found.values() if m.kind == "Imu"), key=lambda m: m.topic)
    return next((m for m in imus if has_orientation(m).any()), imus[0] if imus else None)


def _fixes(log: _Log) -> tuple[FixStream, tuple[Notice, ...], tuple[str, ...]]:
    options = log.options
    if options.latitude:
        (messages, lat), (other, lon) = _asked_column(log, "latitude"), _asked_column(log, "longitude")
        if messages.topic != other.topic:
            raise DataError(f"{log.path}: --latitude and --longitude must be fields of one topic")
        values = {"latitude": messages.column(lat), "longitude": messages.column(lon)}
        positions = replace(messages, values=values)
        stream, notices = fixes_of_positions(positions, log.where(messages.topic), log.source(messages.topic))
        return stream, notices, (messages.topic,)

    table = _gnss_table(log)
    if table is not None and log.note is not None:
        topic = log.note.tables["gnss"].topic
        stream, notices = fixes_of_table(table, log.where(topic))
        return stream, of_messages(notices), (topic,)

    def positions_in(messages: Messages) -> bool:
        return bool(np.isfinite(messages.column("latitude")).any())

    ranks = [
        ("Sentence", has_positions),
        ("NavSatFix", positions_in),
        ("GPSFix", positions_in),
        ("LocationFix", positions_in),
        ("NavPVT", positions_in),
        *((kind, is_measured) for kind in POSE_KINDS),
    ]
    instead = "--latitude TOPIC:path and --longitude TOPIC:path"
    messages, tell = _chosen(log, "fixes", "--fix-topic", options.fix_topic, ranks, instead)
    where, source = log.where(messages.topic), log.source(messages.topic)
    if messages.kind == "Sentence":
        stream, notices = fixes_of_sentences(messages, where, source, _places(log, messages.topic))
    elif messages.kind in POSE_KINDS:
        stream, notices = fixes_of_poses(messages, where, source)
    else:
        stream, notices = fixes_of_positions(messages, where, source)
    return stream, (*tell, *notices), (messages.topic,)


def _places(log: _Log, topic: str) -> int | None:
    """Decimals of the receive times of a converted log's sentences; None for other logs and times."""
    converted = log.note is not None and topic == log.note.nmea_topic and log.options.time == "header"
    return log.note.nmea_places if log.note is not None and converted else None


def _require_common_time(log: _Log, *topics: str) -> None:
    """Raise where the stamps of the streams share no time but their log times do: then the stamps' clocks differ."""
    streams = [log.found[topic] for topic in topics]
    if log.options.time == "log" or _overlap([m.t_s for m in streams]) or not _overlap([m.log_s for m in streams]):
        return
    spans = ", ".join(f"{m.topic} {m.t_s.min():.3f} … {m.t_s.max():.3f} s" for m in streams)
    raise DataError(
        f"{log.path}: the {log.options.time} times of the streams share no time: {spans}; their log times do: "
        "give --time log"
    )


def _overlap(times: Sequence[Floats]) -> bool:
    return bool(max(t.min() for t in times) <= min(t.max() for t in times))


def _further_columns(found: Mapping[str, Messages]) -> dict[str, tuple[Floats, Floats]]:
    """Numbers of topics that are no stream, as series by name: ``motor_current_a``, or ``battery.voltage``."""
    series: dict[str, tuple[Floats, Floats]] = {}
    for topic, messages in sorted(found.items()):
        if messages.kind in FIELDS:
            continue
        stem = topic.strip("/").replace("/", ".")
        names = [name for name in messages.values if name.startswith("+")]
        for name in names:
            alone = len(names) == 1 and name in ("+data", "+value")
            series[stem if alone else f"{stem}.{name[1:]}"] = (messages.t_s, messages.values[name])
    return series
