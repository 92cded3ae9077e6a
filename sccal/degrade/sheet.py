"""A CSV file as bytes whose cells can be found and replaced, everything between them kept.

It is cut as the reader cuts it (``sccal.logs.table``): the first line that is neither blank nor a comment names the
columns, its first of ``,``, ``;`` and tab separates them, and quotes are only decoration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.degrade.edits import Bytes, Edits
from sccal.errors import DataError
from sccal.logs.decimals import PAD, Digits, read_digits, write_decimals
from sccal.logs.dialect import has_decimal_commas

_MOST_PLACES = 13
_LARGEST = 9e17
_WRAPPING = np.zeros(256, dtype=np.bool_)
_WRAPPING[np.frombuffer(b' "\r\t', dtype=np.uint8)] = True


@dataclass(frozen=True)
class Cells:
    """One column's cells, blanks and quotes around them left out; arrays (n,), a row for each line below the header."""

    begin: Ints
    end: Ints
    decimals: Digits
    values: Floats
    """NaN where the cell holds no finite number."""


class Sheet:
    """The rows of a CSV file, and the edits so far."""

    def __init__(self, raw: bytes, name: str) -> None:
        """Find the header and the lines below it. Raises DataError where there is no header."""
        self.data: Bytes = np.frombuffer(raw + bytes(PAD), dtype=np.uint8)
        self.edits = Edits(self.data, len(raw))
        self._mark = b"\n" if b"\n" in raw else b"\r"
        first = 3 if raw.startswith(b"\xef\xbb\xbf") else 0
        while first < len(raw):
            last = raw.find(self._mark, first)
            last = len(raw) if last < 0 else last
            text = raw[first:last].decode("utf-8", errors="replace").strip()
            first = last + 1
            if text and not text.startswith("#"):
                break
        else:
            raise DataError(f"{name}: no header line; the first line names the columns, such as t,yaw_deg")
        self._separator = max(",;\t", key=text.count)
        self.names = [one.strip().strip('"').strip() for one in text.split(self._separator)]
        if has_decimal_commas(raw[first:], self._separator):
            raise DataError(f"{name}: has decimal commas; write points (sccal convert does, there and back)")
        self._lines(min(first, len(raw)), len(raw))

    def _lines(self, first: int, size: int) -> None:
        body = self.data[:size]
        breaks = np.flatnonzero(body[first:] == ord(self._mark)) + first
        self.line_begin = np.concatenate(([first], breaks + 1)).astype(np.int64)
        self.line_end = np.concatenate((breaks + 1, [size])).astype(np.int64)
        if self.line_begin[-1] >= size:
            self.line_begin, self.line_end = self.line_begin[:-1], self.line_end[:-1]
        self._separators = np.append(np.flatnonzero(body == ord(self._separator)), size)
        self._first_separator = np.searchsorted(self._separators, self.line_begin)
        self.comment: Bools = self.data[self.line_begin] == ord("#")

    def require(self, *alternatives: tuple[str, ...]) -> tuple[str, ...]:
        """The first of the alternatives whose columns are all there. Raises DataError."""
        for names in alternatives:
            if set(names) <= set(self.names):
                return names
        needed = " or ".join(",".join(names) for names in alternatives)
        raise DataError(f"the header needs {needed}; it has {','.join(self.names[:20])[:200]}")

    def column(self, name: str) -> Cells | None:
        """The cells of the first column of that name, or None."""
        if name not in self.names:
            return None
        place = self.names.index(name)
        line_stop = self.line_end - (self.data[np.maximum(self.line_end - 1, 0)] == ord(self._mark))
        last = self._separators.size - 1
        before = self._first_separator + place - 1
        begin = self.line_begin if place == 0 else self._separators[np.minimum(before, last)] + 1
        begin = np.minimum(begin, line_stop)
        end = np.minimum(self._separators[np.minimum(before + 1, last)], line_stop)
        begin, end = self._bare(begin, np.maximum(begin, end))
        decimals = read_digits(self.data, begin, end)
        values = decimals.values.copy()
        for row in np.flatnonzero(~decimals.good & (end > begin) & ~self.comment).tolist():
            values[row] = _number(self.data[begin[row] : end[row]].tobytes())
        values[self.comment] = np.nan
        return Cells(begin, end, decimals, values)

    def _bare(self, begin: Ints, end: Ints) -> tuple[Ints, Ints]:
        begin, end = begin.copy(), end.copy()
        while (more := (begin < end) & _WRAPPING[self.data[begin]]).any():
            begin += more
        while (more := (begin < end) & _WRAPPING[self.data[end - 1]]).any():
            end -= more
        return begin, end

    def put(self, cells: Cells, rows: Ints, values: Floats, least_places: int) -> None:
        """Write numbers (k,) into cells, with the places that they had, but at least ``least_places``."""
        places = np.maximum(cells.decimals.places[rows], least_places)
        exact = np.minimum(places, _MOST_PLACES)
        mantissa = np.round(np.minimum(np.abs(values) * 10.0**exact, _LARGEST)).astype(np.int64)
        mantissa *= 10 ** (places - exact)
        text = write_decimals(mantissa, values < 0, np.ones_like(places), places, cells.decimals.dotted[rows])
        self.edits.put(cells.begin[rows], cells.end[rows], text)

    def clear(self, cells: Cells | None, rows: Ints) -> None:
        """Leave cells empty."""
        if cells is not None:
            nothing = np.zeros((rows.size, 0), dtype=np.uint8)
            self.edits.put(cells.begin[rows], cells.end[rows], nothing)

    def leave_out(self, rows: Ints) -> None:
        """Cut whole lines out."""
        nothing = np.zeros((rows.size, 0), dtype=np.uint8)
        self.edits.put(self.line_begin[rows], self.line_end[rows], nothing)


def _number(text: bytes) -> float:
    try:
        value = float(text) if b"_" not in text else math.nan
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan
