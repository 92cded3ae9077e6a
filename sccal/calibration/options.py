"""What a user may choose about a calibration."""

from __future__ import annotations

from dataclasses import dataclass, field

from sccal.filter.forward import Noise
from sccal.filter.options import FilterOptions


@dataclass(frozen=True)
class CalibrationOptions:
    """Options of one calibration; the filter's own are inside."""

    filter: FilterOptions = field(default_factory=FilterOptions)
    outage_window_s: float = 30.0
    output_rate_hz: float = 10.0
    heading_rate_hz: float = 10.0
    """Readings beyond this rate are left out: an AHRS's error changes more slowly."""
    noise: Noise | None = None
    """None: estimated from the log."""
    withhold_s: tuple[tuple[float, float], ...] = ()
    """Windows whose fixes judge and do not teach; in the log's own time, or from its start."""
    effects: tuple[str, ...] = ()
    """Names of effects beyond the paper's model that the filter estimates too."""
