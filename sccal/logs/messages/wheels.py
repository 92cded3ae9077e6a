"""Wheels out of messages: joint states, counters or angles at any path, or the twist of an odometry."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.errors import DataError
from sccal.logs.encoder import repaired_wheels
from sccal.logs.messages.topics import Messages
from sccal.logs.options import ReadOptions
from sccal.logs.rates import integrated
from sccal.logs.streams import Notice, Vehicle, WheelStream
from sccal.logs.table import Table
from sccal.logs.timeline import order_in_time

_TURN_BITS = 20
"""A wrapped angle is unwrapped as a counter that wraps at each turn, with so many bits."""
_FEWEST = 2


@dataclass(frozen=True)
class _Wheel:
    """One quantity of one wheel, finite values only."""

    t_s: Floats
    values: Floats
    number: Ints


def of_messages(notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
    """Notices of readers that count lines, about messages."""
    return tuple(replace(notice, where=notice.where.replace("line ", "message ")) for notice in notices)


def joints_of(messages: Messages, options: ReadOptions) -> tuple[str, str] | None:
    """Names of the left and the right wheel's joint; None where the names do not tell them.

    Without ``left_joint`` and ``right_joint`` they are the joints with "left" and "right" in their names; where there
    are several, the ones that also say "wheel".
    """
    names = sorted({name.split(" ", 1)[1] for name in messages.values if name[0] not in ":+" and " " in name})
    found = []
    for asked, side in ((options.left_joint, "left"), (options.right_joint, "right")):
        if asked:
            alike = [name for name in names if name == asked]
        else:
            alike = [name for name in names if side in name.casefold()]
            alike = alike or [name for name in names if side[0] in re.split(r"[^a-z]+", name.casefold())]
            if len(alike) > 1:
                alike = [name for name in alike if "wheel" in name.casefold()]
        if len(alike) != 1:
            return None
        found.append(alike[0])
    return found[0], found[1]


def joint_names(messages: Messages) -> list[str]:
    """All joints that a joint-state topic names."""
    return sorted({name.split(" ", 1)[1] for name in messages.values if name[0] not in ":+" and " " in name})


def wheels_of_joints(
    messages: Messages, joints: tuple[str, str], vehicle: Vehicle, path: str, source: str
) -> tuple[WheelStream, tuple[Notice, ...]]:
    """Wheels of a joint-state topic: positions (rad) unwrapped, or velocities (rad/s) integrated over their stamps."""
    notices: list[Notice] = []
    sides = [messages.column(f"position {joint}") for joint in joints]
    speeds = [messages.column(f"velocity {joint}") for joint in joints]
    quantity = "position"
    if not all(np.isfinite(side).sum() >= _FEWEST for side in sides):
        quantity = "velocity"
    elif all(_still(side) for side in sides) and not all(_still(speed) for speed in speeds):
        quantity = "velocity"
        notices.append(Notice(source, "joint positions that never change not read", messages.t_s.size, "", "warning"))
    if quantity == "velocity":
        if not all(np.isfinite(speed).sum() >= _FEWEST for speed in speeds):
            raise DataError(f"{path}: joints {', '.join(joints)} have neither positions nor velocities")
        what = "joint velocities integrated to wheel angles over their own stamps"
        notices.append(Notice(source, what, messages.t_s.size))
    left, right = (_finite(messages, column) for column in (sides if quantity == "position" else speeds))
    stream, more = _stream(left, right, "rad", quantity == "velocity", vehicle, path, source)
    efforts = {
        f"{joint}.effort": effort for joint in joints if np.isfinite(effort := messages.column(f"effort {joint}")).any()
    }
    extras = {**stream.extras, **{name: _nearest(stream, messages.t_s, column) for name, column in efforts.items()}}
    return replace(stream, extras=extras), (*notices, *more)


def wheels_of_paths(
    left: tuple[Messages, str], right: tuple[Messages, str], unit: str, vehicle: Vehicle, path: str, source: str
) -> tuple[WheelStream, tuple[Notice, ...]]:
    """Wheels of two columns, of one topic or of two; ``unit`` is ticks or rad."""
    wheels = [_finite(messages, messages.column(name)) for messages, name in (left, right)]
    return _stream(wheels[0], wheels[1], unit, False, vehicle, path, source)


def wheels_of_odometry(
    messages: Messages, vehicle: Vehicle, path: str, source: str
) -> tuple[WheelStream, tuple[Notice, ...]]:
    """Wheels that would have driven the twist: its speed and turning, with the nominal radius and track."""
    speed, turn = messages.column("speed_mps"), messages.column("turn_radps")
    if _still(speed) and _still(turn) and not _still(messages.column("pose_x_m")):
        return _wheels_of_poses(messages, vehicle, path, source)
    half_m = 0.5 * vehicle.track_m
    left = _finite(messages, (speed - half_m * turn) / vehicle.wheel_radius_m)
    right = _finite(messages, (speed + half_m * turn) / vehicle.wheel_radius_m)
    stream, notices = _stream(left, right, "rad", True, vehicle, path, source)
    what = (
        f"twists integrated as two virtual wheels of radius {vehicle.wheel_radius_m:g} m, {vehicle.track_m:g} m apart "
        f"({vehicle.path.name}): radii and track found say how much this odometry is off"
    )
    return stream, (Notice(source, what, messages.t_s.size), *notices)


def _wheels_of_poses(
    messages: Messages, vehicle: Vehicle, path: str, source: str
) -> tuple[WheelStream, tuple[Notice, ...]]:
    """Wheels that would have driven the poses of an odometry whose twist is empty: its steps along its heading."""
    x_m, y_m = messages.column("pose_x_m"), messages.column("pose_y_m")
    qx, qy, qz, qw = (messages.column(f"pose_q{axis}") for axis in "xyzw")
    rows = np.flatnonzero(np.isfinite(x_m + y_m + qx + qy + qz + qw) & (qx**2 + qy**2 + qz**2 + qw**2 > 0))
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy**2 + qz**2))[rows]
    yaw = np.unwrap(yaw)
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    along_m = np.cos(middle) * np.diff(x_m[rows]) + np.sin(middle) * np.diff(y_m[rows])
    travel_m = np.concatenate(([0.0], np.cumsum(along_m)))
    half_m = 0.5 * vehicle.track_m * (yaw - yaw[:1])
    sides = ((travel_m - half_m) / vehicle.wheel_radius_m, (travel_m + half_m) / vehicle.wheel_radius_m)
    left, right = (_Wheel(messages.t_s[rows], side, messages.number[rows]) for side in sides)
    stream, notices = _stream(left, right, "rad", False, vehicle, path, source)
    what = (
        f"poses of an odometry without twist read as two virtual wheels of radius {vehicle.wheel_radius_m:g} m, "
        f"{vehicle.track_m:g} m apart ({vehicle.path.name}): radii and track found say how much it is off"
    )
    return stream, (Notice(source, what, int(rows.size)), *notices)


def with_series(stream: WheelStream, series: Mapping[str, tuple[Floats, Floats]]) -> WheelStream:
    """The wheels with further series (times and values each) as columns, each value at the row nearest to its time."""
    extras = {name: _nearest(stream, t_s, values) for name, (t_s, values) in series.items()}
    return replace(stream, extras={**stream.extras, **extras})


def _nearest(stream: WheelStream, t_s: Floats, values: Floats) -> Floats:
    column = np.full(stream.t_s.size, np.nan)
    use = np.isfinite(values) & (t_s >= stream.t_s[0]) & (t_s <= stream.t_s[-1])
    after = np.clip(np.searchsorted(stream.t_s, t_s[use]), 1, max(stream.t_s.size - 1, 1))
    if stream.t_s.size > 1:
        earlier = t_s[use] - stream.t_s[after - 1] < stream.t_s[after] - t_s[use]
        column[after - earlier] = values[use]
    return column


def _still(values: Floats) -> bool:
    finite = values[np.isfinite(values)]
    return finite.size == 0 or bool(np.ptp(finite) == 0)


def _finite(messages: Messages, values: Floats) -> _Wheel:
    rows = np.isfinite(values) & np.isfinite(messages.t_s)
    return _Wheel(messages.t_s[rows], values[rows], messages.number[rows])


def _stream(
    left: _Wheel, right: _Wheel, unit: str, rates: bool, vehicle: Vehicle, path: str, source: str
) -> tuple[WheelStream, tuple[Notice, ...]]:
    """Both wheels repaired together where they come in the same messages, else each alone and brought together."""
    for wheel, side in ((left, "left"), (right, "right")):
        if wheel.t_s.size < _FEWEST:
            raise DataError(f"{path}: {wheel.t_s.size} readings of the {side} wheel, at least {_FEWEST} are needed")
    if left.number.size == right.number.size and (left.t_s == right.t_s).all():
        return _repaired(left, left.values, right.values, unit, rates, vehicle, path, source)
    one, notices = _repaired(left, left.values, left.values, unit, rates, vehicle, path, source)
    other, more = _repaired(right, right.values, right.values, unit, rates, vehicle, path, source)
    inside = (one.t_s >= other.t_s[0]) & (one.t_s <= other.t_s[-1])
    if inside.sum() < _FEWEST:
        raise DataError(f"{path}: the left and the right wheel's messages share no time; see --time")
    t_s = one.t_s[inside]
    loose = np.diff(np.interp(t_s, other.t_s, np.cumsum(other.loose)), prepend=0.0) > 0
    stream = WheelStream(
        t_s=t_s,
        left_rad=one.left_rad[inside],
        right_rad=np.interp(t_s, other.t_s, other.left_rad),
        loose=one.loose[inside] | loose,
    )
    what = "left wheel's times to which the right wheel's angle was interpolated"
    return stream, (Notice(source, what, int(inside.sum())), *notices, *more)


def _repaired(
    wheel: _Wheel, left: Floats, right: Floats, unit: str, rates: bool, vehicle: Vehicle, path: str, source: str
) -> tuple[WheelStream, tuple[Notice, ...]]:
    order, order_notices = order_in_time(wheel.t_s, wheel.number, source)
    t_s, left, right = wheel.t_s[order], left[order], right[order]
    if rates:
        left, right = integrated(t_s, left), integrated(t_s, right)
    notices = list(order_notices)
    wrapped = unit == "rad" and not rates and (_wrapped(left) or _wrapped(right))
    if wrapped:
        turns = int((np.abs(np.diff(left)) > np.pi).sum() + (np.abs(np.diff(right)) > np.pi).sum())
        notices.append(Notice(source, "steps over the end of a turn in wrapped wheel angles unwrapped", turns))
        per_turn = float(1 << _TURN_BITS)
        vehicle = replace(vehicle, ticks_per_rev=per_turn, counter_bits=_TURN_BITS)
        unit, left, right = "ticks", left * (per_turn / (2 * np.pi)), right * (per_turn / (2 * np.pi))
    columns = {"t": t_s, f"left_{unit}": left, f"right_{unit}": right}
    table = Table(source, columns, wheel.number[order], t_s.size, tuple(notices))
    stream, found = repaired_wheels(table, path, vehicle, rates)
    if wrapped:
        found = tuple(notice for notice in found if "counter wraps" not in notice.what)
    return stream, of_messages(found)


def _wrapped(angle_rad: Floats) -> bool:
    """Whether an angle stays within one turn and steps over its end."""
    slack = 1e-3
    low, high = float(angle_rad.min()), float(angle_rad.max())
    within = (low >= -np.pi - slack and high <= np.pi + slack) or (low >= -slack and high <= 2 * np.pi + slack)
    return within and bool((np.abs(np.diff(angle_rad)) > np.pi).any())
