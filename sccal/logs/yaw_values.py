"""What the numbers in a column of headings are: their unit, by where they begin again, and numbers that stand for none.

A heading that goes once round falls back by a full turn, and the size of that fall is the unit: 360 are degrees, 36000
hundredths of them. A number that comes again and again, exactly and far from what stands before and behind it, is no
heading but what its writer puts where there is none; so is a zero from which the heading jumps.
"""

from __future__ import annotations

import math

import numpy as np

from sccal.arrays import Bools, Floats

TURNS = {
    360.0: "degrees",
    2.0 * math.pi: "radians",
    1.0: "turns",
    400.0: "gon",
    3600.0: "tenths of a degree",
    5760.0: "sixteenths of a degree",
    2000.0 * math.pi: "thousandths of a radian",
    6400.0: "mils, 6400 to a turn",
    36000.0: "hundredths of a degree",
    65536.0: "parts of 65536 to a turn",
    360000.0: "thousandths of a degree",
    3.6e7: "hundred-thousandths of a degree",
    3.6e9: "ten-millionths of a degree",
}
"""Units of headings by what a full turn is in them."""
_WITHIN = 0.01
_MOST_OF_RANGE = 0.6
_AGREE = 0.8
_FAR = 20.0
_FEWEST_RUNS = 3
_MOSTLY = 0.5
_LONG_RUN = 5
_LEAST_JUMP = 0.01
"""Of a full turn: from a zero that is none the heading jumps further."""


def turn_of(values: Floats) -> float | None:
    """What a full turn is in some headings (n), by their falls at its end; None where they show no known one."""
    if values.size < 4:
        return None
    span = float(np.ptp(values))
    steps = np.diff(values)
    falls = np.flatnonzero(np.abs(steps) > _MOST_OF_RANGE * span)
    falls = falls[(falls > 0) & (falls < steps.size - 1)]
    if span == 0.0 or falls.size == 0:
        return None
    beside = np.where(np.abs(steps) > _MOST_OF_RANGE * span, 0.0, steps)
    sizes = np.abs(steps[falls] - 0.5 * (beside[falls - 1] + beside[falls + 1]))
    usual = float(np.median(sizes))
    turn = min(TURNS, key=lambda size: abs(math.log(usual / size)) if usual > 0 else math.inf)
    alike = np.abs(sizes - usual) < 2.0 * _WITHIN * usual
    if abs(usual - turn) > _WITHIN * turn or alike.mean() < _AGREE or span > (1.0 + _WITHIN) * turn:
        return None
    return turn


def stands_for_none(values: Floats, full_turn: float) -> tuple[Bools, float | None]:
    """Which headings (n) are no readings, and the number that they are; a full turn is ``full_turn`` in their unit."""
    if values.size < _LONG_RUN or float(np.max(np.abs(np.diff(values)))) <= _LEAST_JUMP * full_turn:
        return np.zeros(values.size, dtype=np.bool_), None
    begins = np.concatenate(([0], np.flatnonzero(np.diff(values) != 0) + 1))
    value, rows = values[begins], np.diff(np.append(begins, values.size))
    jump = np.abs(_around(np.diff(value), full_turn))
    usual = float(np.median(jump)) if jump.size else 0.0
    far = jump > max(_FAR * usual, _LEAST_JUMP * full_turn)
    before, behind = np.concatenate(([True], far)), np.concatenate((far, [True]))
    apart = before & behind
    apart[0] &= far.size > 0 and bool(far[0])
    apart[-1] &= far.size > 0 and bool(far[-1])
    number = _number_that_comes_again(value, apart)
    if number is not None:
        return np.repeat(value == number, rows), number
    zero = apart & (value == 0.0) & (rows >= _LONG_RUN)
    return np.repeat(zero, rows), 0.0 if zero.any() else None


def _around(steps: Floats, full_turn: float) -> Floats:
    return np.asarray((steps + 0.5 * full_turn) % full_turn - 0.5 * full_turn)


def _number_that_comes_again(value: Floats, apart: Bools) -> float | None:
    """The number that stands apart in several runs of rows, and seldom otherwise."""
    numbers, runs = np.unique(value[apart], return_counts=True)
    if numbers.size == 0:
        return None
    best = int(np.argmax(runs))
    number = float(numbers[best])
    return number if runs[best] >= _FEWEST_RUNS and runs[best] > _MOSTLY * (value == number).sum() else None
