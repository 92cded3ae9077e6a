"""Plain decimals ``[-+]digits[.digits]`` in a byte buffer, many at a time: read and written with the digits they have.

Numbers are rounded as a decimal parser rounds them.

A column of a log has few layouts: so many digits before the point, so many after. All numbers of one layout are read
eight digits at a time: eight bytes as one word, whose digits are joined pairwise by three multiplications (the SWAR
method of Lemire, "Quickly parsing eight digits", 2018). What fits no common layout is read byte by byte.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Bools, Floats, Ints

Bytes = NDArray[np.uint8]
Words = NDArray[np.uint64]

PAD = 64
"""A buffer must have so many zeros after its last number."""
_LONGEST = 20
_MOST_DIGITS = 18
_EXACT = 2**53
_MOST_LAYOUTS = 12
_POWERS = 10.0 ** np.arange(_LONGEST + 1)
_ZEROS = np.uint64(0x3030303030303030)
_HIGH = np.uint64(0x8080808080808080)
_CARRY = np.uint64(0x7676767676767676)
_EVEN = np.uint64(0x000000FF000000FF)
_HUNDREDS = np.uint64(0x000F424000000064)
_UNITS = np.uint64(0x0000271000000001)
_POINT, _ZERO, _MINUS = ord("."), ord("0"), ord("-")


@dataclass(frozen=True)
class Decimals:
    """Numbers as integers over powers of ten; arrays of length n."""

    mantissa: Ints
    """All digits as one signed integer."""
    places: Ints
    """Digits after the point."""
    good: Bools
    """False where there is no plain decimal; mantissa and places then mean nothing."""
    exact: Floats
    """The nearest float; NaN where not good."""


@dataclass(frozen=True)
class Digits:
    """Numbers with the digits that they were written with; every array (n,)."""

    good: Bools
    """False for what is not a plain decimal of at most 18 digits; the other arrays are 0 there, ``values`` NaN."""
    mantissa: Ints
    """Without sign."""
    negative: Bools
    whole: Ints
    """Digits before the point."""
    places: Ints
    """Digits after the point."""
    dotted: Bools
    values: Floats


def words_of(data: Bytes) -> Words:
    """The eight bytes from each place of a buffer on, as one little-endian word (size − 7,), without a copy."""
    return np.ndarray((max(data.size - 7, 0),), dtype="<u8", buffer=data, strides=(1,))


def parse_decimals(data: Bytes, begin: Ints, end: Ints) -> Floats:
    """Plain decimals at [begin, end) of the buffer; NaN for anything else or over 20 bytes."""
    return read_decimals(data, begin, end).exact


def read_decimals(data: Bytes, begin: Ints, end: Ints) -> Decimals:
    """Plain decimals at [begin, end) of the buffer (each (n,)), which ends with PAD zeros."""
    n = begin.size
    mantissa = np.zeros(n, dtype=np.int64)
    places = np.zeros(n, dtype=np.int64)
    good = np.zeros(n, dtype=np.bool_)
    length = end - begin
    first = data[np.minimum(begin, data.size - 1)]
    signed = ((first == ord("-")) | (first == ord("+"))) & (length > 0)
    negative = signed & (first == ord("-"))
    length = np.where(length <= _LONGEST, length, 0)
    if signed.any():
        begin, length = begin + signed, np.maximum(length - signed, 0)
    words = words_of(data)
    left = np.flatnonzero(length > 0)
    for attempt in range(_MOST_LAYOUTS):
        if left.size == 0:
            break
        typical = left[left.size // 2]
        size = int(length[typical])
        text = data[begin[typical] : begin[typical] + size].tobytes()
        point = text.find(b".")
        everywhere = attempt == 0 and left.size == n
        at = begin if everywhere else begin[left]
        same = (length if everywhere else length[left]) == size
        if point >= 0:
            same &= data[at + point] == _POINT
        rows: Ints | slice
        if same.all():
            rows, left = (slice(None) if everywhere else left), left[:0]
        else:
            rows, at, left = left[same], at[same], left[~same]
        before, after = (size, 0) if point < 0 else (point, size - point - 1)
        if before + after > _MOST_DIGITS:
            _one_by_one(data, np.arange(n)[rows], begin, length, mantissa, places, good)
            continue
        whole, clean = _digits(words, at, before, None)
        if point >= 0:
            whole, also = _digits(words, at + (point + 1), after, whole)
            clean &= also
        elif not clean.all():
            left = np.concatenate((np.arange(n)[rows][~clean], left))
        mantissa[rows], places[rows], good[rows] = whole, after, clean & (before + after > 0)
    if left.size:
        _one_by_one(data, left, begin, length, mantissa, places, good)
    exact = mantissa / _POWERS[places]
    if not good.all():
        exact[~good] = np.nan
    if negative.any():
        mantissa, exact = np.where(negative, -mantissa, mantissa), np.where(negative, -exact, exact)
    for row in np.flatnonzero(good & (np.abs(mantissa) >= _EXACT)).tolist():
        magnitude = float(data[begin[row] : begin[row] + length[row]].tobytes())
        exact[row] = -magnitude if negative[row] else magnitude
    return Decimals(mantissa, places, good, exact)


def read_digits(data: Bytes, begin: Ints, end: Ints) -> Digits:
    """As ``read_decimals``, with what it takes to write another number in the same form."""
    read = read_decimals(data, begin, end)
    length = np.where(read.good, end - begin, 0)
    first = data[np.minimum(begin, data.size - 1)]
    negative = (first == _MINUS) & (length > 0)
    signed = negative | ((first == ord("+")) & (length > 0))
    dotted = (length > 0) & ((read.places > 0) | (data[np.maximum(end - 1, 0)] == _POINT))
    whole = length - signed - dotted - read.places
    good = read.good & (whole + read.places <= _MOST_DIGITS)
    mantissa, whole, places = (np.where(good, one, 0) for one in (np.abs(read.mantissa), whole, read.places))
    values = read.exact if good.all() else np.where(good, read.exact, np.nan)
    return Digits(good, mantissa, negative & good, whole, places, dotted & good, values)


def write_decimals(mantissa: Ints, negative: Bools, whole: Ints, places: Ints, dotted: Bools) -> Bytes:
    """Texts (n, width) with at least ``whole`` digits before the dot and ``places`` after it.

    A dot is written where there are places, or where ``dotted`` is True. Zero gets no minus.
    """
    n = mantissa.size
    power = 10 ** np.arange(_MOST_DIGITS + 1, dtype=np.int64)
    digits = np.maximum(np.searchsorted(power, mantissa, side="right"), 1)
    before = np.maximum(np.maximum(whole, digits - places), 1 * (places == 0))
    minus = negative & (mantissa > 0)
    dot = dotted | (places > 0)
    shape = ((before * 32 + places) * 2 + dot) * 2 + minus
    width = int((before + places + dot + minus).max(initial=0))
    text = np.zeros((n, width), dtype=np.uint8)
    shapes = [int(shape[0])] if n and (shape == shape[0]).all() else np.unique(shape).tolist()
    for one in shapes:
        rows = slice(None) if len(shapes) == 1 else np.flatnonzero(shape == one)
        rest = mantissa[rows].copy()
        sign, has_dot, after = one & 1, one >> 1 & 1, one >> 2 & 31
        column = sign + (one >> 7) + has_dot + after
        for _ in range(after):
            column -= 1
            text[rows, column], rest = _last_digit(rest)
        if has_dot:
            column -= 1
            text[rows, column] = _POINT
        for _ in range(one >> 7):
            column -= 1
            text[rows, column], rest = _last_digit(rest)
        if sign:
            text[rows, 0] = _MINUS
    return text


def _last_digit(rest: Ints) -> tuple[Bytes, Ints]:
    shorter = rest // 10
    return (rest - shorter * 10 + _ZERO).astype(np.uint8), shorter


def _digits(words: Words, at: Ints, count: int, start: Ints | None) -> tuple[Ints, Bools]:
    """The ``count`` digits from each place on, appended to ``start``; and where they are digits at all."""
    value = np.zeros(at.size, dtype=np.int64) if start is None else start
    clean = np.ones(at.size, dtype=np.bool_)
    done = 0
    while done < count:
        size = min(8, count - done)
        word = words[at + done]
        if size < 8:
            word = (word << np.uint64(8 * (8 - size))) | (_ZEROS >> np.uint64(8 * size))
        word = word - _ZEROS
        clean &= ((word + _CARRY) | word) & _HIGH == 0
        word = word * np.uint64(10) + (word >> np.uint64(8))
        word = ((word & _EVEN) * _HUNDREDS + ((word >> np.uint64(16)) & _EVEN) * _UNITS) >> np.uint64(32)
        value = value * 10**size + word.astype(np.int64) if done or start is not None else word.astype(np.int64)
        done += size
    return value, clean


def _one_by_one(data: Bytes, rows: Ints, begin: Ints, length: Ints, mantissa: Ints, places: Ints, good: Bools) -> None:
    """The same for texts of any layout, unsigned, written into the last three arrays at ``rows``."""
    for row in rows.tolist():
        text = data[begin[row] : begin[row] + length[row]].tobytes()
        whole, _, fraction = text.partition(b".")
        if not (whole + fraction).isdigit() or len(whole.lstrip(b"0")) > _MOST_DIGITS:
            continue
        digits = len(whole.lstrip(b"0"))
        kept = fraction[: _MOST_DIGITS - digits]
        mantissa[row], places[row], good[row] = int(whole + kept), len(kept), True
