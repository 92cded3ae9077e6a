"""The messages of a log, topic by topic: which are wanted, and their fields as columns under sccal's own names.

A type is known by its last name, whatever package, encoding or ROS version writes it; its fields are found by name,
with or without underscores.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.messages.definitions import known_definitions, parse_definitions, plain_name
from sccal.logs.messages.json_values import JsonGatherer
from sccal.logs.messages.layout import Bytes, Gatherer, MalformedError, Picked, Walker
from sccal.logs.messages.mcap_file import Channel
from sccal.logs.messages.protobuf import ProtobufWalker, parse_descriptors
from sccal.logs.messages.ros import RosWalker
from sccal.logs.options import TimeSource
from sccal.logs.streams import Notice

_POSITION = {
    "latitude": "latitude",
    "longitude": "longitude",
    "altitude": "altitude",
    "status": "status.status",
    "cov_ee": "position_covariance[0]",
    "cov_en": "position_covariance[1]",
    "cov_nn": "position_covariance[4]",
    "cov_type": "position_covariance_type",
}
FIELDS: Mapping[str, Mapping[str, str]] = {
    "JointState": {},
    "Odometry": {
        **{"speed_mps": "twist.twist.linear.x", "turn_radps": "twist.twist.angular.z"},
        **{"pose_x_m": "pose.pose.position.x", "pose_y_m": "pose.pose.position.y"},
        **{f"pose_q{axis}": f"pose.pose.orientation.{axis}" for axis in "xyzw"},
    },
    "TwistStamped": {"speed_mps": "twist.linear.x", "turn_radps": "twist.angular.z"},
    "Imu": {
        "x": "orientation.x",
        "y": "orientation.y",
        "z": "orientation.z",
        "w": "orientation.w",
        "cov_first": "orientation_covariance[0]",
        "cov_yaw": "orientation_covariance[8]",
        "gyro_z": "angular_velocity.z",
        "gyro_cov_first": "angular_velocity_covariance[0]",
        "acc_x": "linear_acceleration.x",
        "acc_y": "linear_acceleration.y",
        "acc_z": "linear_acceleration.z",
        "acc_cov_first": "linear_acceleration_covariance[0]",
    },
    "PoseStamped": {
        **{f"pose_{axis}_m": f"pose.position.{axis}" for axis in "xyz"},
        **{axis: f"pose.orientation.{axis}" for axis in "xyzw"},
    },
    "PoseWithCovarianceStamped": {
        **{f"pose_{axis}_m": f"pose.pose.position.{axis}" for axis in "xyz"},
        **{axis: f"pose.pose.orientation.{axis}" for axis in "xyzw"},
        **{"cov_ee": "pose.covariance[0]", "cov_en": "pose.covariance[1]", "cov_nn": "pose.covariance[7]"},
        "cov_yaw": "pose.covariance[35]",
    },
    "QuaternionStamped": {"x": "quaternion.x", "y": "quaternion.y", "z": "quaternion.z", "w": "quaternion.w"},
    "MagneticField": {"x": "magnetic_field.x", "y": "magnetic_field.y", "z": "magnetic_field.z"},
    "NavSatFix": _POSITION,
    "GPSFix": _POSITION,
    "LocationFix": _POSITION,
    "NavPVT": {
        **{"latitude": "lat", "longitude": "lon", "altitude": "height", "accuracy": "h_acc"},
        **{"fix_type": "fix_type", "flags": "flags"},
    },
    "Sentence": {},
    "String": {},
}
"""The types that hold wheels, heading or fixes, with sccal's name and the path of each field that is read."""

_STAMPS = ("header.stamp", "stamp", "timestamp", "header.timestamp", "time")
_SECONDS = ("sec", "secs", "seconds")
_NANOSECONDS = ("nanosec", "nsec", "nsecs", "nanos", "nanosecs", "nanoseconds")
SPOKEN = {"Sentence": "sentence", "String": "data"}
"""Where types of text hold it."""
_SENTENCE_IN = re.compile(rb"\$(?:[A-Z]{5}|P[A-Z]{3}|KSXT),|#[A-Z][A-Z0-9]{4,}A,[^;]{9,200};")
_LOOK_AT = 200
STAMPED = "stamped"
"""Column of sentences: 1 where the message has a stamp of its own."""
_NO_CAUSE = re.compile(
    "(geometry|nav|tf2|visualization|map|trajectory|shape|stereo|diagnostic|statistics|action|actionlib|lifecycle"
    "|foxglove|rosgraph)_msgs|tf|foxglove|rcl_interfaces|builtin_interfaces"
)
"""Packages whose numbers are no measured causes: poses, plans, and what the middleware says about itself."""
_CAUSES_OF_SENSOR_MSGS = ("BatteryState", "Temperature", "RelativeHumidity", "FluidPressure", "Illuminance", "Range")
_LARGEST_CAUSE_BYTES = 4096
_MOST_CAUSES = 32
_MOST_CAUSE_LAYOUTS = 200
"""A topic whose messages differ more than this in their texts and lengths is a log of words, not of numbers."""


def kind_of(type_name: str) -> str:
    """The last name of a type where it is one that sccal reads, else empty."""
    last = re.split(r"[/.:]+", type_name)[-1]
    return last if last in FIELDS else ""


def normal_path(path: str) -> str:
    """A dotted path in the form in which paths are compared: ``data.0`` is ``data[0]``; case and ``_`` do not count."""
    return re.sub(r"\.(\d+)(?=\.|\[|$)", r"[\1]", path).replace("_", "").casefold()


@dataclass(frozen=True)
class Messages:
    """All messages of one topic in order of log time; arrays of length n."""

    topic: str
    type_name: str
    kind: str
    t_s: Floats
    """By the time asked for."""
    log_s: Floats
    number: Ints
    """Place among the topic's messages in the file, from 1."""
    values: Mapping[str, Floats]
    """Fields by sccal's name, ``:path`` for a field asked for by its path, ``+path`` for further numbers."""
    texts: tuple[bytes, ...]
    """What each message says, where the type is a text; else empty."""

    def column(self, name: str) -> Floats:
        """A column, NaN where the messages have none."""
        return self.values.get(name, np.full(self.t_s.size, np.nan))

    def take(self, rows: Ints) -> Messages:
        """The messages at the indices ``rows``."""
        if rows.size == self.t_s.size and (np.diff(rows) == 1).all():
            return self
        return Messages(
            self.topic,
            self.type_name,
            self.kind,
            self.t_s[rows],
            self.log_s[rows],
            self.number[rows],
            {name: column[rows] for name, column in self.values.items()},
            tuple(self.texts[row] for row in rows.tolist()) if self.texts else (),
        )

    def keep(self, rows: Bools) -> Messages:
        """The messages where ``rows`` (n) is True."""
        return self if rows.all() else self.take(np.flatnonzero(rows))


@dataclass
class ChannelSink:
    """Gathers one channel."""

    channel: Channel
    gatherer: Gatherer | JsonGatherer
    only_causes: bool
    log_ns: list[Ints] = field(default_factory=list)
    publish_ns: list[Ints] = field(default_factory=list)
    count: int = 0
    given_up: bool = False

    def take(self, data: Bytes, begin: Ints, end: Ints, log_ns: Ints, publish_ns: Ints) -> None:
        """As Sink.take."""
        if self.only_causes and isinstance(self.gatherer, Gatherer) and self.gatherer.walks > _MOST_CAUSE_LAYOUTS:
            self.given_up = True
        if self.given_up:
            return
        if self.only_causes and begin.size and int((end - begin).max()) > _LARGEST_CAUSE_BYTES:
            small = end - begin <= _LARGEST_CAUSE_BYTES
            begin, end, log_ns, publish_ns = begin[small], end[small], log_ns[small], publish_ns[small]
        self.gatherer.take(data, begin, end, self.count)
        self.log_ns.append(log_ns)
        self.publish_ns.append(publish_ns)
        self.count += begin.size


@dataclass
class Topics:
    """Opens the channels of one log and holds what they gave."""

    asked: Mapping[str, Sequence[str]]
    """Paths asked for on the command line, by topic without its first slash."""
    sinks: dict[str, list[ChannelSink]] = field(default_factory=dict)
    seen: dict[str, str] = field(default_factory=dict)
    """Type name by topic, of all channels of the log."""
    unread: dict[str, str] = field(default_factory=dict)
    """Why a wanted topic cannot be read."""

    def open(self, channel: Channel) -> ChannelSink | None:
        """The sink for a channel, or None where its messages cannot be of use."""
        self.seen.setdefault(channel.topic, channel.type_name or channel.message_encoding)
        kind = kind_of(channel.type_name)
        asked = self.asked.get(channel.topic.lstrip("/"), ())
        if not kind and not asked and not _may_be_cause(channel.type_name):
            return None
        picker = _picker(kind, asked)
        try:
            gatherer = (
                JsonGatherer(picker) if channel.message_encoding == "json" else Gatherer(walker_of(channel), picker)
            )
        except MalformedError as error:
            if kind or asked:
                self.unread[channel.topic] = str(error)
            return None
        sink = ChannelSink(channel, gatherer, only_causes=not kind and not asked)
        self.sinks.setdefault(channel.topic, []).append(sink)
        return sink

    def messages(
        self, source: str, time: TimeSource, log_ahead_ns: int = 0
    ) -> tuple[dict[str, Messages], list[Notice]]:
        """The messages of every topic that was opened and has any, and what could not be read.

        ``log_ahead_ns`` is how far the log times are ahead of the logging computer's clock (see ``converted``).
        """
        found: dict[str, Messages] = {}
        notices = [
            Notice(source, f"topics not read: {topic}: {why}", 1, severity="warning")
            for topic, why in self.unread.items()
        ]
        for topic, sinks in self.sinks.items():
            kinds = [kind_of(sink.channel.type_name) for sink in sinks]
            own = [s for s, kind in zip(sinks, kinds, strict=True) if kind == kinds[0] and not s.given_up]
            if not own:
                continue
            messages = _collected(topic, kinds[0], own, f"{source} {topic}", time, notices, log_ahead_ns)
            if messages.kind == "String":
                messages = replace(messages, kind="Sentence" if _holds_sentences(messages.texts) else "")
            if messages.t_s.size and (messages.kind == kinds[0] or messages.kind == "Sentence"):
                found[topic] = messages
        return found, notices


def _holds_sentences(texts: Sequence[bytes]) -> bool:
    """Whether most of some texts are NMEA, and not what else is published as text."""
    looked = texts[:_LOOK_AT]
    return sum(_SENTENCE_IN.search(text) is not None for text in looked) > 0.5 * len(looked)


def _may_be_cause(type_name: str) -> bool:
    package, _, name = plain_name(type_name).partition("/")
    if package.split(".")[0] == "sensor_msgs":
        return name in _CAUSES_OF_SENSOR_MSGS
    return _NO_CAUSE.fullmatch(package) is None


@functools.cache
def walker_of(channel: Channel) -> Walker:
    """What walks the messages of a channel, by its own definitions. Raises MalformedError where they cannot be read."""
    encoding = channel.message_encoding
    if encoding == "protobuf":
        messages = parse_descriptors(channel.schema)
        if channel.type_name not in messages:
            raise MalformedError(f"its schema does not describe {channel.type_name!r}")
        return ProtobufWalker(messages, channel.type_name)
    if encoding not in ("cdr", "ros1"):
        raise MalformedError(f"message encoding {encoding!r} is not read (cdr, ros1, protobuf and json are)")
    root = plain_name(channel.type_name)
    if channel.schema_encoding in ("ros2msg", "ros1msg") and channel.schema.strip():
        definitions = parse_definitions(root, channel.schema.decode("utf-8", "replace"))
    else:
        definitions = known_definitions()
    if not definitions.get(root):
        raise MalformedError(
            f"no definition of {channel.type_name!r} that can be read ({channel.schema_encoding or 'none'})"
        )
    return RosWalker(definitions, root, encoding == "ros1")


def _picker(kind: str, asked: Sequence[str]) -> Callable[[Iterable[str], Mapping[str, str]], Picked]:
    def pick(paths: Iterable[str], texts: Mapping[str, str]) -> Picked:
        by_name = {normal_path(path): path for path in paths}
        columns = {
            name: by_name[normal_path(path)]
            for name, path in FIELDS.get(kind, {}).items()
            if normal_path(path) in by_name
        }
        pinned: list[str] = []
        if kind == "JointState":
            pinned = [path for path in texts if re.fullmatch(r"names?\[\d+\]", normal_path(path))]
            for path in pinned:
                place = path[path.rindex("[") :]
                for quantity in ("position", "velocity", "effort"):
                    if quantity + place in by_name:
                        columns[f"{quantity} {texts[path]}"] = by_name[quantity + place]
        columns |= {f":{path}": by_name[normal_path(path)] for path in asked if normal_path(path) in by_name}
        if not kind:
            taken = set(columns.values())
            further = [path for path in by_name.values() if path not in taken and _is_cause(path)]
            if len(further) <= _MOST_CAUSES:
                columns |= {f"+{path}": path for path in further}
        text = next((path for path in texts if normal_path(path) == SPOKEN[kind]), "") if kind in SPOKEN else ""
        return Picked(columns, pinned, text, _stamp(by_name))

    return pick


def _is_cause(path: str) -> bool:
    first = normal_path(path).split(".")[0]
    return "[" not in path and first not in ("header", "stamp", "timestamp")


def _stamp(by_name: Mapping[str, str]) -> tuple[str, str] | None:
    for prefix in _STAMPS:
        for seconds in _SECONDS:
            for nanoseconds in _NANOSECONDS:
                pair = f"{prefix}.{seconds}", f"{prefix}.{nanoseconds}"
                if pair[0] in by_name and pair[1] in by_name:
                    return by_name[pair[0]], by_name[pair[1]]
    return None


def _collected(
    topic: str,
    kind: str,
    sinks: Sequence[ChannelSink],
    source: str,
    time: TimeSource,
    notices: list[Notice],
    log_ahead_ns: int,
) -> Messages:
    """The columns of one topic's channels, joined and in order of log time."""
    count = sum(sink.count for sink in sinks)
    names = {name for sink in sinks for part in sink.gatherer.parts for name in part.columns}
    values = {name: np.full(count, np.nan) for name in sorted(names)}
    stamp_ns = np.zeros(count, dtype=np.int64)
    texts: list[bytes] = [b""] * count if kind in SPOKEN else []
    readable = np.zeros(count, dtype=np.bool_)
    first = 0
    for sink in sinks:
        for part in sink.gatherer.parts:
            rows = part.index + first
            readable[rows] = True
            for name, column in part.columns.items():
                values[name][rows] = column
            if part.stamp_ns is not None:
                stamp_ns[rows] = part.stamp_ns
            if part.texts is not None and texts:
                for row, text in zip(rows.tolist(), part.texts, strict=True):
                    texts[row] = text
        if sink.gatherer.malformed:
            what = f"messages that cannot be decoded left out ({sink.gatherer.why})"
            where = f"message {sink.gatherer.malformed[0] + 1}"
            notices.append(Notice(source, what, len(sink.gatherer.malformed), where, "warning"))
        sink.gatherer.parts.clear()
        first += sink.count
    log_ns = np.concatenate([ns for sink in sinks for ns in sink.log_ns] or [np.zeros(0, dtype=np.int64)])
    publish_ns = np.concatenate([ns for sink in sinks for ns in sink.publish_ns] or [np.zeros(0, dtype=np.int64)])
    chosen_ns = (log_ns if time == "log" else publish_ns) - log_ahead_ns if time != "header" else stamp_ns
    if time == "header":
        unset = stamp_ns == 0
        chosen_ns = np.where(unset, np.where(log_ns != 0, log_ns, publish_ns) - log_ahead_ns, stamp_ns)
        if kind in SPOKEN:
            values[STAMPED] = np.where(unset, 0.0, 1.0)
        if unset.any() and not unset.all():
            where = f"message {int(np.flatnonzero(unset)[0]) + 1}"
            notices.append(
                Notice(source, "messages with an empty stamp read by their log time", int(unset.sum()), where)
            )
    order = np.argsort(log_ns, kind="stable")
    order = order[readable[order]]
    messages = Messages(
        topic=topic,
        type_name=sinks[0].channel.type_name,
        kind=kind,
        t_s=seconds_of(chosen_ns),
        log_s=seconds_of(log_ns),
        number=np.arange(1, count + 1, dtype=np.int64),
        values=values,
        texts=tuple(texts),
    )
    return messages.take(order)


def seconds_of(ns: Ints) -> Floats:
    """Seconds (n), rounded once. Dividing at once would round twice and shift equal stamps apart."""
    seconds: Floats = ns // 1_000_000_000 + (ns % 1_000_000_000) / 1e9
    return seconds
