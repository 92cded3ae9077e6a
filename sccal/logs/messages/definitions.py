"""ROS message definitions: the text that a log carries for each type, and the types that sccal knows without it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

_SECTION = re.compile(r"^=+\s*$", re.MULTILINE)
_FIELD = re.compile(r"^([A-Za-z][\w/]*)(?:<=\d+)?(\[(?:<=)?(\d*)\])?\s+([A-Za-z]\w*)\s*(=)?")
_PRIMITIVE = re.compile(r"^(bool|byte|char|w?string|float(32|64)|u?int(8|16|32|64))$")


@dataclass(frozen=True)
class FieldDefinition:
    """One field of a message."""

    name: str
    type: str
    """A primitive, or the full name ``package/Type`` of a message."""
    count: int | None = None
    """None for a single value, −1 for a sequence with its length before it, else the length of a fixed array."""


Definitions = Mapping[str, tuple[FieldDefinition, ...]]

_HEADER = "Header header\n"
_KNOWN_TEXTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3Stamped": _HEADER + "Vector3 vector",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance",
    "geometry_msgs/PoseStamped": _HEADER + "Pose pose",
    "geometry_msgs/PoseWithCovarianceStamped": _HEADER + "PoseWithCovariance pose",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance",
    "geometry_msgs/QuaternionStamped": _HEADER + "Quaternion quaternion",
    "nav_msgs/Odometry": _HEADER
    + "string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist",
    "nmea_msgs/Sentence": _HEADER + "string sentence",
    "sensor_msgs/BatteryState": _HEADER
    + "float32 voltage\nfloat32 temperature\nfloat32 current\nfloat32 charge\nfloat32 capacity\n"
    "float32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\nuint8 power_supply_health\n"
    "uint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\nfloat32[] cell_temperature\n"
    "string location\nstring serial_number",
    "sensor_msgs/Imu": _HEADER + "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
    "sensor_msgs/JointState": _HEADER + "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
    "sensor_msgs/MagneticField": _HEADER + "geometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance",
    "sensor_msgs/NavSatStatus": "int8 status\nuint16 service",
    "sensor_msgs/NavSatFix": _HEADER + "NavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
    "float64[9] position_covariance\nuint8 position_covariance_type",
    "sensor_msgs/Temperature": _HEADER + "float64 temperature\nfloat64 variance",
    **{
        f"std_msgs/{name}": f"{name.lower()} data"
        for name in ("Float32", "Float64", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64")
    },
    "std_msgs/Bool": "bool data",
}


def plain_name(name: str) -> str:
    """``package/Type`` of ``package/msg/Type``, ``package::msg::Type`` or ``package.msg.Type``."""
    parts = [part for part in re.split(r"[/.:]+", name) if part]
    return f"{parts[-3] if len(parts) > 2 and parts[-2] == 'msg' else parts[-2]}/{parts[-1]}" if parts[1:] else name


def parse_definitions(root: str, text: str) -> Definitions:
    """All message types of a definition with its dependencies, by full name; ``root`` is the first one's."""
    sections: dict[str, str] = {}
    for number, section in enumerate(_SECTION.split(text)):
        section = section.strip("\r\n ")
        name, body = root, section
        if number:
            title, _, body = section.partition("\n")
            if not title.startswith("MSG:"):
                continue
            name = title.removeprefix("MSG:").strip()
        sections.setdefault(plain_name(name), body)
    return _parsed(sections)


def known_definitions() -> Definitions:
    """The types that sccal reads, for logs that hold no definitions (ROS 2 before Iron) or hold them as IDL."""
    return _parsed(_KNOWN_TEXTS)


def full_text(name: str) -> str:
    """The definition of a known type with all it depends on, as ROS 2 writes it into a log."""
    definitions = known_definitions()
    order = [name]
    for one in order:
        order += [f.type for f in definitions[one] if f.type in definitions and f.type not in order]
    texts = {**_KNOWN_TEXTS, "builtin_interfaces/Time": "int32 sec\nuint32 nanosec"}
    first = texts[name].replace("Header header", "std_msgs/Header header")
    parts = [first, *(f"MSG: {one}\n{texts[one]}" for one in order[1:])]
    return ("\n" + "=" * 80 + "\n").join(parts) + "\n"


def _parsed(sections: Mapping[str, str]) -> Definitions:
    definitions: dict[str, tuple[FieldDefinition, ...]] = {
        # Whatever a log says about these two: ROS 1 has them as primitives of the same eight bytes.
        "builtin_interfaces/Time": (FieldDefinition("sec", "int32"), FieldDefinition("nanosec", "uint32")),
        "builtin_interfaces/Duration": (FieldDefinition("sec", "int32"), FieldDefinition("nanosec", "uint32")),
    }
    for name, body in sections.items():
        if name in definitions:
            continue
        fields = []
        for line in body.splitlines():
            found = _FIELD.match(line.strip())
            if found is None or found[5]:
                continue
            count = None if found[2] is None else int(found[3]) if found[3] and "<" not in found[2] else -1
            fields.append(FieldDefinition(found[4], _resolved(found[1], name, sections), count))
        definitions[name] = tuple(fields)
    return definitions


def _resolved(type_name: str, parent: str, sections: Mapping[str, str]) -> str:
    if _PRIMITIVE.match(type_name):
        return type_name
    if type_name in ("time", "duration"):
        return f"builtin_interfaces/{type_name.capitalize()}"
    if "/" in type_name:
        return plain_name(type_name)
    if type_name == "Header":
        return "std_msgs/Header"
    beside = f"{parent.rpartition('/')[0]}/{type_name}"
    return beside if beside in sections else next((n for n in sections if n.endswith(f"/{type_name}")), beside)
