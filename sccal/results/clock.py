"""How the fixes came onto the logging computer's clock."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal


@dataclass(frozen=True)
class Clock:
    """How the fixes' times were put on the logging computer's clock."""

    source: Literal["host", "utc", "utc_mapped", "motion"]
    """host: receive times as logged (gnss.csv); utc: the logging clock is Unix time; utc_mapped: the receiver's epochs
    mapped onto the logging clock through the receive times; motion: any of these, and then moved to where fixes and
    wheels move together."""
    offset_s: float
    """Logging clock minus UTC at the median time of the fixes. For receive times alone, and unless moved: 0; if moved:
    the wheels' clock minus the one that stamped the fixes."""
    skew_ppm: float
    """Mean rate of the logging clock against UTC, minus one."""
    jitter_s: float
    """Robust spread (1.4826 × median absolute deviation) of the receive times around the mapping."""
    knots: int
    """Corners of the mapping; 2 is a straight line, more mean that the logging clock was being steered."""
    sigma_offset_s: float = 0.0
    """Standard deviations of offset and skew; 0 where they are not estimated but taken as logged."""
    sigma_skew_ppm: float = 0.0
    offset_at_start_s: float | None = None
    """Logging clock minus UTC at the first fix; None where the log has no UTC."""

    WRITTEN: ClassVar[str] = "source offset_s sigma_offset_s skew_ppm sigma_skew_ppm offset_at_start_s jitter_s knots"
