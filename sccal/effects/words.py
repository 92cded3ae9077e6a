"""How an effect says what was found of it: the estimates as its sentence needs them, and the words they share."""

from __future__ import annotations

import math
from decimal import Decimal
from typing import Protocol

_MISSING = "n/a"
_MOST_DECIMALS = 12
_MOST_DIGITS = 12


class Measured(Protocol):
    """A parameter of an effect as it was found, in the unit of the files."""

    @property
    def value(self) -> float:
        """Finite in all that an effect is asked to say."""

    @property
    def sigma(self) -> float:
        """NaN where it is not known."""


def rounded(value: float, digits: int = 3) -> str:
    """Significant digits as reports show them: plain ones, those before the decimal point all kept."""
    if not math.isfinite(value):
        return _MISSING
    if value == 0.0:
        return "0"
    exponent = Decimal(value).adjusted()
    decimals = max(0, digits - 1 - exponent)
    if decimals > _MOST_DECIMALS or exponent >= _MOST_DIGITS:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{decimals}f}"


def about(value: float) -> str:
    """Three digits from one on, two below: 1.37, 12.3, 0.86, 0.055."""
    return rounded(value, 3 if abs(value) >= 1.0 else 2)


def size(found: Measured) -> str:
    """Without its sign, which the words have."""
    return about(abs(found.value))


def percent(found: Measured) -> str:
    """The size of a share."""
    return f"{about(100.0 * abs(found.value))} %"


def amplitude(one: Measured, other: Measured) -> str:
    """The size of two parts at right angles."""
    return about(math.hypot(one.value, other.value))


def sense(found: Measured) -> str:
    """Which way an angle turns."""
    return "to the left (counter-clockwise)" if found.value > 0.0 else "to the right (clockwise)"


def less(found: Measured, below_zero: str = "further") -> str:
    """What a loss does, and what one below zero does."""
    return "less" if found.value > 0.0 else below_zero


def moment(at: Measured) -> str:
    """When something happened once."""
    return f"{rounded(at.value)} s after the run's start"
