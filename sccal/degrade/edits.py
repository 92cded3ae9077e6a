"""New text for places of a buffer: collected, then cut in at once, everything else byte for byte as it was.

Texts are matrices of bytes (n, width), each row's text at its left and zeros after it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Bools, Ints

Bytes = NDArray[np.uint8]


class Edits:
    """Spans of a buffer and what is to stand there; no two may overlap."""

    def __init__(self, data: Bytes, size: int) -> None:
        """``data`` may be longer than the ``size`` bytes that count, by padding."""
        self._data = data
        self._size = size
        self._begin: list[Ints] = []
        self._end: list[Ints] = []
        self._text: list[Bytes] = []

    def put(self, begin: Ints, end: Ints, text: Bytes) -> NDArray[np.uint8]:
        """Replace the spans [begin, end) (n,) by the rows of ``text`` (n, width).

        Returns what that changes in an exclusive-or sum over each span (n,).
        """
        if begin.size:
            self._begin.append(begin)
            self._end.append(end)
            self._text.append(text)
        change = np.bitwise_xor.reduce(text, axis=1) if text.shape[1] else np.zeros(begin.size, dtype=np.uint8)
        length = end - begin
        for place in range(int(length.max(initial=0))):
            inside = place < length
            change ^= np.where(inside, self._data[np.where(inside, begin + place, 0)], np.uint8(0))
        return change

    def within(self, first: int, last: int) -> bytes:
        """The text that [first, last) will have, for a span whose edits lie wholly within it."""
        spans: list[tuple[int, int, bytes]] = []
        for begin, end, text in zip(self._begin, self._end, self._text, strict=True):
            rows = np.flatnonzero((begin >= first) & (end <= last))
            spans += [(int(begin[i]), int(end[i]), text[i].tobytes().rstrip(b"\0")) for i in rows]
        pieces, at = [], first
        for begin_at, end_at, new in sorted(spans):
            pieces += [self._data[at:begin_at].tobytes(), new]
            at = end_at
        return b"".join([*pieces, self._data[at:last].tobytes()])

    def applied(self) -> bytes:
        """The buffer with all edits."""
        if not self._begin:
            return self._data[: self._size].tobytes()
        new = self._data[: self._size].copy()
        longer: list[tuple[Ints, Ints, Bytes, Ints]] = []
        for begin, end, text in zip(self._begin, self._end, self._text, strict=True):
            length = np.count_nonzero(text, axis=1)
            same = length == end - begin
            if same.all():
                _write(new, begin, text, length)
                continue
            _write(new, begin[same], text[same], length[same])
            longer.append((begin[~same], end[~same], text[~same], length[~same]))
        return _recut(new, longer).tobytes() if longer else new.tobytes()


def _write(data: Bytes, begin: Ints, text: Bytes, length: Ints) -> None:
    shortest = int(length.min(initial=text.shape[1]))
    for place in range(text.shape[1]):
        if place < shortest:
            data[begin + place] = text[:, place]
        else:
            rows = length > place
            data[begin[rows] + place] = text[rows, place]


def _recut(data: Bytes, edits: list[tuple[Ints, Ints, Bytes, Ints]]) -> Bytes:
    """The buffer with texts of other lengths than the spans that they replace."""
    begin = np.concatenate([one[0] for one in edits])
    end = np.concatenate([one[1] for one in edits])
    length = np.concatenate([one[3] for one in edits])
    kept = _outside(begin, end, data.size)
    order = np.argsort(begin, kind="stable")
    growth = (length - (end - begin))[order]
    shift = np.empty(begin.size, dtype=np.int64)
    shift[order] = np.cumsum(growth) - growth
    new = np.empty(data.size + int(growth.sum()), dtype=np.uint8)
    new_begin = begin + shift
    new[_outside(new_begin, new_begin + length, new.size)] = data[kept]
    done = 0
    for _, _, text, own_length in edits:
        _write(new, new_begin[done : done + own_length.size], text, own_length)
        done += own_length.size
    return new


def _outside(begin: Ints, end: Ints, size: int) -> Bools:
    """(size,) True outside all spans."""
    marks = np.zeros(size + 1, dtype=np.int8)
    some = end > begin
    marks[begin[some]] += 1
    marks[end[some]] -= 1
    depth = np.cumsum(marks[:-1], dtype=np.int8)
    return np.asarray(depth == 0)


def constant(text: bytes, count: int) -> Bytes:
    """The same text ``count`` times."""
    return np.tile(np.frombuffer(text, dtype=np.uint8), (count, 1))


def letters(codes: Bytes) -> Bytes:
    """One letter each (n, 1)."""
    return codes.astype(np.uint8)[:, None]
