"""Gates on the terminal: what failed and what was skipped, then how many kept."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from sccal.report.layout import wrapped
from sccal.results.calibration import VEHICLE_RUN, Estimate
from sccal.results.differences import unit_of
from sccal.results.gates import GateResult
from sccal.results.numbers import MISSING, one_line, short, with_sigma

REASONS_SHOWN = 12
"""Lines each for gates that failed and for gates that were skipped; the rest by their number."""


def gates_text(gates: Sequence[GateResult], width: int = 100) -> str:
    """Empty where no gate was asked for."""
    if not gates:
        return ""
    lines: list[str] = []
    for outcome in ("failed", "skipped"):
        told = [gate for gate in gates if gate.outcome == outcome]
        for gate in told[:REASONS_SHOWN]:
            lines += wrapped(f"gate {outcome}: {whose(gate)}: {gate_line(gate)}", width)
        if len(told) > REASONS_SHOWN:
            lines.append(f"… and {len(told) - REASONS_SHOWN} more {outcome}")
    lines += wrapped(gates_count(gates), width)
    return "\n".join(lines) + "\n"


def gates_count(gates: Iterable[GateResult]) -> str:
    """``gates: 3 passed, 1 failed, 0 skipped``."""
    outcomes = [gate.outcome for gate in gates]
    return "gates: " + ", ".join(f"{outcomes.count(one)} {one}" for one in ("passed", "failed", "skipped"))


def gate_line(gate: GateResult) -> str:
    """One gate on one result: the reason, which tells measured and threshold, or where there is none these two."""
    told = gate.reason or f"measured {value_text(gate.measured)}, threshold {value_text(gate.threshold)}"
    return f"{gate.expression}: {told}"


def whose(gate: GateResult) -> str:
    """The run, or the vehicle by its name."""
    return f"vehicle {one_line(gate.vehicle)}" if gate.run == VEHICLE_RUN else one_line(gate.run)


def value_text(value: float | str | None) -> str:
    """A number with enough digits to tell it from a threshold; ``n/a`` where there is none."""
    if value is None:
        return MISSING
    return one_line(value) if isinstance(value, str) else short(value)


def estimate_text(name: str, estimate: Estimate) -> str:
    """``parameters.track_m 0.72836 ± 0.00088 m, nominal 0.7``."""
    text = f"{name} {with_sigma(estimate.value, estimate.sigma, unit_of(name.rpartition('.')[2]))}"
    return text if estimate.nominal is None else f"{text}, nominal {short(estimate.nominal)}"
