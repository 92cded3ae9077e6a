"""Known cases of messages: bags in parts, compressed or unclosed, and types that hold what is needed elsewhere."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from pathlib import Path

from studies.field.bags import (
    Message,
    Told,
    header,
    imu,
    in_order,
    joint_state,
    messages,
    nothing,
    quaternion,
    sentence_messages,
    usual_fix,
    vector,
    write_db3,
    write_mcap,
    write_metadata,
    write_ros1,
)
from studies.field.files import write_vehicle
from studies.field.known_clocks import base
from studies.field.wanted import ANY_LEVEL, Chapter, Truth, doubted, inspected, refused, right

BAGS = Chapter("known", "bags")
TYPES = Chapter("known", "messages")
CHAPTERS = (BAGS, TYPES)


@functools.cache
def usual() -> tuple[Message, ...]:
    """The plain log as messages."""
    return tuple(messages(base()))


def parts_of(count: int) -> list[tuple[Message, ...]]:
    """The messages in so many parts, one after another."""
    found = usual()
    size = len(found) // count + 1
    return [found[begin : begin + size] for begin in range(0, len(found), size)]


def write_parts(folder: Path, count: int) -> None:
    """One drive as a recorder splits it."""
    write_vehicle(folder, base())
    names = [f"rosbag2_drive_{number}.mcap" for number in range(count)]
    for name, part in zip(names, parts_of(count), strict=True):
        write_mcap(folder / "rosbag2_drive" / name, part)
    write_metadata(folder / "rosbag2_drive", names)


@BAGS.case("bag-split-mcap", right(1.3, runs=1))
def split_mcap(folder: Path) -> Truth:
    """A drive in six files of one folder, with their page."""
    write_parts(folder, 6)
    return Truth.of(base())


@BAGS.case("bag-mcap-zstd", right(1.3), refused("zstd"))
def whole_zstd(folder: Path) -> Truth:
    """The whole file was compressed by the recorder."""
    from backports import zstd

    write_vehicle(folder, base())
    place = folder / "rosbag2_drive"
    write_mcap(place / "plain", usual())
    (place / "rosbag2_drive_0.mcap.zstd").write_bytes(zstd.compress((place / "plain").read_bytes()))
    (place / "plain").unlink()
    write_metadata(place, ["rosbag2_drive_0.mcap.zstd"], form="zstd", mode="FILE")
    return Truth.of(base())


@BAGS.case("bag-active", right(2.5, ANY_LEVEL), refused(r"(bag\.active|reindex)"))
def active(folder: Path) -> Truth:
    """The power went off while a ROS 1 bag was written."""
    write_vehicle(folder, base())
    write_ros1(folder / "whole", usual())
    raw = (folder / "whole").read_bytes()
    (folder / "run.bag.active").write_bytes(raw[: int(len(raw) * 0.85)])
    (folder / "whole").unlink()
    return Truth.of(base())


@BAGS.case("bag-ros1", right(1.3))
def ros1(folder: Path) -> Truth:
    """A bag as it should be."""
    write_vehicle(folder, base())
    write_ros1(folder / "run.bag", usual())
    return Truth.of(base())


@BAGS.case("bag-db3", right(1.3), asked=(inspected(r"good"),))
def db3(folder: Path) -> Truth:
    """The older form of ROS 2."""
    write_vehicle(folder, base())
    write_db3(folder / "rosbag2_drive", usual())
    return Truth.of(base())


@BAGS.case("bag-cut-mcap", right(2.5, ANY_LEVEL))
def cut_mcap(folder: Path) -> Truth:
    """The power went off while an MCAP was written."""
    write_vehicle(folder, base())
    write_mcap(folder / "run.mcap", usual(), chunk_size=64 * 1024)
    raw = (folder / "run.mcap").read_bytes()
    (folder / "run.mcap").write_bytes(raw[: int(len(raw) * 0.85)])
    return Truth.of(base())


def one_mcap(found: Callable[[], list[Message]]) -> Callable[[Path], Truth]:
    """One MCAP file."""

    def build(folder: Path) -> Truth:
        write_vehicle(folder, base())
        write_mcap(folder / "run.mcap", found())
        return Truth.of(base())

    return build


TYPES.add(
    "message-string",
    one_mcap(lambda: in_order(messages(base(), fix=nothing), sentence_messages(base()))),
    right(1.3),
    asked=(inspected(),),
)


def nav_pvt_of(topic: str, ns: int, lat: float, lon: float) -> Told:
    """A receiver's own message, in ten-millionths of degrees, under a topic."""
    content = {
        "i_tow": ns // 10**6 % 604_800_000,
        "lon": round(lon * 1e7),
        "lat": round(lat * 1e7),
        "height": 450_000,
        "h_acc": 14,
        "fix_type": 3,
        "flags": 131,
    }
    return [(topic, "ublox_msgs/msg/NavPVT", content)]


def nav_pvt(_number: int, ns: int, lat: float, lon: float) -> Told:
    """The same where its driver usually has it."""
    return nav_pvt_of("/ublox/navpvt", ns, lat, lon)


TYPES.add(
    "message-navpvt",
    one_mcap(lambda: messages(base(), fix=nav_pvt)),
    right(1.6),
    options=("--latitude", "/ublox/navpvt:lat", "--longitude", "/ublox/navpvt:lon"),
)


class Odometer:
    """A base that integrates its nominal wheels."""

    def __init__(self, radius_m: float, track_m: float) -> None:
        """Begin at zero."""
        self.radius_m, self.track_m = radius_m, track_m
        self.east_m = self.north_m = self.yaw_rad = 0.0
        self.last: tuple[float, float] | None = None

    def pose(self, left_rad: float, right_rad: float) -> tuple[float, float, float]:
        """Where it believes to be."""
        if self.last is not None:
            left_m = (left_rad - self.last[0]) * self.radius_m
            right_m = (right_rad - self.last[1]) * self.radius_m
            turn = (right_m - left_m) / self.track_m
            self.east_m += 0.5 * (left_m + right_m) * math.cos(self.yaw_rad + 0.5 * turn)
            self.north_m += 0.5 * (left_m + right_m) * math.sin(self.yaw_rad + 0.5 * turn)
            self.yaw_rad += turn
        self.last = (left_rad, right_rad)
        return self.east_m, self.north_m, self.yaw_rad


def pose_only() -> Callable[[int, int, float, float], Told]:
    """Odometry with a pose and an empty twist."""
    odometer = Odometer(0.08, 0.70)

    def wheels(_number: int, ns: int, left_rad: float, right_rad: float) -> Told:
        x, y, yaw = odometer.pose(left_rad, right_rad)
        content = {
            "header": header(ns, "odom"),
            "child_frame_id": "base",
            "pose": {"pose": {"position": vector(x, y), "orientation": quaternion(yaw)}, "covariance": [0.0] * 36},
            "twist": {"twist": {"linear": vector(), "angular": vector()}, "covariance": [0.0] * 36},
        }
        return [("/odom", "nav_msgs/msg/Odometry", content)]

    return wheels


TYPES.add("message-odom-pose-only", one_mcap(lambda: messages(base(), wheels=pose_only())), right(1.6, ANY_LEVEL))


def in_degrees(_number: int, ns: int, left_rad: float, right_rad: float) -> Told:
    """Joints in degrees, against the standard."""
    angles = (math.degrees(left_rad), math.degrees(right_rad))
    state = joint_state(ns, ("left_wheel_joint", "right_wheel_joint"), angles)
    return [("/joint_states", "sensor_msgs/msg/JointState", state)]


DEGREES = r"(degrees? instead|in degrees|57\.\d|degrees, not radians)"
TYPES.add(
    "message-joints-degrees",
    one_mcap(lambda: messages(base(), wheels=in_degrees)),
    right(1.3),
    doubted(DEGREES),
    refused(DEGREES),
)


def zeros_between(number: int, ns: int, yaw_rad: float) -> Told:
    """An AHRS whose quaternion is all zero now and then."""
    zero = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
    return [
        ("/imu/data", "sensor_msgs/msg/Imu", imu(ns, zero if number % 40 == 7 or number < 60 else quaternion(yaw_rad)))
    ]


TYPES.add("message-quaternion-zeros", one_mcap(lambda: messages(base(), heading=zeros_between)), right(1.3))


def nan_first(number: int, ns: int, lat: float, lon: float) -> Told:
    """No position for the first twenty seconds."""
    return usual_fix(number, ns, math.nan, math.nan) if number < 100 else usual_fix(number, ns, lat, lon)


TYPES.add("message-nan-first", one_mcap(lambda: messages(base(), fix=nan_first)), right(1.5))


def four_wheels(_number: int, ns: int, left_rad: float, right_rad: float) -> Told:
    """Two joints on either side."""
    names = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
    state = joint_state(ns, names, (left_rad, right_rad, left_rad, right_rad))
    return [("/joint_states", "sensor_msgs/msg/JointState", state)]


TYPES.add("message-four-wheels", one_mcap(lambda: messages(base(), wheels=four_wheels)), refused("front_left_wheel"))
TYPES.add(
    "message-four-wheels-told",
    one_mcap(lambda: messages(base(), wheels=four_wheels)),
    right(1.3),
    options=("--left-joint", "rear_left_wheel", "--right-joint", "rear_right_wheel"),
)
