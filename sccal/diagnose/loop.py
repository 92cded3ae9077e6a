"""The loop: score every candidate, accept the best that passes, fit again, until nothing passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sccal.calibration.extension import Free
from sccal.diagnose.evidence import Evidence, gather
from sccal.diagnose.held_out import Judged, judge
from sccal.diagnose.model import Accepted, Model, names_of, refitted
from sccal.diagnose.pool import Pool, Score
from sccal.effects.effect import Effect
from sccal.effects.patterns import Pattern

MIN_HELD_OUT_NATS = 8.0
MIN_T = 4.0
MIN_PATTERN_NATS = 12.0
MIN_PATTERN_T = 4.5
CLEARLY_BETTER_NATS = 5.0
CLEARLY_BETTER = 1.25
FLEXIBLE = 4.0
MANY_SHAPES = 3
"""A few waves of time or place follow anything that changes slowly or differs from place to place."""
ALIAS_NATS = 3.0
ALIAS_SHARE = 0.5
MAX_FINDINGS = 8
KEPT_T = 3.0
WORSE, MUCH_WORSE = 1.02, 1.15


@dataclass(frozen=True)
class Step:
    """One acceptance, with what was known when it was made."""

    score: Score
    indistinguishable_from: tuple[str, ...]
    ranking: tuple[Score, ...]


@dataclass
class Loop:
    """The model as it grew."""

    model: Model
    judged: Judged
    steps: list[Step] = field(default_factory=list)
    dropped: dict[str, str] = field(default_factory=dict)
    """Candidates that passed and were taken back, and why."""
    last_pool: Pool | None = None


def evidence_of(model: Model, candidates: Sequence[Effect]) -> list[Evidence]:
    """One scoring pass per run."""
    return [gather(problem, model.at(k), candidates) for k, problem in enumerate(model.problems)]


def passes(score: Score, least_nats: float) -> bool:
    """Whether a candidate is a finding."""
    pattern = isinstance(score.effect, Pattern)
    nats, t = (MIN_PATTERN_NATS, MIN_PATTERN_T) if pattern else (MIN_HELD_OUT_NATS, MIN_T)
    return score.held_out_nats >= max(nats, least_nats) and score.t >= t and score.size >= 1.0


def chosen(ranking: Sequence[Score], least_nats: float) -> Score | None:
    """The best that passes; a pattern without a name only where no effect with one does nearly as well."""
    passing = [one for one in ranking if passes(one, least_nats)]
    if not passing:
        return None
    named = next((one for one in passing if not isinstance(one.effect, Pattern)), None)
    pattern = next((one for one in passing if isinstance(one.effect, Pattern)), None)
    if named is None or pattern is None:
        return named or pattern
    return pattern if pattern.held_out_nats > clearly_better_than(named, pattern) else named


def clearly_better_than(named: Score, pattern: Score) -> float:
    """Held-out nats a pattern needs to be taken before an effect with a name: the more, the more forms it can take."""
    share = FLEXIBLE if pattern.values.size >= MANY_SHAPES else CLEARLY_BETTER
    return max(share * named.held_out_nats, named.held_out_nats + CLEARLY_BETTER_NATS)


def aliases(pool: Pool, score: Score) -> tuple[str, ...]:
    """Other effects with a name that leave the chosen one nothing to explain."""
    name = score.effect.name
    found = []
    for other in pool.candidates:
        if other.name == name or isinstance(other, Pattern) or not pool.rows(other.name).size:
            continue
        alone = float(pool.held_out(other.name).sum())
        if alone < ALIAS_SHARE * score.held_out_nats:
            continue
        if float(pool.held_out(name, other.name).sum()) - alone < ALIAS_NATS:
            found.append(other.name)
    return tuple(found)


def run_loop(
    model: Model, candidates: Sequence[Effect], least_nats: float = 0.0, window_s: float = 30.0
) -> Loop:
    """Grow the model until nothing passes."""
    loop = Loop(model, judge(model, window_s))
    while True:
        inside = {one.free.effect.name for one in loop.model.accepted}
        left = [effect for effect in candidates if effect.name not in inside | set(loop.dropped)]
        pool = Pool(evidence_of(loop.model, left), left)
        loop.last_pool = pool
        ranking = pool.ranked()
        best = chosen(ranking, least_nats)
        if best is None or len(loop.steps) >= MAX_FINDINGS:
            return loop
        step = Step(best, aliases(pool, best), tuple(ranking))
        accepted = (*loop.model.accepted, Accepted(Free(best.effect)))
        grown = refitted(loop.model, accepted, {best.effect.name: best.values})
        judged = judge(grown, window_s)
        doubt = _doubt(loop, grown, judged, best.effect)
        if doubt:
            loop.dropped[best.effect.name] = doubt
            continue
        loop.model, loop.judged = grown, judged
        loop.steps.append(step)


def _doubt(loop: Loop, grown: Model, judged: Judged, effect: Effect) -> str:
    """Why an effect that passed is taken back once it is in the filter; empty where it stays."""
    size, t = size_in(grown, effect)
    if size < 1.0 or t < KEPT_T:
        return f"refitted it came out at {size:.1f} of the smallest size that matters, {t:.1f} of its sigma"
    before, after = loop.judged, judged
    if before.outage_end_rms_m and after.outage_end_rms_m:
        worse = after.outage_end_rms_m / before.outage_end_rms_m
        if worse > MUCH_WORSE or (worse > WORSE and after.nll_per_measurement > before.nll_per_measurement):
            return f"with it the drift without fixes grew from {before.outage_end_rms_m:.2f} to {after.outage_end_rms_m:.2f} m"
    return ""


def size_in(model: Model, effect: Effect) -> tuple[float, float]:
    """Size of an effect in a model: its largest parameter over the smallest that matters, and over its sigma."""
    size, t = 0.0, 0.0
    for k, problem in enumerate(model.problems):
        for j, (name, parameter) in enumerate(names_of(problem)):
            if name != effect.name:
                continue
            one = next(p for p in effect.parameters if p.name == parameter)
            value = abs(float(model.fit.each[k][3 + j]))
            shared = 3 + j < model.fit.mode.size
            variance = model.fit.robust[3 + j, 3 + j] if shared else model.fit.runs[k].covariance[3 + j, 3 + j]
            size = max(size, value / max(one.matters, 1e-12))
            t = max(t, value / float(np.sqrt(variance)))
    return size, t


def sigma_of(model: Model, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Joint values and robust sigmas of one effect of the vehicle."""
    problem = model.problems[0]
    names = [(e.name, one.name) for e, one in problem.extension.parameters]  # type: ignore[union-attr]
    rows = [3 + k for k, (effect, _) in enumerate(names) if effect == name]
    return model.fit.each[0][rows], np.sqrt(np.diag(model.fit.robust)[[r for r in rows if r < model.fit.mode.size]])
