"""One run: start, noise, the honest forward pass, and the pass linearised at its own answer.

The filter runs forward from the nominal constants first. That pass is what a robot would have learnt on the way: it
gives the history of the parameters and the outage figures. The constants themselves come from the iterated passes.
"""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from sccal.align import Aligned, align, build_timeline
from sccal.align.clocks import DAY_S, ERA_S
from sccal.arrays import Floats
from sccal.calibration.beside_small import at_estimates
from sccal.calibration.causes import find_causes
from sccal.calibration.consistency import consistency_over_time
from sccal.calibration.manoeuvres import describe_manoeuvres
from sccal.calibration.missing import look_for_missing
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.outage import run_with_outages
from sccal.calibration.reference import judged_forward
from sccal.calibration.status import effect_estimates, judge
from sccal.calibration.stretches import Stretches, compare_stretches
from sccal.calibration.unseen import unseen_parameters
from sccal.calibration.verdict import judged_run
from sccal.evidence.extension import FreeEffects
from sccal.evidence.model import Accepted, Trust, bare_model, refitted, trust_in
from sccal.filter.forward import ForwardPass, fix_nis
from sccal.filter.iterate import At, RunProblem, iterate, likeliest, reported_covariance, reported_values
from sccal.filter.noise import MISFIT_HZ, Reach, estimate_noise
from sccal.filter.start import ODD_SCALE, Constants, find_start
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.streams import Notice, Run
from sccal.results.calibration import (
    Calibration,
    Drive,
    Estimate,
    Fit,
    Fixes,
    History,
    Origin,
    Residuals,
    Trajectory,
)

SETTLED_S = 20.0
STANDING_MPS = 0.02
MANY_REJECTED = 0.05
EARLIEST_UTC_S = 946684800.0
"""2000-01-01: a clock that shows less counts from its own start."""
LATEST_UTC_S = 4102444800.0


def prepare(aligned: Aligned, options: CalibrationOptions) -> RunProblem:
    """Find the start and the noise of one aligned run. Raises DataError where that is impossible."""
    extension = options.extension(aligned)
    start, noise = find_start(aligned), options.noise_of(aligned.name)
    if noise is None and not isinstance(extension, FreeEffects):
        noise, _ = estimate_noise(aligned, start, options.filter, options.heading_rate_hz)
    elif noise is None:
        assert isinstance(extension, FreeEffects)
        # The effects come near under the noise of a model without them, and the noise is searched for beside them.
        bare = bare_model([aligned], options.filter, options.heading_rate_hz)
        accepted = [Accepted(free) for free in extension.effects]
        noise = refitted(bare, accepted, reach=Reach.FEW).problems[0].noise
    if trust_in(noise) is Trust.PATH:
        # All misfit is white in it, at the rates at which it was found.
        heading_hz, fix_hz, _ = MISFIT_HZ
        timeline = build_timeline(aligned, options.output_rate_hz, heading_hz, fix_hz)
    else:
        timeline = build_timeline(aligned, options.output_rate_hz, options.heading_rate_hz)
    return RunProblem(aligned, timeline, start, noise, options.filter, extension)


def calibrate_run(run: Run, options: CalibrationOptions) -> tuple[Calibration, RunProblem]:
    """Calibrate one run. Raises DataError where the data cannot support it.

    Returns what was found, and the problem that it solves: with measurements weighed softly, as all estimates are.
    """
    aligned = align(run, options.withhold_s)
    del run  # an hour of raw streams is not needed any more, and as large as all that follows
    problem = prepare(aligned, options)
    start = problem.start

    judged = None
    if aligned.reference is None:
        forward = problem.begun(problem.at_centre())
        outage = run_with_outages(forward, aligned, start, options.outage_window_s)
        honest = forward.finish()
    else:
        honest, outage, judged = judged_forward(problem, options)

    problem = replace(problem, options=replace(options.filter, soft_gate=True))
    learnt = reported_values(honest)
    first = [At(Constants.of(learnt), learnt[4:], honest)]
    if (model := options.model) is not None:
        judged_at = at_estimates(problem, model.parameters, {one.name: one.parameters for one in model.effects})
        first.append(replace(judged_at, path=honest))
    values, final = iterate(problem, likeliest(problem, first))
    covariance = reported_covariance(final)
    if options.filter.with_offset:
        covariance[3, 3] += _variance_of_the_level(problem)
    drive = describe_drive(aligned, float(values[:2].mean()))
    lacking = look_for_missing(problem, values, options.heading_rate_hz)
    # What is missing by name owns up to itself; a contradiction without a name is told as one.
    stretches = Stretches() if lacking.missing else compare_stretches(problem, values)
    constants = stretches.widened(lacking.widened(covariance[:4, :4]))
    return (
        judged_run(
            Calibration(
                run=aligned.name,
                vehicle=aligned.vehicle,
                with_offset=options.filter.with_offset,
                parameters=judge(values[:4], constants, aligned.vehicle, options.filter, drive),
                origin=Origin(aligned.plane.lat_deg, aligned.plane.lon_deg, aligned.plane.alt_m),
                fit=measure_fit(problem, final),
                outage=outage,
                noise=problem.noise,
                drive=drive,
                clock=aligned.clock,
                trajectory=_trajectory(final),
                history=_history(honest),
                residuals=_residuals(problem, final),
                fixes=Fixes(aligned.fix_t_s, aligned.fix_east_m, aligned.fix_north_m, aligned.fix_quality),
                notices=(*aligned.notices, *_doubts(problem, final), *stretches.notices),
                effects=_effects(problem, values[4:], covariance[4:, 4:]),
                on_the_way=_trajectory(honest),
                against_reference=judged,
                unseen=unseen_parameters(problem, values),
                started=_started(aligned),
                causes=find_causes(problem, final, values, start.moving_from_s + SETTLED_S),
                consistency=consistency_over_time(problem, final),
                manoeuvres=describe_manoeuvres(aligned, values),
                missing=lacking.missing,
            )
        ),
        problem,
    )


def _started(aligned: Aligned) -> str | None:
    """By the receiver's date or a logging clock that shows one; an era of GPS weeks too early is the receiver's."""
    start = aligned.span_s[0]
    own = start if EARLIEST_UTC_S < start < LATEST_UTC_S else None
    offset = aligned.clock.offset_at_start_s
    if offset is None or not EARLIEST_UTC_S < start - offset < LATEST_UTC_S:
        return None if own is None else utc_text(own)
    rolled_over = abs(offset) > DAY_S and abs(math.remainder(offset, ERA_S)) < DAY_S
    if rolled_over:
        return None if own is None else utc_text(own)
    return utc_text(start - offset)


def utc_text(utc_s: float) -> str:
    """Unix time as ISO 8601 in UTC, to the second."""
    return datetime.fromtimestamp(utc_s, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _effects(problem: RunProblem, values: Floats, covariance: Floats) -> dict[str, dict[str, Estimate]]:
    extension = problem.extension
    return effect_estimates(extension, values, covariance) if isinstance(extension, FreeEffects) else {}


def measure_fit(problem: RunProblem, found: ForwardPass) -> Fit:
    """Innovation figures of one pass, from SETTLED_S after the first motion on; fixes of the leading quality."""
    timeline, aligned = problem.timeline, problem.aligned
    settled = problem.start.moving_from_s + SETTLED_S
    heading = found.heading_accepted & (aligned.heading_t_s[timeline.heading_index] >= settled)
    leading = aligned.fix_leading[timeline.fix_index]
    fix = found.fix_accepted & leading & (aligned.fix_t_s[timeline.fix_index] >= settled)
    if not heading.any():
        heading = found.heading_accepted
    if not fix.any():
        fix = found.fix_accepted & leading
    return fit_of(
        found.heading_nu_rad[heading],
        found.heading_var_rad2[heading],
        found.fix_nu_m[fix],
        found.fix_var_m2[fix],
        fixes_used=int(found.fix_accepted.sum()),
        fixes_rejected=int((~found.fix_accepted).sum()),
        headings_used=int(found.heading_accepted.sum()),
        headings_rejected=int((~found.heading_accepted).sum()),
        recoveries=found.recoveries,
    )


def fit_of(heading_nu: Floats, heading_var: Floats, fix_nu: Floats, fix_var: Floats, **counts: int) -> Fit:
    """Root mean squares and normalised innovations squared of accepted measurements."""
    nis_fix, _ = fix_nis(fix_nu, fix_var)
    return Fit(
        gnss_innovation_rms_m=_rms(np.hypot(fix_nu[:, 0], fix_nu[:, 1])),
        heading_innovation_rms_rad=_rms(heading_nu),
        nis_gnss=float(nis_fix.mean() / 2.0) if nis_fix.size else float("nan"),
        nis_heading=float((heading_nu**2 / heading_var).mean()) if heading_nu.size else float("nan"),
        **counts,
    )


def describe_drive(aligned: Aligned, radius_m: float) -> Drive:
    """What the run did, by its wheels and AHRS."""
    steps = 0.5 * radius_m * (np.diff(aligned.right_rad) + np.diff(aligned.left_rad))
    seconds = np.arange(aligned.span_s[0], aligned.span_s[1], 0.5)
    travel = np.interp(seconds, aligned.wheel_t_s, np.concatenate(([0.0], np.cumsum(steps))))
    speed = np.diff(travel) / 0.5
    turn = np.diff(np.interp(seconds, aligned.heading_t_s, aligned.yaw_rad))
    # Small turns are the AHRS's noise as much as the robot's motion; the wheels must agree that it turns.
    by_wheels = np.diff(np.interp(seconds, aligned.wheel_t_s, aligned.right_rad - aligned.left_rad))
    by_wheels *= radius_m / aligned.vehicle.track_m
    turning = np.abs(by_wheels) > np.radians(1.0)
    wheels_stand = np.abs(by_wheels) < 1e-6
    return Drive(
        duration_s=aligned.span_s[1] - aligned.span_s[0],
        distance_m=float(np.abs(steps).sum()),
        reversed_m=abs(float(steps[steps < 0].sum())),
        standing_s=float(0.5 * ((np.abs(speed) < STANDING_MPS) & wheels_stand).sum()),
        max_speed_mps=float(np.abs(speed).max()) if speed.size else 0.0,
        turned_left_rad=float(turn[turning & (turn > 0)].sum()),
        turned_right_rad=abs(float(turn[turning & (turn < 0)].sum())),
    )


def _variance_of_the_level(problem: RunProblem) -> float:
    """What the heading offset's variance (rad²) lacks because the level of the AHRS's slow error is itself estimated.

    A run of n correlation times (2τ each) knows that level's variance to about 2/n of itself; the offset's share of it
    is the n-th part, and is widened by as much, as Student's distribution would.
    """
    noise = problem.noise
    first, last = problem.aligned.span_s
    count = max((last - first) / (2.0 * noise.heading_tau_s), 1.0)
    return noise.heading_coloured_rad**2 / count * (2.0 / count)


def _doubts(problem: RunProblem, found: ForwardPass) -> list[Notice]:
    """What the filter itself noticed."""
    notices = []
    for accepted, what in ((found.fix_accepted, "fixes"), (found.heading_accepted, "heading readings")):
        rejected = int((~accepted).sum())
        if rejected:
            many = rejected > MANY_REJECTED * accepted.size
            notices.append(
                Notice("filter", f"{what} rejected as outliers", rejected, "", "warning" if many else "info")
            )
    if found.recoveries:
        what = "times the measurements left the prediction for good, and the filter was opened up again"
        notices.append(Notice("filter", what, found.recoveries, "", "warning"))
    scale = problem.start.wheel_scale
    if abs(scale - 1.0) > ODD_SCALE:
        what = (
            f"sign that ticks_per_rev or wheel_radius_m is wrong: at the start the fixes move {scale:.2f} times as far "
            "as the wheels"
        )
        notices.append(Notice(VEHICLE_FILE, what, 1, "", "warning"))
    return notices


def _trajectory(found: ForwardPass) -> Trajectory:
    state, sigma = found.state, found.sigma
    return Trajectory(
        found.timeline.out_t_s, state[:, 0], state[:, 1], state[:, 2], sigma[:, 0], sigma[:, 1], sigma[:, 2]
    )


def _history(found: ForwardPass) -> History:
    state, sigma = found.state, found.sigma
    return History(found.timeline.out_t_s, *(state[:, k] for k in range(3, 7)), *(sigma[:, k] for k in range(3, 7)))


def _residuals(problem: RunProblem, found: ForwardPass) -> Residuals:
    timeline, aligned = problem.timeline, problem.aligned
    return Residuals(
        heading_t_s=aligned.heading_t_s[timeline.heading_index],
        heading_rad=found.heading_nu_rad,
        heading_sigma_rad=np.sqrt(found.heading_var_rad2),
        heading_accepted=found.heading_accepted,
        fix_t_s=aligned.fix_t_s[timeline.fix_index],
        fix_east_m=found.fix_nu_m[:, 0],
        fix_north_m=found.fix_nu_m[:, 1],
        fix_sigma_east_m=np.sqrt(found.fix_var_m2[:, 0]),
        fix_sigma_north_m=np.sqrt(found.fix_var_m2[:, 1]),
        fix_accepted=found.fix_accepted,
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")
