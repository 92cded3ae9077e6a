"""A calibration's effects with sigmas that own up to small amounts of everything else, and its model to be judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sccal.calibration.held_out import how, judge
from sccal.evidence.extension import FreeEffects, name_in
from sccal.evidence.model import CONTRADICTED, Model, Trust, bare_model, model_of, refitted
from sccal.evidence.nuisance import sigmas_beside_small
from sccal.filter.iterate import At, RunProblem
from sccal.filter.start import Constants
from sccal.results.calibration import Calibration, Estimate, HeldOut, Parameters, VehicleCalibration

Effects = Mapping[str, Mapping[str, Estimate]]


def model_of_run(calibration: Calibration, problem: RunProblem, heading_rate_hz: float) -> Model:
    """The model that one run was calibrated with."""
    return model_of([problem], [at_estimates(problem, calibration.parameters, calibration.effects)], heading_rate_hz)


def model_of_vehicle(vehicle: VehicleCalibration, problems: Sequence[RunProblem], heading_rate_hz: float) -> Model:
    """The model of all runs of a vehicle."""
    starts = [
        at_estimates(problem, vehicle.parameters, {**run.effects, **vehicle.effects})
        for problem, run in zip(problems, vehicle.runs, strict=True)
    ]
    return model_of(problems, starts, heading_rate_hz)


def judged_held_out(model: Model, window_s: float) -> HeldOut | None:
    """Drift without fixes on data that fitted neither; None where no window fits into what is left out."""
    judged = judge(model, window_s)
    if judged.outage_end_rms_m is None:
        return None
    return HeldOut(judged.outage_rms_m, judged.outage_end_rms_m, how(model))


def widened(effects: Effects, model: Model) -> Effects:
    """A calibration's effects with sigmas as wide as small amounts of all other effects leave them.

    Never below the fit's own, and with the part that no log shows. Where the log contradicts its own noise, how far
    the answer moves when only the whole path counts is part of what is not known.
    """
    if not model.accepted:
        return effects
    beside: dict[tuple[str, str], list[float]] = {}
    for (effect, parameter, _), sigma in sigmas_beside_small(model).items():
        beside.setdefault((name_in(effect), parameter), []).append(sigma)
    hidden = {
        (one.free.effect.name, parameter.name): parameter.hidden_sigma
        for one in model.accepted
        for parameter in one.free.parameters
    }

    elsewhere = _along_the_path(model) if model.fit.misfit > CONTRADICTED else {}

    def sigma_of(effect: str, parameter: str, one: Estimate) -> float:
        own = one.sigma
        if (effect, parameter) in elsewhere:
            value, sigma = elsewhere[effect, parameter]
            own = max(own, sigma, abs(value - one.value))
        if (effect, parameter) not in hidden:
            return own
        others = np.array(beside.get((effect, parameter), [0.0]))
        pooled = 0.0 if not others.all() else float(1.0 / np.sqrt((1.0 / others**2).sum()))
        return float(np.hypot(max(own, pooled), hidden[effect, parameter]))

    return {
        effect: {name: replace(one, sigma=sigma_of(effect, name, one)) for name, one in parameters.items()}
        for effect, parameters in effects.items()
    }


def _along_the_path(model: Model) -> dict[tuple[str, str], tuple[float, float]]:
    """Value and sigma of every effect's parameters if only the whole path counts, by effect and parameter."""
    options = model.problems[0].options
    bare = bare_model([one.aligned for one in model.problems], options, model.heading_rate_hz, Trust.PATH)
    fit = refitted(bare, model.accepted).fit
    sigmas = np.sqrt(np.diag(fit.all_robust))
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for (effect, name, _), value, sigma in zip(fit.places.keys, fit.values.tolist(), sigmas.tolist(), strict=True):
        found.setdefault((name_in(effect), name), []).append((value, sigma))
    return {key: (float(np.mean([v for v, _ in some])), max(s for _, s in some)) for key, some in found.items()}


def at_estimates(problem: RunProblem, parameters: Parameters, effects: Effects) -> At:
    """Where a run's passes start from some estimates; effects that these do not hold at zero."""
    constants = Constants(parameters.radius_right_m.value, parameters.radius_left_m.value, parameters.track_m.value)
    extension = problem.extension
    free = extension.parameters if isinstance(extension, FreeEffects) else ()
    known = [effects.get(effect.name, {}).get(one.name) for effect, one in free]
    values = np.array([0.0 if one is None else one.value for one in known], dtype=np.float64)
    return At(constants, values)
