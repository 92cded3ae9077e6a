"""Streams as MCAP messages in the ros2 profile: JointState, Imu, and NMEA sentences or NavSatFix, stamped as logged.

All values are written as they are, in double precision. Messages of one topic have one layout: a blank message is
encoded once, and numpy sets its numbers row by row.
"""

from __future__ import annotations

import os
import re
import struct
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Floats, Ints
from sccal.errors import DataError
from sccal.logs.messages.converted import LEFT_JOINT, RIGHT_JOINT
from sccal.logs.messages.definitions import full_text, known_definitions
from sccal.logs.messages.ros import RosWalker
from sccal.logs.quality import navsat_status
from sccal.logs.streams import FixStream, HeadingStream, WheelStream

WHEELS_TOPIC, HEADING_TOPIC, FIX_TOPIC, NMEA_TOPIC = "/joint_states", "/imu/data", "/fix", "/nmea_sentence"


@dataclass(frozen=True)
class Stamped:
    """Encoded messages of one topic: n stamps (ns) and n CDR messages."""

    topic: str
    type_name: str
    stamp_ns: Ints
    messages: list[bytes]
    log_ns: Ints | None = None
    """When each was logged; None for the stamps."""
    definition: str = ""
    """Of the type; empty for those that sccal knows."""

    @property
    def log_times_ns(self) -> Ints:
        """(n) log times."""
        return self.stamp_ns if self.log_ns is None else self.log_ns


def write_topics(
    path: Path,
    topics: Sequence[Stamped],
    metadata: Mapping[str, Mapping[str, str]] | None = None,
    attachments: Mapping[str, tuple[str, bytes]] | None = None,
    compression: str = "zstd",
    library: str = "sccal",
) -> None:
    """Write topics in order of log time, whole or not at all; the same bytes every time.

    ``attachments`` are media type and content by name. They and ``metadata`` (by name) stand before the messages, where
    a cut file still has them.

    Raises:
        DataError: log times before 1970-01-01 (negative ones).
    """
    from mcap.writer import CompressionType, Writer

    if min((int(topic.log_times_ns.min()) for topic in topics if topic.stamp_ns.size), default=0) < 0:
        raise DataError(f"{path}: the run has times below zero, which MCAP cannot hold")
    kind = {"": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}[compression]
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            writer = Writer(file, compression=kind)
            writer.start(profile="ros2", library=library)
            for name, entries in (metadata or {}).items():
                writer.add_metadata(name, dict(entries))
            for name, (media_type, content) in (attachments or {}).items():
                writer.add_attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=content)
            channels = []
            schemas: dict[str, int] = {}
            for topic in topics:
                if topic.type_name not in schemas:
                    text = topic.definition or full_text(topic.type_name.replace("/msg/", "/"))
                    schemas[topic.type_name] = writer.register_schema(topic.type_name, "ros2msg", text.encode())
                channels.append(writer.register_channel(topic.topic, "cdr", schemas[topic.type_name]))
            for number, (ns, which, message) in enumerate(_in_order(topics)):
                writer.add_message(channels[which], log_time=ns, publish_time=ns, data=message, sequence=number)
            writer.finish()  # type: ignore[no-untyped-call]
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def joint_states(wheels: WheelStream) -> Stamped:
    """The wheels' cumulative angles as positions of two joints."""
    texts = {"header.frame_id": "base_link", "name[0]": LEFT_JOINT, "name[1]": RIGHT_JOINT}
    numbers = {"position[0]": wheels.left_rad, "position[1]": wheels.right_rad}
    return encoded(WHEELS_TOPIC, "sensor_msgs/msg/JointState", wheels.t_s, texts, {"name": 2, "position": 2}, numbers)


def imu(heading: HeadingStream, convention: str) -> Stamped:
    """The heading as orientations in ROS's east, north, up; angles that the AHRS does not give are zero."""
    numbers = imu_numbers(heading, convention)
    return encoded(HEADING_TOPIC, "sensor_msgs/msg/Imu", heading.t_s, {"header.frame_id": "base_link"}, {}, numbers)


def imu_numbers(heading: HeadingStream, convention: str) -> dict[str, Floats]:
    """The fields (n) of those messages by path."""
    yaw = heading.yaw_rad if convention == "enu" else 0.5 * np.pi - heading.yaw_rad
    zero = np.zeros(yaw.size)
    pitch = zero if heading.pitch_rad is None else -np.nan_to_num(heading.pitch_rad)
    roll = zero if heading.roll_rad is None else np.nan_to_num(heading.roll_rad)
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(a / 2), np.sin(a / 2)) for a in (yaw, pitch, roll))
    numbers = {
        "orientation.w": cr * cp * cy + sr * sp * sy,
        "orientation.x": sr * cp * cy - cr * sp * sy,
        "orientation.y": cr * sp * cy + sr * cp * sy,
        "orientation.z": cr * cp * sy - sr * sp * cy,
        "linear_acceleration_covariance[0]": zero - 1.0,
    }
    if heading.yaw_sigma_rad is not None:
        variance = np.nan_to_num(heading.yaw_sigma_rad) ** 2
        numbers |= {f"orientation_covariance[{i}]": variance for i in (0, 4, 8)}
    if heading.gyro_z_radps is None:
        numbers["angular_velocity_covariance[0]"] = zero - 1.0
    else:
        numbers["angular_velocity.z"] = heading.gyro_z_radps
    return numbers


def nav_sat_fixes(fixes: FixStream) -> Stamped:
    """The fixes, stamped with the receive time where there is one, else with the receiver's epoch."""
    t_s = np.where(np.isfinite(fixes.host_t_s), fixes.host_t_s, fixes.utc_s)
    frame = {"header.frame_id": "gnss"}
    return encoded(FIX_TOPIC, "sensor_msgs/msg/NavSatFix", t_s, frame, {}, nav_sat_numbers(fixes))


def nav_sat_numbers(fixes: FixStream) -> dict[str, Floats]:
    """The fields (n) of those messages by path."""
    stated = np.isfinite(fixes.sigma_east_m) & np.isfinite(fixes.sigma_north_m)
    return {
        "status.status": np.array([navsat_status(code) for code in fixes.quality.tolist()], dtype=np.float64),
        "latitude": fixes.lat_deg,
        "longitude": fixes.lon_deg,
        "altitude": fixes.alt_m,
        "position_covariance[0]": np.where(stated, fixes.sigma_east_m**2, 0.0),
        "position_covariance[1]": np.where(stated, fixes.cov_en_m2, 0.0),
        "position_covariance[3]": np.where(stated, fixes.cov_en_m2, 0.0),
        "position_covariance[4]": np.where(stated, fixes.sigma_north_m**2, 0.0),
        "position_covariance_type": np.where(stated, 3.0, 0.0),
    }


def sentence_messages(stamp_ns: Ints, texts: Sequence[bytes], log_ns: Ints | None = None) -> Stamped:
    """Sentences (n) as messages with these stamps (n); a stamp of 0 is none."""
    messages = []
    for ns, text in zip(stamp_ns.tolist(), texts, strict=True):
        head = struct.pack("<4BiI", 0, 1, 0, 0, *divmod(ns, 1_000_000_000)) + struct.pack("<I5s", 5, b"gnss\0")
        head += bytes(-(len(head) - 4) % 4)
        messages.append(head + struct.pack("<I", len(text) + 1) + text + b"\0")
    return Stamped(NMEA_TOPIC, "nmea_msgs/msg/Sentence", stamp_ns, messages, log_ns)


def encoded(
    topic: str,
    type_name: str,
    times: Floats,
    texts: Mapping[str, str],
    counts: Mapping[str, int],
    numbers: Mapping[str, Floats],
) -> Stamped:
    """Messages of one layout: ``texts`` by path, lengths of sequences by path, and columns (n) of numbers by path.

    ``times`` (n) are seconds.
    """
    root = type_name.replace("/msg/", "/")
    blank = _Blank(texts, counts).encoded(root)
    places = RosWalker(known_definitions(), root).shape(blank).numbers
    stamp_ns = nanoseconds_of(times)
    rows: NDArray[np.uint8] = np.tile(np.frombuffer(blank, dtype=np.uint8), (times.size, 1))
    columns: dict[str, Floats | Ints] = dict(numbers)
    if "header.stamp.sec" in places:
        columns |= {"header.stamp.sec": stamp_ns // 1_000_000_000, "header.stamp.nanosec": stamp_ns % 1_000_000_000}
    for name, column in columns.items():
        place = places[name]
        values = np.ascontiguousarray(column.astype(place.kind)).view(np.uint8).reshape(times.size, place.width)
        rows[:, place.offset : place.offset + place.width] = values
    return Stamped(topic, type_name, stamp_ns, [row.tobytes() for row in rows])


class _Blank:
    """One message with all numbers zero."""

    def __init__(self, texts: Mapping[str, str], counts: Mapping[str, int]) -> None:
        self.texts, self.counts = texts, counts
        self.data = bytearray((0, 1, 0, 0))
        self.definitions = known_definitions()

    def encoded(self, name: str) -> bytes:
        self._struct(name, "")
        return bytes(self.data)

    def _struct(self, name: str, path: str) -> None:
        for one in self.definitions[name]:
            where = f"{path}.{one.name}" if path else one.name
            if one.count is None:
                self._value(one.type, where)
                continue
            count = one.count
            if count < 0:
                count = self.counts.get(where, 0)
                self._number(4, count)
            for i in range(count):
                self._value(one.type, f"{where}[{i}]")

    def _value(self, kind: str, path: str) -> None:
        bits = re.fullmatch(r"(?:u?int|float)(\d+)", kind)
        if kind == "string":
            text = self.texts.get(path, "").encode() + b"\0"
            self._number(4, len(text))
            self.data += text
        elif bits or kind in ("bool", "byte", "char"):
            self._number(int(bits[1]) // 8 if bits else 1, 0)
        else:
            self._struct(kind, path)

    def _number(self, size: int, value: int) -> None:
        self.data += bytes(-(len(self.data) - 4) % size)
        self.data += value.to_bytes(size, "little")


def nanoseconds_of(t_s: Floats) -> Ints:
    """Whole nanoseconds of times in seconds (n)."""
    whole = np.floor(t_s)
    return whole.astype(np.int64) * 1_000_000_000 + np.round((t_s - whole) * 1e9).astype(np.int64)


def _in_order(topics: Sequence[Stamped]) -> Iterator[tuple[int, int, bytes]]:
    """Stamp, topic and message of all topics in order of time."""
    ns = np.concatenate([topic.log_times_ns for topic in topics] or [np.empty(0, dtype=np.int64)])
    which = np.repeat(np.arange(len(topics)), [topic.stamp_ns.size for topic in topics])
    row = np.concatenate([np.arange(topic.stamp_ns.size) for topic in topics] or [np.empty(0, dtype=np.int64)])
    order = np.argsort(ns, kind="stable")
    for at, topic, i in zip(ns[order].tolist(), which[order].tolist(), row[order].tolist(), strict=True):
        yield at, topic, topics[topic].messages[i]
