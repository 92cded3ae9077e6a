"""From aligned runs of one vehicle to a diagnosis: the loop, what it leaves, and the story.

See sccal.diagnose.loop for how effects are found, and sccal.diagnose.criteria for what makes one a finding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sccal.align import Aligned
from sccal.arrays import Floats
from sccal.calibration.combine import pooled_drive
from sccal.calibration.held_out import Judged, how, judge
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import describe_drive
from sccal.calibration.status import judge as judge_parameters
from sccal.diagnose.criteria import ALIKE_NATS, ALIKE_SHARE, CLEARLY_LESS, LEAST_NATS
from sccal.diagnose.excitation import excitation
from sccal.diagnose.loop import Loop, Sized, need_more, run_loop, values_in
from sccal.diagnose.moved import with_moved
from sccal.diagnose.picture import picture_of
from sccal.diagnose.unexplained import unexplained
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.logged import LoggedColumn
from sccal.evidence.extension import Free, name_in
from sccal.evidence.joint import Key
from sccal.evidence.model import CONTRADICTED, Accepted, Model, Trust, refitted
from sccal.evidence.nonsense import NonsenseColumn, with_nonsense
from sccal.evidence.nuisance import sigmas_beside_small, spread_of_shapes
from sccal.evidence.posterior import PRICE_NATS, Posterior
from sccal.evidence.saturated import posterior_of
from sccal.filter.layout import OFFSET
from sccal.filter.noise import Reach
from sccal.results.calibration import Estimate, OutageWindow, Parameters
from sccal.results.diagnosis import (
    Diagnosis,
    Finding,
    Judgement,
    Placebo,
    Ranked,
)
from sccal.results.model import JudgedEffect, JudgedModel, RunNoise

BOOTSTRAP = 400
RANKED = 8
MOST_ALIASES = 6
"""Of what would explain the same, the likeliest: beyond, the drive tells hardly anything apart."""
TRUST = {
    Trust.DETAIL: (
        "noise, constants and effects estimated together from every run's innovations; measurements count by their "
        "probability of being no outliers"
    ),
    Trust.PATH: (
        "nothing may wander: fixes and wheels trusted as far as the whole path meets them, because details of these "
        "logs are wrong in ways that no noise describes"
    ),
}


@dataclass(frozen=True)
class _Told:
    """A finding on its way."""

    sized: Sized
    aliases: tuple[str, ...]
    before: Judged
    after: Judged


def diagnose(runs: Sequence[Aligned], options: CalibrationOptions) -> Diagnosis:
    """Find what the model lacks in some runs of one vehicle.

    Raises:
        DataError: where a run cannot be calibrated.
    """
    dressed, nonsense = with_nonsense(runs)
    loop = run_loop(runs, options.filter, options.heading_rate_hz)
    if loop.model.fit.misfit > CONTRADICTED:
        loop = _more_trusted(loop, runs, options)
    placebo = _chance(loop, dressed, nonsense)
    left = unexplained(loop)
    need_more(loop, placebo.highest_nats)
    before = judge(loop.first, options.outage_window_s)
    told = _steps(loop, before, options.outage_window_s)
    after = told[-1].after if told else _after(loop, before, options.outage_window_s)
    unsure = _unsure(loop)
    findings = with_moved([_finding(loop, one, unsure) for one in told], runs)
    hidden, detectable, inseparable = excitation(loop.posterior, loop.candidates, loop.kept, loop.saturated.model)
    parameters = _parameters(loop.model, runs, unsure.spread)
    return Diagnosis(
        runs=tuple(run.name for run in runs),
        vehicle=runs[0].vehicle,
        trust=TRUST[loop.model.trust],
        findings=findings,
        taken_back=dict(loop.taken_back),
        not_excited=tuple(hidden),
        detectable=tuple(detectable),
        inseparable=tuple(inseparable),
        before=_judgement(before),
        after=_judgement(after),
        held_out_how=how(loop.model),
        unexplained=left,
        placebo=placebo,
        parameters_before=_parameters(loop.first, runs),
        parameters_after=parameters,
        noises=tuple(RunNoise(p.aligned.name, p.noise) for p in loop.model.problems),
        notices=tuple(notice for run in runs for notice in run.notices),
        model=_saved(loop, runs, parameters, after, unsure),
    )


@dataclass(frozen=True)
class _Unsure:
    """What the sigmas of the model's own fit leave out."""

    beside: Mapping[Key, float]
    """Sigmas with small amounts of all other effects allowed."""
    spread: Floats
    """(G, G) what shapes add that are known only so well."""

    def sigmas(self, model: Model, keys: Sequence[Key], by_fit: Floats) -> Floats:
        """Of some parameters (k,)."""
        rows = [model.fit.places.keys.index(key) for key in keys]
        beside = np.array([self.beside.get(key, 0.0) for key in keys])
        return np.asarray(np.sqrt(np.maximum(by_fit, beside) ** 2 + np.diag(self.spread)[rows]))


def _unsure(loop: Loop) -> _Unsure:
    model = loop.model
    beside = sigmas_beside_small(model) if model.accepted else {}
    return _Unsure(beside, spread_of_shapes(model, loop.shape_sigmas))


def _more_trusted(loop: Loop, runs: Sequence[Aligned], options: CalibrationOptions) -> Loop:
    """Of two trusts in the details, that whose model drifts clearly less on data that it was not fitted to.

    Asked for only where the stretches of the log contradict the model and its noise: details are wrong there in ways
    that no noise describes, and constants fitted to them are worse than those that the whole path shows.
    """
    other = run_loop(runs, options.filter, options.heading_rate_hz, Trust.PATH)
    here, there = (judge(one.model, options.outage_window_s).outage_end_rms_m for one in (loop, other))
    if here is None or there is None:
        return loop
    return other if there < CLEARLY_LESS * here else loop


def _chance(loop: Loop, dressed: Sequence[Aligned], nonsense: Sequence[NonsenseColumn]) -> Placebo:
    """The same evidence for columns about nothing, free beside the final model: this log's own false alarms."""
    model = loop.model
    problems = tuple(replace(p, aligned=run) for p, run in zip(model.problems, dressed, strict=True))
    columns = [Accepted(Free(one)) for one in nonsense]
    full = refitted(replace(model, problems=problems), [*model.accepted, *columns], reach=None, rounds=2)
    posterior = posterior_of(full, {one.key: PRICE_NATS for one in columns})
    kept = [one.key for one in model.accepted]
    gains = [posterior.gain(one.key, kept) for one in columns]
    return Placebo(
        tried=len(columns),
        passed=sum(gain >= LEAST_NATS for gain in gains),
        highest_nats=max(gains, default=0.0),
        needed_nats=max(LEAST_NATS, *gains),
    )


def _steps(loop: Loop, before: Judged, window_s: float) -> list[_Told]:
    """The findings in the order in which the evidence adds them, each with the drift before and after it."""
    accepted: list[Accepted] = []
    steps: list[_Told] = []
    judged = before
    last = max((k for k, one in enumerate(loop.sized) if one.told), default=-1)
    for number, one in enumerate(loop.sized):
        accepted.append(one.accepted)
        if not one.told:
            continue
        # What is not told comes in with the last finding, so that the last step ends at the model.
        model = loop.model if number == last else refitted(loop.model, accepted, reach=Reach.NEAR)
        after = judge(model, window_s)
        steps.append(_Told(one, _aliases(loop, one), judged, after))
        judged = after
    return steps


def _after(loop: Loop, before: Judged, window_s: float) -> Judged:
    """The drift of a model that holds nothing worth telling."""
    return judge(loop.model, window_s) if loop.model.accepted else before


def _aliases(loop: Loop, one: Sized) -> tuple[str, ...]:
    """Other candidates that would explain the same: exchanged for it they cost next to no evidence.

    Logged columns that are a function of what the effect follows stand beside it too.
    """
    posterior, kept, key = loop.posterior, loop.kept, one.accepted.key
    rest = [name for name in kept if name != key]
    whole, allowed = posterior.evidence(kept), max(ALIKE_NATS, ALIKE_SHARE * one.worth_nats)
    losses = {name: whole - posterior.evidence([*rest, name]) for name in posterior.rows if name not in kept}
    found = [name_in(name) for name in sorted(losses, key=lambda name: losses[name]) if losses[name] < allowed]
    name = one.accepted.free.effect.name
    found += [column for column, follows in loop.candidates.shadows.items() if name in follows]
    return tuple(other for other in dict.fromkeys(found) if other != name)[:MOST_ALIASES]


def _finding(loop: Loop, told: _Told, unsure: _Unsure) -> Finding:
    one = told.sized
    free = one.accepted.free
    effect = free.effect
    parameters, per_run = _estimates(loop, one.accepted, unsure)
    advice = ""
    if told.aliases:
        beside = [CATALOGUE[name] for name in told.aliases if name in CATALOGUE]
        advice = "; ".join(dict.fromkeys(each.excited_by for each in (effect, *beside)))
    runs = range(len(loop.model.problems)) if one.accepted.run is None else [one.accepted.run]
    return Finding(
        name=effect.name,
        title=effect.title,
        reference=effect.reference,
        parameters=parameters,
        units={each.name: each.unit for each in effect.parameters},
        per_run=per_run,
        evidence_nats=one.worth_nats,
        held_out_gain_nats=one.held_out_nats,
        t=one.t,
        indistinguishable_from=told.aliases,
        advice=advice,
        ranking=_ranking(loop, one),
        drift_before_m=told.before.outage_end_rms_m,
        drift_after_m=told.after.outage_end_rms_m,
        picture=picture_of(loop.first, loop.model, free, list(runs)),
    )


def _estimates(
    loop: Loop, accepted: Accepted, unsure: _Unsure
) -> tuple[dict[str, Estimate], dict[str, tuple[Estimate, ...]]]:
    """Of an effect's parameters and shapes, and of those that every run has its own of the runs' own values."""
    parameters: dict[str, Estimate] = {}
    per_run: dict[str, tuple[Estimate, ...]] = {}
    for values, by_fit, parameter in values_in(loop.model, accepted):
        keys = [key for key in loop.model.fit.places.keys if key[:2] == (accepted.key, parameter.name)]
        honest = unsure.sigmas(loop.model, keys, by_fit)
        if values.size > 1:
            each = zip(values.tolist(), honest.tolist(), strict=True)
            per_run[parameter.name] = tuple(Estimate(value, sigma, "estimated") for value, sigma in each)
        value, sigma = _pooled(values, honest)
        parameters[parameter.name] = Estimate(value, sigma, "estimated", "", None, parameter.prior_sigma)
    of_shapes = loop.shape_sigmas.get(accepted.key, {})
    for name, shape in accepted.free.shapes.items():
        parameters[name] = Estimate(float(shape), of_shapes.get(name, float("nan")), "estimated")
    ordered = [one.name for one in accepted.free.effect.parameters if one.name in parameters]
    return {name: parameters[name] for name in ordered}, per_run


def _pooled(values: Floats, sigmas: Floats) -> tuple[float, float]:
    """One value for all runs, and its sigma, the runs' scatter included."""
    weight = 1.0 / sigmas**2
    value = float((weight * values).sum() / weight.sum())
    scatter = float(values.std(ddof=1)) if values.size > 1 else 0.0
    return value, float(np.hypot(1.0 / np.sqrt(weight.sum()), scatter / np.sqrt(values.size)))


def _ranking(loop: Loop, one: Sized) -> tuple[Ranked, ...]:
    """The best candidates at the moment when this one was added."""
    posterior = loop.posterior
    before = loop.kept[: loop.kept.index(one.accepted.key)]
    gains = sorted(
        ((posterior.gain(key, before), key) for key in posterior.rows if key not in before), key=lambda pair: -pair[0]
    )
    effects = {free.accepted.key: free.accepted.free for free in loop.sized}
    effects |= {accepted.key: accepted.free for accepted in loop.saturated.model.accepted}
    return tuple(_ranked(posterior, effects[key], key, gain, before) for gain, key in gains[:RANKED])


def _ranked(posterior: Posterior, free: Free, key: str, gain: float, before: Sequence[str]) -> Ranked:
    kept = [*before, key]
    matters = max(min(one.matters / one.prior_sigma for one in free.parameters), 1e-12)
    size = float(np.abs(posterior.of(key, kept)[0]).max()) / matters
    return Ranked(free.effect.name, free.effect.title, True, gain, posterior.t(key, kept), size)


def _judgement(judged: Judged) -> Judgement:
    return Judgement(
        windows=judged.windows,
        window_s=judged.window_s,
        outage_rms_m=judged.outage_rms_m,
        outage_end_rms_m=judged.outage_end_rms_m,
        outage_end_interval_m=_interval(judged.windows),
        gnss_innovation_rms_m=judged.gnss_innovation_rms_m,
        heading_innovation_rms_rad=judged.heading_innovation_rms_rad,
        nll_per_measurement=judged.nll_per_measurement,
    )


def _interval(windows: Sequence[OutageWindow]) -> tuple[float, float] | None:
    """90 % interval of the end drift's rms, windows drawn again with replacement."""
    if len(windows) < 3:
        return None
    squared = np.array([window.end_drift_m for window in windows]) ** 2
    rng = np.random.default_rng(0)
    drawn = squared[rng.integers(0, squared.size, (BOOTSTRAP, squared.size))].mean(axis=1)
    low, high = np.sqrt(np.quantile(drawn, [0.05, 0.95]))
    return float(low), float(high)


def _parameters(model: Model, runs: Sequence[Aligned], spread: Floats | None = None) -> Parameters:
    finals = [one.path for one in model.fit.runs]
    offsets = np.array([found.final_state[OFFSET] for found in finals])
    middle = float(np.angle(np.exp(1j * offsets).sum()))
    apart = np.angle(np.exp(1j * (offsets - middle)))
    own = float(np.mean([found.final_covariance[OFFSET, OFFSET] for found in finals]))
    scatter = float(apart.var(ddof=1)) if len(finals) > 1 else 0.0
    covariance = np.zeros((4, 4))
    covariance[:3, :3] = model.fit.robust[:3, :3] + (0.0 if spread is None else spread[:3, :3])
    covariance[3, 3] = max(own, scatter) / len(finals)
    drive = pooled_drive([describe_drive(run, float(model.fit.mode[:2].mean())) for run in runs])
    values = np.append(model.fit.mode[:3], middle + float(apart.mean()))
    return judge_parameters(values, covariance, runs[0].vehicle, model.problems[0].options, drive)


def _saved(loop: Loop, runs: Sequence[Aligned], parameters: Parameters, after: Judged, unsure: _Unsure) -> JudgedModel:
    """The model that was judged, for other commands to start from."""
    effects = []
    for one in loop.sized:
        accepted = one.accepted
        estimates, _ = _estimates(loop, accepted, unsure)
        effect = accepted.free.effect
        effects.append(
            JudgedEffect(
                name=effect.name,
                title=effect.title,
                parameters={name: each for name, each in estimates.items() if name not in accepted.free.shapes},
                units={each.name: each.unit for each in effect.parameters},
                shapes=dict(accepted.free.shapes),
                run="" if accepted.run is None else runs[accepted.run].name,
                told=one.told,
                prior_scale=accepted.free.prior_scale,
                column=effect.range if isinstance(effect, LoggedColumn) else None,
            )
        )
    return JudgedModel(
        vehicle=runs[0].vehicle.name,
        parameters=parameters,
        effects=tuple(effects),
        noises={problem.aligned.name: problem.noise for problem in loop.model.problems},
        outage_end_rms_m=after.outage_end_rms_m,
        how=how(loop.model),
    )
