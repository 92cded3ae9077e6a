"""Several runs of one vehicle as one result: the joint fit, its judgement, and everything pooled over the runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from sccal.arrays import Floats
from sccal.calibration.outage import summarise
from sccal.calibration.status import effect_estimates, judge
from sccal.calibration.verdict import judged_vehicle
from sccal.evidence.extension import Free, FreeEffects
from sccal.evidence.joint import JointFit, fit_jointly
from sccal.filter.iterate import At, RunProblem
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants
from sccal.logs.streams import Notice
from sccal.results.calibration import Calibration, Drive, Estimate, Fit, Parameters, VehicleCalibration

INCONSISTENT = 3.0
OFFSET_OF_THE_RUN_RAD = np.radians(5.0)


def combine(runs: Sequence[Calibration], problems: Sequence[RunProblem]) -> VehicleCalibration:
    """One result for all runs of a vehicle; runs and problems belong together, one or more.

    The runs may have different effects: what belongs to one run, and columns that only some of them log.
    """
    if len(runs) == 1:
        return only_run(runs[0])
    own = [_own_values(run, problem) for run, problem in zip(runs, problems, strict=True)]
    fit = fit_jointly(problems, [At(Constants.of(theta), theta[3:]) for theta in own], with_stretches=True)
    return combined(runs, problems[0].options, fit, _shared_effects(problems, fit))


def only_run(run: Calibration) -> VehicleCalibration:
    """The vehicle's result where there is one run."""
    return judged_vehicle(
        VehicleCalibration(
            run.vehicle,
            run.with_offset,
            (run,),
            run.parameters,
            run.fit,
            run.outage,
            None,
            effects=run.effects,
            held_out=run.held_out,
        )
    )


class Answer(Protocol):
    """A joint fit's answer for the k shared parameters, R_r, R_l and L first."""

    @property
    def mode(self) -> Floats:
        """(k,)"""
        ...

    @property
    def robust(self) -> Floats:
        """(k, k) covariance with every sigma at least the runs' scatter."""
        ...

    @property
    def chi2_per_dof(self) -> float | None:
        """Disagreement of the runs."""
        ...


def combined(
    runs: Sequence[Calibration],
    options: FilterOptions,
    fit: Answer,
    effects: Mapping[str, Mapping[str, Estimate]] | None = None,
) -> VehicleCalibration:
    """One result for two or more runs, given the joint answer; of the runs no array over time is needed."""
    vehicle, chi2_per_dof = runs[0].vehicle, fit.chi2_per_dof
    offset, notices = _combined_offset(runs)
    full = np.zeros((4, 4))
    full[:3, :3] = fit.robust[:3, :3]
    full[3, 3] = offset.sigma**2
    parameters = judge(
        np.append(fit.mode[:3], offset.value), full, vehicle, options, pooled_drive([run.drive for run in runs])
    )
    if chi2_per_dof is not None and chi2_per_dof > INCONSISTENT:
        what = (
            f"runs disagree about radii and track by {np.sqrt(chi2_per_dof):.1f} times what their sigmas allow; the "
            "vehicle's sigmas are widened to their scatter, and something that the model lacks differs between runs"
        )
        notices.append(Notice("vehicle", what, len(runs), "", "warning"))
    return judged_vehicle(
        VehicleCalibration(
            vehicle=vehicle,
            with_offset=runs[0].with_offset,
            runs=tuple(runs),
            parameters=Parameters(parameters.radius_right_m, parameters.radius_left_m, parameters.track_m, offset),
            fit=_pooled_fit([run.fit for run in runs]),
            outage=summarise(
                [window for run in runs for window in run.outage.windows],
                runs[0].outage.window_s,
                runs[0].outage.how.split(" from ")[0]
                + " in every run; each judged by what its own run had learnt before it",
            ),
            consistency_chi2_per_dof=chi2_per_dof,
            notices=tuple(notices),
            effects=effects or {},
        )
    )


def _shared_effects(problems: Sequence[RunProblem], fit: JointFit) -> dict[str, dict[str, Estimate]]:
    """The vehicle's share of the effects; what belongs to runs stands in the runs' own results."""
    free: dict[str, Free] = {}
    for problem in problems:
        if isinstance(problem.extension, FreeEffects):
            free |= {one.key: one for one in problem.extension.effects if one.key not in free}
    places = {key[:2]: place for place, key in enumerate(fit.places.keys[: fit.places.shared])}
    sigmas = np.sqrt(np.diag(fit.robust))
    found: dict[str, dict[str, Estimate]] = {}
    for key, one in free.items():
        mine = [places.get((key, parameter.name)) for parameter in one.parameters]
        if all(place is None for place in mine):
            continue
        values = np.array([0.0 if place is None else fit.mode[place] for place in mine])
        spread = np.array([0.0 if place is None else sigmas[place] for place in mine])
        ((name, estimates),) = effect_estimates(FreeEffects((one,)), values, np.diag(spread**2)).items()
        of_vehicle = {parameter.name for parameter in one.effect.parameters if parameter.scope == "vehicle"}
        found[name] = {parameter: estimate for parameter, estimate in estimates.items() if parameter in of_vehicle}
    return found


def _own_values(run: Calibration, problem: RunProblem) -> Floats:
    """The run's own estimates of R_r, R_l, L and the effects' parameters (3 + m,)."""
    p = run.parameters
    effects = problem.extension.parameters if isinstance(problem.extension, FreeEffects) else ()
    return np.array(
        [
            p.radius_right_m.value,
            p.radius_left_m.value,
            p.track_m.value,
            *(run.effects[effect.name][one.name].value for effect, one in effects),
        ]
    )


def _combined_offset(runs: Sequence[Calibration]) -> tuple[Estimate, list[Notice]]:
    """The heading offset belongs to each run; their mean is the mounting's where they agree."""
    every = [run.parameters.heading_offset_rad for run in runs]
    if not runs[0].with_offset:
        return every[0], []
    # A run that does not show its own offset says nothing of whether they agree.
    offsets = [one for one in every if one.status == "estimated"]
    if not offsets:
        return min(every, key=lambda one: one.sigma), []
    if len(offsets) == 1:
        return offsets[0], []
    values = np.array([one.value for one in offsets])
    sigmas = np.array([one.sigma for one in offsets])
    middle = float(np.angle(np.exp(1j * values).sum()))
    apart = np.angle(np.exp(1j * (values - middle)))
    # Random effects: the runs' own scatter beyond their sigmas is part of what one offset for all cannot know.
    between2 = max(float(apart.var(ddof=1)) - float((sigmas**2).mean()), 0.0)
    weight = 1.0 / (sigmas**2 + between2)
    mean = middle + float((weight * apart).sum() / weight.sum())
    value = float(np.pi - (np.pi - mean) % (2.0 * np.pi))
    sigma = float(1.0 / np.sqrt(weight.sum()))
    spread = float(np.ptp(apart))
    if spread > OFFSET_OF_THE_RUN_RAD:
        reason = (
            f"the heading offset differs by up to {np.degrees(spread):.0f}° between the runs: it belongs to each run "
            "(an AHRS whose zero is set at power-up?), see the runs' own values"
        )
        return Estimate(value, max(sigma, spread), "unobserved", reason), [Notice("vehicle", reason, 1, "", "warning")]
    return Estimate(value, sigma, "estimated"), []


def pooled_drive(drives: Sequence[Drive]) -> Drive:
    """All runs' drives together."""
    return Drive(
        duration_s=sum(d.duration_s for d in drives),
        distance_m=sum(d.distance_m for d in drives),
        reversed_m=sum(d.reversed_m for d in drives),
        standing_s=sum(d.standing_s for d in drives),
        max_speed_mps=max(d.max_speed_mps for d in drives),
        turned_left_rad=sum(d.turned_left_rad for d in drives),
        turned_right_rad=sum(d.turned_right_rad for d in drives),
    )


def _pooled_fit(fits: Sequence[Fit]) -> Fit:
    """Means weighted by the number of measurements."""

    def mean(values: list[float], weights: list[int]) -> float:
        return float(np.average(values, weights=np.maximum(weights, 1)))

    used, heads = [f.fixes_used for f in fits], [f.headings_used for f in fits]
    return Fit(
        gnss_innovation_rms_m=float(np.sqrt(mean([f.gnss_innovation_rms_m**2 for f in fits], used))),
        heading_innovation_rms_rad=float(np.sqrt(mean([f.heading_innovation_rms_rad**2 for f in fits], heads))),
        nis_gnss=mean([f.nis_gnss for f in fits], used),
        nis_heading=mean([f.nis_heading for f in fits], heads),
        fixes_used=sum(used),
        fixes_rejected=sum(f.fixes_rejected for f in fits),
        headings_used=sum(heads),
        headings_rejected=sum(f.headings_rejected for f in fits),
        recoveries=sum(f.recoveries for f in fits),
    )
