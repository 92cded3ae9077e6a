"""The forward filter judged by fixes that it never saw, where a log has them: withheld, lost, or as they were before.

The lost fixes are put back into the timeline as events that are predicted and compared but teach nothing, so that the
filter stands exactly at their times. Noise, start and final values know nothing of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sccal.align import Aligned, build_timeline
from sccal.arrays import Bools, Floats, Ints
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.outage import SETTLING_S, drift_in_window, fixes_of, run_with_outages, summarise
from sccal.filter.forward import Filter, ForwardPass
from sccal.filter.iterate import RunProblem
from sccal.results.calibration import AgainstReference, Outage

LOSSES = "the stretches whose fixes are lost or withheld; the filter knows wheels and heading there, and fixes before"
UNDISPLACED = "; judged by the fixes as they were before they were displaced"
SAME_S = 1e-3
"""Fixes of one epoch, before and after the fault, stand this near in time …"""
SAME_M = 1e-4
"""… and in place, where the fault did not displace them."""


def judged_forward(problem: RunProblem, options: CalibrationOptions) -> tuple[ForwardPass, Outage, AgainstReference]:
    """The honest forward pass of a run with a reference, its outage windows, and what the reference says."""
    aligned, lost_fixes = with_lost_fixes(problem.aligned)
    timeline = build_timeline(aligned, options.output_rate_hz, options.heading_rate_hz)
    whole = replace(problem, aligned=aligned, timeline=timeline)
    forward = whole.begun(whole.at_centre())
    lost = lost_fixes[timeline.fix_index]
    event_of = np.flatnonzero(timeline.fix_row >= 0)
    stretches = _stretches(lost)
    forward.blind = tuple((int(event_of[rows[0]]), int(event_of[rows[-1]]) + 1) for rows in stretches)
    judges, displaced = _judges(forward, aligned)
    outage = run_with_outages(forward, aligned, problem.start, options.outage_window_s, lost, judges)
    if displaced.any():
        outage = replace(outage, how=outage.how + UNDISPLACED)
    honest = forward.finish()

    fix_t = aligned.fix_t_s[timeline.fix_index]
    apart = judges - forward.output.antenna
    losses = []
    for stretch in stretches:
        rows = stretch[aligned.fix_leading[timeline.fix_index][stretch]]
        if rows.size:
            window = (float(fix_t[max(stretch[0] - 1, 0)]), float(fix_t[stretch[-1]]))
            losses.append(drift_in_window(aligned, window, fix_t[rows], apart[rows]))
    longest = max((window.end_s - window.start_s for window in losses), default=0.0)
    settled = max(problem.start.until_s, problem.start.moving_from_s + SETTLING_S)
    seen = np.sum(apart[displaced & (fix_t >= settled)] ** 2, axis=1)
    return (
        honest,
        outage,
        AgainstReference(
            losses=summarise(losses, longest, LOSSES) if losses else None,
            displaced_rms_m=float(np.sqrt(seen.mean())) if seen.size else None,
            displaced=int(displaced.sum()),
        ),
    )


def with_lost_fixes(aligned: Aligned) -> tuple[Aligned, Bools]:
    """The run with its lost fixes put back in order of time, and which of all fixes these are (f,)."""
    assert aligned.reference is not None
    fixes = aligned.reference.fixes
    back = np.flatnonzero(aligned.reference.lost)
    t_s = np.concatenate((aligned.fix_t_s, fixes.t_s[back]))
    order = np.argsort(t_s, kind="stable")
    order = order[np.concatenate(([True], np.diff(t_s[order]) > 0))]

    def both(now: Any, before: Any) -> Any:
        return np.concatenate((now, before[back]))[order]

    lost = np.concatenate((np.zeros(aligned.fix_t_s.size, dtype=np.bool_), np.ones(back.size, dtype=np.bool_)))[order]
    return (
        replace(
            aligned,
            fix_t_s=t_s[order],
            fix_east_m=both(aligned.fix_east_m, fixes.east_m),
            fix_north_m=both(aligned.fix_north_m, fixes.north_m),
            fix_quality=both(aligned.fix_quality, fixes.quality),
            fix_var_east_m2=both(aligned.fix_var_east_m2, fixes.var_east_m2),
            fix_var_north_m2=both(aligned.fix_var_north_m2, fixes.var_north_m2),
            fix_cov_m2=both(aligned.fix_cov_m2, fixes.cov_m2),
            fix_leading=both(aligned.fix_leading, aligned.reference.leading),
        ),
        lost,
    )


def _stretches(lost: Bools) -> list[Ints]:
    """Rows of each stretch of lost fixes with none between that teaches."""
    rows = np.flatnonzero(lost)
    return [part for part in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if part.size]


def _judges(forward: Filter, aligned: Aligned) -> tuple[Floats, Bools]:
    """(f, 2) where each fix of the timeline was before the fault, and which of them were displaced (f,)."""
    assert aligned.reference is not None
    judges, before = fixes_of(forward), aligned.reference.fixes
    t_s = aligned.fix_t_s[forward.timeline.fix_index]
    at = np.minimum(np.searchsorted(before.t_s, t_s - 0.5 * SAME_S), before.t_s.size - 1)
    there = np.column_stack((before.east_m[at], before.north_m[at]))
    known = np.abs(before.t_s[at] - t_s) < SAME_S
    displaced = known & (np.hypot(*(there - judges).T) > SAME_M)
    judges[known] = there[known]
    return judges, displaced
