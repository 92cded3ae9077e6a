"""Protobuf messages on the wire, by the descriptor set that the log carries as their schema.

Each field is a tag (number and wire type) and a value. Fields that hold their default are left out, so messages of one
type have several layouts; a field that was left out reads as zero.
Encoding: https://protobuf.dev/programming-guides/encoding
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from sccal.logs.messages.layout import MOST_FIELDS, MalformedError, Place, Shape

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_STRING, _MESSAGE, _BYTES_FIELD = 9, 11, 12
_KINDS = {
    1: "<f8",
    2: "<f4",
    3: "varint",
    4: "varint",
    5: "varint",
    6: "<u8",
    7: "<u4",
    8: "varint",
    13: "varint",
    14: "varint",
    15: "<i4",
    16: "<i8",
    17: "zigzag",
    18: "zigzag",
}
"""How a number is written, by the type's number in descriptor.proto."""
_DEEPEST = 24
_NAMED_ELEMENTS = 512


@dataclass(frozen=True)
class _Field:
    name: str
    type: int
    repeated: bool
    message: str


Messages = Mapping[str, Mapping[int, _Field]]


def parse_descriptors(schema: bytes) -> Messages:
    """Fields by number of every message type of a FileDescriptorSet, by the types' full names.

    Raises:
        MalformedError: not a descriptor set.
    """
    found: dict[str, dict[int, _Field]] = {}
    for number, file in _parts(schema):
        if number == 1:
            package = next((text.decode("utf-8", "replace") for n, text in _parts(file) if n == 2), "")
            for n, message in _parts(file):
                if n == 4:
                    _describe(message, package, found, 0)
    return found


def _describe(message: bytes, scope: str, found: dict[str, dict[int, _Field]], depth: int) -> None:
    if depth > _DEEPEST:
        raise MalformedError("descriptors nested too deep")
    parts = list(_parts(message))
    own = next((text.decode("utf-8", "replace") for n, text in parts if n == 1), "")
    name = f"{scope}.{own}" if scope else own
    fields: dict[int, _Field] = {}
    for n, part in parts:
        if n == 2:
            texts = {k: v.decode("utf-8", "replace") for k, v in _parts(part) if k in (1, 6)}
            numbers = dict(_numbers(part))
            kind, repeated = numbers.get(5, 0), numbers.get(4, 1) == 3
            fields[numbers.get(3, 0)] = _Field(texts.get(1, ""), kind, repeated, texts.get(6, "").lstrip("."))
        elif n == 3:
            _describe(part, name, found, depth + 1)
    found[name] = fields


def _entries(data: bytes) -> Iterator[tuple[int, int, int, int, int]]:
    """Number, wire type, where the tag begins, and [begin, end) of the value of each field of a message."""
    position, size = 0, len(data)
    while position < size:
        start = position
        tag, position = _varint(data, position, size)
        wire = tag & 7
        begin = position
        if wire == _VARINT:
            _, end = _varint(data, position, size)
        elif wire == _FIXED64:
            end = position + 8
        elif wire == _FIXED32:
            end = position + 4
        elif wire == _BYTES:
            length, begin = _varint(data, position, size)
            end = begin + length
        else:
            raise MalformedError(f"wire type {wire} at byte {start}")
        if end > size:
            raise MalformedError(f"a field of {end - begin} bytes at {begin} of a message of {size}")
        yield tag >> 3, wire, start, begin, end
        position = end


def _parts(data: bytes) -> Iterator[tuple[int, bytes]]:
    return ((number, data[begin:end]) for number, wire, _, begin, end in _entries(data) if wire == _BYTES)


def _numbers(data: bytes) -> Iterator[tuple[int, int]]:
    return ((number, _varint(data, begin, end)[0]) for number, wire, _, begin, end in _entries(data) if wire == _VARINT)


def _varint(data: bytes, position: int, size: int) -> tuple[int, int]:
    value = shift = 0
    while position < size and shift < 70:
        byte = data[position]
        value |= (byte & 0x7F) << shift
        position += 1
        if byte < 0x80:
            return value, position
        shift += 7
    raise MalformedError(f"a number that does not end at byte {position}")


@dataclass(frozen=True)
class ProtobufWalker:
    """Walks messages of one type."""

    messages: Messages
    root: str

    def shape(self, message: bytes) -> Shape:
        """Where the fields of one message are.

        Raises:
            MalformedError: a length points beyond the message, or the message is no protobuf.
        """
        shape = Shape()
        self._walk(message, 0, self.root, "", shape, 0)
        return shape

    def _walk(self, data: bytes, origin: int, name: str, path: str, shape: Shape, depth: int) -> None:
        fields = self.messages.get(name, {})
        if depth > _DEEPEST:
            raise MalformedError("messages nested too deep")
        counts: dict[int, int] = {}
        seen: set[int] = set()
        for number, wire, start, begin, end in _entries(data):
            shape.fixed.append((origin + start, origin + begin))
            one = fields.get(number)
            seen.add(number)
            if one is None:
                if wire == _VARINT:
                    shape.varints.append((origin + begin, origin + end))
                continue
            where = f"{path}.{one.name}" if path else one.name
            if one.repeated and not (wire == _BYTES and one.type in _KINDS):
                count = counts[number] = counts.get(number, -1) + 1
                where = f"{where}[{count}]"
            if one.type == _MESSAGE and wire == _BYTES:
                self._walk(data[begin:end], origin + begin, one.message, where, shape, depth + 1)
            elif one.type in (_STRING, _BYTES_FIELD) and wire == _BYTES:
                if len(shape.texts) < MOST_FIELDS:
                    shape.texts[where] = Place(origin + begin, end - begin, "text")
            elif one.type in _KINDS and wire == _BYTES:
                self._packed(data, origin, begin, end, where, _KINDS[one.type], shape)
            elif one.type in _KINDS:
                self._note(where, origin + begin, origin + end, _KINDS[one.type], shape, wire)
            elif wire == _VARINT:
                shape.varints.append((origin + begin, origin + end))
        self._absent(fields, seen, path, shape, depth)

    def _absent(self, fields: Mapping[int, _Field], seen: set[int], path: str, shape: Shape, depth: int) -> None:
        for number, one in fields.items():
            if number in seen or one.repeated or len(shape.numbers) >= MOST_FIELDS:
                continue
            where = f"{path}.{one.name}" if path else one.name
            if one.type in _KINDS:
                shape.numbers.setdefault(where, Place(0, 0, "zero"))
            elif one.type == _MESSAGE and depth < 4:
                self._absent(self.messages.get(one.message, {}), set(), where, shape, depth + 1)

    def _packed(self, data: bytes, origin: int, begin: int, end: int, path: str, kind: str, shape: Shape) -> None:
        position = begin
        width = 0 if kind in ("varint", "zigzag") else int(kind[2])
        if width and (end - begin) % width:
            raise MalformedError(f"{path}: {end - begin} bytes are no whole number of elements")
        for i in range(_NAMED_ELEMENTS if width else end - begin):
            if position >= end:
                break
            after = position + width if width else _varint(data, position, end)[1]
            if i < _NAMED_ELEMENTS:
                self._note(f"{path}[{i}]", origin + position, origin + after, kind, shape, None)
            else:
                shape.varints.append((origin + position, origin + after))
            position = after

    def _note(self, path: str, begin: int, end: int, kind: str, shape: Shape, wire: int | None) -> None:
        varint = kind in ("varint", "zigzag")
        expected = _VARINT if varint else _FIXED64 if kind[2] == "8" else _FIXED32
        if wire is not None and wire != expected:
            raise MalformedError(f"{path}: wire type {wire} where {expected} is declared")
        if varint:
            shape.varints.append((begin, end))
        if len(shape.numbers) < MOST_FIELDS:
            shape.numbers[path] = Place(begin, end - begin, kind)


def appended(walker: ProtobufWalker, path: str, value: float | bytes) -> bytes:
    """A field, with the messages that it stands in, as bytes that take its place when they follow a message.

    Raises:
        MalformedError: the type has no such field, or it is repeated.
    """
    steps: list[tuple[int, _Field]] = []
    name = walker.root
    for step in path.split("."):
        number, one = next(((n, f) for n, f in walker.messages.get(name, {}).items() if f.name == step), (0, None))
        if one is None or one.repeated:
            raise MalformedError(f"{path}: no single field of that name in {name}")
        steps.append((number, one))
        name = one.message
    number, last = steps[-1]
    if isinstance(value, bytes):
        body = _tag(number, _BYTES) + _written(len(value)) + value
    elif _KINDS[last.type] in ("varint", "zigzag"):
        whole = round(value)
        whole = (whole << 1) ^ (whole >> 63) if _KINDS[last.type] == "zigzag" else whole
        body = _tag(number, _VARINT) + _written(whole & 0xFFFFFFFFFFFFFFFF)
    else:
        kind = _KINDS[last.type]
        code = {"<f8": "<d", "<f4": "<f", "<u8": "<Q", "<u4": "<I", "<i4": "<i", "<i8": "<q"}[kind]
        fixed = struct.pack(code, value if kind[1] == "f" else round(value))
        body = _tag(number, _FIXED64 if kind[2] == "8" else _FIXED32) + fixed
    for number, _ in reversed(steps[:-1]):
        body = _tag(number, _BYTES) + _written(len(body)) + body
    return body


def _tag(number: int, wire: int) -> bytes:
    return _written(number << 3 | wire)


def _written(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
