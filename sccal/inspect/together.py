"""What was read, on one clock: arrays of length 0 where a stream is missing, so that every question can be asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.align.aligned import yaw_to_enu
from sccal.arrays import Bools, Floats
from sccal.inspect.place import PlacedFixes, placed_fixes
from sccal.inspect.read import LogStreams
from sccal.results.clock import Clock
from sccal.results.inspection import StreamName

MIDDLE_S = 0.5


@dataclass(frozen=True)
class Together:
    """The streams of one run on the logging clock."""

    wheel_t_s: Floats
    travel_m: Floats
    """Signed distance of the middle between the wheels, from 0."""
    turn_rad: Floats
    """By the wheels, from 0; empty where the track is not known."""
    yaw_t_s: Floats
    yaw_rad: Floats
    """Turned into enu, unwrapped."""
    gyro_radps: Floats | None
    fixes: PlacedFixes | None
    span_s: tuple[float, float]
    """From the first to the last moment of the streams that share time with the reference: the wheels if there."""
    apart: tuple[StreamName, ...]
    """Streams that share no time with the reference."""

    @property
    def clock(self) -> Clock | None:
        """How the fixes came onto the logging clock."""
        return None if self.fixes is None else self.fixes.clock

    def times(self, name: StreamName) -> Floats:
        """Stamps of one stream."""
        if name == "fixes":
            return np.zeros(0) if self.fixes is None else self.fixes.t_s
        return self.wheel_t_s if name == "wheels" else self.yaw_t_s

    def meets(self, *names: StreamName) -> bool:
        """Whether all of these streams are there and share the reference's time."""
        return all(self.times(name).size >= 2 and name not in self.apart for name in names)


def bring_together(streams: LogStreams) -> Together:
    """Put what was read on one clock."""
    wheels, heading, vehicle = streams.wheels, streams.heading, streams.vehicle
    none = np.zeros(0)
    wheel_t_s, travel, turn = none, none, none
    if wheels is not None and vehicle is not None:
        wheel_t_s = wheels.t_s
        right, left = (vehicle.wheel_radius_m * (one - one[0]) for one in (wheels.right_rad, wheels.left_rad))
        travel = 0.5 * (right + left)
        turn = (right - left) / vehicle.track_m if streams.track_known else none
    yaw_t_s, yaw = none, none
    if heading is not None:
        yaw_t_s = heading.t_s
        declared = "enu" if vehicle is None else vehicle.convention
        yaw = np.unwrap(yaw_to_enu(heading.yaw_rad, heading.convention or declared))
    reference = next((t for t in (wheel_t_s, yaw_t_s) if t.size), none)
    fixes = None
    if streams.fixes is not None:
        stamps = streams.fixes.host_t_s
        stamps = stamps if np.isfinite(stamps).any() else streams.fixes.utc_s
        span = _ends(reference) if reference.size else (float(np.nanmin(stamps)), float(np.nanmax(stamps)))
        fixes = placed_fixes(streams.fixes, span)
        reference = reference if reference.size else fixes.t_s
    times: dict[StreamName, Floats] = {
        "wheels": wheel_t_s,
        "heading": yaw_t_s,
        "fixes": none if fixes is None else fixes.t_s,
    }
    first, last = _ends(reference)
    there = {name: t for name, t in times.items() if t.size}
    apart = tuple(name for name, t in there.items() if t[-1] < first or t[0] > last)
    shared = [_ends(t) for name, t in there.items() if name not in apart]
    return Together(
        wheel_t_s=wheel_t_s,
        travel_m=travel,
        turn_rad=turn,
        yaw_t_s=yaw_t_s,
        yaw_rad=yaw,
        gyro_radps=None if heading is None else heading.gyro_z_radps,
        fixes=fixes,
        span_s=(min(one[0] for one in shared), max(one[1] for one in shared)) if shared else (0.0, 0.0),
        apart=apart,
    )


def rate(t_s: Floats, t_of: Floats, cumulative: Floats, window_s: float, longest_gap_s: float) -> Floats:
    """Change per second over ``window_s`` around each time; NaN outside the stream and where it has a gap."""
    if t_of.size < 2:
        return np.full(t_s.shape, np.nan)
    begin, end = t_s - MIDDLE_S * window_s, t_s + MIDDLE_S * window_s
    change = np.interp(end, t_of, cumulative) - np.interp(begin, t_of, cumulative)
    return np.where(there(begin, end, t_of, longest_gap_s), change / window_s, np.nan)


def there(begin_s: Floats, end_s: Floats, t_of: Floats, longest_gap_s: float) -> Bools:
    """Whether the stream covers each stretch without a gap."""
    if t_of.size < 2:
        return np.zeros(begin_s.shape, dtype=np.bool_)
    wide = np.concatenate(([0], np.cumsum(np.diff(t_of) > longest_gap_s)))
    first = np.clip(np.searchsorted(t_of, begin_s, side="right") - 1, 0, t_of.size - 1)
    last = np.clip(np.searchsorted(t_of, end_s), 0, t_of.size - 1)
    inside = (begin_s >= t_of[0]) & (end_s <= t_of[-1])
    return np.asarray(inside & (wide[last] == wide[first]))


def _ends(t_s: Floats) -> tuple[float, float]:
    return (float(t_s[0]), float(t_s[-1])) if t_s.size else (0.0, 0.0)
