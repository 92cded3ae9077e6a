"""New values put into one encoded message: in place where its layout has room, else encoded again.

CDR and ROS 1 hold numbers of fixed size, which are overwritten; a text stands at the end of its message and is
exchanged with the length before it. Of protobuf, numbers of fixed size are overwritten; what has another length or was
left out as zero is appended: a later field takes the place of an earlier one, and messages within are merged.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sccal.logs.messages.json_values import found_ways
from sccal.logs.messages.layout import MalformedError, Shape
from sccal.logs.messages.mcap_file import Channel
from sccal.logs.messages.protobuf import ProtobufWalker, appended
from sccal.logs.messages.topics import SPOKEN, normal_path, walker_of

_KEPT = 64


@dataclass
class Patcher:
    """Patches the messages of one channel; values go by the normal form of their paths (``normal_path``)."""

    channel: Channel
    _layouts: dict[int, list[tuple[bytes, Shape, dict[str, str]]]] = field(default_factory=dict)

    def patched(self, data: bytes, numbers: Mapping[str, float], text: bytes | None = None) -> bytes:
        """The message with these numbers, and with its sentence exchanged for ``text``.

        Raises MalformedError where the message is none of its type.
        """
        if self.channel.message_encoding == "json":
            return _json_patched(data, numbers, text)
        walker = walker_of(self.channel)
        shape, by_name = self._shape(data)
        out = bytearray(data)
        more = b""
        for name, value in numbers.items():
            path = by_name.get(name)
            if path is None:
                continue
            place = shape.numbers[path]
            if place.kind in ("zero", "varint", "zigzag"):
                assert isinstance(walker, ProtobufWalker)
                more += appended(walker, path, value)
            else:
                kind = np.dtype(place.kind)
                cast = kind.type(value) if kind.kind == "f" else kind.type(round(value))
                out[place.offset : place.offset + place.width] = np.array(cast, dtype=kind).tobytes()
        if text is not None:
            path = next(path for path in shape.texts if normal_path(path) in SPOKEN.values())
            place = shape.texts[path]
            if isinstance(walker, ProtobufWalker):
                more += appended(walker, path, text)
            else:
                order = ">" if not walker.ros1 and not data[1] & 1 else "<"  # type: ignore[attr-defined]
                end = b"" if walker.ros1 else b"\0"  # type: ignore[attr-defined]
                after = data[place.offset + place.width + len(end) :]
                length = struct.pack(order + "I", len(text) + len(end))
                out = out[: place.offset - 4] + length + text + end + after
        return bytes(out) + more

    def _shape(self, data: bytes) -> tuple[Shape, dict[str, str]]:
        known = self._layouts.setdefault(len(data), [])
        for sample, shape, by_name in known:
            if all(sample[a:b] == data[a:b] for a, b in shape.fixed) and not shape.varints:
                return shape, by_name
        shape = walker_of(self.channel).shape(data)
        by_name = {normal_path(path): path for path in shape.numbers}
        if len(known) < _KEPT:
            known.append((data, shape, by_name))
        return shape, by_name


def _json_patched(data: bytes, numbers: Mapping[str, float], text: bytes | None) -> bytes:
    message: dict[str, Any] = json.loads(data)
    ways, texts = found_ways(message)
    for name, value in numbers.items():
        way = next((way for path, way in ways.items() if normal_path(path) == name), None)
        if way is not None:
            _put(message, way, value)
    if text is not None:
        way = next((way for path, way in texts.items() if normal_path(path) in SPOKEN.values()), None)
        if way is None:
            raise MalformedError("no sentence in it")
        _put(message, way, text.decode("utf-8", "replace"))
    tight = b'": ' not in data
    written = json.dumps(message, separators=(",", ":") if tight else (", ", ": "), ensure_ascii=data.isascii())
    return written.encode()


def _put(message: Any, way: tuple[str | int, ...], value: float | str) -> None:
    """JSON has no NaN: null says as much."""
    for step in way[:-1]:
        message = message[step]
    old = message[way[-1]]
    whole = isinstance(old, int) and not isinstance(value, str) and value == round(value)
    none = not isinstance(value, str) and math.isnan(value)
    message[way[-1]] = None if none else round(float(value)) if whole else value
