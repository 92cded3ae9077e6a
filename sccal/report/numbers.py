"""Numbers as reports print them; they live with the results, where exports find them too."""

from sccal.results.numbers import (
    MISSING,
    MOST_DECIMALS,
    MOST_DIGITS,
    change_percent,
    duration,
    one_line,
    plain,
    short,
    value_and_sigma,
    with_sigma,
    wrapped_deg,
)

__all__ = [
    "MISSING",
    "MOST_DECIMALS",
    "MOST_DIGITS",
    "change_percent",
    "duration",
    "one_line",
    "plain",
    "short",
    "value_and_sigma",
    "with_sigma",
    "wrapped_deg",
]
