"""Gates put to results: passed, failed, or skipped where the drive could not show the parameter."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sccal.errors import UsageError
from sccal.gates.expression import OPERATORS, Gate
from sccal.gates.names import Named, UnknownNameError, look_up
from sccal.results.differences import why_not_estimated
from sccal.results.gates import GateResult, Outcome
from sccal.results.saved import Saved, SavedEstimate

NUMBERS_OF_AN_ESTIMATE = ("value", "sigma")
"""Fields that mean nothing unless the parameter was estimated."""


def judge(gates: Iterable[Gate], runs: Sequence[Saved], vehicles: Sequence[Saved]) -> tuple[GateResult, ...]:
    """Every gate on every result that it asks for, gate by gate.

    A name that some results have and others lack fails on those that lack it.

    Raises:
        UsageError: a name that none of the results has, or text compared with a number.
    """
    judged: list[GateResult] = []
    for gate in gates:
        results = vehicles if gate.of_vehicle else runs
        unknown: list[tuple[Saved, UnknownNameError]] = []
        for saved in results:
            try:
                judged.append(_judged(gate, saved, look_up(saved.document, gate.name)))
            except UnknownNameError as error:
                unknown.append((saved, error))
                judged.append(_result(gate, saved, "failed", None, str(error)))
        if unknown and len(unknown) == len(results):
            raise UsageError(f'--gate "{gate.text}": {unknown[0][1]}')
    return tuple(judged)


def _judged(gate: Gate, saved: Saved, named: Named) -> GateResult:
    measured = named.value
    if gate.name == "verdict" and isinstance(measured, str):
        measured = measured.partition(":")[0]
    parameter = named.parameter
    if parameter is not None and named.field in NUMBERS_OF_AN_ESTIMATE:
        estimate = SavedEstimate(0.0, 0.0, str(parameter["status"]), str(parameter.get("reason") or ""))
        why = why_not_estimated(estimate)
        if estimate.status in ("unobserved", "held"):
            return _result(gate, saved, "skipped", None, why)
        if why:
            told = "" if measured is None else f"measured {shown(measured)}, threshold {shown(gate.threshold)}, but "
            return _result(gate, saved, "failed", measured, f"{told}{why}")
    if measured is None:
        return _result(gate, saved, "failed", None, _why_missing(gate.name, saved))
    return _compared(gate, saved, measured)


def _compared(gate: Gate, saved: Saved, measured: float | str) -> GateResult:
    if isinstance(gate.threshold, float) and isinstance(measured, float):
        kept = OPERATORS[gate.sign](measured, gate.threshold)
    elif isinstance(gate.threshold, str) and isinstance(measured, str):
        kept = (measured == gate.threshold) is (gate.sign == "==")
    else:
        kinds = ("a number", "a word") if isinstance(measured, float) else ("text", "a number")
        raise UsageError(
            f'--gate "{gate.text}": {gate.name} is {kinds[0]} ({shown(measured)} in {saved.run}) and is compared '
            f"with {kinds[1]}"
        )
    if kept:
        return _result(gate, saved, "passed", measured, "")
    told, limit = shown(measured), shown(gate.threshold)
    if told == limit and measured != gate.threshold:
        told, limit = repr(measured), repr(gate.threshold)
    return _result(gate, saved, "failed", measured, f"measured {told}, threshold {limit}")


def _why_missing(name: str, saved: Saved) -> str:
    if name.startswith("outage.") and not saved.document.get("outage", {}).get("windows"):
        return f"{name} has no value: no outage window fits into the run"
    if name.startswith("held_out.") and saved.document.get("held_out") is None:
        return f"{name} has no value: no window without fixes fits into what is left out of the fit"
    return f"{name} has no value"


def _result(gate: Gate, saved: Saved, outcome: Outcome, measured: float | str | None, reason: str) -> GateResult:
    return GateResult(saved.run, saved.vehicle, gate.text, outcome, measured, gate.threshold, reason)


def shown(value: float | str) -> str:
    """As it stands in a reason: six significant digits."""
    return value if isinstance(value, str) else f"{value:.6g}"
