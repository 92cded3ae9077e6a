"""Before and after, on data that fitted neither.

Several runs: each is judged by constants and effects fitted on all the others. One run: each of some stretches of time
is judged by a fit that saw nothing of it. What belongs to a run that was left out (its clock, its heading offset) the
filter learns on the way, from the data before each moment, as it would on the robot. The noise levels, seven numbers a
run, are the run's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from sccal.align import Timeline
from sccal.arrays import Floats
from sccal.calibration.outage import isolated, run_with_outages, summarise
from sccal.evidence.joint import Places, fit_jointly, names_of
from sccal.evidence.model import Model
from sccal.evidence.parallel import each_apart
from sccal.filter.forward import ForwardPass, fix_nis
from sccal.filter.iterate import At, RunProblem
from sccal.filter.layout import BASE_STATES, CONSTANTS, OFFSET, THETA
from sccal.filter.start import Constants
from sccal.results.calibration import OutageWindow

STRETCHES = 4
MIN_RUNS = 3
SETTLED_S = 20.0
ROUNDS = 3
CLIP = 25.0
"""A measurement's normalised innovation squared counts no further in the likelihood: outliers judge nothing."""


@dataclass(frozen=True)
class Judged:
    """What one model does on data that did not fit it."""

    windows: tuple[OutageWindow, ...]
    """Stretches without fixes, in the order of runs and times."""
    window_s: float
    fix_m2: Floats
    """Squared innovations of the fixes (f,), east and north together."""
    heading_rad2: Floats
    nll: Floats
    """Negative log-likelihood per scalar measurement, of every measurement."""

    @property
    def outage_rms_m(self) -> float | None:
        return summarise(list(self.windows), self.window_s, "").rms_m

    @property
    def outage_end_rms_m(self) -> float | None:
        return summarise(list(self.windows), self.window_s, "").end_rms_m

    @property
    def gnss_innovation_rms_m(self) -> float:
        return float(np.sqrt(self.fix_m2.mean())) if self.fix_m2.size else float("nan")

    @property
    def heading_innovation_rms_rad(self) -> float:
        return float(np.sqrt(self.heading_rad2.mean())) if self.heading_rad2.size else float("nan")

    @property
    def nll_per_measurement(self) -> float:
        return float(self.nll.mean()) if self.nll.size else float("nan")


def judge(model: Model, window_s: float) -> Judged:
    """Hold out every run, or every stretch of the only one, in its turn."""
    if len(model.problems) > 1:
        parts = each_apart(partial(_on_others, model, window_s), range(len(model.problems)))
    else:
        parts = each_apart(partial(_on_a_stretch, model, window_s), stretches(model.problems[0]))
    return Judged(
        windows=tuple(window for part in parts for window in part.windows),
        window_s=window_s,
        fix_m2=np.concatenate([part.fix_m2 for part in parts]),
        heading_rad2=np.concatenate([part.heading_rad2 for part in parts]),
        nll=np.concatenate([part.nll for part in parts]),
    )


def how(model: Model) -> str:
    """In words, which data judged and which fitted."""
    if len(model.problems) > 1:
        return how_of_runs(len(model.problems))
    return (
        f"each of {STRETCHES} stretches of the run judged by a fit that saw neither fixes nor headings of it; position "
        "and heading offset followed on the way, from data before each moment"
    )


def how_of_runs(count: int) -> str:
    """The same for two or more runs."""
    others = "the other" if count == 2 else f"the {count - 1} others"
    return (
        f"each of {count} runs judged by constants and effects fitted on {others}; its heading offset and clock learnt "
        "on the way, from data before each moment"
    )


def stretches(problem: RunProblem) -> list[tuple[float, float]]:
    """Equal parts of the time after settling."""
    first = max(problem.start.until_s, problem.start.moving_from_s + SETTLED_S)
    edges = np.linspace(min(first, problem.aligned.span_s[1]), problem.aligned.span_s[1], STRETCHES + 1)
    return [(float(a), float(b)) for a, b in pairwise(edges)]


def _on_others(model: Model, window_s: float, run: int) -> Judged:
    others = [k for k in range(len(model.problems)) if k != run]
    fit = fit_jointly([model.problems[k] for k in others], [model.at(k) for k in others], ROUNDS, with_stretches=True)
    problem = model.problems[run]
    size = 3 + problem.extra
    theta = np.concatenate((problem.centre.as_array(), np.zeros(problem.extra)))
    covariance = problem.prior.copy()
    # What is the vehicle's, as far as the others have it too; by name, since runs may hold different effects.
    theirs = {key: row for row, key in enumerate(fit.places.keys[: fit.places.shared])}
    mine = Places.of([problem])
    pairs = [(place, theirs[mine.keys[row]]) for place, row in enumerate(mine.of_run[0]) if mine.keys[row] in theirs]
    places, rows = (np.array(some, dtype=np.int64) for some in zip(*pairs, strict=True))
    theta[places] = fit.values[rows]
    covariance[places, :] = 0.0
    covariance[:, places] = 0.0
    covariance[np.ix_(places, places)] = fit.robust[np.ix_(rows, rows)]
    for place in np.setdiff1d(np.arange(size), places):
        values = _on_runs(model, others, run, place)
        if values.size:
            theta[place], variance = expected_of_one_more(values)
            covariance[place, place] = min(variance, covariance[place, place])
    offsets = np.array([model.path(k).final_state[OFFSET] for k in others])
    middle = float(np.angle(np.exp(1j * offsets).sum()))
    apart, variance = expected_of_one_more(np.angle(np.exp(1j * (offsets - middle))))
    return _judged(
        problem, theta, covariance, problem.aligned.span_s, window_s, model.path(run), (middle + apart, variance)
    )


def _on_runs(model: Model, others: Sequence[int], run: int, place: int) -> Floats:
    """What other runs have for a parameter of this run's own, as far as they have it."""
    wanted = names_of(model.problems[run])[place - 3]
    return np.array(
        [
            float(model.fit.each[k][3 + j])
            for k in others
            for j, name in enumerate(names_of(model.problems[k]))
            if name == wanted
        ]
    )


def expected_of_one_more(values: Floats) -> tuple[float, float]:
    """Mean and variance of one more run's value: the others' scatter, doubled where it rests on few of them."""
    count = values.size
    if count < MIN_RUNS:
        return float(values.mean()), np.inf
    return float(values.mean()), float(values.var(ddof=1)) * (1.0 + 1.0 / count) * (1.0 + 2.0 / (count - 1))


def _on_a_stretch(model: Model, window_s: float, stretch: tuple[float, float]) -> Judged:
    problem = model.problems[0]
    blind = replace(problem, timeline=without(problem.timeline, stretch))
    fit = fit_jointly([blind], [model.at(0)], ROUNDS, with_stretches=True)
    covariance = fit.all_robust
    return _judged(problem, fit.each[0], covariance, stretch, window_s, model.path(0))


def without(timeline: Timeline, stretch: tuple[float, float]) -> Timeline:
    """The timeline with the measurements of a stretch taken away."""
    inside = (timeline.t_s > stretch[0]) & (timeline.t_s <= stretch[1])
    return replace(
        timeline,
        heading_row=np.where(inside, -1, timeline.heading_row).astype(np.int32),
        fix_row=np.where(inside, -1, timeline.fix_row).astype(np.int32),
    )


def _judged(
    problem: RunProblem,
    theta: Floats,
    covariance: Floats,
    stretch: tuple[float, float],
    window_s: float,
    path: ForwardPass,
    offset: tuple[float, float] | None = None,
) -> Judged:
    """Run the filter over the whole run from the given constants, and look at the stretch.

    The path only says where the robot headed, for effects that depend on it; a blind fit's path would not know.
    ``offset`` is what other runs say of the heading offset: mean (rad) and variance (rad²).
    """
    at = At(Constants.of(theta), theta[3:], path if problem.extra else None)
    run = problem.begun(at, linearise_there=True)
    learnt = np.r_[CONSTANTS, BASE_STATES : run.states]
    whole = run.belief.covariance()
    whole[np.ix_(learnt, learnt)] = covariance
    x = run.belief.x
    if offset is not None and problem.options.with_offset and offset[1] < whole[OFFSET, OFFSET]:
        x[THETA] += x[OFFSET] - offset[0]
        x[OFFSET], whole[OFFSET, OFFSET] = offset
    run.belief = run.belief.begun(whole)
    outage = run_with_outages(run, problem.aligned, problem.start, window_s)
    windows = tuple(w for w in outage.windows if w.start_s >= stretch[0] - 1e-6 and w.end_s <= stretch[1] + 1e-6)
    out = run.output
    settled = max(stretch[0], problem.start.moving_from_s + SETTLED_S)
    fix_t = problem.aligned.fix_t_s[problem.timeline.fix_index]
    heading_t = problem.aligned.heading_t_s[problem.timeline.heading_index]
    leading = problem.aligned.fix_leading[problem.timeline.fix_index]
    fix = (fix_t > settled) & (fix_t <= stretch[1]) & leading & np.isfinite(out.fix_nu[:, 0])
    heading = (heading_t > settled) & (heading_t <= stretch[1]) & np.isfinite(out.heading_nu)
    e, n = out.fix_nu[fix].T
    d2, determinant = fix_nis(out.fix_nu[fix], out.fix_var[fix])
    nll_fix = 0.5 * (np.minimum(d2, 2.0 * CLIP) + np.log(determinant) + 2.0 * np.log(2.0 * np.pi)) / 2.0
    nu, var = out.heading_nu[heading], out.heading_var[heading]
    nll_heading = 0.5 * (np.minimum(nu**2 / var, CLIP) + np.log(2.0 * np.pi * var))
    inlying = ~isolated(d2 > 2.0 * CLIP, problem.options.recover_count)
    return Judged(
        windows=windows,
        window_s=window_s,
        fix_m2=(e**2 + n**2)[inlying],
        heading_rad2=nu**2,
        nll=np.concatenate((np.repeat(nll_fix, 2), nll_heading)),
    )
