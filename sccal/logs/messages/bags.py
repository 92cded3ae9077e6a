"""ROS bags (rosbag2 in SQLite, ROS 1) through the ``rosbags`` library, an extra; handed on as MCAP's channels are."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sccal.errors import DataError
from sccal.logs.messages.mcap_file import Channel, OpenChannel, Sink
from sccal.logs.streams import Notice

_BATCH_BYTES = 1 << 20


def read_ros1_bag(path: Path, open_channel: OpenChannel) -> tuple[Notice, ...]:
    """Hand every wanted message of a ROS 1 bag to its channel's sink.

    Raises:
        DataError: the library is missing, or the file cannot be read.
    """
    return _read(path, open_channel, True)


def read_ros2_bag(path: Path, open_channel: OpenChannel) -> tuple[Notice, ...]:
    """Hand every wanted message of a ROS 2 bag, a SQLite file or a folder with some, to its channel's sink.

    Raises:
        DataError: the library is missing, or the file cannot be read.
    """
    return _read(path, open_channel, False)


def _read(path: Path, open_channel: OpenChannel, ros1: bool) -> tuple[Notice, ...]:
    try:
        from rosbags.rosbag1 import Reader as Ros1Reader
        from rosbags.rosbag2 import Reader as Ros2Reader
    except ImportError as error:
        raise DataError(f"{path}: reading ROS bags needs the extra `ros`: pip install 'sccal-robotics[ros]'") from error
    if path.is_file() and path.stat().st_size == 0:
        raise DataError(f"{path}: is empty (0 bytes); log it again or remove it")
    if path.is_dir():
        odd = [file.name for file in path.iterdir() if not file.is_file() and not file.is_dir()]
        if odd:
            raise DataError(f"{path}: {', '.join(sorted(odd)[:5])}: not a regular file, and not opened")
    reader: Callable[[Path], Any] = Ros1Reader if ros1 else Ros2Reader
    lost: list[Notice] = []
    try:
        with reader(path) as bag:
            _hand_on(bag, ros1, path, open_channel, lost)
    except DataError:
        raise
    except Exception as error:  # whatever the library or SQLite makes of a broken file
        why = " ".join(str(error).split())[:300] or type(error).__name__
        raise DataError(f"{path}: cannot be read as a {'ROS 1' if ros1 else 'ROS 2'} bag ({why})") from error
    return tuple(lost)


def _hand_on(bag: Any, ros1: bool, path: Path, open_channel: OpenChannel, lost: list[Notice]) -> None:
    sinks: dict[int, Sink] = {}
    for connection in bag.connections:
        sink = open_channel(_channel(connection, ros1))
        if sink is not None:
            sinks[connection.id] = sink
    wanted = [connection for connection in bag.connections if connection.id in sinks]
    if not wanted:
        return
    batches: dict[int, list[tuple[int, bytes]]] = {number: [] for number in sinks}
    size = last_ns = 0
    try:
        for connection, log_ns, raw in bag.messages(connections=wanted):
            batches[connection.id].append((log_ns, bytes(raw)))
            size, last_ns = size + len(raw), log_ns
            if size >= _BATCH_BYTES:
                _flush(batches, sinks)
                size = 0
    except Exception as error:  # a bag that breaks off: what came before is read
        why = " ".join(str(error).split())[:200] or type(error).__name__
        what = f"place where the bag breaks off; all before is read ({why})"
        lost.append(Notice(path.name, what, 1, f"t = {last_ns * 1e-9:.3f} s", "warning"))
    _flush(batches, sinks)


def _flush(batches: dict[int, list[tuple[int, bytes]]], sinks: dict[int, Sink]) -> None:
    for number, batch in batches.items():
        if batch:
            lengths = np.array([len(raw) for _, raw in batch], dtype=np.int64)
            end = np.cumsum(lengths)
            data = np.frombuffer(b"".join(raw for _, raw in batch) or b"\0", dtype=np.uint8)
            log_ns = np.array([ns for ns, _ in batch], dtype=np.int64)
            sinks[number].take(data, end - lengths, end, log_ns, log_ns)
            batch.clear()


def _channel(connection: Any, ros1: bool) -> Channel:
    text = str(getattr(connection.msgdef, "data", "") or "")
    name = getattr(getattr(connection.msgdef, "format", None), "name", "")
    own = "ros1msg" if ros1 else "ros2msg"
    encoding = own if name == "MSG" and text else ""
    return Channel(connection.topic, connection.msgtype, "ros1" if ros1 else "cdr", encoding, text.encode())
