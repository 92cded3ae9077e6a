"""NMEA 0183 sentences in a byte buffer: found, checked and cut into fields with array operations.

A sentence runs from ``$`` to a line end or the next ``$``; anything else between (binary messages, prompts) is passed
over. Numbers are parsed as integer mantissa over a power of ten, so that they round as a decimal parser rounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Bools, Floats, Ints

Bytes = NDArray[np.uint8]

_PAD = 64
_LONGEST_NUMBER = 20
_LONGEST_SENTENCE = 512
_HEX = np.full(256, 255, dtype=np.uint8)
_HEX[np.frombuffer(b"0123456789ABCDEF", dtype=np.uint8)] = np.arange(16)
_HEX[np.frombuffer(b"abcdef", dtype=np.uint8)] = np.arange(10, 16)


@dataclass(frozen=True)
class Sentences:
    """All sentences of a buffer, in file order; arrays of length n unless said otherwise."""

    data: Bytes
    """The buffer, padded with zeros at its end."""
    start: Ints
    """Place of the ``$``."""
    stop: Ints
    """Place after the last field: of the ``*``, or of the sentence's end."""
    kind: NDArray[np.bytes_]
    """The three letters after the talker, upper case; empty for what is not a five-letter address."""
    has_checksum: Bools
    right_checksum: Bools
    complete: Bools
    """False where the sentence is cut: by the next ``$`` or the end of the file."""
    line: Ints
    host_t_s: Floats
    """Time before the first ``$`` of the line; NaN where there is none."""
    commas: Ints
    """Places of all commas of the buffer (any length), and its size at the end."""
    first_comma: Ints
    """Index into ``commas`` of each sentence's first."""

    def field_count(self) -> Ints:
        """Commas in each sentence."""
        return np.searchsorted(self.commas, self.stop) - self.first_comma

    def take(self, rows: Ints) -> Sentences:
        """Only the sentences at the indices ``rows``."""
        return Sentences(
            self.data,
            self.start[rows],
            self.stop[rows],
            self.kind[rows],
            self.has_checksum[rows],
            self.right_checksum[rows],
            self.complete[rows],
            self.line[rows],
            self.host_t_s[rows],
            self.commas,
            self.first_comma[rows],
        )

    def number(self, field: int) -> Floats:
        """Field ``field`` (from 1) as a number; NaN where it is empty, missing or not a plain decimal."""
        begin, end = self.span(field)
        return parse_decimals(self.data, begin, end)

    def letter(self, field: int) -> Bytes:
        """The only byte of field ``field`` (from 1), upper case; 0 where the field has not one byte."""
        begin, end = self.span(field)
        letters = self.data[begin]
        letters = np.where((letters >= 97) & (letters <= 122), letters - 32, letters)
        return np.where(end - begin == 1, letters, 0).astype(np.uint8)

    def span(self, field: int) -> tuple[Ints, Ints]:
        """Where field ``field`` (from 1) begins and ends in the buffer; empty where the sentence has not that many."""
        last = self.commas.size - 1
        comma = self.first_comma + (field - 1)
        begin = self.commas[np.minimum(comma, last)] + 1
        end = np.minimum(self.commas[np.minimum(comma + 1, last)], self.stop)
        begin = np.minimum(begin, self.stop)
        return begin, np.maximum(begin, end)


def find_sentences(raw: bytes) -> Sentences:
    """Find every sentence of a file's bytes."""
    size = len(raw)
    data = np.frombuffer(raw + bytes(_PAD), dtype=np.uint8)
    body = data[:size]
    start = np.flatnonzero(body == ord("$"))
    ends = np.flatnonzero((body == ord("\n")) | (body == ord("\r")) | (body == ord("$")))
    ends = np.append(ends, size)
    end = ends[np.searchsorted(ends, start, side="right")]
    complete = (end < size) & (data[end] != ord("$"))
    end = np.minimum(end, start + _LONGEST_SENTENCE)

    stars = np.append(np.flatnonzero(body == ord("*")), size)
    star = stars[np.searchsorted(stars, start)]
    high, low = _HEX[data[np.minimum(star + 1, size)]], _HEX[data[np.minimum(star + 2, size)]]
    has_checksum = (star + 2 < end) & (high < 16) & (low < 16)
    stop = np.where(star < end, star, end)
    right = np.zeros(start.size, dtype=np.bool_)
    if start.size:
        bounds = np.column_stack((start + 1, np.maximum(stop, start + 2))).ravel()
        sums = np.bitwise_xor.reduceat(data, bounds)[::2]
        right = has_checksum & (sums == high * 16 + low) & (stop > start + 1)

    breaks = np.flatnonzero(body == (ord("\n") if b"\n" in raw else ord("\r")))
    line_index = np.searchsorted(breaks, start)
    commas = np.append(np.flatnonzero(body == ord(",")), size)
    return Sentences(
        data=data,
        start=start,
        stop=stop,
        kind=_kinds(data, start, stop),
        has_checksum=has_checksum,
        right_checksum=right,
        complete=complete | has_checksum,
        line=line_index + 1,
        host_t_s=_host_times(data, start, line_index, breaks),
        commas=commas,
        first_comma=np.searchsorted(commas, start),
    )


def _kinds(data: Bytes, start: Ints, stop: Ints) -> NDArray[np.bytes_]:
    address = data[start[:, None] + np.arange(1, 7)]
    lower = (address >= 97) & (address <= 122)
    address = np.where(lower, address - 32, address).astype(np.uint8)
    letters = ((address[:, :5] >= 65) & (address[:, :5] <= 90)).all(axis=1)
    usual = letters & (address[:, 5] == ord(",")) & (address[:, 0] != ord("P")) & (start + 6 < stop)
    kinds = np.ascontiguousarray(address[:, 2:5]).view("S3").ravel()
    return np.where(usual, kinds, b"").astype("S3")


def _host_times(data: Bytes, start: Ints, line_index: Ints, breaks: Ints) -> Floats:
    """The number before the first ``$`` of each sentence's line."""
    if start.size == 0:
        return np.empty(0)
    first_of_line = np.concatenate(([True], np.diff(line_index) > 0))
    own = np.flatnonzero(first_of_line)
    begin = np.where(line_index[own] > 0, np.append(breaks, 0)[line_index[own] - 1] + 1, 0)
    end = start[own].copy()
    for _ in range(4):
        mark = data[np.maximum(end - 1, 0)]
        separator = (mark == ord(" ")) | (mark == ord("\t")) | (mark == ord(",")) | (mark == ord(";"))
        end = np.where(separator & (end > begin), end - 1, end)
    for _ in range(2):
        mark = data[begin]
        begin = np.where(((mark == ord(" ")) | (mark == ord("\r"))) & (begin < end), begin + 1, begin)
    times: Floats = parse_decimals(data, begin, end)[np.cumsum(first_of_line) - 1]
    return times


def parse_decimals(data: Bytes, begin: Ints, end: Ints) -> Floats:
    """Plain decimals ``[-+]digits[.digits]`` at [begin, end) of the buffer; NaN for anything else or over 20 bytes."""
    length = end - begin
    mantissa = np.zeros(begin.size, dtype=np.int64)
    digits = np.zeros(begin.size, dtype=np.int64)
    decimals = np.zeros(begin.size, dtype=np.int64)
    dotted = np.zeros(begin.size, dtype=np.bool_)
    wrong = (length <= 0) | (length > _LONGEST_NUMBER)
    negative = np.zeros(begin.size, dtype=np.bool_)
    limit = data.size - 1
    for place in range(int(min(length.max(initial=0), _LONGEST_NUMBER))):
        byte = data[np.minimum(begin + place, limit)]
        inside = place < length
        digit = byte - np.uint8(48)
        is_digit = inside & (digit < 10)
        is_dot = inside & (byte == ord(".")) & ~dotted
        is_sign = inside & ((byte == ord("-")) | (byte == ord("+"))) if place == 0 else np.zeros_like(inside)
        wrong |= inside & ~(is_digit | is_dot | is_sign)
        negative |= is_sign & (byte == ord("-"))
        counted = is_digit & (digits < 18)
        mantissa = np.where(counted, mantissa * 10 + digit, mantissa)
        digits += is_digit & ((digits > 0) | (digit > 0))
        decimals += counted & dotted
        wrong |= is_digit & ~counted & ~dotted
        dotted |= is_dot
    wrong |= (digits == 0) & ~_any_digit(data, begin, end, limit)
    values = mantissa / 10.0**decimals
    return np.where(wrong, np.nan, np.where(negative, -values, values))


def _any_digit(data: Bytes, begin: Ints, end: Ints, limit: int) -> Bools:
    """True for numbers like 0, 0.0 and .0; False for a lone sign or dot."""
    seen = np.zeros(begin.size, dtype=np.bool_)
    for place in range(3):
        byte = data[np.minimum(begin + place, limit)]
        seen |= (begin + place < end) & (byte - np.uint8(48) < 10)
    return seen


def kinds_in(kind: NDArray[np.bytes_], wanted: Sequence[bytes]) -> Bools:
    """True where ``kind`` is one of ``wanted``."""
    found: Bools = np.isin(kind, np.array(wanted, dtype="S3"))
    return found
