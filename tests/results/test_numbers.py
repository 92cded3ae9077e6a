"""Rounded texts stay true to the numbers they show."""

from __future__ import annotations

import math
from decimal import Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sccal.results.numbers import (
    change_percent,
    duration,
    one_line,
    plain,
    short,
    value_and_sigma,
    with_sigma,
    wrapped_deg,
)

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def half_a_unit(text: str) -> Decimal:
    """Half of the last digit that the text shows."""
    mantissa, _, exponent = text.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return Decimal(5).scaleb(int(exponent or 0) - decimals - 1)


@given(NUMBERS, st.floats(0.0, allow_nan=False, allow_infinity=False))
@example(0.0808312, 0.000999)
@example(-0.0004, 0.12)
@example(123456.0, 4321.0)
@example(1e300, 1e-300)
@example(5e-324, 5e-324)
def test_value_and_sigma_read_back_within_half_a_unit(value: float, sigma: float) -> None:
    value_text, sigma_text = value_and_sigma(value, sigma)
    for number, text in ((value, value_text), (sigma, sigma_text)):
        coarsest = half_a_unit(text)
        if "." not in text and "e" not in text:
            coarsest = max(coarsest, Decimal(5).scaleb(Decimal(sigma or 1.0).adjusted() - 1))
        assert abs(Decimal(text) - Decimal(number)) <= coarsest


@given(st.floats(-1e6, 1e6), st.floats(1e-8, 1e3))
def test_ordinary_numbers_are_plain_and_end_at_the_same_decimal(value: float, sigma: float) -> None:
    value_text, sigma_text = value_and_sigma(value, sigma)
    assert "e" not in value_text + sigma_text
    assert len(value_text.partition(".")[2]) == len(sigma_text.partition(".")[2])
    assert len(sigma_text.replace(".", "").lstrip("0")) in (2, 3, 4)


@given(NUMBERS, st.integers(1, 12))
def test_plain_reads_back_within_half_a_unit(value: float, digits: int) -> None:
    for text in (plain(value, digits), short(value, digits)):
        assert abs(Decimal(text) - Decimal(value)) <= half_a_unit(plain(value, digits)) or value == 0.0


@given(st.floats(-1e4, 1e4))
def test_wrapped_degrees_are_the_same_direction(angle_rad: float) -> None:
    degrees = wrapped_deg(angle_rad)
    assert -180.0 < degrees <= 180.0
    assert math.cos(math.radians(degrees) - angle_rad) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (0.0808312, 0.000123, "0.08083 ± 0.00012 m"),
        (0.08, 0.0, "0.08 ± 0 m"),
        (0.08, math.nan, "0.08 ± n/a m"),
        (0.08, math.inf, "0.08 ± n/a m"),
        (0.08, None, "0.08 ± n/a m"),
        (0.08, -1.0, "0.08 ± n/a m"),
        (math.nan, 0.1, "n/a"),
        (None, None, "n/a"),
        (-0.004, 0.99, "0.00 ± 0.99 m"),
        (0.5, 0.0999, "0.50 ± 0.10 m"),
        (56789.0, 1234.0, "56800 ± 1200 m"),
        (0.0, 2.5, "0.0 ± 2.5 m"),
        (1e20, 1e18, "1.000e+20 ± 1.0e+18 m"),
        (0.08, 1e-14, "0.08 ± 1.0e-14 m"),
    ],
)
def test_with_sigma(value: float | None, sigma: float | None, text: str) -> None:
    assert with_sigma(value, sigma, "m") == text


def test_change_keeps_the_digits_that_sigma_carries() -> None:
    assert change_percent(0.0808312, 0.000123, 0.08) == "+1.04 %"
    assert change_percent(0.0799, math.nan, 0.08) == "-0.13 %"
    assert change_percent(0.0799, 0.0001, None) == "n/a"
    assert change_percent(0.0799, 0.0001, 0.0) == "n/a"


def test_half_turn_is_written_as_plus_180() -> None:
    assert wrapped_deg(-math.pi) == 180.0
    assert wrapped_deg(math.pi) == 180.0
    assert math.isnan(wrapped_deg(math.nan))


def test_durations() -> None:
    assert [duration(s) for s in (42.4, 119.9, 312.0, 3720.0, math.nan)] == [
        "42 s", "2 min 00 s", "5 min 12 s", "1 h 02 min", "n/a",
    ]  # fmt: skip


def test_one_line_defuses_terminals_and_comments() -> None:
    assert one_line("a\nb\x1b[31m\tc\udc80") == "a b�[31m c�"
