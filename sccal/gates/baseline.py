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
from sccal.results.differences import difference, unit_of, why_not_estimated, why_own_log_only
from sccal.results.document import read_document
from sccal.results.gates import GateResult, Outcome
from sccal.results.saved import (
    PARAMETERS,
    SCHEMA,
    SUMMARY_FILE,
    SUMMARY_SCHEMA,
    VEHICLE_RUN,
    Json,
    Saved,
    SavedEstimate,
    read_estimate,
    read_saved,
)

_Estimates = Mapping[str, SavedEstimate]


@dataclass(frozen=True)
class Earlier:
    """One result of the baseline; its estimates by dotted name, ``parameters.track_m``."""

    run: str
    """VEHICLE_RUN for the vehicle's."""
    vehicle: str
    estimates: _Estimates


@dataclass(frozen=True)
class Baseline:
    """Earlier results."""

    path: Path
    results: tuple[Earlier, ...]

    def of(self, saved: Saved) -> Earlier | str:
        """What the result is compared with, or why there is nothing."""
        same_vehicle = [one for one in self.results if one.vehicle == saved.vehicle]
        if not same_vehicle:
            return f"the baseline has no vehicle {saved.vehicle}"
        for wanted in (saved.run, VEHICLE_RUN):
            for one in same_vehicle:
                if one.run == wanted:
                    return one
        if len(same_vehicle) == 1:
            return same_vehicle[0]
        return (
            f"the baseline has {len(same_vehicle)} runs of {saved.vehicle}, none of this name, and no vehicle's result"
        )


def read_baseline(path: Path) -> Baseline:
    """A baseline from its JSON file, or from the folder that holds one; summary.json before the others there.

    Raises:
        UsageError: there is no such file or folder, or the folder holds none.
        DataError: the file is neither a calibration nor a summary.
    """
    if path.is_dir() and (path / SUMMARY_FILE).is_file():
        path /= SUMMARY_FILE
    if not path.exists() or path.is_dir():
        saved = read_saved(path)
        return Baseline(saved.path, tuple(_of_calibration(saved)))
    document, schema = read_document(path, "--baseline")
    if schema == SCHEMA:
        return Baseline(path, tuple(_of_calibration(read_saved(path))))
    if schema != SUMMARY_SCHEMA:
        raise DataError(
            f"--baseline {path}: its schema is {schema!r}; name a calibration.json, a vehicle.json ({SCHEMA}) "
            f"or a summary.json ({SUMMARY_SCHEMA})"
        )
    try:
        results = tuple(
            Earlier(str(one.get("run", VEHICLE_RUN)), str(one["vehicle"]), _estimates(one))
            for block in ("runs", "vehicles")
            for one in document.get(block, [])
            if isinstance(one.get("parameters"), Mapping)
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"--baseline {path}: not all of a summary is there ({error!r})") from error
    return Baseline(path, results)


def judge_drift(
    baseline: Baseline, allowances: Sequence[Allowance], results: Sequence[Saved]
) -> tuple[GateResult, ...]:
    """Every parameter of every result, of runs and of vehicles, by every allowance that is for its unit.

    A parameter that no allowance is for is skipped, once. A vehicle that is missing from the baseline is skipped.

    Raises:
        UsageError: the baseline has none of the vehicles.
    """
    theirs = sorted({one.vehicle for one in baseline.results})
    ours = sorted({saved.vehicle for saved in results})
    if ours and not set(theirs) & set(ours):
        raise UsageError(
            f"--baseline {baseline.path}: is of {', '.join(theirs) or 'no vehicle'}, the new results are of "
            f"{', '.join(ours)}; the name in vehicle.toml decides"
        )
    return tuple(judged for saved in results for judged in _of_result(baseline, allowances, saved))


def _of_result(baseline: Baseline, allowances: Sequence[Allowance], saved: Saved) -> Iterator[GateResult]:
    earlier = baseline.of(saved)
    if isinstance(earlier, str):
        yield GateResult(saved.run, saved.vehicle, f"drift from {baseline.path.name}", "skipped", None, None, earlier)
        return
    whose = f"vehicle {earlier.vehicle}" if earlier.run == VEHICLE_RUN else f"run {earlier.run}"
    against = f"{whose} in {baseline.path.name}"
    estimates = _estimates(saved.document)
    for name, now in estimates.items():
        of, _, key = name.rpartition(".")
        beside = [other.rpartition(".")[2] for other in estimates if other.rpartition(".")[0] == of]
        fitting = [one for one in allowances if not one.why_not_for(key)]
        before = earlier.estimates.get(name)
        if before is None:
            yield _skipped(saved, name, allowances, f"{against} has no {name}")
        elif why := why_own_log_only(key, beside):
            yield _skipped(saved, name, allowances, why)
        elif why := why_not_estimated(now):
            outcome: Outcome = "failed" if now.status == "estimated" else "skipped"
            expression = _expression(name, " and ".join(one.text for one in allowances))
            yield GateResult(saved.run, saved.vehicle, expression, outcome, None, None, why)
        elif why := why_not_estimated(before):
            yield _skipped(saved, name, allowances, f"in {against}: {why}")
        elif not fitting:
            yield _skipped(saved, name, allowances, allowances[0].why_not_for(key) if allowances else "nothing allowed")
        else:
            for allowance in fitting:
                yield _judged(saved, name, allowance, before, now, against)


def _judged(
    saved: Saved, name: str, allowance: Allowance, before: SavedEstimate, now: SavedEstimate, against: str
) -> GateResult:
    key = name.rpartition(".")[2]
    unit = f" {unit_of(key)}" if unit_of(key) else ""
    d = difference(key, before, now)
    largest = allowance.largest(before, d)
    expression = _expression(name, allowance.text)
    if math.isnan(largest):
        why = f"no sigma to judge by, against {against}"
        return GateResult(saved.run, saved.vehicle, expression, "failed", d.amount, None, why)
    sigmas = f", {d.in_sigmas:+.1f} sigma" if math.isfinite(d.in_sigmas) else ""
    reason = (
        f"{now.value:.6g} against {before.value:.6g}{unit} of {against}: {d.amount:+.3g}{unit}{sigmas}; "
        f"allowed {largest:.3g}{unit}"
    )
    outcome: Outcome = "passed" if abs(d.amount) <= largest else "failed"
    return GateResult(saved.run, saved.vehicle, expression, outcome, d.amount, largest, reason)


def _skipped(saved: Saved, name: str, allowances: Sequence[Allowance], why: str) -> GateResult:
    expression = _expression(name, " and ".join(one.text for one in allowances))
    return GateResult(saved.run, saved.vehicle, expression, "skipped", None, None, why)


def _expression(name: str, allowed: str) -> str:
    return f"drift of {name} <= {allowed}"


def _of_calibration(saved: Saved) -> Iterator[Earlier]:
    yield Earlier(saved.run, saved.vehicle, _estimates(saved.document))
    if saved.of_vehicle:
        for one in saved.document.get("runs", []):
            yield Earlier(str(one["run"]), saved.vehicle, _estimates(one))


def _estimates(block: Json) -> _Estimates:
    """By dotted name: the four parameters, then those of effects that the block has."""
    found: dict[str, SavedEstimate] = {}
    parameters: Mapping[str, Any] = block["parameters"]
    found |= {f"parameters.{key}": read_estimate(parameters[key]) for key in PARAMETERS if key in parameters}
    for effect, named in (block.get("effects") or {}).items():
        found |= {f"effects.{effect}.{name}": read_estimate(one) for name, one in named.items()}
    return found
