"""Runs without effects, each judged by what the others say, without all of them in memory at once.

The same as ``held_out`` of several runs: constants and heading offset come from the other runs' likelihoods.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sccal.arrays import Floats
from sccal.calibration.held_out import expected_of_one_more, how_of_runs
from sccal.calibration.outage import run_with_outages, summarise
from sccal.calibration.shared import SharedLikelihood, pooled
from sccal.evidence.model import timeline_of, trust_in
from sccal.filter.iterate import At, RunProblem
from sccal.filter.layout import CONSTANTS, OFFSET, THETA
from sccal.filter.start import Constants
from sccal.results.calibration import Calibration, HeldOut, OutageWindow


@dataclass(frozen=True)
class SaidByOthers:
    """What all other runs of a vehicle say of one run's constants."""

    mode: Floats
    """(3,) R_r, R_l and L, m."""
    covariance: Floats
    """(3, 3)"""
    offset_rad: float
    offset_var_rad2: float
    """Infinite where too few runs say anything."""

    @classmethod
    def of(cls, likelihoods: Sequence[SharedLikelihood], runs: Sequence[Calibration], place: int) -> SaidByOthers:
        """For the run at ``place``."""
        fit = pooled([one for k, one in enumerate(likelihoods) if k != place])
        offsets = np.array(
            [run.parameters.heading_offset_rad.value for k, run in enumerate(runs) if k != place], dtype=np.float64
        )
        middle = float(np.angle(np.exp(1j * offsets).sum()))
        apart, variance = expected_of_one_more(np.angle(np.exp(1j * (offsets - middle))))
        return cls(fit.mode, fit.robust, middle + apart, variance)


def windows_by_others(
    problem: RunProblem, said: SaidByOthers, heading_rate_hz: float, window_s: float
) -> tuple[OutageWindow, ...]:
    """A run's windows without fixes, its constants those that the others say."""
    timeline = timeline_of(problem.aligned, heading_rate_hz, trust_in(problem.noise))
    run_problem = replace(problem, timeline=timeline, options=replace(problem.options, soft_gate=True))
    run = run_problem.begun(At(Constants.of(said.mode), np.zeros(0)), linearise_there=True)
    whole = run.belief.covariance()
    whole[CONSTANTS, CONSTANTS] = said.covariance
    x = run.belief.x
    if problem.options.with_offset and said.offset_var_rad2 < whole[OFFSET, OFFSET]:
        x[THETA] += x[OFFSET] - said.offset_rad
        x[OFFSET], whole[OFFSET, OFFSET] = said.offset_rad, said.offset_var_rad2
    run.belief = run.belief.begun(whole)
    return run_with_outages(run, problem.aligned, problem.start, window_s).windows


def held_out_of(each: Sequence[tuple[OutageWindow, ...]], window_s: float) -> HeldOut | None:
    """All runs' windows together; None where there is none."""
    found = summarise([window for windows in each for window in windows], window_s, "")
    if found.end_rms_m is None:
        return None
    return HeldOut(found.rms_m, found.end_rms_m, how_of_runs(len(each)))
