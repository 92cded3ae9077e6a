"""What the user says about reading a log of messages: which topics, joints and fields, and which of their times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from sccal.logs.streams import Convention

TimeSource = Literal["header", "log", "publish"]


@dataclass(frozen=True)
class ReadOptions:
    """Choices for logs of messages (.mcap, .db3, .bag); empty where the log itself is to decide. CSV has no use for it.

    A field of any message is named ``TOPIC:path``, such as ``/wheels/left:ticks`` or ``/joints:position[2]``.
    """

    wheels_topic: str = ""
    heading_topic: str = ""
    fix_topic: str = ""
    left_joint: str = ""
    right_joint: str = ""
    left_ticks: str = ""
    right_ticks: str = ""
    left_rad: str = ""
    right_rad: str = ""
    yaw: str = ""
    """Radians, or degrees where the topic or path ends in ``deg``; in the convention of vehicle.toml."""
    latitude: str = ""
    longitude: str = ""
    time: TimeSource = "header"
    """header: the stamp that the driver put into the message, where it is not zero; else when it was logged."""
    orientation: Convention = "enu"
    """Of quaternions in messages: enu as ROS asks (REP 103), or ned from a driver that does not follow it."""
