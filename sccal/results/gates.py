"""What a batch gave and how its gates ended: all that the reports for CI are written from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from sccal.errors import Exit, Failure
from sccal.results.calibration import Calibration, VehicleCalibration

Outcome = Literal["passed", "failed", "skipped"]


@dataclass(frozen=True)
class GateResult:
    """One gate on one result."""

    run: str
    """VEHICLE_RUN where it judged the vehicle's result."""
    vehicle: str
    expression: str
    """As it was asked for; for a baseline ``drift of parameters.track_m <= 2sigma``."""
    outcome: Outcome
    measured: float | str | None
    """None where the value is missing; for a baseline the signed difference, new minus baseline."""
    threshold: float | str | None
    """For a baseline the largest difference allowed, in the parameter's unit; None where nothing could be compared."""
    reason: str
    """Why it failed or was skipped; for a baseline also what was compared with what."""


@dataclass(frozen=True)
class NoResult:
    """A run, or a path on the command line, that gave nothing."""

    run: str
    error: str
    """The kind of failure."""
    exit_code: int
    message: str


@dataclass(frozen=True)
class BatchOutcome:
    """One call of ``calibrate``, as CI sees it."""

    runs: tuple[Calibration, ...]
    """Without arrays over time."""
    vehicles: Mapping[str, VehicleCalibration]
    """By the name of the file that each stands in."""
    failures: tuple[Failure, ...]
    gates: tuple[GateResult, ...] = ()

    SCHEMA: ClassVar[str] = "sccal.batch/1"
    WRITTEN: ClassVar[str] = "exit_code runs vehicles=vehicle_results failures=no_results gates"

    @property
    def vehicle_results(self) -> tuple[VehicleCalibration, ...]:
        """The vehicles in their order."""
        return tuple(self.vehicles.values())

    @property
    def no_results(self) -> tuple[NoResult, ...]:
        """The failures in the words of a file."""
        return tuple(
            NoResult(failure.name, type(failure.error).__name__, int(failure.error.exit_code), str(failure.error))
            for failure in self.failures
        )

    @property
    def exit_code(self) -> Exit:
        """The worst failure's code, since without its result the answer is incomplete; else 1 where a gate failed."""
        if self.failures:
            return max(failure.error.exit_code for failure in self.failures)
        return Exit.GATE_FAILED if any(gate.outcome == "failed" for gate in self.gates) else Exit.FINE
