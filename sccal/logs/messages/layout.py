"""Columns out of many encoded messages: one is walked in Python, and all of the same layout are gathered by numpy.

A walker (ROS or protobuf) visits one message and notes where its fields are: its *shape*. Some of its bytes decide the
shape: lengths, tags, the bytes of strings that name things. A message of the same length in which these bytes are the
same has its fields at the same places, so a column is a strided view over the rows of such messages. A message that
fits no known layout is walked in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Bools, Floats, Ints

Bytes = NDArray[np.uint8]

MOST_FIELDS = 4096
"""Fields of a message beyond these are not noted."""
MOST_COLUMNS = 256
"""Columns of one topic: joints that change their names with every message would take memory for each."""
_LAYOUTS_KEPT = 64
_CONTINUES = np.uint8(0x80)


class MalformedError(Exception):
    """A message that contradicts its own schema or is cut."""


@dataclass(frozen=True)
class Place:
    """Where a field is: a numpy type code, or ``varint``, ``zigzag``, ``text``; ``zero`` for a field left out."""

    offset: int
    width: int
    kind: str


@dataclass
class Shape:
    """What a walk over one message notes."""

    numbers: dict[str, Place] = field(default_factory=dict)
    texts: dict[str, Place] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)
    """[begin, end) of bytes that decide the shape."""
    varints: list[tuple[int, int]] = field(default_factory=list)
    """[begin, end) of numbers whose continuation bits decide the shape."""


class Walker(Protocol):
    """Visits one message."""

    def shape(self, message: bytes) -> Shape:
        """Where the fields are; raises MalformedError."""


@dataclass(frozen=True)
class Picked:
    """What is wanted of a message."""

    columns: Mapping[str, str]
    """Column name to the path of a number."""
    pinned: Iterable[str] = ()
    """Paths of strings that must be the same for the columns to mean the same."""
    text: str = ""
    """Path of the string that is wanted itself."""
    stamp: tuple[str, str] | None = None
    """Paths of the seconds and nanoseconds of the message's own time."""


Picker = Callable[[Iterable[str], Mapping[str, str]], Picked]
"""Chooses among the paths of a message's numbers and its strings by path."""


@dataclass(frozen=True)
class _Layout:
    fixed: tuple[tuple[int, Bytes], ...]
    varints: tuple[tuple[int, Bytes], ...]
    """Continuation bits only."""
    columns: tuple[tuple[str, Place], ...]
    text: Place | None
    stamp: tuple[Place, Place] | None

    def fits(self, rows: Bytes) -> Bools:
        """(k) which rows have this layout."""
        fits = np.ones(len(rows), dtype=np.bool_)
        for begin, wanted in self.fixed:
            fits &= (rows[:, begin : begin + wanted.size] == wanted).all(axis=1)
        for begin, wanted in self.varints:
            fits &= ((rows[:, begin : begin + wanted.size] & _CONTINUES) == wanted).all(axis=1)
        return fits


@dataclass(frozen=True)
class Part:
    """Columns of the messages ``index`` (k), counted over all that the gatherer was given."""

    index: Ints
    columns: Mapping[str, Floats]
    stamp_ns: Ints | None
    texts: tuple[bytes, ...] | None


@dataclass
class Gatherer:
    """Gathers the picked columns of one channel's messages."""

    walker: Walker
    picker: Picker
    parts: list[Part] = field(default_factory=list)
    malformed: list[int] = field(default_factory=list)
    """Which messages could not be read."""
    why: str = ""
    """What was wrong with the first of them."""
    walks: int = 0
    """Layouts met, or met again after too many others."""
    _layouts: dict[int, list[_Layout]] = field(default_factory=dict)
    _names: set[str] = field(default_factory=set)

    def take(self, data: Bytes, begin: Ints, end: Ints, first: int) -> None:
        """Read the messages at [begin, end) of ``data``, numbered from ``first`` on."""
        lengths = end - begin
        for length in np.unique(lengths).tolist():
            rows = np.flatnonzero(lengths == length)
            if length == 0:
                windows = np.zeros((rows.size, 0), dtype=np.uint8)
            else:
                shape = (data.size - length + 1, length)
                windows = np.lib.stride_tricks.as_strided(data, shape, (1, 1), writeable=False)[begin[rows]]
            self._take_equal(windows, rows + first)

    def _take_equal(self, rows: Bytes, index: Ints) -> None:
        known = self._layouts.setdefault(rows.shape[1], [])
        for layout in known:
            if index.size == 0:
                return
            rows, index = self._take_fitting(layout, rows, index)
        while index.size:
            try:
                layout = self._layout(rows[0].tobytes())
            except MalformedError as error:
                self.why = self.why or str(error)
                self.malformed.append(int(index[0]))
                rows, index = rows[1:], index[1:]
                continue
            if len(known) < _LAYOUTS_KEPT:
                known.append(layout)
            before = index.size
            rows, index = self._take_fitting(layout, rows, index)
            assert index.size < before

    def _layout(self, message: bytes) -> _Layout:
        self.walks += 1
        shape = self.walker.shape(message)
        texts = {
            path: message[place.offset : place.offset + place.width].decode("utf-8", "replace")
            for path, place in shape.texts.items()
        }
        picked = self.picker(shape.numbers, texts)
        if len(self._names | picked.columns.keys()) > MOST_COLUMNS:
            raise MalformedError(f"its messages name more than {MOST_COLUMNS} different fields")
        self._names |= picked.columns.keys()
        fixed = shape.fixed + [
            (place.offset, place.offset + place.width) for place in map(shape.texts.__getitem__, picked.pinned)
        ]
        raw = np.frombuffer(message, dtype=np.uint8)
        stamp = picked.stamp and (shape.numbers[picked.stamp[0]], shape.numbers[picked.stamp[1]])
        return _Layout(
            fixed=tuple((begin, raw[begin:end]) for begin, end in _merged(fixed)),
            varints=tuple((begin, raw[begin:end] & _CONTINUES) for begin, end in _merged(shape.varints)),
            columns=tuple((name, shape.numbers[path]) for name, path in picked.columns.items()),
            text=shape.texts[picked.text] if picked.text else None,
            stamp=stamp or None,
        )

    def _take_fitting(self, layout: _Layout, rows: Bytes, index: Ints) -> tuple[Bytes, Ints]:
        """Keep the columns of the rows that fit; gives the others."""
        fits = layout.fits(rows)
        whole = bool(fits.all())
        if not whole and not fits.any():
            return rows, index
        own = rows if whole else rows[fits]
        stamp_ns = None
        if layout.stamp is not None:
            seconds, nanoseconds = (_integers(own, place) for place in layout.stamp)
            stamp_ns = seconds * 1_000_000_000 + nanoseconds
        texts = None
        if layout.text is not None:
            begin, width = layout.text.offset, layout.text.width
            texts = tuple(row.tobytes() for row in own[:, begin : begin + width])
        columns = {name: _values(own, place) for name, place in layout.columns}
        self.parts.append(Part(index if whole else index[fits], columns, stamp_ns, texts))
        return (rows[:0], index[:0]) if whole else (rows[~fits], index[~fits])


def _merged(ranges: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Sorted ranges, those that touch made one."""
    merged: list[tuple[int, int]] = []
    for begin, end in sorted(ranges):
        if merged and begin <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        elif end > begin:
            merged.append((begin, end))
    return merged


def _column(rows: Bytes, place: Place) -> NDArray[np.generic]:
    """(k) the field as it is written, unaligned and not copied."""
    kind = np.dtype([("field", place.kind)])
    window = np.lib.stride_tricks.as_strided(
        rows[:, place.offset :], (len(rows), kind.itemsize), rows.strides, writeable=False
    )
    return np.ascontiguousarray(window).view(kind)["field"].ravel()


def _values(rows: Bytes, place: Place) -> Floats:
    if place.kind in ("zero", "varint", "zigzag"):
        return _integers(rows, place).astype(np.float64)
    column = _column(rows, place)
    if column.dtype.kind == "u" and column.dtype.itemsize == 8:
        column = column.astype(np.uint64).view(np.int64)
    return column.astype(np.float64)


def _integers(rows: Bytes, place: Place) -> Ints:
    if place.kind == "zero":
        return np.zeros(len(rows), dtype=np.int64)
    if place.kind in ("varint", "zigzag"):
        total = np.zeros(len(rows), dtype=np.uint64)
        for i in range(place.width):
            total |= (rows[:, place.offset + i] & 0x7F).astype(np.uint64) << np.uint64(7 * i)
        if place.kind == "zigzag":
            return (total >> np.uint64(1)).view(np.int64) ^ -((total & np.uint64(1)).view(np.int64))
        return total.view(np.int64)
    column = _column(rows, place)
    if column.dtype.kind == "f":
        column = np.nan_to_num(column)
    return column.astype(np.int64)
