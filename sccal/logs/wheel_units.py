"""The units in which wheels are logged, besides counts and angles: speeds, and travel in metres."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class WheelUnit:
    """What a wheel's column holds, by the end of its name."""

    words: str
    """As messages name it."""
    spelled: str
    """Other ends of names that mean the same, as a pattern of folded names."""
    rad: float = 0.0
    """Radians in one of it; 0 where it is a length."""
    m: float = 0.0
    """Metres in one of it; 0 where it is an angle."""
    rate: bool = True
    """Per second; else cumulative."""


UNITS: Mapping[str, WheelUnit] = {
    "radps": WheelUnit("rad/s", "rad_s|rad_per_s|rad_per_sec|radians_per_second", rad=1.0),
    "degps": WheelUnit("deg/s", "deg_s|deg_per_s|dps|degrees_per_second", rad=math.radians(1.0)),
    "rpm": WheelUnit("rpm", "rev_min|rev_per_min", rad=2.0 * math.pi / 60.0),
    "rps": WheelUnit("turns/s", "rev_s|rev_per_s|revps", rad=2.0 * math.pi),
    "mps": WheelUnit("m/s", "m_s|m_per_s", m=1.0),
    "mmps": WheelUnit("mm/s", "mm_s|mm_per_s", m=1e-3),
    "m": WheelUnit("m", "metres|meters", m=1.0, rate=False),
    "mm": WheelUnit("mm", "millimetres|millimeters", m=1e-3, rate=False),
}
"""Of each, ``left_NAME`` and ``right_NAME`` are columns."""
RATE_COLUMNS = tuple(("t", f"left_{name}", f"right_{name}") for name in UNITS)
