"""Logs of messages for tests: one simulated run in every encoding, and small logs made by hand."""

from __future__ import annotations

import functools
import io
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2._dynamic import generate_dynamic, serialize_dynamic

from sccal.logs.messages.definitions import full_text
from sccal.logs.messages.write import (
    Stamped,
    encoded,
    imu,
    joint_states,
    nanoseconds_of,
    nav_sat_fixes,
    sentence_messages,
    write_topics,
)
from sccal.logs.run import RunSource, read_run
from sccal.logs.streams import Run

VEHICLE = "[nominal]\nwheel_radius_m = 0.08\ntrack_m = 0.7\n[encoder]\nticks_per_rev = 1000\n"
SENTENCE = re.compile(rb"^\s*([-+]?\d+(?:\.\d+)?)[\s,;]+(\$[^\r\n]*)", re.MULTILINE)
Message = tuple[str, str, int, bytes]
"""Topic, type, log time (ns) and bytes."""


def plain(type_name: str) -> str:
    """package/Type."""
    return type_name.replace("/msg/", "/")


def cdr(type_name: str, values: Mapping[str, Any]) -> bytes:
    """One message as the stock writer encodes it."""
    return _encoder(plain(type_name))(dict(values))


def decoded(type_name: str, raw: bytes) -> Any:
    """One message as the stock decoder reads it."""
    return _decoder(plain(type_name))(raw)


@functools.cache
def _encoder(name: str) -> Any:
    return serialize_dynamic(name, full_text(name))[name]


@functools.cache
def _decoder(name: str) -> Any:
    return generate_dynamic(name, full_text(name))[name]


def stamp(t_s: float, frame: str = "") -> dict[str, Any]:
    """A header."""
    ns = round(t_s * 1e9)
    return {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": frame}


def ros2_bytes(messages: Iterable[Message], **settings: Any) -> bytes:
    """A ros2 MCAP file; ``settings`` are the writer's."""
    file = io.BytesIO()
    writer = Writer(file, **{"chunk_size": 4096, **settings})
    writer.start(profile="ros2", library="test")
    channels: dict[tuple[str, str], int] = {}
    for topic, type_name, log_ns, raw in messages:
        if (topic, type_name) not in channels:
            schema = writer.register_schema(type_name, "ros2msg", full_text(plain(type_name)).encode())
            channels[topic, type_name] = writer.register_channel(topic, "cdr", schema)
        writer.add_message(channels[topic, type_name], log_time=log_ns, publish_time=log_ns, data=raw)
    writer.finish()
    return file.getvalue()


def json_bytes(messages: Iterable[tuple[str, str, int, Mapping[str, Any]]], **settings: Any) -> bytes:
    """A JSON MCAP file; an empty type gives a channel without schema."""
    file = io.BytesIO()
    writer = Writer(file, **{"chunk_size": 4096, **settings})
    writer.start(profile="", library="test")
    channels: dict[tuple[str, str], int] = {}
    for topic, type_name, log_ns, values in messages:
        if (topic, type_name) not in channels:
            schema = writer.register_schema(type_name, "jsonschema", b'{"type":"object"}') if type_name else 0
            channels[topic, type_name] = writer.register_channel(topic, "json", schema)
        raw = json.dumps(values).encode()
        writer.add_message(channels[topic, type_name], log_time=log_ns, publish_time=log_ns, data=raw)
    writer.finish()
    return file.getvalue()


NO_CHUNKS = {"use_chunking": False}
NO_INDEX = {
    "index_types": IndexType.NONE,
    "repeat_channels": False,
    "repeat_schemas": False,
    "use_statistics": False,
    "use_summary_offsets": False,
}
LZ4 = {"compression": CompressionType.LZ4}
PLAIN = {"compression": CompressionType.NONE}


def streams_of(run: Run, nmea: bytes | None) -> list[Stamped]:
    """A run's streams; of ``nmea``, the bytes of a gnss.nmea, sentences instead of its fixes."""
    fixes = nav_sat_fixes(run.fixes)
    if nmea is not None:
        found = SENTENCE.findall(nmea)
        fixes = sentence_messages(nanoseconds_of(np.array([float(t) for t, _ in found])), [text for _, text in found])
    return [joint_states(run.wheels), imu(run.heading, run.vehicle.convention), fixes]


def write_mcap(run: Run, path: Path, nmea: bytes | None = None) -> None:
    """A run as an MCAP file, its further columns as topics of numbers."""
    further = [
        encoded("/" + re.sub(r"\W+", "_", name), "std_msgs/msg/Float64", t_s[rows], {}, {}, {"data": column[rows]})
        for t_s, extras in ((run.wheels.t_s, run.wheels.extras), (run.heading.t_s, run.heading.extras))
        for name, column in extras.items()
        for rows in (np.isfinite(column),)
    ]
    write_topics(path, [*streams_of(run, nmea), *further])


def messages_of(run: Run, nmea: bytes | None) -> list[Message]:
    """A run's messages in order of time."""
    rows = [
        (topic.topic, topic.type_name, ns, raw)
        for topic in streams_of(run, nmea)
        for ns, raw in zip(topic.stamp_ns.tolist(), topic.messages, strict=True)
    ]
    return sorted(rows, key=lambda row: row[2])


def as_dict(value: Any) -> Any:
    """A decoded message as plain Python."""
    if isinstance(value, SimpleNamespace):
        return {name: as_dict(getattr(value, name)) for name in type(value).__slots__}
    if isinstance(value, list | tuple):
        return [as_dict(below) for below in value]
    return value.tolist() if isinstance(value, np.ndarray) else list(value) if hasattr(value, "typecode") else value


def as_json(messages: Iterable[Message], **settings: Any) -> bytes:
    """The same messages as JSON."""
    rows = ((topic, kind, ns, as_dict(decoded(kind, raw))) for topic, kind, ns, raw in messages)
    return json_bytes(rows, **settings)


_NUMBERS = {"double": 1, "int64": 3, "int32": 5, "uint32": 13, "sint32": 17, "fixed64": 6, "float": 2, "bool": 8}
PROTO = {
    "Time": {"sec": "int32", "nanosec": "uint32"},
    "Header": {"stamp": "Time", "frame_id": "string"},
    "Quaternion": {"x": "double", "y": "double", "z": "double", "w": "double"},
    "Vector3": {"x": "double", "y": "double", "z": "double"},
    "JointState": {
        "header": "Header",
        "name": "string*",
        "position": "double*",
        "velocity": "double*",
        "effort": "double*",
    },
    "Imu": {
        "header": "Header",
        "orientation": "Quaternion",
        "orientation_covariance": "double*",
        "angular_velocity": "Vector3",
        "angular_velocity_covariance": "double*",
        "linear_acceleration": "Vector3",
        "linear_acceleration_covariance": "double*",
    },
    "Status": {"status": "int32"},
    "NavSatFix": {
        "header": "Header",
        "status": "Status",
        "latitude": "double",
        "longitude": "double",
        "altitude": "double",
        "position_covariance": "double*",
        "position_covariance_type": "int32",
    },
    "Sentence": {"header": "Header", "sentence": "string"},
    "LocationFix": {
        "timestamp": "Time",
        "frame_id": "string",
        "latitude": "double",
        "longitude": "double",
        "altitude": "double",
        "position_covariance": "double*",
        "position_covariance_type": "int32",
    },
}


def proto_classes(package: str, types: Mapping[str, Mapping[str, str]] = PROTO) -> tuple[dict[str, Any], bytes]:
    """Message classes by name, and the descriptor set that goes into a schema."""
    from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClass

    file = FileDescriptorProto(name=f"{package}.proto", package=package, syntax="proto3")
    for name, fields in types.items():
        message = file.message_type.add(name=name)
        for number, (field, kind) in enumerate(fields.items(), 1):
            base = kind.rstrip("*")
            one = message.field.add(name=field, number=number, label=3 if kind.endswith("*") else 1)
            one.type = {**_NUMBERS, "string": 9}.get(base, 11)
            if one.type == 11:
                one.type_name = f".{package}.{base}"
    pool = DescriptorPool()
    pool.Add(file)
    classes = {name: GetMessageClass(pool.FindMessageTypeByName(f"{package}.{name}")) for name in types}
    return classes, FileDescriptorSet(file=[file]).SerializeToString()


def fill(message: Any, values: Mapping[str, Any]) -> Any:
    """Set a protobuf message's fields."""
    for name, value in values.items():
        if name not in message.DESCRIPTOR.fields_by_name:
            continue
        if isinstance(value, Mapping):
            fill(getattr(message, name), value)
        elif isinstance(value, list):
            getattr(message, name).extend(value)
        else:
            setattr(message, name, value)
    return message


def as_protobuf(messages: Iterable[Message], package: str = "sensor_msgs.msg", **settings: Any) -> bytes:
    """The same messages as protobuf, by types of the same field names."""
    classes, descriptors = proto_classes(package)
    file = io.BytesIO()
    writer = Writer(file, **{"chunk_size": 8192, **settings})
    writer.start(profile="", library="test")
    channels: dict[str, int] = {}
    for topic, type_name, ns, raw in messages:
        last = type_name.split("/")[-1]
        if topic not in channels:
            schema = writer.register_schema(f"{package}.{last}", "protobuf", descriptors)
            channels[topic] = writer.register_channel(topic, "protobuf", schema)
        data = fill(classes[last](), as_dict(decoded(type_name, raw))).SerializeToString()
        writer.add_message(channels[topic], log_time=ns, publish_time=ns, data=data)
    writer.finish()
    return file.getvalue()


def write_db3(messages: Iterable[Message], folder: Path) -> Path:
    """The same messages as a rosbag2 folder in SQLite."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections: dict[str, Any] = {}
        for topic, type_name, ns, raw in messages:
            if topic not in connections:
                if type_name.startswith("nmea_msgs"):
                    text = full_text(plain(type_name))
                    more = {"msgdef": text, "rihs01": "RIHS01_" + "0" * 64}
                    connections[topic] = writer.add_connection(topic, type_name, **more)
                else:
                    connections[topic] = writer.add_connection(topic, type_name, typestore=store)
            writer.write(connections[topic], ns, raw)
    return folder


@functools.cache
def typestore(name: str) -> Any:
    """One of rosbags' stores: it compiles a type when it first meets it."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores[name])


def as_ros1(type_name: str, raw: bytes) -> bytes:
    """One message as ROS 1 writes it."""
    ours, theirs = typestore("ROS2_HUMBLE"), typestore("ROS1_NOETIC")

    def converted(value: Any) -> Any:
        if not hasattr(value, "__msgtype__"):
            return value
        fields = {name: converted(getattr(value, name)) for name in value.__dataclass_fields__ if name[0] != "_"}
        if value.__msgtype__.endswith("/Header"):
            fields["seq"] = 7
        return theirs.types[value.__msgtype__](**fields)

    return bytes(theirs.serialize_ros1(converted(ours.deserialize_cdr(raw, type_name)), type_name))


def ros1_definition(type_name: str) -> str:
    """A type's definition as ROS 1 logs it."""
    return str(typestore("ROS1_NOETIC").generate_msgdef(type_name)[0])


def write_ros1(messages: Iterable[Message], path: Path) -> Path:
    """The same messages as a ROS 1 bag."""
    from rosbags.rosbag1 import Writer

    theirs = typestore("ROS1_NOETIC")
    with Writer(path) as writer:
        connections: dict[str, Any] = {}
        for topic, type_name, ns, raw in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=theirs)
            writer.write(connections[topic], ns, as_ros1(type_name, raw))
    return path


def read_bytes(folder: Path, data: bytes, name: str = "log.mcap", vehicle: str = VEHICLE, **options: Any) -> Run:
    """Read a file of these bytes."""
    from sccal.logs.options import ReadOptions

    (folder / name).write_bytes(data)
    (folder / "vehicle.toml").write_text(vehicle)
    return read_run(RunSource("log", folder / name, folder / "vehicle.toml"), ReadOptions(**options))
