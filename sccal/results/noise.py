"""The noise that a log was found to have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar


@dataclass(frozen=True)
class Noise:
    """Levels and correlation times of the measurement errors that the filter uses, and where they come from."""

    heading_white_rad: float
    heading_coloured_rad: float
    heading_tau_s: float
    fix_scale: float
    """Factor on the stated (or table) sigma of the fixes of the leading quality: their white part in this log."""
    fix_coloured_m: float
    fix_tau_s: float
    slip_m_per_sqrt_m: float
    """Random travel error of each wheel: standard deviation after one metre, growing with the root of distance."""
    source: str = "estimated"
    """estimated or given."""
    other_fix_scale: Mapping[int, float] = field(default_factory=dict)
    """The same factor for fixes of another quality (GGA code to factor)."""
    fix_stated_m: float = float("nan")
    """Median of the stated (or table) sigma of the leading fixes, which fix_scale multiplies."""
    apart_nats: float = 0.0
    """How far the two best ends of the search are apart in log-likelihood: near zero where the search is sure."""

    WRITTEN: ClassVar[str] = (
        "heading_white_rad heading_coloured_rad heading_tau_s fix_scale other_fix_scale fix_coloured_m fix_tau_s "
        "slip_m_per_sqrt_m fix_stated_m apart_nats source"
    )
