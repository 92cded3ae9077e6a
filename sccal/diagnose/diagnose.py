"""From aligned runs of one vehicle to a diagnosis: two loops with different trust in the measurements, and the story.

The fine loop takes the noise as the innovations have it; small effects are found there. The path loop trusts the fixes
only as far as the whole path meets them; effects so large that the fine loop takes them for noise are found there, and
suggested to the fine loop. Of the two final models the one that drifts less on data it was not fitted to is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from sccal.align import Aligned
from sccal.arrays import Floats
from sccal.calibration.combine import pooled_drive
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.result import Estimate, OutageWindow, Parameters
from sccal.calibration.single import describe_drive
from sccal.calibration.status import judge as judge_parameters
from sccal.diagnose.confounded import confounded_sigmas, linear_effects
from sccal.diagnose.excitation import excitation
from sccal.diagnose.held_out import Judged, how
from sccal.diagnose.honest import under_other_trust
from sccal.diagnose.loop import MIN_HELD_OUT_NATS, Loop, Step, is_flexible, passes, run_loop, values_in, wandering
from sccal.diagnose.model import Model, fine_regime, first_model, path_regime
from sccal.diagnose.picture import picture_of
from sccal.diagnose.placebo import NAME as NONSENSE
from sccal.diagnose.placebo import Placebo, with_placebos
from sccal.diagnose.pool import WHOLE_RUNS, Score
from sccal.diagnose.result import Diagnosis, Finding, Judgement, Picture, Ranked, RunNoise, Unexplained
from sccal.diagnose.result import Placebo as PlaceboResult
from sccal.diagnose.unexplained import variance_fraction
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.logged import logged_effects
from sccal.effects.patterns import PATTERNS, Pattern

BETTER, CLEARLY, GROSS = 0.98, 0.75, 0.6
"""Shares of a drift: hardly better, clearly better, and what only an effect beyond all noise can bring about."""
TRANSPORT_S = 0.02
"""What no log shows of the time that its lines are under way: part of any latency's sigma."""
SECOND_ORDER = 1.5
BOOTSTRAP = 400
RANKED = 8
TRUST = {
    "fine": "noise estimated from the innovations of every run, with the findings in the model",
    "path": (
        "nothing may wander: fixes and wheels trusted as far as the whole path meets them, because details of these "
        "logs are wrong in ways that no noise describes"
    ),
}


def diagnose(runs: Sequence[Aligned], options: CalibrationOptions) -> Diagnosis:
    """Find what the model lacks in some runs of one vehicle. Raises DataError where a run cannot be calibrated."""
    dressed, placebos = with_placebos(runs)
    own = [{name: one for name, one in run.extras.items() if not name.startswith(NONSENSE)} for run in dressed]
    candidates = (*linear_effects(), *logged_effects(own), *PATTERNS, *placebos)
    window_s = options.outage_window_s

    def path_loop() -> Loop:
        return run_loop(first_model(dressed, path_regime(options.filter)), candidates, window_s, with_moments=False)

    # The first fine model waits for nothing that the path loop finds; side by side they share the cores.
    with ThreadPoolExecutor(max_workers=1) as beside:
        running = beside.submit(path_loop)
        first = first_model(dressed, fine_regime(options.filter, options.heading_rate_hz))
        path = running.result()
    suggestions = [_at_the_end(path, step) for step in path.steps if not isinstance(step.score.effect, Pattern)]
    fine = run_loop(first, candidates, window_s, suggestions=suggestions)
    return _told(_better(fine, path), runs, placebos)


def _at_the_end(loop: Loop, step: Step) -> Score:
    """A step with the values of the final model."""
    values = np.array([float(v.mean()) for v, _, _ in values_in(loop.model, step.score.effect)])
    return replace(step.score, values=values)


def _better(fine: Loop, path: Loop) -> Loop:
    """The loop whose final model drifts less; the fine one where they do alike, or where the other found nothing."""
    drift_fine, drift_path = fine.judged.outage_end_rms_m, path.judged.outage_end_rms_m
    if not path.steps or drift_fine is None or drift_path is None or drift_path > BETTER * drift_fine:
        return fine
    before = path.first_judged.outage_end_rms_m
    named = [step.score.effect.name for step in path.steps if not isinstance(step.score.effect, Pattern)]
    seen = [step.score.effect.name for step in fine.steps]
    gross = bool(named) and named[0] not in seen and before is not None and drift_path < GROSS * before
    # The few windows of one run are no judge between two kinds of trust; whole runs left out are.
    whole_runs = len(path.model.problems) >= WHOLE_RUNS
    return path if gross or (whole_runs and drift_path < CLEARLY * drift_fine) else fine


def _told(loop: Loop, runs: Sequence[Aligned], placebos: Sequence[Placebo]) -> Diagnosis:
    model = loop.model
    sigmas = confounded_sigmas(model)
    plain = [one.free.effect for one in model.accepted if not one.free.shapes]
    elsewhere = under_other_trust(model.problems, plain) if model.regime.name == "fine" else {}
    named = [s for s in loop.steps if not isinstance(s.score.effect, Pattern) and not _is_second_order(loop, s)]
    assert loop.pool is not None
    hidden, detectable, inseparable = excitation(loop.pool, [step.score.effect for step in named])
    return Diagnosis(
        runs=tuple(run.name for run in runs),
        vehicle=runs[0].vehicle,
        trust=TRUST[model.regime.name],
        findings=tuple(_finding(loop, step, sigmas, elsewhere) for step in named),
        patterns=tuple(step.score.effect.name for step in loop.steps if step not in named),
        taken_back=dict(loop.dropped),
        not_excited=tuple(hidden),
        detectable=tuple(detectable),
        inseparable=tuple(inseparable),
        before=_judgement(loop.first_judged),
        after=_judgement(loop.judged),
        held_out_how=how(model),
        unexplained=_unexplained(loop),
        placebo=PlaceboResult(
            tried=len(placebos),
            passed=loop.placebos_passed,
            highest_nats=loop.placebo_nats,
            needed_nats=max(MIN_HELD_OUT_NATS, loop.placebo_nats),
        ),
        parameters_before=_parameters(loop.first, runs),
        parameters_after=_parameters(model, runs),
        noises=tuple(RunNoise(p.aligned.name, p.noise) for p in model.problems),
        notices=tuple(notice for run in runs for notice in run.notices),
    )


def _finding(
    loop: Loop,
    step: Step,
    sigmas: dict[tuple[str, str], Floats],
    elsewhere: dict[tuple[str, str], tuple[float, float]],
) -> Finding:
    effect = step.score.effect
    parameters: dict[str, Estimate] = {}
    per_run: dict[str, tuple[Estimate, ...]] = {}
    for values, by_fit, parameter in values_in(loop.model, effect):
        honest = np.maximum(by_fit, sigmas.get((effect.name, parameter.name), by_fit))
        if step.free.shapes:
            place = [one.name for one in step.free.parameters].index(parameter.name)
            honest = np.maximum(honest, step.score.sigmas[place])
        if effect.name == "gnss_latency":
            honest = np.hypot(honest, TRANSPORT_S)
        if values.size > 1:
            each = zip(values.tolist(), honest.tolist(), strict=True)
            per_run[parameter.name] = tuple(Estimate(one, sigma, "estimated") for one, sigma in each)
        weight = 1.0 / honest**2
        value = float((weight * values).sum() / weight.sum())
        scatter = float(values.std(ddof=1)) if values.size > 1 else 0.0
        sigma = float(np.hypot(1.0 / np.sqrt(weight.sum()), scatter / np.sqrt(values.size)))
        if (effect.name, parameter.name) in elsewhere:
            other, its_sigma = elsewhere[effect.name, parameter.name]
            sigma = max(sigma, its_sigma, abs(value - other))
        parameters[parameter.name] = Estimate(value, sigma, "estimated", "", None, parameter.prior_sigma)
    for name, value in step.free.shapes.items():
        parameters[name] = Estimate(float(value), step.shape_sigmas.get(name, float("nan")), "estimated")
    units = {one.name: one.unit for one in effect.parameters}
    advice = ""
    if step.indistinguishable_from:
        beside = [CATALOGUE[name] for name in step.indistinguishable_from if name in CATALOGUE]
        advice = "; ".join(dict.fromkeys(one.excited_by for one in (effect, *beside)))
    return Finding(
        name=effect.name,
        title=effect.title,
        reference=effect.reference,
        parameters={one.name: parameters[one.name] for one in effect.parameters if one.name in parameters},
        units=units,
        per_run=per_run,
        held_out_gain_nats=step.score.held_out_nats,
        t=step.score.t,
        indistinguishable_from=step.indistinguishable_from,
        advice=advice,
        ranking=tuple(_ranked(one) for one in _with(step.ranking, step.score)[:RANKED]),
        drift_before_m=step.before.outage_end_rms_m,
        drift_after_m=step.after.outage_end_rms_m,
        picture=_picture(loop, step),
    )


def _is_second_order(loop: Loop, step: Step) -> bool:
    """Whether a second harmonic of the heading is only what a first one of its size brings along.

    A hard iron of A radians has a second harmonic of A²/2 by the compass's geometry, and none where its error is sine
    and cosine alone. The model keeps it either way; it is no second cause.
    """
    if step.score.effect.name != "soft_iron":
        return False
    first, second = (_amplitude_rad(loop.model, name) for name in ("hard_iron", "soft_iron"))
    return bool(second < SECOND_ORDER * 0.5 * first**2)


def _amplitude_rad(model: Model, name: str) -> float:
    """Of a deviation of the compass, 0 where the model has none."""
    degrees = [float(each.mean()) for each, _, _ in values_in(model, CATALOGUE[name])]
    return float(np.radians(np.linalg.norm(degrees))) if degrees else 0.0


def _with(ranking: Sequence[Score], score: Score) -> list[Score]:
    """The ranking with the chosen one in it, which a search of moments may have found elsewhere."""
    others = [one for one in ranking if one.effect.name != score.effect.name]
    return sorted([score, *others], key=lambda one: -one.held_out_nats)


def _ranked(one: Score) -> Ranked:
    pattern = isinstance(one.effect, Pattern)
    return Ranked(one.effect.name, one.effect.title, not pattern, one.held_out_nats, one.t, one.size)


def _picture(loop: Loop, step: Step) -> Picture | None:
    runs = range(len(loop.model.problems)) if step.run is None else [step.run]
    return picture_of(loop.first, loop.model, step.free, list(runs))


def _unexplained(loop: Loop) -> Unexplained:
    """The strongest pattern without a name: one that is in the model, or one that was only told."""
    steps = [step for step in loop.steps if isinstance(step.score.effect, Pattern)]
    inside = max(steps, key=lambda step: step.score.held_out_nats, default=None)
    assert loop.pool is not None
    told = next((one for one in loop.pool.ranked() if is_flexible(one.effect) and passes(one, loop.placebo_nats)), None)
    if inside is None and told is None:
        told = wandering(loop)
    if inside is None and told is None:
        return Unexplained(False)
    if inside is not None and (told is None or inside.score.held_out_nats >= told.held_out_nats):
        score, picture, values = inside.score, _picture(loop, inside), None
    else:
        assert told is not None
        score, picture, values = told, None, told.values
    pattern = score.effect
    assert isinstance(pattern, Pattern)
    fraction, size = variance_fraction(loop.model, pattern, values)
    return Unexplained(
        significant=True,
        port=pattern.port,
        depends_on=pattern.depends_on,
        variance_fraction=fraction,
        held_out_gain_nats=score.held_out_nats,
        t=score.t,
        size=size,
        picture=picture,
    )


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


def _parameters(model: Model, runs: Sequence[Aligned]) -> Parameters:
    finals = [one.path for one in model.fit.runs]
    offsets = np.array([found.final_state[6] for found in finals])
    middle = float(np.angle(np.exp(1j * offsets).sum()))
    apart = np.angle(np.exp(1j * (offsets - middle)))
    own = float(np.mean([found.final_covariance[6, 6] for found in finals]))
    scatter = float(apart.var(ddof=1)) if len(finals) > 1 else 0.0
    covariance = np.zeros((4, 4))
    covariance[:3, :3] = model.fit.robust[:3, :3]
    covariance[3, 3] = max(own, scatter) / len(finals)
    drive = pooled_drive([describe_drive(run, float(model.fit.mode[:2].mean())) for run in runs])
    values = np.append(model.fit.mode[:3], middle + float(apart.mean()))
    return judge_parameters(values, covariance, runs[0].vehicle, model.problems[0].options, drive)
