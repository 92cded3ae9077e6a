"""All that the command line asks of results, read before anything is calibrated and judged after."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from sccal.errors import UsageError
from sccal.gates.allowance import Allowance, parse_allowance
from sccal.gates.baseline import Baseline, judge_drift, read_baseline
from sccal.gates.expression import Gate, parse_gates, require_effects
from sccal.gates.judge import judge
from sccal.results.calibration import Calibration, VehicleCalibration
from sccal.results.gates import GateResult

DEFAULT_DRIFT = "3sigma"
"""Allowed where a baseline is given and no --allow-drift."""


@dataclass(frozen=True)
class Asked:
    """Gates and baseline of one call."""

    gates: tuple[Gate, ...]
    baseline: Baseline | None
    allowances: tuple[Allowance, ...]

    def judge(self, runs: Sequence[Calibration], vehicles: Sequence[VehicleCalibration]) -> tuple[GateResult, ...]:
        """Gates first, then the drift of the runs, then of the vehicles.

        Raises:
            UsageError: a name that no result has, text compared with a number, or a baseline of other vehicles.
        """
        judged = judge(self.gates, runs, vehicles)
        if self.baseline is None:
            return judged
        return judged + judge_drift(self.baseline, self.allowances, (*runs, *vehicles))


def read_asked(
    gates: Sequence[str], baseline: Path | None, allow_drift: Sequence[str], effects: Collection[str]
) -> Asked:
    """What is asked, by the values of --gate, --baseline and --allow-drift; ``effects`` that will be estimated.

    The baseline is read here, so that it may be a file that the new results will replace.

    Raises:
        UsageError: a gate or an allowance cannot be read, or drift is allowed from no baseline.
        DataError: the baseline is damaged or of another schema.
    """
    parsed = parse_gates(gates)
    require_effects(parsed, effects)
    if baseline is None and allow_drift:
        raise UsageError(f"--allow-drift {allow_drift[0]}: from which results? Add --baseline previous.json")
    allowances = tuple(dict.fromkeys(parse_allowance(text) for text in allow_drift or [DEFAULT_DRIFT]))
    return Asked(parsed, None if baseline is None else read_baseline(baseline), allowances)
