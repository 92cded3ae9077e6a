"""Effects that a calibration was told to estimate, with sigmas that own up to what else could be there.

Beside every other effect of the catalogue, and where fixes or heading wander in ways that no receiver and no AHRS does:
under another trust too. How far the answer moves when details no longer count is then part of what is not known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sccal.arrays import Floats
from sccal.calibration.extension import Free, FreeEffects
from sccal.calibration.joint import fit_jointly
from sccal.calibration.result import Calibration, Estimate, VehicleCalibration
from sccal.calibration.status import fixes_wander, heading_wanders
from sccal.diagnose.confounded import sigmas_beside_all
from sccal.diagnose.model import Accepted, Model, first_model, path_regime, refitted
from sccal.effects.effect import Effect
from sccal.filter.iterate import At, RunProblem
from sccal.filter.start import Constants

ROUNDS = 2

Effects = Mapping[str, Mapping[str, Estimate]]


def with_honest_effects(calibration: Calibration, problem: RunProblem) -> Calibration:
    """One run's calibration, the sigmas of its effects widened."""
    p = calibration.parameters
    constants = Constants(p.radius_right_m.value, p.radius_left_m.value, p.track_m.value)
    effects = _widened(calibration.effects, [problem], [_at(problem, constants, calibration.effects)])
    return replace(calibration, effects=effects)


def with_honest_vehicle(vehicle: VehicleCalibration, problems: Sequence[RunProblem]) -> VehicleCalibration:
    """All runs of a vehicle together, the sigmas of its effects widened."""
    p = vehicle.parameters
    constants = Constants(p.radius_right_m.value, p.radius_left_m.value, p.track_m.value)
    starts = [
        _at(problem, constants, {**run.effects, **vehicle.effects})
        for problem, run in zip(problems, vehicle.runs, strict=True)
    ]
    return replace(vehicle, effects=_widened(vehicle.effects, problems, starts))


def _at(problem: RunProblem, constants: Constants, effects: Effects) -> At:
    extension = problem.extension
    assert isinstance(extension, FreeEffects)
    return At(constants, np.array([effects[effect.name][one.name].value for effect, one in extension.parameters]))


def _widened(effects: Effects, problems: Sequence[RunProblem], starts: Sequence[At]) -> Effects:
    extension = problems[0].extension
    assert isinstance(extension, FreeEffects)
    found = [free.effect for free in extension.effects]
    fit = fit_jointly(problems, starts, ROUNDS)
    runs = [
        (problem, At(Constants.of(theta), theta[3:], one.path))
        for problem, theta, one in zip(problems, fit.each, fit.runs, strict=True)
    ]
    sigmas = sigmas_beside_all(runs, found)
    elsewhere = under_other_trust(problems, found)
    widened: dict[str, dict[str, Estimate]] = {}
    for name, parameters in effects.items():
        for parameter, one in parameters.items():
            sigma = max(one.sigma, _pooled(sigmas[name, parameter]))
            if (name, parameter) in elsewhere:
                value, other = elsewhere[name, parameter]
                sigma = max(sigma, other, abs(value - one.value))
            widened.setdefault(name, {})[parameter] = replace(one, sigma=sigma)
    return widened


def under_other_trust(
    problems: Sequence[RunProblem], found: Sequence[Effect]
) -> dict[tuple[str, str], tuple[float, float]]:
    """Value and sigma of every parameter of some effects without shapes when only the whole path counts.

    Empty where the noise is what receivers and AHRS have: then the details are to be trusted.
    """
    if not found or not any(fixes_wander(problem.noise) or heading_wanders(problem.noise) for problem in problems):
        return {}
    return _along_the_path(problems, found)


def _pooled(sigmas: Floats) -> float:
    """One sigma of what several runs have each."""
    return float(1.0 / np.sqrt((1.0 / sigmas**2).sum()))


def _along_the_path(
    problems: Sequence[RunProblem], found: Sequence[Effect]
) -> dict[tuple[str, str], tuple[float, float]]:
    """Value and sigma of every parameter when only the whole path counts."""
    base = first_model([problem.aligned for problem in problems], path_regime(problems[0].options))
    model: Model = refitted(base, [Accepted(Free(effect)) for effect in found], {})
    sigmas = sigmas_beside_all([(p, model.at(k)) for k, p in enumerate(model.problems)], found)
    values: dict[tuple[str, str], tuple[float, float]] = {}
    own = model.problems[0].extension
    assert isinstance(own, FreeEffects)
    for place, (effect, parameter) in enumerate(own.parameters):
        each = np.array([theta[3 + place] for theta in model.fit.each])
        key = (effect.name, parameter.name)
        values[key] = (float(each.mean()), _pooled(sigmas[key]))
    return values
