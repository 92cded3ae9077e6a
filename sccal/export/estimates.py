"""What formats of parameters share: why a value is not a result, and its text beside its sigma."""

from __future__ import annotations

import math

from sccal.results.calibration import Estimate
from sccal.results.numbers import one_line, value_and_sigma

_WHY = {
    "estimated": "no value",
    "unobserved": "not observed in this data",
    "at_bound": "stopped at its bound, not to be trusted",
    "held": "held, not estimated",
}


def usable(estimate: Estimate) -> bool:
    """Whether the data gave it a value."""
    return estimate.status == "estimated" and math.isfinite(estimate.value)


def why_not(estimate: Estimate) -> str:
    """For a comment beside a value that is not a result, on one line."""
    reason = one_line(estimate.reason)
    return f"{_WHY.get(estimate.status, one_line(estimate.status))}{f': {reason}' if reason else ''}"


def with_sigma(estimate: Estimate, unit: str) -> str:
    """``0.080799 +/- 0.000025 m``, in ASCII."""
    value, sigma = value_and_sigma(estimate.value, estimate.sigma)
    return f"{value} +/- {sigma} {unit}"
