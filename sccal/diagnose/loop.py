"""The loop: score every candidate, accept the best that passes, fit again, until nothing passes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sccal.arrays import Floats
from sccal.calibration.extension import Free
from sccal.diagnose.evidence import Evidence, gather
from sccal.diagnose.held_out import Judged, judge
from sccal.diagnose.model import Accepted, Model, names_of, refitted, without_transport
from sccal.diagnose.moments import Moment, find_moments
from sccal.diagnose.parallel import each
from sccal.diagnose.placebo import Placebo
from sccal.diagnose.pool import WHOLE_RUNS, Pool, Score
from sccal.effects.effect import Effect, Parameter
from sccal.effects.patterns import PATTERNS, Pattern

MIN_HELD_OUT_NATS = 8.0
MIN_T = 4.5
MIN_PATTERN_NATS = 12.0
MIN_PATTERN_T = 5.0
MIN_MOMENT_T = 6.0
CLEARLY_BETTER_NATS = 5.0
CLEARLY_BETTER = 1.25
MANY_SHAPES = 3
"""A few waves of time or place follow anything that changes slowly or from place to place: told, never added."""
ALIAS_NATS = 3.0
ALIAS_SHARE = 0.5
ALIAS_LACK = 0.02
MAX_FINDINGS = 8
RIVAL_SHARE, MAX_RIVALS = 0.75, 2
LEVEL_NATS, LEVEL_SHARE = 5.0, 0.04
"""Likelihoods this near, in nats or in parts of the gain, do not tell two causes apart."""
KEPT_T = 3.0
HINT_NATS, HINT_T, MAX_HINTS = 3.0, 3.5, 3
MIN_SWALLOWED_NATS, FREED_NATS = 15.0, 4.0
CLEARLY_LESS = 0.9
WANDERING_RAD = np.radians(1.0)
MIN_WANDER_NATS, MIN_WANDER_T, MOST_LEFT = 3.0, 6.0, 0.5
WORSE, MUCH_WORSE = 1.02, 1.15
MUCH_LIKELIER = 0.01
"""Nats per measurement."""


@dataclass(frozen=True)
class Step:
    """One acceptance, with what was known when it was made."""

    score: Score
    free: Free
    run: int | None
    indistinguishable_from: tuple[str, ...]
    ranking: tuple[Score, ...]
    before: Judged
    after: Judged
    shape_sigmas: Mapping[str, float] = field(default_factory=dict)


@dataclass
class Loop:
    """The model as it grew."""

    first: Model
    model: Model
    first_judged: Judged
    judged: Judged
    steps: list[Step] = field(default_factory=list)
    dropped: dict[str, str] = field(default_factory=dict)
    """Candidates that passed and were taken back, and why."""
    pool: Pool | None = None
    """The evidence when nothing passed any more."""
    placebo_nats: float = 0.0
    """Largest held-out gain of a nonsense column in the last round, and how many passed the test there."""
    placebos_passed: int = 0


def evidence_of(model: Model, candidates: Sequence[Effect]) -> list[Evidence]:
    """One scoring pass per run; the time that lines take is held at zero there, for it is a candidate itself."""
    runs = range(len(model.problems))
    return each(lambda k: gather(*without_transport(model.problems[k], model.at(k)), candidates), runs)


def passes(score: Score, least_nats: float = 0.0) -> bool:
    """Whether a candidate is a finding."""
    pattern = isinstance(score.effect, Pattern)
    nats, t = (MIN_PATTERN_NATS, MIN_PATTERN_T) if pattern else (MIN_HELD_OUT_NATS, MIN_T)
    return score.held_out_nats >= max(nats, least_nats) and score.t >= t and score.size >= 1.0


def is_flexible(effect: Effect) -> bool:
    """Whether it is a pattern that could follow anything slow."""
    return isinstance(effect, Pattern) and len(effect.parameters) >= MANY_SHAPES


def chosen(ranking: Sequence[Score], least_nats: float) -> Score | None:
    """The best that passes; a pattern without a name only where no effect with one does nearly as well."""
    passing = [one for one in ranking if passes(one, least_nats) and not is_flexible(one.effect)]
    named = next((one for one in passing if not isinstance(one.effect, Pattern)), None)
    pattern = next((one for one in passing if isinstance(one.effect, Pattern)), None)
    if named is None or pattern is None:
        return named or pattern
    clearly = max(CLEARLY_BETTER * named.held_out_nats, named.held_out_nats + CLEARLY_BETTER_NATS)
    return pattern if pattern.held_out_nats > clearly else named


def aliases(pool: Pool, score: Score) -> tuple[str, ...]:
    """Other effects with a name that leave the chosen one nothing to explain."""
    name = score.effect.name
    found = []
    for other in pool.candidates:
        if other.name == name or isinstance(other, Pattern | Placebo) or not pool.rows(other.name).size:
            continue
        if pool.gain(other.name) < ALIAS_SHARE * score.held_out_nats:
            continue
        lacking = float(pool.held_out((name, other.name)).sum() - pool.held_out((other.name,), (name,)).sum())
        if lacking < max(ALIAS_NATS, ALIAS_LACK * score.held_out_nats):
            found.append(other.name)
    return tuple(found)


def run_loop(
    model: Model,
    candidates: Sequence[Effect],
    window_s: float,
    with_moments: bool = True,
    suggestions: Sequence[Score] = (),
) -> Loop:
    """Grow the model until nothing passes; suggestions are effects found under another trust in the measurements."""
    judged = judge(model, window_s)
    loop = Loop(model, model, judged, judged)
    while True:
        inside = {one.free.effect.name for one in loop.model.accepted}
        left = [effect for effect in candidates if effect.name not in inside | set(loop.dropped)]
        pool = loop.pool = Pool(evidence_of(loop.model, left), left)
        placebos = pool.placebos()
        loop.placebos_passed = sum(passes(one) for one in placebos)
        least = loop.placebo_nats = max((one.held_out_nats for one in placebos), default=0.0)
        ranking = pool.ranked()
        best = chosen([one for one in ranking if _can_be_judged(loop.model, one.effect)], least)
        moment = _best_moment(loop) if with_moments else None
        if len(loop.steps) >= MAX_FINDINGS:
            return loop
        if moment is not None and (best is None or moment.gain_nats > CLEARLY_BETTER * best.held_out_nats):
            best = _as_score(moment)
            accepted = Accepted(moment.free, moment.run)
        elif best is not None:
            accepted = Accepted(Free(best.effect))
        elif not _swallowed(loop, ranking, suggestions, least, window_s):
            return loop
        else:
            continue
        if accepted.run is None:
            passing = [one for one in ranking if passes(one, least) and _can_be_judged(loop.model, one.effect)]
            best, grown, also = _contest(loop, pool, best, passing)
            accepted = Accepted(Free(best.effect))
        else:
            grown, also = _with(loop.model, accepted, best.values), ()
        after = judge(grown, window_s)
        doubt = _doubt(loop.judged, after, grown, best.effect, accepted.run is not None)
        if doubt:
            loop.dropped[best.effect.name] = doubt
            continue
        shapes = moment.shape_sigmas if moment is not None and accepted.run is not None else {}
        loop.steps.append(Step(best, accepted.free, accepted.run, also, tuple(ranking), loop.judged, after, shapes))
        loop.model, loop.judged = grown, after
        _prune(loop, window_s)


def _prune(loop: Loop, window_s: float) -> None:
    """Take out what a later finding has made unnecessary: a drift, once the step is in that it had to imitate."""
    newest = loop.steps[-1].score.effect.name
    for step in loop.steps[:-1]:
        effect = step.score.effect
        size, t = size_in(loop.model, effect)
        if size >= 1.0 and t >= KEPT_T:
            continue
        kept = tuple(one for one in loop.model.accepted if one.free.effect.name != effect.name)
        loop.model = refitted(loop.model, kept, {})
        loop.judged = judge(loop.model, window_s)
        loop.dropped[effect.name] = f"with {newest} in the model nothing of it is left ({t:.1f} of its sigma)"
        loop.steps = [one for one in loop.steps if one.score.effect.name != effect.name]
        # The first of the remaining steps starts where the model did.
        loop.steps = [replace(one, before=loop.first_judged) if k == 0 else one for k, one in enumerate(loop.steps)]
        loop.steps[-1] = replace(loop.steps[-1], after=loop.judged)
        return


def _can_be_judged(model: Model, effect: Effect) -> bool:
    """Whether an effect may be a finding under this trust.

    Where only the whole path counts, and runs are judged by others, what belongs to each run alone says nothing to the
    judge: a clock of its own fits every run's details, which are not to be trusted there.
    """
    whole_runs = len(model.problems) >= WHOLE_RUNS
    own = any(parameter.scope == "run" for parameter in effect.parameters)
    return not (own and whole_runs and model.regime.name == "path")


def _with(model: Model, accepted: Accepted, values: Floats) -> Model:
    """The model with one more effect, refitted from first values of its parameters."""
    return refitted(model, (*model.accepted, accepted), {accepted.free.effect.name: values})


def _contest(loop: Loop, pool: Pool, best: Score, passing: Sequence[Score]) -> tuple[Score, Model, tuple[str, ...]]:
    """The best candidate against those that gain nearly as much, each refitted with the noise estimated anew.

    Scores are linear and the noise is that of a model that lacks the effect; near ties are settled by the whole
    likelihood. Where that does not tell either, the candidate whose size is least surprising is named, and the others
    are said to be indistinguishable from it.
    """
    rivals = [best]
    if not isinstance(best.effect, Pattern):
        near = [one for one in passing if one.held_out_nats > RIVAL_SHARE * best.held_out_nats]
        rivals += [one for one in near if one is not best and not isinstance(one.effect, Pattern)][:MAX_RIVALS]
    grown = [_with(loop.model, Accepted(Free(one.effect)), one.values) for one in rivals]
    if len(rivals) == 1:
        return best, grown[0], aliases(pool, best)
    gains = np.array([_nll(loop.model) - _nll(one) for one in grown])
    most = float(gains.max())
    level = [k for k in range(len(rivals)) if gains[k] > most - max(LEVEL_NATS, LEVEL_SHARE * most)]
    surprise = [_surprise(grown[k], rivals[k].effect) for k in level]
    winner = level[int(np.argmin(surprise))]
    beside = [rivals[k].effect.name for k in level if k != winner]
    also = tuple(dict.fromkeys((*beside, *aliases(pool, rivals[winner]))))
    return rivals[winner], grown[winner], also


def _surprise(model: Model, effect: Effect) -> float:
    """Squared size of an effect's parameters in units of their priors."""
    return sum(float(np.mean((values / one.prior_sigma) ** 2)) for values, _, one in values_in(model, effect))


def _swallowed(
    loop: Loop, ranking: Sequence[Score], suggestions: Sequence[Score], least_nats: float, window_s: float
) -> bool:
    """Try effects that the noise may have been taken for: with the noise estimated anew, does the run become likelier?

    A compass that drifts by 10 degrees is a compass with a slow error of 5, until the drift is in the model.
    """
    inside = {one.free.effect.name for one in loop.model.accepted}
    hinted = [one for one in suggestions if one.effect.name not in inside | set(loop.dropped)]
    promising = [one for one in ranking if one.held_out_nats > HINT_NATS and one.t > HINT_T and one.size >= 1.0]
    tried: set[str] = set()
    for score in (*hinted, *promising):
        effect = score.effect
        if isinstance(effect, Pattern) or effect.name in tried or len(tried) >= MAX_HINTS:
            continue
        if not _can_be_judged(loop.model, effect):
            continue
        tried.add(effect.name)
        accepted = Accepted(Free(effect))
        grown = _with(loop.model, accepted, score.values)
        gain = _nll(loop.model) - _nll(grown)
        size, t = size_in(grown, effect)
        # What the noise gives back when the effect is in counts as much as a likelihood that is little higher.
        needed = (
            FREED_NATS if _heading_variance(grown) < MOST_LEFT * _heading_variance(loop.model) else MIN_SWALLOWED_NATS
        )
        if gain < needed or size < 1.0 or t < MIN_T:
            continue
        after = judge(grown, window_s)
        if gain < least_nats and not _drifts_less(loop.judged, after, grown):
            continue
        if _doubt(loop.judged, after, grown, effect, False):
            continue
        found = _score_in(grown, effect, gain)
        loop.steps.append(Step(found, accepted.free, None, (), tuple(ranking), loop.judged, after))
        loop.model, loop.judged = grown, after
        return True
    return False


def wandering(loop: Loop) -> Score | None:
    """The pattern of time or place that a heading's large slow error follows, if it follows one.

    Such an error is noise to the filter, and a pattern with few bends against noise with the same bends looks like
    nothing. With the noise estimated anew beside the pattern, it is one or the other.
    """
    model = loop.model
    if max(problem.noise.heading_coloured_rad for problem in model.problems) < WANDERING_RAD:
        return None
    found: list[Score] = []
    for pattern in PATTERNS:
        if pattern.port != "heading" or not is_flexible(pattern):
            continue
        grown = _with(model, Accepted(Free(pattern)), np.zeros(len(pattern.parameters)))
        gain = _nll(model) - _nll(grown)
        size, t = size_in(grown, pattern)
        freed = _heading_variance(grown) < MOST_LEFT * _heading_variance(model)
        if gain >= MIN_WANDER_NATS and t >= MIN_WANDER_T and size >= 1.0 and freed:
            found.append(_score_in(grown, pattern, gain))
    return max(found, key=lambda one: one.gain_nats, default=None)


def _drifts_less(before: Judged, after: Judged, grown: Model) -> bool:
    """Whether whole runs left out drift clearly less: better evidence than nats that nonsense can gain too."""
    if len(grown.problems) < WHOLE_RUNS or not before.outage_end_rms_m or not after.outage_end_rms_m:
        return False
    return after.outage_end_rms_m < CLEARLY_LESS * before.outage_end_rms_m


def _score_in(model: Model, effect: Effect, gain_nats: float) -> Score:
    """An effect as a refitted model has it, found by the whole likelihood."""
    size, t = size_in(model, effect)
    inside = values_in(model, effect)
    values = np.array([float(each.mean()) for each, _, _ in inside])
    sigmas = np.array([float(each.mean()) for _, each, _ in inside])
    return Score(effect, gain_nats, gain_nats, t, values, sigmas, size)


def _heading_variance(model: Model) -> float:
    """Of the heading's slow error, rad², the runs' mean."""
    return float(np.mean([problem.noise.heading_coloured_rad**2 for problem in model.problems]))


def _nll(model: Model) -> float:
    """Negative log-likelihood of all runs, with a moderate price for noise far from its prior left out."""
    return sum(one.path.nll_heading + one.path.nll_fix for one in model.fit.runs)


def _best_moment(loop: Loop) -> Moment | None:
    """The moment or place that stands out most in any run."""

    def of_run(run: int) -> list[Moment]:
        known = [one.free.effect.name for one in loop.model.accepted if one.run == run]
        return find_moments(loop.model, run, [*known, *loop.dropped])

    of_runs = each(of_run, range(len(loop.model.problems)))
    found = [one for several in of_runs for one in several]
    good = [one for one in found if one.gain_nats >= MIN_HELD_OUT_NATS and one.t >= MIN_MOMENT_T and one.size >= 1.0]
    return max(good, key=lambda one: one.gain_nats, default=None)


def _as_score(moment: Moment) -> Score:
    gain = moment.gain_nats
    return Score(moment.free.effect, gain, gain, moment.t, moment.values, moment.sigmas, moment.size)


def _doubt(before: Judged, after: Judged, grown: Model, effect: Effect, is_moment: bool) -> str:
    """Why an effect that passed is taken back once it is in the filter; empty where it stays."""
    size, t = size_in(grown, effect)
    if size < 1.0 or t < KEPT_T:
        return f"refitted it came out at {size:.1f} of the smallest size that matters, {t:.1f} of its sigma"
    if not is_moment and before.outage_end_rms_m and after.outage_end_rms_m:
        first_m, then_m = before.outage_end_rms_m, after.outage_end_rms_m
        worse = then_m / first_m
        # Whole runs left out are a hard judge. The few windows of one run are not: there the likelihood has its say.
        likelier = before.nll_per_measurement - after.nll_per_measurement
        whole_runs = len(grown.problems) >= WHOLE_RUNS
        limit = WORSE if whole_runs or likelier < 0.0 else MUCH_WORSE if likelier < MUCH_LIKELIER else np.inf
        if worse > limit:
            return f"with it the drift without fixes grew from {first_m:.2f} to {then_m:.2f} m"
    return ""


def size_in(model: Model, effect: Effect) -> tuple[float, float]:
    """Size of an effect in a model: its largest parameter over the smallest that matters, and over its sigma."""
    size, t = 0.0, 0.0
    for value, sigma, parameter in values_in(model, effect):
        size = max(size, float(np.max(np.abs(value))) / max(parameter.matters, 1e-12))
        t = max(t, float(np.max(np.abs(value) / sigma)))
    return size, t


def values_in(model: Model, effect: Effect) -> list[tuple[Floats, Floats, Parameter]]:
    """Per free parameter of an effect: its values and sigmas, one of the vehicle's or one per run, and itself."""
    found = []
    for parameter in Free(effect).parameters:
        values, sigmas = [], []
        for k, problem in enumerate(model.problems):
            for j, name in enumerate(names_of(problem)):
                if name != (effect.name, parameter.name):
                    continue
                shared = parameter.scope == "vehicle"
                variance = model.fit.robust[3 + j, 3 + j] if shared else model.fit.runs[k].covariance[3 + j, 3 + j]
                values.append(float(model.fit.each[k][3 + j]))
                sigmas.append(float(np.sqrt(variance)))
        if parameter.scope == "vehicle":
            values, sigmas = values[:1], sigmas[:1]
        if values:
            found.append((np.array(values), np.array(sigmas), parameter))
    return found
