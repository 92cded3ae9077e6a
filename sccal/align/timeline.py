"""One timeline of events: every encoder sample, every measurement and every output, in order of time.

The *cumulative* wheel angle is interpolated to each event's own time, so the state is predicted exactly to it. Using
the last encoder sample instead leaves the state up to one sample stale, which looks like a latency of the heading.
While the robot stands hardly anything is an event but the outputs (see standing).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sccal.align.aligned import Aligned
from sccal.align.denoise import denoised_angles
from sccal.align.standing import DITHER_M, worth_taking
from sccal.arrays import Floats, Ints, Rows

LOOSE_FRACTION = 0.25
LOOSE_FLOOR_M = 0.02
RATIO_DIGITS = 4
"""Of R_r/R_l: known so well, it leaves less turn in a straight line than slip does."""
KEPT_RATIOS = 4
ROUNDING = 0.1
"""Stamps of a 50 Hz stream rarely have a median step of exactly 0.02 s; a tenth of a step more is the same rate."""


@dataclass(frozen=True)
class Timeline:
    """n events; rows point into the aligned measurements (-1: none here)."""

    t_s: Floats
    right_rad: Floats
    """Wheel angle since the event before (n,); 0 at the first."""
    left_rad: Floats
    loose_m2: Floats
    """Extra variance of each wheel's travel since the event before (n,): gaps and counter resets."""
    heading_row: Rows
    """(n,) into Timeline.heading_index."""
    fix_row: Rows
    out_row: Rows
    heading_index: Ints
    """(h,) which of the aligned readings are used."""
    fix_index: Ints
    out_t_s: Floats
    known_clear: dict[float, tuple[Floats, Floats]] = field(default_factory=dict, compare=False, repr=False)
    """What clear_steps found last, by the ratio of the radii: every pass asks for it, and few ratios differ."""


def thin(t_s: Floats, rate_hz: float) -> Ints:
    """Indices of the readings that keep at most the given rate (every k-th where the stream is regular)."""
    if t_s.size < 2 or not np.isfinite(rate_hz):
        return np.arange(t_s.size)
    step = float(np.median(np.diff(t_s)))
    every = max(1, int(np.ceil(1.0 / (rate_hz * max(step, 1e-9)) - ROUNDING)))
    return np.arange(0, t_s.size, every)


def build_timeline(
    aligned: Aligned,
    output_rate_hz: float = 10.0,
    heading_rate_hz: float = 10.0,
    fix_rate_hz: float = 10.0,
    between_s: tuple[float, float] | None = None,
    wheel_rate_hz: float = np.inf,
) -> Timeline:
    """Events of the run, or of the part of it between two times.

    Readings of the AHRS come faster than its error changes; the ones beyond heading_rate_hz would only pretend to be
    independent, and so would those of a robot that stands. wheel_rate_hz thins the pure prediction events, for passes
    that need no fine path.
    """
    first, last = aligned.span_s
    if between_s is not None:
        first, last = max(first, between_s[0]), min(last, between_s[1])

    def chosen(t_s: Floats, rate_hz: float, *columns: Floats) -> Ints:
        index = _within(t_s, first, last, thin(t_s, rate_hz))
        taken = worth_taking(t_s[index], aligned.standing_s, first, *(column[index] for column in columns))
        return np.asarray(index[taken])

    heading_index = chosen(aligned.heading_t_s, heading_rate_hz, aligned.yaw_rad)
    fix_index = _without_held(aligned, chosen(aligned.fix_t_s, fix_rate_hz, aligned.fix_east_m, aligned.fix_north_m))
    wheel_index = chosen(aligned.wheel_t_s, wheel_rate_hz)
    heading_t, fix_t = aligned.heading_t_s[heading_index], aligned.fix_t_s[fix_index]
    out_t = np.arange(np.ceil(first * output_rate_hz), np.floor(last * output_rate_hz) + 1) / output_rate_hz
    out_t = out_t[(out_t >= first) & (out_t <= last)]

    starts_t = np.array([end for _, end in aligned.standing_s if first < end < last])
    t_s = np.unique(np.concatenate(([first, last], aligned.wheel_t_s[wheel_index], starts_t, heading_t, fix_t, out_t)))
    return Timeline(
        t_s=t_s,
        right_rad=_steps(t_s, aligned.wheel_t_s, aligned.right_rad),
        left_rad=_steps(t_s, aligned.wheel_t_s, aligned.left_rad),
        loose_m2=_steps(t_s, aligned.wheel_t_s, np.cumsum(_loose_variance(aligned))),
        heading_row=_rows(t_s, heading_t),
        fix_row=_rows(t_s, fix_t),
        out_row=_rows(t_s, out_t),
        heading_index=heading_index,
        fix_index=fix_index,
        out_t_s=out_t,
    )


def clear_steps(aligned: Aligned, timeline: Timeline, right_over_left: float) -> tuple[Floats, Floats]:
    """Right and left wheel angle from event to event (n,), without what is only slip (see denoise).

    The timeline must be one of the run. The ratio counts to its fourth digit.
    """
    ratio = round(right_over_left, RATIO_DIGITS)
    known = timeline.known_clear
    found = known.get(ratio)
    if found is None:
        found = _clear_steps(aligned, timeline, ratio)
        for old in list(known)[: -(KEPT_RATIOS - 1)]:
            known.pop(old, None)
        known[ratio] = found
    return found


def _clear_steps(aligned: Aligned, timeline: Timeline, right_over_left: float) -> tuple[Floats, Floats]:
    first = max(int(np.searchsorted(aligned.wheel_t_s, timeline.t_s[0])) - 1, 0)
    last = int(np.searchsorted(aligned.wheel_t_s, timeline.t_s[-1])) + 1
    part = slice(first, last)
    grid, right, left = denoised_angles(
        aligned.wheel_t_s[part], aligned.right_rad[part], aligned.left_rad[part], right_over_left
    )
    return _steps(timeline.t_s, grid, right), _steps(timeline.t_s, grid, left)


def _without_held(aligned: Aligned, index: Ints) -> Ints:
    """The fixes at the indices without those that repeat the one before while the robot stays where it is.

    A receiver may hold its position during a pivot or a short stop, and would seem to have no noise.
    """
    east, north = aligned.fix_east_m[index], aligned.fix_north_m[index]
    same = (np.diff(east) == 0.0) & (np.diff(north) == 0.0)
    if not same.any():
        return index
    travel = np.interp(aligned.fix_t_s[index], aligned.wheel_t_s, aligned.travel_m)
    return np.asarray(index[np.concatenate(([True], ~same | (np.abs(np.diff(travel)) > DITHER_M)))])


def _within(t_s: Floats, first: float, last: float, index: Ints) -> Ints:
    return np.asarray(index[(t_s[index] >= first) & (t_s[index] <= last)])


def _steps(t_s: Floats, sample_t_s: Floats, cumulative: Floats) -> Floats:
    """Change of a cumulative quantity from event to event (n,), 0 at the first."""
    at = np.interp(t_s, sample_t_s, cumulative)
    steps = np.empty_like(at)
    steps[0] = 0.0
    np.subtract(at[1:], at[:-1], out=steps[1:])
    return steps


def _rows(t_s: Floats, some_t_s: Floats) -> Rows:
    """For every event the row of the measurement that stands at its time, or -1."""
    rows = np.full(t_s.size, -1, dtype=np.int32)
    rows[np.searchsorted(t_s, some_t_s)] = np.arange(some_t_s.size, dtype=np.int32)
    return rows


def _loose_variance(aligned: Aligned) -> Floats:
    """Variance (m²) of each wheel's travel since the sample before, where that travel is not well known."""
    variance = np.zeros(aligned.wheel_t_s.size)
    index = np.flatnonzero(aligned.loose)
    index = index[index > 0]
    for angle in (aligned.right_rad, aligned.left_rad):
        travel = np.abs(angle[index] - angle[index - 1]) * aligned.vehicle.wheel_radius_m
        variance[index] = np.maximum(variance[index], (LOOSE_FRACTION * travel + LOOSE_FLOOR_M) ** 2)
    return variance
