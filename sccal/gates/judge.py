"""Gates put to results: passed, failed, or skipped where the drive could not show the parameter."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sccal.errors import UsageError
from sccal.gates.expression import OPERATORS, Gate
from sccal.gates.names import Named, UnknownNameError, look_up
from sccal.results.calibration import Calibrated, Calibration, Estimate, VehicleCalibration
from sccal.results.converter import document_of
from sccal.results.differences import why_not_estimated
from sccal.results.gates import GateResult, Outcome

NUMBERS_OF_AN_ESTIMATE = ("value", "sigma")
"""Fields that mean nothing unless the parameter was estimated."""


def judge(
    gates: Iterable[Gate], runs: Sequence[Calibration], vehicles: Sequence[VehicleCalibration]
) -> tuple[GateResult, ...]:
    """Every gate on every result that it asks for, gate by gate.

    A name that some results have and others lack fails on those that lack it.

    Raises:
        UsageError: a name that none of the results has, or text compared with a number.
    """
    judged: list[GateResult] = []
    of_runs, of_vehicles = ([(one, document_of(one)) for one in results] for results in (runs, vehicles))
    for gate in gates:
        results = of_vehicles if gate.of_vehicle else of_runs
        unknown: list[UnknownNameError] = []
        for result, document in results:
            try:
                judged.append(_judged(gate, result, look_up(document, gate.name)))
            except UnknownNameError as error:
                unknown.append(error)
                judged.append(_result(gate, result, "failed", None, str(error)))
        if unknown and len(unknown) == len(results):
            raise UsageError(f'--gate "{gate.text}": {unknown[0]}')
    return tuple(judged)


def _judged(gate: Gate, result: Calibrated, named: Named) -> GateResult:
    measured = result.verdict.level if gate.name == "verdict" else named.value
    parameter = named.parameter
    if parameter is not None and named.field in NUMBERS_OF_AN_ESTIMATE:
        estimate = Estimate(0.0, 0.0, parameter["status"], parameter["reason"])
        why = why_not_estimated(estimate)
        if estimate.status in ("unobserved", "held"):
            return _result(gate, result, "skipped", None, why)
        if why:
            told = "" if measured is None else f"measured {shown(measured)}, threshold {shown(gate.threshold)}, but "
            return _result(gate, result, "failed", measured, f"{told}{why}")
    if measured is None:
        return _result(gate, result, "failed", None, _why_missing(gate.name, result))
    return _compared(gate, result, measured)


def _compared(gate: Gate, result: Calibrated, measured: float | str) -> GateResult:
    if isinstance(gate.threshold, float) and isinstance(measured, float):
        kept = OPERATORS[gate.sign](measured, gate.threshold)
    elif isinstance(gate.threshold, str) and isinstance(measured, str):
        kept = (measured == gate.threshold) is (gate.sign == "==")
    else:
        kinds = ("a number", "a word") if isinstance(measured, float) else ("text", "a number")
        raise UsageError(
            f'--gate "{gate.text}": {gate.name} is {kinds[0]} ({shown(measured)} in {result.run}) and is compared '
            f"with {kinds[1]}"
        )
    if kept:
        return _result(gate, result, "passed", measured, "")
    told, limit = shown(measured), shown(gate.threshold)
    if told == limit and measured != gate.threshold:
        told, limit = repr(measured), repr(gate.threshold)
    return _result(gate, result, "failed", measured, f"measured {told}, threshold {limit}")


def _why_missing(name: str, result: Calibrated) -> str:
    if name.startswith("outage.") and not result.outage.windows:
        return f"{name} has no value: no outage window fits into the run"
    if name.startswith("held_out.") and result.held_out is None:
        return f"{name} has no value: no window without fixes fits into what is left out of the fit"
    return f"{name} has no value"


def _result(gate: Gate, result: Calibrated, outcome: Outcome, measured: float | str | None, reason: str) -> GateResult:
    return GateResult(result.run, result.vehicle.name, gate.text, outcome, measured, gate.threshold, reason)


def shown(value: float | str) -> str:
    """As it stands in a reason: six significant digits."""
    return value if isinstance(value, str) else f"{value:.6g}"
