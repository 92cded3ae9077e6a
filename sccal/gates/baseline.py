"""Results against earlier ones: has a parameter drifted further than allowed?

The baseline is a run's calibration.json, a vehicle.json or a summary.json. A run is compared with the run of the same
name and vehicle where the baseline has one, else with the vehicle's result there, else with the baseline's only run of
that vehicle; a vehicle with the vehicle's result, else with the only run. The difference is new minus baseline, its
sigma from both (see ``sccal.results.differences``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sccal.errors import DataError, UsageError
from sccal.gates.allowance import Allowance
from sccal.results.calibration import (
    CALIBRATION_SCHEMA,
    VEHICLE_RUN,
    Calibrated,
    Calibration,
    Estimate,
    VehicleCalibration,
    named_estimates,
)
from sccal.results.converter import WrongPartError, read_json, result_from
from sccal.results.differences import difference, unit_of, why_not_estimated, why_own_log_only
from sccal.results.files import SUMMARY_FILE, calibration_file, read_calibration
from sccal.results.gates import GateResult, Outcome
from sccal.results.summary import SUMMARY_SCHEMA

EARLIER = ("run", "vehicle", "parameters", "effects")
"""What a baseline needs of a summary's blocks."""


@dataclass(frozen=True)
class Earlier:
    """One result of the baseline; its estimates by dotted name, ``parameters.track_m``."""

    run: str
    """VEHICLE_RUN for the vehicle's."""
    vehicle: str
    estimates: Mapping[str, Estimate]


@dataclass(frozen=True)
class Baseline:
    """Earlier results."""

    path: Path
    results: tuple[Earlier, ...]

    def of(self, result: Calibrated) -> Earlier | str:
        """What the result is compared with, or why there is nothing."""
        same_vehicle = [one for one in self.results if one.vehicle == result.vehicle.name]
        if not same_vehicle:
            return f"the baseline has no vehicle {result.vehicle.name}"
        for wanted in (result.run, VEHICLE_RUN):
            for one in same_vehicle:
                if one.run == wanted:
                    return one
        if len(same_vehicle) == 1:
            return same_vehicle[0]
        runs = f"{len(same_vehicle)} runs of {result.vehicle.name}"
        return f"the baseline has {runs}, none of this name, and no vehicle's result"


def read_baseline(path: Path) -> Baseline:
    """A baseline from its JSON file, or from the folder that holds one; summary.json before the others there.

    Raises:
        UsageError: there is no such file or folder, or the folder holds none.
        DataError: the file is neither a calibration nor a summary.
    """
    if path.is_dir() and (path / SUMMARY_FILE).is_file():
        path /= SUMMARY_FILE
    path = calibration_file(path)
    document, schema = read_json(path, "--baseline")
    if schema == CALIBRATION_SCHEMA:
        return Baseline(path, tuple(_of_calibration(read_calibration(path))))
    if schema != SUMMARY_SCHEMA:
        raise DataError(
            f"--baseline {path}: its schema is {schema!r}; name a calibration.json, a vehicle.json "
            f"({CALIBRATION_SCHEMA}) or a summary.json ({SUMMARY_SCHEMA})"
        )
    try:
        return Baseline(path, tuple(_of_summary(document)))
    except (AttributeError, TypeError, WrongPartError) as error:
        raise DataError(f"--baseline {path}: not all of a summary is there ({error})") from error


def judge_drift(
    baseline: Baseline, allowances: Sequence[Allowance], results: Sequence[Calibrated]
) -> tuple[GateResult, ...]:
    """Every parameter of every result, of runs and of vehicles, by every allowance that is for its unit.

    A parameter that no allowance is for is skipped, once. A vehicle that is missing from the baseline is skipped.

    Raises:
        UsageError: the baseline has none of the vehicles.
    """
    theirs = sorted({one.vehicle for one in baseline.results})
    ours = sorted({result.vehicle.name for result in results})
    if ours and not set(theirs) & set(ours):
        raise UsageError(
            f"--baseline {baseline.path}: is of {', '.join(theirs) or 'no vehicle'}, the new results are of "
            f"{', '.join(ours)}; the name in vehicle.toml decides"
        )
    return tuple(judged for result in results for judged in _of_result(baseline, allowances, result))


def _of_result(baseline: Baseline, allowances: Sequence[Allowance], result: Calibrated) -> Iterator[GateResult]:
    earlier = baseline.of(result)
    if isinstance(earlier, str):
        yield GateResult(
            result.run, result.vehicle.name, f"drift from {baseline.path.name}", "skipped", None, None, earlier
        )
        return
    whose = f"vehicle {earlier.vehicle}" if earlier.run == VEHICLE_RUN else f"run {earlier.run}"
    against = f"{whose} in {baseline.path.name}"
    estimates = named_estimates(result)
    for name, now in estimates.items():
        of, _, key = name.rpartition(".")
        beside = [other.rpartition(".")[2] for other in estimates if other.rpartition(".")[0] == of]
        fitting = [one for one in allowances if not one.why_not_for(key)]
        before = earlier.estimates.get(name)
        if before is None:
            yield _skipped(result, name, allowances, f"{against} has no {name}")
        elif why := why_own_log_only(key, beside):
            yield _skipped(result, name, allowances, why)
        elif why := why_not_estimated(now):
            outcome: Outcome = "failed" if now.status == "estimated" else "skipped"
            expression = _expression(name, " and ".join(one.text for one in allowances))
            yield GateResult(result.run, result.vehicle.name, expression, outcome, None, None, why)
        elif why := why_not_estimated(before):
            yield _skipped(result, name, allowances, f"in {against}: {why}")
        elif not fitting:
            yield _skipped(
                result, name, allowances, allowances[0].why_not_for(key) if allowances else "nothing allowed"
            )
        else:
            for allowance in fitting:
                yield _judged(result, name, allowance, before, now, against)


def _judged(
    result: Calibrated, name: str, allowance: Allowance, before: Estimate, now: Estimate, against: str
) -> GateResult:
    key = name.rpartition(".")[2]
    unit = f" {unit_of(key)}" if unit_of(key) else ""
    d = difference(key, before, now)
    largest = allowance.largest(before, d)
    expression = _expression(name, allowance.text)
    if math.isnan(largest):
        why = f"no sigma to judge by, against {against}"
        return GateResult(result.run, result.vehicle.name, expression, "failed", d.amount, None, why)
    sigmas = f", {d.in_sigmas:+.1f} sigma" if math.isfinite(d.in_sigmas) else ""
    reason = (
        f"{now.value:.6g} against {before.value:.6g}{unit} of {against}: {d.amount:+.3g}{unit}{sigmas}; "
        f"allowed {largest:.3g}{unit}"
    )
    outcome: Outcome = "passed" if abs(d.amount) <= largest else "failed"
    return GateResult(result.run, result.vehicle.name, expression, outcome, d.amount, largest, reason)


def _skipped(result: Calibrated, name: str, allowances: Sequence[Allowance], why: str) -> GateResult:
    expression = _expression(name, " and ".join(one.text for one in allowances))
    return GateResult(result.run, result.vehicle.name, expression, "skipped", None, None, why)


def _expression(name: str, allowed: str) -> str:
    return f"drift of {name} <= {allowed}"


def _of_calibration(result: Calibrated) -> Iterator[Earlier]:
    yield Earlier(result.run, result.vehicle.name, named_estimates(result))
    if isinstance(result, VehicleCalibration):
        yield from (Earlier(one.run, result.vehicle.name, named_estimates(one)) for one in result.runs)


def _of_summary(document: Mapping[str, Any]) -> Iterator[Earlier]:
    """A summary's blocks have the names of a calibration's, as far as they go; a vehicle without a file has none."""
    vehicles = (one for one in document.get("vehicles", []) if one["parameters"])
    for block in (*document.get("runs", []), *({**one, "run": VEHICLE_RUN} for one in vehicles)):
        told = result_from({key: block[key] for key in EARLIER if key in block}, Calibration)
        yield Earlier(told.run, told.vehicle.name, named_estimates(told))
