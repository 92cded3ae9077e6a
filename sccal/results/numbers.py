"""Numbers as a reader wants them: a value and its sigma rounded together, plain digits, units for display.

Sigma keeps two significant digits, the value stops at the same decimal: ``0.08083 ± 0.00012 m``. What is missing or
not finite reads ``n/a``. Scientific notation appears only where plain digits would run past MOST_DECIMALS or
MOST_DIGITS.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import ROUND_HALF_EVEN, Context, Decimal

MISSING = "n/a"
MOST_DECIMALS = 12
MOST_DIGITS = 12

_EXACT = Context(prec=60, rounding=ROUND_HALF_EVEN)


def value_and_sigma(value: float | None, sigma: float | None) -> tuple[str, str]:
    """The two texts, each to within half a unit of its own last digit."""
    if value is None or not math.isfinite(value):
        return MISSING, MISSING
    if sigma is None or not math.isfinite(sigma) or sigma < 0.0:
        return short(value), MISSING
    if sigma == 0.0:
        return short(value), "0"
    exponent = _exponent_at_two_digits(sigma)
    if exponent >= MOST_DIGITS or _exponent(value) >= MOST_DIGITS:
        digits = min(max(_exponent(value) - exponent + 1, 1), 15)
        return f"{value:.{digits}e}", f"{sigma:.1e}"
    decimals = 1 - exponent
    if decimals > MOST_DECIMALS:
        return short(value, 10), f"{sigma:.1e}"
    return _at_decimal(value, decimals), _at_decimal(sigma, decimals)


def with_sigma(value: float | None, sigma: float | None, unit: str = "") -> str:
    """``0.08083 ± 0.00012 m``."""
    value_text, sigma_text = value_and_sigma(value, sigma)
    if value_text == MISSING:
        return MISSING
    return f"{value_text} ± {sigma_text}" + (f" {unit}" if unit else "")


def plain(value: float | None, digits: int = 3) -> str:
    """Significant digits without an exponent; digits before the decimal point are never rounded away."""
    if value is None or not math.isfinite(value):
        return MISSING
    if value == 0.0:
        return "0"
    decimals = max(0, digits - 1 - _exponent(value))
    if decimals > MOST_DECIMALS or _exponent(value) >= MOST_DIGITS:
        return f"{value:.{digits - 1}e}"
    return _at_decimal(value, decimals)


def short(value: float | None, digits: int = 6) -> str:
    """As ``plain``, without trailing zeros: declared values, and values that have no sigma to be rounded by."""
    text = plain(value, digits)
    if "." not in text or "e" in text:
        return text
    return text.rstrip("0").rstrip(".")


def change_percent(value: float | None, sigma: float | None, nominal: float | None) -> str:
    """``+1.04 %`` from the nominal value, as many digits as sigma carries."""
    if value is None or nominal is None or not math.isfinite(value) or not math.isfinite(nominal) or nominal == 0.0:
        return MISSING
    percent = 100.0 * (value / nominal - 1.0)
    if sigma is not None and math.isfinite(sigma) and sigma > 0.0:
        text = value_and_sigma(percent, 100.0 * sigma / abs(nominal))[0]
    else:
        text = _at_decimal(percent, 2) if abs(percent) < 10.0**MOST_DIGITS else plain(percent)
    return f"{text} %" if text.startswith("-") else f"+{text} %"


def wrapped_deg(angle_rad: float) -> float:
    """Radians to degrees in (−180, 180]."""
    if not math.isfinite(angle_rad):
        return math.nan
    angle_deg = math.degrees(angle_rad)
    if -180.0 < angle_deg <= 180.0:
        return angle_deg
    wrapped = math.remainder(angle_deg, 360.0)
    return 180.0 if wrapped <= -180.0 else wrapped


def radians_of(angle_deg: float) -> float:
    """Degrees to the radians that they were made of, bit for bit where math.degrees made them of any."""
    angle_rad = math.radians(angle_deg)
    around = (angle_rad, math.nextafter(angle_rad, math.inf), math.nextafter(angle_rad, -math.inf))
    return next((one for one in around if math.degrees(one) == angle_deg), angle_rad)


def duration(seconds: float | None) -> str:
    """``42 s``, ``5 min 12 s``, ``1 h 02 min``."""
    if seconds is None or not math.isfinite(seconds) or seconds < 0.0:
        return MISSING
    whole = round(seconds)
    if whole < 120:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def one_line(text: str) -> str:
    """Names and reasons from outside, made safe for one line of a terminal, a YAML comment or a JSON string."""
    kept = "".join(c if c.isprintable() or c.isspace() else "�" for c in text)
    return " ".join(kept.split())


def _at_decimal(value: float, decimals: int) -> str:
    rounded = Decimal(value).quantize(Decimal(1).scaleb(-decimals), context=_EXACT)
    return f"{abs(rounded) if rounded.is_zero() else rounded:f}"


def _exponent(value: float) -> int:
    return Decimal(value).adjusted() if value else 0


def _exponent_at_two_digits(sigma: float) -> int:
    """Decimal exponent of sigma's first digit once it is rounded to two: 0.000999 becomes 0.0010."""
    return int(f"{sigma:.1e}".partition("e")[2])


def listed(names: Sequence[str]) -> str:
    """One or more names as a sentence lists them: ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
