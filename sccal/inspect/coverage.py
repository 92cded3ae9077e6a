"""Is a stream there all the time, at an even rate, and finely enough resolved?"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sccal.arrays import Floats
from sccal.inspect.read import LogStreams
from sccal.inspect.together import Together
from sccal.logs.names import AHRS_FILE, ENCODER_FILE
from sccal.logs.streams import Notice
from sccal.results.inspection import Gap, StreamFacts, StreamName

GAP_STEPS = 3.0
GAP_S = 0.5
GAPS_TOLD = 100
METRES_PER_DEGREE = 111_320.0
_SAME_RAD = 1e-8
_SAME_DEG = 1e-10
_REPAIRS = ("dropped", "sorted", "passed over")


def longest_step_s(t_s: Floats) -> float:
    """A step longer than this is a gap: three usual ones, and half a second."""
    return max(GAP_STEPS * float(np.median(np.diff(t_s))), GAP_S) if t_s.size > 1 else np.inf


def stream_facts(streams: LogStreams, together: Together) -> tuple[StreamFacts, ...]:
    """Of every stream that is there."""
    facts = []
    of_heading = AHRS_FILE if streams.heading is None else streams.heading.source
    of_wheels = ENCODER_FILE if streams.wheels is None else streams.wheels.source
    sources: dict[StreamName, str] = {"wheels": of_wheels, "heading": of_heading, "fixes": streams.fix_source}
    for name, source in sources.items():
        t_s = together.times(name)
        if t_s.size >= 2:
            source = source if streams.source.path.is_dir() else streams.source.path.name
            facts.append(_facts(name, source, t_s, streams, together))
    return tuple(facts)


def _facts(name: StreamName, source: str, t_s: Floats, streams: LogStreams, together: Together) -> StreamFacts:
    steps = np.diff(t_s)
    limit = longest_step_s(t_s)
    wide = np.flatnonzero(steps > limit)
    longest = wide[np.argsort(steps[wide])[::-1]][:GAPS_TOLD]
    usual_s = float(np.median(steps))
    whole_steps = np.maximum(np.round(steps[steps <= limit] / usual_s), 1.0)
    off = steps[steps <= limit] - whole_steps * usual_s
    low, high = np.quantile(off, (0.159, 0.841)) if off.size else (np.nan, np.nan)
    missing = float(whole_steps.sum() - whole_steps.size)
    first, last = together.span_s
    shares = name not in together.apart
    whole = last - first if shares else float(t_s[-1] - t_s[0])
    present = min(float(t_s[-1]), last) - max(float(t_s[0]), first) if shares else whole
    value, unit = _resolution(name, streams)
    return StreamFacts(
        name=name,
        source=source,
        rows=int(t_s.size),
        first_s=float(t_s[0]),
        last_s=float(t_s[-1]),
        rate_hz=1.0 / float(np.median(steps)),
        jitter_s=float(0.5 * (high - low)),
        missing=missing / (t_s.size + missing),
        longest_step_s=float(steps.max()),
        gaps=tuple(Gap(float(t_s[k]), float(steps[k])) for k in longest),
        gap_count=int(wide.size),
        gap_total_s=float(steps[wide].sum()),
        covered=float(np.clip((present - steps[wide].sum()) / whole, 0.0, 1.0)) if whole > 0 else 1.0,
        resolution=value,
        resolution_unit=unit,
        repaired=_repaired(source, streams.notices),
        shares_time=shares,
    )


def _repaired(source: str, notices: Iterable[Notice]) -> int:
    return sum(
        one.count
        for one in notices
        if one.source == source and any(word in one.what for word in _REPAIRS) and "other sentences" not in one.what
    )


def _resolution(name: StreamName, streams: LogStreams) -> tuple[float, str]:
    if name == "wheels" and streams.wheels is not None and streams.vehicle is not None:
        wheels = streams.wheels
        own = ~wheels.loose[1:]
        # At speed no step is one count, but steps differ by whole counts.
        steps = np.abs(np.concatenate([np.diff(one)[own] for one in (wheels.left_rad, wheels.right_rad)]))
        smallest = _smallest(np.diff(np.unique(np.append(steps, 0.0))), _SAME_RAD)
        return 1e3 * streams.vehicle.wheel_radius_m * smallest, "mm"
    if name == "heading" and streams.heading is not None:
        return float(np.degrees(_smallest(np.diff(np.unique(streams.heading.yaw_rad)), _SAME_RAD))), "deg"
    if streams.fixes is not None:
        lat = _smallest(np.diff(np.unique(streams.fixes.lat_deg)), _SAME_DEG)
        return METRES_PER_DEGREE * lat, "m"
    return np.nan, ""


def _smallest(steps: Floats, same: float) -> float:
    size = np.abs(steps)
    size = size[size > same]
    return float(size.min()) if size.size else np.nan
