"""Heading out of messages: orientation quaternions, a magnetic field levelled with the IMU, or a yaw at any path.

ROS (REP 103) has the body's axes forward, left, up and the world's east, north, up. Of a rotation yaw-pitch-roll
(z, y', x''), yaw is counter-clockwise from east; roll about the forward axis raises the left side, as in sccal's files;
pitch about the left axis *lowers* the nose, so sccal's pitch is minus it. A driver that answers in north, east, down
with a body forward, right, down gives yaw clockwise from north, and its pitch raises the nose.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.limits import ANGLE_LIMIT_RAD, SIGMA_LIMIT_RAD, TURN_RATE_LIMIT_RADPS
from sccal.logs.messages.topics import Messages
from sccal.logs.messages.wheels import of_messages
from sccal.logs.streams import Convention, HeadingStream, Notice, Vehicle
from sccal.logs.timeline import order_in_time

_DEGREE_LIKE_RAD = 50.0
_SMALLEST_NORM = 0.1


def has_orientation(messages: Messages) -> Bools:
    """(n) which messages hold a quaternion: not all zeros, and not marked as absent by covariance[0] = −1."""
    norm = np.sqrt(sum(messages.column(axis) ** 2 for axis in "xyzw"))
    absent = messages.column("cov_first") == -1
    has: Bools = (norm > _SMALLEST_NORM) & np.isfinite(norm) & ~absent
    return has


def euler(x: Floats, y: Floats, z: Floats, w: Floats) -> tuple[Floats, Floats, Floats]:
    """Yaw, pitch and roll (rad) of quaternions of any norm, as rotations about z, y' and x''."""
    squared = w * w + x * x + y * y + z * z
    yaw = np.arctan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    pitch = np.arcsin(np.clip(2 * (w * y - x * z) / squared, -1.0, 1.0))
    roll = np.arctan2(2 * (w * x + y * z), w * w - x * x - y * y + z * z)
    return yaw, pitch, roll


def in_convention(yaw_rad: Floats, written: Convention, wanted: Convention) -> Floats:
    """A yaw turned from the convention that it is written in into the vehicle's."""
    return yaw_rad if written == wanted else 0.5 * np.pi - yaw_rad


def heading_of_quaternions(
    messages: Messages, written: Convention, vehicle: Vehicle, path: str, source: str
) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """Heading of an Imu or QuaternionStamped topic, in the vehicle's declared convention.

    Raises:
        DataError: no message holds an orientation.
    """
    has = has_orientation(messages)
    notices = _missing(has, messages, "messages without an orientation passed over", source)
    if not has.any():
        raise DataError(
            f"{path}: {messages.t_s.size} messages without an orientation (zeros, or orientation_covariance[0] = −1); "
            "choose another topic with --heading-topic"
        )
    messages = messages.keep(has)
    order, order_notices = order_in_time(messages.t_s, messages.number, source)
    messages = messages.take(order)
    yaw, pitch, roll = euler(*(messages.column(axis) for axis in "xyzw"))
    variance = messages.column("cov_yaw")
    sigma = np.minimum(np.sqrt(np.where(variance > 0, variance, np.nan)), SIGMA_LIMIT_RAD)
    gyro = np.where(messages.column("gyro_cov_first") == -1, np.nan, messages.column("gyro_z"))
    gyro = np.where(np.abs(gyro) <= TURN_RATE_LIMIT_RADPS, gyro, np.nan)
    stream = HeadingStream(
        t_s=messages.t_s,
        yaw_rad=in_convention(yaw, written, vehicle.convention),
        yaw_sigma_rad=sigma if np.isfinite(sigma).all() else None,
        pitch_rad=-pitch if written == "enu" else pitch,
        roll_rad=roll,
        gyro_z_radps=gyro if np.isfinite(gyro).any() else None,
    )
    return stream, of_messages((*notices, *order_notices))


def heading_of_field(
    messages: Messages, imu: Messages | None, vehicle: Vehicle, path: str, source: str
) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """Heading of a magnetometer: where the horizontal field points is magnetic north.

    Raises:
        DataError: no message holds a field.
    """
    field = [messages.column(axis) for axis in "xyz"]
    has = np.isfinite(field[0] + field[1] + field[2]) & (np.abs(field[0]) + np.abs(field[1]) > 0)
    notices = _missing(has, messages, "messages without a field passed over", source)
    if not has.any():
        raise DataError(f"{path}: none of {messages.t_s.size} messages holds a magnetic field")
    messages = messages.keep(has)
    order, order_notices = order_in_time(messages.t_s, messages.number, source)
    messages = messages.take(order)
    bx, by, bz = (messages.column(axis) for axis in "xyz")
    tilt = None if imu is None else _tilt(imu, messages.t_s)
    if tilt is None:
        what = "magnetic fields not levelled, for no IMU says how the robot stood: a slope turns the heading"
        tell = Notice(source, what, messages.t_s.size, "", "warning")
        pitch = roll = np.zeros(messages.t_s.size)
    else:
        pitch, roll = tilt
        tell = Notice(source, f"magnetic fields levelled with {imu.topic if imu else ''}", messages.t_s.size)
    left = np.cos(roll) * by - np.sin(roll) * bz
    forward = np.cos(pitch) * bx + np.sin(pitch) * (np.sin(roll) * by + np.cos(roll) * bz)
    stream = HeadingStream(
        t_s=messages.t_s,
        yaw_rad=in_convention(0.5 * np.pi - np.arctan2(left, forward), "enu", vehicle.convention),
        pitch_rad=None if tilt is None else -pitch,
        roll_rad=None if tilt is None else roll,
    )
    return stream, of_messages((*notices, tell, *order_notices))


def heading_of_path(
    messages: Messages, name: str, vehicle: Vehicle, path: str, source: str
) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """Heading of one column, in the vehicle's convention; degrees where the topic or path ends in ``deg``."""
    values = messages.column(name)
    has = np.abs(values) <= ANGLE_LIMIT_RAD
    notices = list(_missing(has, messages, "messages without a yaw passed over", source))
    messages = messages.keep(has)
    order, order_notices = order_in_time(messages.t_s, messages.number, source)
    messages = messages.take(order)
    yaw = messages.column(name)
    asked = name.casefold()
    in_degrees = asked.endswith(("deg", "degrees")) or messages.topic.casefold().endswith(("deg", "degrees"))
    odd = np.abs(yaw) > _DEGREE_LIKE_RAD
    if not in_degrees and odd.any():
        what = f"yaws beyond {_DEGREE_LIKE_RAD:.0f} rad look like degrees; if so, name the field or topic …_deg"
        where = f"message {messages.number[odd][0]}"
        notices.append(Notice(source, what, int(odd.sum()), where, "warning"))
    what = f"yaws read as {'degrees' if in_degrees else 'radians'}, {vehicle.convention} ({vehicle.path.name})"
    notices.append(Notice(source, what, yaw.size))
    stream = HeadingStream(t_s=messages.t_s, yaw_rad=np.radians(yaw) if in_degrees else yaw)
    return stream, of_messages((*notices, *order_notices))


def _tilt(imu: Messages, t_s: Floats) -> tuple[Floats, Floats] | None:
    """ROS pitch and roll at the times ``t_s``: of the IMU's orientation, else of its acceleration."""
    has = has_orientation(imu)
    if has.any():
        imu = imu.keep(has)
        _, pitch, roll = euler(*(imu.column(axis) for axis in "xyzw"))
    else:
        ax, ay, az = (imu.column(f"acc_{axis}") for axis in "xyz")
        norm = np.sqrt(ax**2 + ay**2 + az**2)
        usable = (norm > 1.0) & (imu.column("acc_cov_first") != -1)
        if not usable.any():
            return None
        imu = imu.keep(usable)
        ax, ay, az = ax[usable], ay[usable], az[usable]
        pitch, roll = np.arctan2(-ax, np.hypot(ay, az)), np.arctan2(ay, az)
    order = np.argsort(imu.t_s, kind="stable")
    return tuple(np.interp(t_s, imu.t_s[order], np.unwrap(angle[order])) for angle in (pitch, roll))  # type: ignore[return-value]


def _missing(has: Bools, messages: Messages, what: str, source: str) -> tuple[Notice, ...]:
    if has.all():
        return ()
    where = f"message {messages.number[~has][0]}"
    return (Notice(source, what, int((~has).sum()), where),)
