"""How far one saved estimate is from another: d = after − before, σ_d² = σ_before² + σ_after².

The heading offset is an angle without beginning or end: its differences lie in (−180°, 180°]. All other parameters,
angles of effects among them, are amplitudes and do not wrap. σ_d holds for results of different data; those of the same
data share their errors.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from sccal.results.calibration import Estimate

OFFSET_KEY = "heading_offset_deg"
_UNITS = ("m", "deg", "s", "ppm")


@dataclass(frozen=True)
class Difference:
    """One parameter in two results, in the unit of its key."""

    amount: float
    """after − before; NaN where a value is missing."""
    sigma: float
    """NaN where a sigma is missing."""

    @property
    def in_sigmas(self) -> float:
        """Signed; infinite where both sigmas are zero and the values differ."""
        if self.sigma == 0.0:
            return math.copysign(math.inf, self.amount) if self.amount else 0.0
        return self.amount / self.sigma


def difference(key: str, before: Estimate, after: Estimate) -> Difference:
    """From ``before`` to ``after``; ``key`` as in calibration.json, for an effect its parameter's name."""
    amount = after.value - before.value
    if key == OFFSET_KEY and math.isfinite(amount):
        amount = math.remainder(amount, 360.0)
        amount = 180.0 if amount <= -180.0 else amount
    return Difference(amount, math.hypot(before.sigma, after.sigma))


def unit_of(key: str) -> str:
    """``m``, ``deg``, ``s`` or ``ppm``, by the end of a parameter's name; empty for a ratio and for a rate."""
    for unit in _UNITS:
        if key == unit or key.endswith(f"_{unit}"):
            return unit
    return ""


def why_own_log_only(key: str, beside: Collection[str]) -> str:
    """Why an effect's parameter means something in its own log only; empty for all others.

    ``beside`` are all keys of the effect: an east and a north that have a radius are a place, without one a distance.
    """
    if key == "at_s":
        return "a moment of its own log"
    if key in ("east_m", "north_m") and "radius_m" in beside:
        return "a place counted from its own log's origin"
    return ""


def why_not_estimated(estimate: Estimate) -> str:
    """Why an estimate cannot stand in a comparison, in a few words and its reason; empty where it can."""
    reason = f": {estimate.reason}" if estimate.reason else ""
    if estimate.status == "unobserved":
        return f"not excited{reason}"
    if estimate.status == "at_bound":
        return f"at its bound{reason}"
    if estimate.status != "estimated":
        return f"{estimate.status}{reason}"
    return "" if math.isfinite(estimate.value) else f"has no value{reason}"
