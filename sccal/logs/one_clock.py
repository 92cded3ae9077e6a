"""The streams of a run that were stamped by one clock in several forms, put on the form of the wheels' stamps.

Times of day beside Unix time, and local time beside UTC, lie whole quarters of an hour apart, and a clock that was set
moved in all streams alike. What else lies between the streams' clocks is for the alignment to find.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sccal.arrays import Floats
from sccal.logs.names import ENCODER_FILE
from sccal.logs.set_clock import like_the_wheels
from sccal.logs.streams import FixStream, HeadingStream, Notice, WheelStream

ZONE_STEP_S = 900.0
"""Zones of the world are whole quarters of an hour from UTC."""
_NEAR_S = 120.0
"""Streams of one log begin and end within so much of one another, on average."""
_DAY_S = 86400.0


def on_one_clock(
    wheels: WheelStream, heading: HeadingStream, fixes: FixStream
) -> tuple[HeadingStream, FixStream, tuple[Notice, ...]]:
    """Heading and fixes by the wheels' clock, and what was done for it."""
    notices: list[Notice] = []
    heading_t_s = like_the_wheels(heading.t_s, heading.clock_steps, wheels.clock_steps)
    host_t_s = like_the_wheels(fixes.host_t_s, fixes.clock_steps, wheels.clock_steps)
    if heading.utc_s is None:
        heading_t_s = _in_zone(heading_t_s, wheels.t_s, heading.source, notices)
    host_t_s = _in_zone(host_t_s, wheels.t_s, "gnss", notices)
    return replace(heading, t_s=heading_t_s), replace(fixes, host_t_s=host_t_s), tuple(notices)


def _in_zone(t_s: Floats, wheel_t_s: Floats, source: str, notices: list[Notice]) -> Floats:
    """Times (n) moved by whole quarters of an hour to where the wheels' are; as they are where that is not clear."""
    known = t_s[np.isfinite(t_s)]
    if known.size < 2 or wheel_t_s.size < 2 or (known.max() >= wheel_t_s[0] and known.min() <= wheel_t_s[-1]):
        return t_s
    away_s = 0.5 * float(wheel_t_s[0] - known.min() + wheel_t_s[-1] - known.max())
    moved_s = round(away_s / ZONE_STEP_S) * ZONE_STEP_S
    if not moved_s or abs(away_s - moved_s) > _NEAR_S:
        return t_s
    days, hours = divmod(moved_s, _DAY_S) if abs(moved_s) >= _DAY_S else (0.0, moved_s)
    size = f"{days:.0f} days and {hours / 3600.0:g} h" if days else f"{hours / 3600.0:+g} h"
    what = f"times moved by {size} to the clock of {ENCODER_FILE}: another zone, or times of day"
    notices.append(Notice(source, what, int(known.size), "", "warning"))
    return t_s + moved_s
