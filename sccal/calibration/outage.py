"""How far the robot drifts when the fixes go away, judged on stretches where they are there but withheld.

At the start of every window the forward filter is copied and runs on with wheels and heading only; its antenna is
compared with the fixes that it did not see. It has learnt from the data before the window and from nothing else; only
the noise levels, which are seven numbers a log, were estimated from the run as a whole.
"""

from __future__ import annotations

import numpy as np

from sccal.align import Aligned
from sccal.arrays import Bools, Floats, Ints
from sccal.calibration.result import Outage, OutageWindow
from sccal.filter.forward import Filter
from sccal.filter.start import Start

SETTLING_S = 20.0
MIN_FIXES = 3
MIN_COVERED = 0.8
HOW = (
    "windows laid end to end from {first:.0f} s after the first motion; in each, the filter knows wheels and heading, "
    "and of the fixes only those before the window"
)


def run_with_outages(run: Filter, aligned: Aligned, start: Start, window_s: float) -> Outage:
    """Run a begun filter to its end and judge it on every window on the way."""
    timeline, events = run.timeline, run.events
    judged = aligned.fix_leading[timeline.fix_index]
    fix_t = aligned.fix_t_s[timeline.fix_index]
    travelled = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(aligned.travel_m)))))
    scratch = run.make_output(with_states=False)
    scratch = scratch._replace(state=run.output.state.copy(), sigma=run.output.sigma.copy())
    settled = max(start.until_s, start.moving_from_s + SETTLING_S)
    predicted: list[tuple[float, float, Ints, Floats]] = []
    begin = settled
    while begin + window_s <= aligned.span_s[1]:
        end = begin + window_s
        rows = np.flatnonzero((fix_t > begin) & (fix_t <= end) & judged)
        first, last = np.searchsorted(timeline.t_s, [begin, end], side="right")
        run.run_to(int(first))
        if rows.size >= MIN_FIXES and fix_t[rows[-1]] - begin >= MIN_COVERED * window_s:
            run.outage_to(int(last), scratch)
            predicted.append((begin, end, rows, scratch.antenna[rows].copy()))
        begin = end
    run.run_to()
    outlying = isolated(~run.output.fix_ok, run.options.recover_count)
    windows = []
    for begin, end, rows, antenna in predicted:
        kept = ~outlying[rows]
        if kept.sum() < MIN_FIXES:
            continue
        seen = rows[kept]
        drift = np.hypot(events.fix_east_m[seen] - antenna[kept, 0], events.fix_north_m[seen] - antenna[kept, 1])
        distance = float(np.diff(np.interp([begin, end], aligned.wheel_t_s, travelled))[0])
        windows.append(
            OutageWindow(
                start_s=begin,
                end_s=end,
                distance_m=distance,
                rms_drift_m=float(np.sqrt(np.mean(drift**2))),
                end_drift_m=float(drift[-1]),
                t_s=fix_t[seen],
                drift_m=drift,
            )
        )
    return summarise(windows, window_s, HOW.format(first=settled - start.moving_from_s))


def isolated(rejected: Bools, too_many: int) -> Bools:
    """Rejected fixes in streaks too short to mean that the filter, not the fix, was wrong: outliers judge nothing."""
    padded = np.concatenate(([False], rejected, [False]))
    change = np.flatnonzero(np.diff(padded.astype(np.int8)))
    isolated = np.zeros(rejected.size, dtype=np.bool_)
    for first, last in zip(change[::2], change[1::2], strict=True):
        isolated[first:last] = last - first < too_many
    return isolated


def summarise(windows: list[OutageWindow], window_s: float, how: str) -> Outage:
    """Figures over all windows, of one run or of several."""
    if not windows:
        return Outage(window_s, (), None, None, None, how)
    every = np.concatenate([w.drift_m for w in windows])
    ends = np.array([w.end_drift_m for w in windows])
    distance = sum(w.distance_m for w in windows)
    return Outage(
        window_s=window_s,
        windows=tuple(windows),
        rms_m=float(np.sqrt(np.mean(every**2))),
        end_rms_m=float(np.sqrt(np.mean(ends**2))),
        percent_of_distance=float(100.0 * ends.sum() / distance) if distance > 0 else None,
        how=how,
    )
