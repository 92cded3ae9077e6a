"""May a calibration's numbers be used? Decided from statuses and figures of fit, nothing else."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from sccal.calibration.missing import missing_in_any
from sccal.calibration.status import fixes_wander, heading_wanders
from sccal.results.calibration import (
    OFFSET_KEY,
    Calibration,
    Estimate,
    Fit,
    Missing,
    Parameters,
    VehicleCalibration,
)
from sccal.results.noise import Noise
from sccal.results.numbers import short
from sccal.results.verdict import Verdict

NIS_LOW = 0.3
NIS_HIGH = 3.0
"""Between these the stated noise explains the innovations; outside, every sigma is off by more than about √3."""
REJECTED_MOST = 0.1
"""Share of measurements that may be rejected before the accepted ones stop being the rule."""
CONSISTENCY_HIGH = 3.0
"""χ² per degree of freedom of the runs about the shared parameters."""
MISSING_NAMED = 3
"""Effects that the model lacks, in the words of a verdict; the others by their number."""


def judged_run(calibration: Calibration) -> Calibration:
    """The calibration of one run with its verdict."""
    return replace(calibration, verdict=run_verdict(calibration))


def judged_vehicle(vehicle: VehicleCalibration) -> VehicleCalibration:
    """The calibration of a vehicle with what it lacks in some run, and with its verdict."""
    vehicle = replace(vehicle, missing=missing_in_any([run.missing for run in vehicle.runs]))
    return replace(vehicle, verdict=vehicle_verdict(vehicle))


def run_verdict(calibration: Calibration) -> Verdict:
    """Of one run."""
    doubts = [
        *_missing_doubts(calibration.missing),
        *(notice.doubt for notice in calibration.notices if notice.doubt),
        *_noise_doubts(calibration.noise),
    ]
    return _verdict(calibration.parameters, calibration.fit, calibration.with_offset, doubts)


def vehicle_verdict(vehicle: VehicleCalibration) -> Verdict:
    """Of several runs taken as one problem; also asks whether they agree with each other."""
    chi2 = vehicle.consistency_chi2_per_dof
    disagreement = (
        (f"the runs disagree about the shared parameters (chi2 per dof {short(chi2, 3)})",)
        if chi2 is not None and not chi2 <= CONSISTENCY_HIGH
        else ()
    )
    missing = _missing_doubts(vehicle.missing)
    return _verdict(vehicle.parameters, vehicle.fit, vehicle.with_offset, [*missing, *disagreement])


def _verdict(parameters: Parameters, fit: Fit, with_offset: bool, further_doubts: Iterable[str]) -> Verdict:
    wanted = [(key, estimate) for key, estimate in parameters.by_key.items() if with_offset or key != OFFSET_KEY]
    doubts = [*_parameter_doubts(wanted), *_fit_doubts(fit), *further_doubts]
    lacks = [
        f"{key} {'not observed' if estimate.status == 'unobserved' else 'held'}"
        for key, estimate in wanted
        if estimate.status in ("unobserved", "held")
    ]
    if len(lacks) == len(wanted):
        doubts.append("no parameter could be estimated")
        lacks = []
    if doubts:
        return Verdict("doubtful", (*doubts, *lacks))
    if lacks:
        return Verdict("partial", tuple(lacks))
    count = {3: "three", 4: "four"}[len(wanted)]
    return Verdict("good", (f"all {count} parameters estimated, predictions consistent with the measurements",))


def _parameter_doubts(wanted: Iterable[tuple[str, Estimate]]) -> list[str]:
    doubts = []
    for key, estimate in wanted:
        if not math.isfinite(estimate.value):
            doubts.append(f"{key} has no value")
        elif estimate.status == "at_bound":
            doubts.append(f"{key} at its bound")
        elif estimate.status == "estimated" and not (math.isfinite(estimate.sigma) and estimate.sigma > 0.0):
            doubts.append(f"{key} has no sigma")
    return doubts


def _fit_doubts(fit: Fit) -> list[str]:
    doubts = []
    for what, used, rejected, nis in (
        ("fixes", fit.fixes_used, fit.fixes_rejected, fit.nis_gnss),
        ("headings", fit.headings_used, fit.headings_rejected, fit.nis_heading),
    ):
        if used + rejected == 0:
            doubts.append(f"no {what}")
            continue
        if rejected > REJECTED_MOST * (used + rejected):
            doubts.append(f"{100.0 * rejected / (used + rejected):.0f} % of the {what} rejected")
        if used and not NIS_LOW <= nis <= NIS_HIGH:
            doubts.append(f"{what} do not fit their noise (NIS {short(nis, 3)}, consistent is 1)")
    if fit.recoveries:
        times = "once" if fit.recoveries == 1 else f"{fit.recoveries} times"
        doubts.append(f"measurements left the prediction for good {times}")
    return doubts


def _missing_doubts(missing: Sequence[Missing]) -> list[str]:
    """What the constants make up for because nothing else in the model can."""
    if not missing:
        return []
    titles = [one.title for one in missing[:MISSING_NAMED]]
    rest = len(missing) - len(titles)
    more = [f"{rest} more effect{'' if rest == 1 else 's'}"] if rest else []
    *first, last = [*titles, *more]
    named = f"{', '.join(first)} and {last}" if first else last
    return [f"`sccal diagnose` would name {named}"]


def _noise_doubts(noise: Noise) -> list[str]:
    doubts = []
    if fixes_wander(noise):
        doubts.append(
            f"fixes wander by {short(noise.fix_coloured_m, 2)} m about the model, stated are "
            f"{short(noise.fix_stated_m, 2)} m: receiver, antenna place or clocks"
        )
    if heading_wanders(noise):
        wander_deg = math.degrees(noise.heading_coloured_rad)
        doubts.append(f"heading wanders by {short(wander_deg, 2)} deg about the model, more than an AHRS does")
    return doubts
