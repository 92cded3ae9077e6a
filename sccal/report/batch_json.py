"""A whole batch on standard output, for pipes: schema ``sccal.batch/1``, strict JSON."""

from __future__ import annotations

from sccal import __version__
from sccal.report.as_json import Json, strict_document
from sccal.results.gates import BatchOutcome, GateResult

SCHEMA = "sccal.batch/1"


def batch_json(outcome: BatchOutcome) -> Json:
    """``runs`` and ``vehicles`` are whole documents of ``sccal.calibration/1``, as in their files."""
    return strict_document(
        {
            "schema": SCHEMA,
            "sccal_version": __version__,
            "exit_code": int(outcome.exit_code),
            "runs": [saved.document for saved in outcome.runs],
            "vehicles": [saved.document for saved in outcome.vehicles],
            "failures": [
                {
                    "run": failure.name,
                    "error": type(failure.error).__name__,
                    "exit_code": int(failure.error.exit_code),
                    "message": str(failure.error),
                }
                for failure in outcome.failures
            ],
            "gates": [gate_block(gate) for gate in outcome.gates],
        }
    )


def gate_block(gate: GateResult) -> Json:
    """One gate on one result; ``measured`` is null where the value is missing."""
    return {
        "run": gate.run,
        "vehicle": gate.vehicle,
        "expression": gate.expression,
        "outcome": gate.outcome,
        "measured": gate.measured,
        "threshold": gate.threshold,
        "reason": gate.reason,
    }
