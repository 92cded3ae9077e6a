"""ROS messages on the wire: CDR as ROS 2 writes it, in either byte order, and ROS 1's packing.

Both hold the fields in the order of the definition. CDR puts four bytes before them that tell the byte order, aligns
every number to its own size (to at most 4 in XCDR2) and ends strings with a zero; ROS 1 does neither.
"""

from __future__ import annotations

import contextlib
import struct
from dataclasses import dataclass

from sccal.logs.messages.definitions import Definitions, FieldDefinition
from sccal.logs.messages.layout import MOST_FIELDS, MalformedError, Place, Shape

_CODES = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
_DEEPEST = 24
_MOST_VISITS = 100_000
_NAMED_ELEMENTS = 512
"""Elements of an array beyond these are skipped: no field of use stands there."""


class _UnsupportedError(Exception):
    """The walk cannot go on; what was noted before stands."""


@dataclass(frozen=True)
class RosWalker:
    """Walks messages of one type."""

    definitions: Definitions
    root: str
    ros1: bool = False

    def shape(self, message: bytes) -> Shape:
        """Where the fields of one message are.

        Raises:
            MalformedError: a length points beyond the message, or the encapsulation is not read.
        """
        return _Walk(self, message).run()


class _Walk:
    def __init__(self, walker: RosWalker, message: bytes) -> None:
        self.definitions, self.root, self.ros1 = walker.definitions, walker.root, walker.ros1
        self.message = message
        self.shape = Shape()
        self.order = "<"
        self.most_aligned = 8
        self.origin = self.position = self.visits = 0

    def run(self) -> Shape:
        if not self.ros1:
            self._encapsulation()
        with contextlib.suppress(_UnsupportedError):
            self._struct(self.root, "", 0)
        return self.shape

    def _encapsulation(self) -> None:
        if len(self.message) < 4:
            raise MalformedError(f"{len(self.message)} bytes are too few for CDR")
        kind = self.message[1]
        if self.message[0] or kind not in (0, 1, 6, 7):
            raise MalformedError(
                f"CDR encapsulation {self.message[:2].hex()} is not read (0000, 0001, 0006 and 0007 are)"
            )
        self.order = "<" if kind & 1 else ">"
        self.most_aligned = 4 if kind >= 6 else 8
        self.origin = self.position = 4
        self.shape.fixed.append((0, 2))

    def _struct(self, name: str, path: str, depth: int) -> None:
        fields = self.definitions.get(name)
        if fields is None or depth > _DEEPEST:
            raise _UnsupportedError
        if not fields and not self.ros1:
            self._step(1, 1)
        for one in fields:
            where = f"{path}.{one.name}" if path else one.name
            if one.count is None:
                self._value(one, where, depth)
            else:
                self._array(one, where, depth)

    def _array(self, one: FieldDefinition, path: str, depth: int) -> None:
        count = one.count if one.count is not None and one.count >= 0 else self._length()
        code = _CODES.get(one.type)
        if code is None:
            # The smallest element takes a byte, so that no length makes the walk endless.
            if count > len(self.message) - self.position:
                raise MalformedError(f"{path}: {count} elements in {len(self.message) - self.position} bytes")
            for i in range(count):
                self._value(one, f"{path}[{i}]", depth)
            return
        size = int(code[1])
        if count == 0:
            return
        begin = self._step(size, size * count)
        for i in range(min(count, _NAMED_ELEMENTS)):
            self._note(f"{path}[{i}]", begin + i * size, code)

    def _value(self, one: FieldDefinition, path: str, depth: int) -> None:
        self.visits += 1
        if self.visits > _MOST_VISITS:
            raise _UnsupportedError
        code = _CODES.get(one.type)
        if code is not None:
            size = int(code[1])
            self._note(path, self._step(size, size), code)
        elif one.type == "string":
            length = self._length()
            begin = self._step(1, length)
            if len(self.shape.texts) < MOST_FIELDS:
                content = length - (0 if self.ros1 else min(length, 1))
                self.shape.texts[path] = Place(begin, content, "text")
        elif one.type == "wstring":
            raise _UnsupportedError
        else:
            self._struct(one.type, path, depth + 1)

    def _length(self) -> int:
        at = self._step(4, 4)
        self.shape.fixed.append((at, at + 4))
        return int(struct.unpack_from(self.order + "I", self.message, at)[0])

    def _note(self, path: str, offset: int, code: str) -> None:
        if len(self.shape.numbers) < MOST_FIELDS:
            self.shape.numbers[path] = Place(offset, int(code[1]), self.order + code)

    def _step(self, align: int, size: int) -> int:
        """Where the next ``size`` bytes begin; goes on behind them."""
        begin = self.position
        if not self.ros1:
            align = min(align, self.most_aligned)
            begin += -(begin - self.origin) % align
        if begin + size > len(self.message):
            raise MalformedError(f"{size} bytes at {begin} of a message of {len(self.message)}")
        self.position = begin + size
        return begin
