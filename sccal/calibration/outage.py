"""How far the robot drifts when the fixes go away, judged on stretches where they are there but withheld.

At the start of every window the forward filter is copied and runs on with wheels and heading only; its antenna is
compared with the fixes that it did not see. It has learnt from the data before the window and from nothing else; only
the noise levels, which are seven numbers a log, were estimated from the run as a whole.
"""

from __future__ import annotations

import numpy as np

from sccal.align import Aligned
from sccal.arrays import Bools, Floats, Ints
from sccal.filter.forward import Filter
from sccal.filter.start import Start
from sccal.results.calibration import Outage, OutageWindow

SETTLING_S = 20.0
MIN_FIXES = 3
MIN_COVERED = 0.8
HOW = (
    "windows laid end to end from {first:.0f} s after the first motion; in each, the filter knows wheels and heading, "
    "and of the fixes only those before the window"
)


def run_with_outages(
    run: Filter,
    aligned: Aligned,
    start: Start,
    window_s: float,
    lost: Bools | None = None,
    judges_m: Floats | None = None,
) -> Outage:
    """Run a begun filter to its end and judge it on every window on the way.

    ``lost`` (f,) marks fixes of the filter's timeline that teach nothing (Filter.blind); windows that hold one are left
    out, for there the drift would not begin at the window's start. ``judges_m`` (f, 2) are the places, east and north,
    to judge by; by default those of the fixes.
    """
    timeline = run.timeline
    known = np.ones(timeline.fix_index.size, dtype=np.bool_) if lost is None else ~lost
    judges = fixes_of(run) if judges_m is None else judges_m
    judged = aligned.fix_leading[timeline.fix_index] & known
    fix_t = aligned.fix_t_s[timeline.fix_index]
    scratch = run.make_output(with_states=False)
    scratch = scratch._replace(state=run.output.state.copy(), sigma=run.output.sigma.copy())
    settled = max(start.until_s, start.moving_from_s + SETTLING_S)
    predicted: list[tuple[float, float, Ints, Floats]] = []
    begin = settled
    while begin + window_s <= aligned.span_s[1]:
        end = begin + window_s
        inside = (fix_t > begin) & (fix_t <= end)
        rows = np.flatnonzero(inside & judged)
        first, last = np.searchsorted(timeline.t_s, [begin, end], side="right")
        run.run_to(int(first))
        covered = rows.size >= MIN_FIXES and fix_t[rows[-1]] - begin >= MIN_COVERED * window_s
        if covered and known[inside].all():
            run.outage_to(int(last), scratch)
            predicted.append((begin, end, rows, scratch.antenna[rows].copy()))
        begin = end
    run.run_to()
    outlying = isolated(~run.output.fix_ok, run.options.recover_count)
    windows = []
    for begin, end, rows, antenna in predicted:
        kept = ~outlying[rows]
        if kept.sum() >= MIN_FIXES:
            kept_rows = rows[kept]
            windows.append(drift_in_window(aligned, (begin, end), fix_t[kept_rows], judges[kept_rows] - antenna[kept]))
    return summarise(windows, window_s, HOW.format(first=settled - start.moving_from_s))


def fixes_of(run: Filter) -> Floats:
    """(f, 2) east and north of the fixes of a filter's timeline."""
    return np.column_stack((run.events.fix_east_m, run.events.fix_north_m))


def drift_in_window(aligned: Aligned, window_s: tuple[float, float], t_s: Floats, apart_m: Floats) -> OutageWindow:
    """One window's figures from its fixes' times (k,) and how far they are from the predicted antenna (k, 2)."""
    drift = np.hypot(apart_m[:, 0], apart_m[:, 1])
    return OutageWindow(
        start_s=window_s[0],
        end_s=window_s[1],
        distance_m=_travelled_m(aligned, window_s),
        rms_drift_m=float(np.sqrt(np.mean(drift**2))),
        end_drift_m=float(drift[-1]),
        t_s=t_s,
        drift_m=drift,
    )


def _travelled_m(aligned: Aligned, window_s: tuple[float, float]) -> float:
    """By the wheels, forwards and backwards alike."""
    first, last = np.searchsorted(aligned.wheel_t_s, window_s)
    rows = slice(max(int(first) - 1, 0), int(last) + 1)
    steps = np.abs(np.diff(aligned.right_rad[rows] + aligned.left_rad[rows]))
    travelled = 0.5 * aligned.vehicle.wheel_radius_m * np.concatenate(([0.0], np.cumsum(steps)))
    return float(np.diff(np.interp(window_s, aligned.wheel_t_s[rows], travelled))[0])


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
