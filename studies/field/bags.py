"""The same logs as messages: MCAP, ROS 2 and ROS 1 files, written by libraries that are not the package's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from studies.arrays import floats
from studies.field.files import nmea_lines, write_lines
from studies.field.world import START_S, Log

Values = Mapping[str, Any]
Message = tuple[int, str, str, Values]
"""Log time (ns), topic, type and content."""

_RULE = "=" * 80 + "\nMSG: "
_TIME = _RULE + "builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER = _RULE + "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + _TIME
_QUATERNION = _RULE + "geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_VECTOR = _RULE + "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
_POINT = _RULE + "geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
_POSE = _RULE + "geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
_TWIST = _RULE + "geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"
_TOP = "std_msgs/Header header\n"
DEFINITIONS = {
    "sensor_msgs/msg/JointState": _TOP
    + "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    + _HEADER,
    "sensor_msgs/msg/Imu": _TOP
    + "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    + "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    + "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    + _HEADER
    + _QUATERNION
    + _VECTOR,
    "sensor_msgs/msg/NavSatFix": _TOP
    + "sensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
    + "float64[9] position_covariance\nuint8 position_covariance_type\n"
    + _HEADER
    + _RULE
    + "sensor_msgs/NavSatStatus\nint8 status\nuint16 service\n",
    "std_msgs/msg/String": "string data\n",
    "std_msgs/msg/Float64": "float64 data\n",
    "ublox_msgs/msg/NavPVT": "uint32 i_tow\nint32 lon\nint32 lat\nint32 height\n"
    + "uint32 h_acc\nuint8 fix_type\nuint8 flags\n",
    "nav_msgs/msg/Odometry": _TOP
    + "string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n"
    + _HEADER
    + _RULE
    + "geometry_msgs/PoseWithCovariance\ngeometry_msgs/Pose pose\nfloat64[36] covariance\n"
    + _RULE
    + "geometry_msgs/TwistWithCovariance\ngeometry_msgs/Twist twist\nfloat64[36] covariance\n"
    + _POSE
    + _POINT
    + _QUATERNION
    + _TWIST
    + _VECTOR,
    "geometry_msgs/msg/PoseStamped": _TOP + "geometry_msgs/Pose pose\n" + _HEADER + _POSE + _POINT + _QUATERNION,
    "geometry_msgs/msg/TwistStamped": _TOP + "geometry_msgs/Twist twist\n" + _HEADER + _TWIST + _VECTOR,
}
NOTHING9 = [0.0] * 9


def nanoseconds(unix_s: float) -> int:
    """A time of day in June 2024 to a tenth of a millisecond."""
    return round(unix_s * 1e4) * 100_000


def header(ns: int, frame: str = "base") -> Values:
    """A stamp and a frame."""
    return {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": frame}


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Values:
    """Three numbers."""
    return {"x": x, "y": y, "z": z}


def quaternion(yaw_rad: float) -> Values:
    """A level orientation."""
    return {"x": 0.0, "y": 0.0, "z": math.sin(yaw_rad / 2.0), "w": math.cos(yaw_rad / 2.0)}


def joint_state(ns: int, names: Sequence[str], positions: Sequence[float]) -> Values:
    """Angles of some joints."""
    return {"header": header(ns), "name": list(names), "position": list(positions), "velocity": [], "effort": []}


def imu(ns: int, orientation: Values) -> Values:
    """An orientation, and gravity."""
    return {
        "header": header(ns, "imu"),
        "orientation": orientation,
        "orientation_covariance": NOTHING9,
        "angular_velocity": vector(),
        "angular_velocity_covariance": NOTHING9,
        "linear_acceleration": vector(z=9.81),
        "linear_acceleration_covariance": NOTHING9,
    }


def nav_sat_fix(ns: int, lat_deg: float, lon_deg: float, status: int = 2) -> Values:
    """A fix of a centimetre or two."""
    covariance = [2e-4, 0.0, 0.0, 0.0, 2e-4, 0.0, 0.0, 0.0, 8e-4]
    return {
        "header": header(ns, "gps"),
        "status": {"status": status, "service": 1},
        "latitude": lat_deg,
        "longitude": lon_deg,
        "altitude": 450.0,
        "position_covariance": covariance,
        "position_covariance_type": 2,
    }


JOINTS = ("left_wheel_joint", "right_wheel_joint")
Told = list[tuple[str, str, Values]]
"""Topic, type and content of the messages of one moment."""


def usual_wheels(_number: int, ns: int, left_rad: float, right_rad: float) -> Told:
    """The state of two joints."""
    return [("/joint_states", "sensor_msgs/msg/JointState", joint_state(ns, JOINTS, (left_rad, right_rad)))]


def usual_heading(_number: int, ns: int, yaw_rad: float) -> Told:
    """An orientation."""
    return [("/imu/data", "sensor_msgs/msg/Imu", imu(ns, quaternion(yaw_rad)))]


def usual_fix(_number: int, ns: int, lat_deg: float, lon_deg: float) -> Told:
    """A fix."""
    return [("/fix", "sensor_msgs/msg/NavSatFix", nav_sat_fix(ns, lat_deg, lon_deg))]


def nothing(*_of: object) -> Told:
    """No message."""
    return []


def messages(
    log: Log,
    wheels: Callable[[int, int, float, float], Told] = usual_wheels,
    heading: Callable[[int, int, float], Told] = usual_heading,
    fix: Callable[[int, int, float, float], Told] = usual_fix,
) -> list[Message]:
    """The messages of a log in order of time."""
    found: list[Message] = []
    to_rad = 2.0 * math.pi / log.robot.ticks_per_rev
    counts = zip(log.wheel_t.tolist(), log.left.tolist(), log.right.tolist(), strict=True)
    for number, (t, left, right) in enumerate(counts):
        ns = nanoseconds(START_S + t)
        found += [(ns, *told) for told in wheels(number, ns, left * to_rad, right * to_rad)]
    for number, (t, yaw) in enumerate(zip(log.yaw_t.tolist(), np.radians(log.yaw_deg).tolist(), strict=True)):
        ns = nanoseconds(START_S + t)
        found += [(ns, *told) for told in heading(number, ns, yaw)]
    latitudes, longitudes = log.places
    fixes = zip((log.received_t - 0.02).tolist(), latitudes.tolist(), longitudes.tolist(), strict=True)
    for number, (t, lat, lon) in enumerate(fixes):
        ns = nanoseconds(START_S + t)
        found += [(ns, *told) for told in fix(number, ns, lat, lon)]
    return sorted(found, key=lambda message: message[0])


def in_order(first: Iterable[Message], second: Iterable[Message]) -> list[Message]:
    """Two lists of messages as one."""
    return sorted([*first, *second], key=lambda message: message[0])


def sentence_messages(log: Log, topic: str = "/nmea") -> list[Message]:
    """The receiver's sentences as strings."""
    return [(nanoseconds(t), topic, "std_msgs/msg/String", {"data": text + "\r\n"}) for t, text in nmea_lines(log)]


def write_mcap(path: Path, found: Iterable[Message], **settings: Any) -> None:
    """An MCAP file of ROS 2 messages."""
    from mcap_ros2.writer import Writer

    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        writer: Any = Writer(file, **settings)
        schemas: dict[str, Any] = {}
        for ns, topic, kind, values in found:
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, DEFINITIONS[kind])
            writer.write_message(topic, schemas[kind], values, log_time=ns, publish_time=ns)
        writer.finish()


def write_metadata(folder: Path, files: Sequence[str], storage: str = "mcap", form: str = "", mode: str = "") -> None:
    """The page that a recorder puts beside the files of one bag."""
    lines = [
        "rosbag2_bagfile_information:",
        "  version: 8",
        f"  storage_identifier: {storage}",
        "  duration:",
        "    nanoseconds: 180000000000",
        "  starting_time:",
        f"    nanoseconds_since_epoch: {nanoseconds(START_S)}",
        "  message_count: 19000",
        "  topics_with_message_count: []",
        f'  compression_format: "{form}"',
        f'  compression_mode: "{mode}"',
        "  relative_file_paths:",
        *(f"    - {name}" for name in files),
        "  files: []",
    ]
    write_lines(folder / "metadata.yaml", lines, "\n")


def _objects(store: Any, kind: str, values: Values, with_seq: bool) -> Any:
    """A message of the library's own classes."""
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](**values["header"]["stamp"])
    seq = {"seq": 0} if with_seq else {}
    head = types["std_msgs/msg/Header"](**seq, stamp=stamp, frame_id=values["header"]["frame_id"])
    if kind.endswith("JointState"):
        return types[kind](head, values["name"], *(floats(values[key]) for key in ("position", "velocity", "effort")))
    if kind.endswith("Imu"):
        three, four = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
        return types[kind](
            head,
            four(**values["orientation"]),
            floats(NOTHING9),
            three(**values["angular_velocity"]),
            floats(NOTHING9),
            three(**values["linear_acceleration"]),
            floats(NOTHING9),
        )
    status = types["sensor_msgs/msg/NavSatStatus"](**values["status"])
    numbers = (values[key] for key in ("latitude", "longitude", "altitude"))
    return types[kind](
        head, status, *numbers, floats(values["position_covariance"]), values["position_covariance_type"]
    )


def write_ros1(path: Path, found: Iterable[Message], **settings: Any) -> None:
    """A ROS 1 bag of the three usual types."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    path.parent.mkdir(parents=True, exist_ok=True)
    writer: Any = Writer(path)
    if "compression" in settings:
        writer.set_compression(settings["compression"])
    with writer:
        ways: dict[str, Any] = {}
        for ns, topic, kind, values in found:
            if topic not in ways:
                ways[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(ways[topic], ns, store.serialize_ros1(_objects(store, kind, values, True), kind))


def write_db3(folder: Path, found: Iterable[Message]) -> None:
    """A ROS 2 folder with an SQLite file, of the three usual types."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with Writer(folder, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        ways: dict[str, Any] = {}
        for ns, topic, kind, values in found:
            if topic not in ways:
                ways[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(ways[topic], ns, store.serialize_cdr(_objects(store, kind, values, False), kind))
