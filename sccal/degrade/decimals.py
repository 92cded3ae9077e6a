"""Plain decimals in a buffer, read and written many at a time, with the digits that they have.

A number is an integer mantissa over a power of ten. Fields of one log mostly have one shape (length and place of the
dot); all fields of a shape are read by one pass over their columns, odd ones one by one.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Bools, Floats, Ints

Bytes = NDArray[np.uint8]

_LONGEST = 24
_MOST_DIGITS = 18
_SHAPES = 12
_PLAIN = re.compile(rb"([-+]?)([0-9]*)(\.?)([0-9]*)")
_DOT, _ZERO, _MINUS, _PLUS = ord("."), ord("0"), ord("-"), ord("+")


@dataclass(frozen=True)
class Decimals:
    """Numbers as written; every array (n,)."""

    good: Bools
    """False for what is not a plain decimal of at most 18 digits; the other arrays are 0 there."""
    mantissa: Ints
    """Without sign."""
    negative: Bools
    whole: Ints
    """Digits before the dot."""
    places: Ints
    """Digits after the dot."""
    dotted: Bools

    @property
    def values(self) -> Floats:
        """As numbers; NaN where not good."""
        size = self.mantissa / 10.0**self.places
        return np.where(self.good, np.where(self.negative, -size, size), np.nan)


def read_decimals(data: Bytes, begin: Ints, end: Ints) -> Decimals:
    """Read the fields [begin, end) (n,) of a buffer."""
    n = begin.size
    mantissa, whole, places = (np.zeros(n, dtype=np.int64) for _ in range(3))
    good, negative, dotted = (np.zeros(n, dtype=np.bool_) for _ in range(3))
    length = end - begin
    left = np.flatnonzero((length > 0) & (length <= _LONGEST))
    for _ in range(_SHAPES):
        if left.size == 0:
            break
        first = left[0]
        text = data[begin[first] : end[first]].tobytes()
        match = _PLAIN.fullmatch(text)
        if match is None or not 0 < len(match[2]) + len(match[4]) <= _MOST_DIGITS:
            left = left[1:]
            continue
        like = left[length[left] == len(text)]
        value, fits = _columns(data, begin[like], text)
        rows = like[fits]
        mantissa[rows], good[rows] = value[fits], True
        negative[rows], dotted[rows] = match[1] == b"-", bool(match[3])
        whole[rows], places[rows] = len(match[2]), len(match[4])
        left = left[~good[left]]
    for row in left.tolist():
        match = _PLAIN.fullmatch(data[begin[row] : end[row]].tobytes())
        if match is None or not 0 < len(match[2]) + len(match[4]) <= _MOST_DIGITS:
            continue
        mantissa[row], good[row] = int(match[2] + match[4]), True
        negative[row], dotted[row] = match[1] == b"-", bool(match[3])
        whole[row], places[row] = len(match[2]), len(match[4])
    return Decimals(good, mantissa, negative, whole, places, dotted)


def _columns(data: Bytes, begin: Ints, like: bytes) -> tuple[Ints, Bools]:
    """Mantissas of fields of the shape of ``like``, and which fields have that shape."""
    value = np.zeros(begin.size, dtype=np.int64)
    fits = np.ones(begin.size, dtype=np.bool_)
    for place, mark in enumerate(like):
        byte = data[begin + place]
        if mark in (_DOT, _MINUS, _PLUS):
            fits &= byte == mark
            continue
        digit = byte - np.uint8(_ZERO)
        fits &= digit < 10
        value *= 10
        value += digit
    return value, fits


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
            text[rows, column] = _DOT
        for _ in range(one >> 7):
            column -= 1
            text[rows, column], rest = _last_digit(rest)
        if sign:
            text[rows, 0] = _MINUS
    return text


def _last_digit(rest: Ints) -> tuple[Bytes, Ints]:
    shorter = rest // 10
    return (rest - shorter * 10 + _ZERO).astype(np.uint8), shorter
