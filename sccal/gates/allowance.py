"""What ``--allow-drift`` allows a parameter to move by: sigmas of the difference, a share, or an amount with a unit."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from sccal.errors import UsageError
from sccal.results.calibration import Estimate
from sccal.results.differences import Difference, unit_of

UNITS: Mapping[str, tuple[str, float]] = {
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "m": ("m", 1.0),
    "deg": ("deg", 1.0),
    "rad": ("deg", math.degrees(1.0)),
    "ms": ("s", 1e-3),
    "s": ("s", 1.0),
    "ppm": ("ppm", 1.0),
}
"""By its name: the unit of the parameters that it is for, and how many of those it is."""
SIGMAS = ("sigma", "sigmas", "σ")
_AMOUNT = re.compile(r"\s*([0-9]+\.?[0-9]*(?:[eE][+-]?[0-9]+)?|\.[0-9]+(?:[eE][+-]?[0-9]+)?)\s*([A-Za-z%σ]*)\s*")


@dataclass(frozen=True)
class Allowance:
    """One ``--allow-drift``."""

    text: str
    """As it was asked for, without blanks."""
    amount: float
    """In ``unit``; for ``%`` of the baseline's value, for ``sigma`` of the difference's sigma."""
    unit: str
    """``sigma``, ``%``, or the unit of the parameters that it is for."""

    def why_not_for(self, key: str) -> str:
        """Why this says nothing about the parameter; empty where it does."""
        unit = unit_of(key)
        if self.unit == "%" and unit == "deg":
            return f"an angle has no percentage: --allow-drift {self.text} does not judge it; give an amount in deg too"
        if self.unit not in ("sigma", "%", unit):
            return f"--allow-drift {self.text} does not judge it; give an amount in {unit or 'sigmas'} too"
        return ""

    def largest(self, before: Estimate, d: Difference) -> float:
        """The largest difference allowed, in the parameter's unit; NaN where it cannot be told."""
        if self.unit == "sigma":
            return self.amount * d.sigma
        return self.amount / 100.0 * abs(before.value) if self.unit == "%" else self.amount


def parse_allowance(text: str) -> Allowance:
    """``2sigma``, ``1%``, ``0.5mm``, ``0.2deg``.

    Raises:
        UsageError: it is none of these.
    """
    found = _AMOUNT.fullmatch(text)
    ways = "write 2sigma, 1%, 0.5mm or 0.2deg"
    if found is None:
        raise UsageError(f'--allow-drift "{text}": not a positive number and a unit; {ways}')
    number, unit = float(found.group(1)), found.group(2)
    if not math.isfinite(number) or number == 0.0:
        raise UsageError(f'--allow-drift "{text}": {found.group(1)} allows nothing that can be judged; {ways}')
    kept = "".join(text.split())
    if unit in SIGMAS:
        return Allowance(kept, number, "sigma")
    if unit == "%":
        return Allowance(kept, number, "%")
    if unit not in UNITS:
        known = ", ".join(("sigma", "%", *UNITS))
        raise UsageError(
            f'--allow-drift "{text}": {f"no unit {unit}" if unit else "no unit"} (there are {known}); {ways}'
        )
    base, factor = UNITS[unit]
    return Allowance(kept, number * factor, base)
