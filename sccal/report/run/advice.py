"""What the verdict means for someone with a robot to run: which values to use, and what to do next."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from sccal.report.rows import Row, parameter_rows
from sccal.results.calibration import Calibration, Parameters, VehicleCalibration
from sccal.results.verdict import Verdict

Class = Literal["good", "partial", "doubtful", "unusable"]
_USABLE: tuple[str, ...] = ("estimated",)


@dataclass(frozen=True)
class Advice:
    """The verdict in words for a page."""

    level: Class
    """The verdict's level, or unusable where no parameter may be used."""
    title: str
    next_step: str


def advice_on(c: Calibration | VehicleCalibration, verdict: Verdict) -> Advice:
    """What to do with one result."""
    usable, rest = _sorted(c.parameters, c.with_offset)
    if not usable:
        reasons = _reasons(rest) or "find out why from the reasons above, then drive and log again."
        return Advice("unusable", "Unusable: no parameter may be used", f"Keep the nominal values; {reasons}")
    names = _listed(row.name for row in usable)
    if verdict.level == "good":
        return Advice(
            "good",
            "Good: these values may be used",
            f"{_deploy(usable)}, and calibrate again after tyres or load change.",
        )
    if verdict.level == "partial":
        others = _listed(row.name for row in rest)
        return Advice(
            "partial",
            f"Good in part: use {names}, not {others}",
            f"{_deploy(usable)}; what was not estimated stays nominal there. "
            f"To get {others} too: {_reasons(rest) or 'drive straight, then turn both ways, and calibrate again.'}",
        )
    if _lacks(c):
        return Advice(
            "doubtful",
            "Doubtful: the constants make up for what the model lacks",
            "The command sccal diagnose says what it is; its model.json then makes a calibration with it: "
            "sccal calibrate … --model OUT/model.json.",
        )
    return Advice(
        "doubtful",
        "Doubtful: find out why before these values are used",
        "Look into the reasons above and the figures of the residuals, mend the cause, and calibrate again. "
        "The command sccal diagnose looks for what the model lacks.",
    )


def _lacks(c: Calibration | VehicleCalibration) -> bool:
    return any(run.missing for run in c.runs) if isinstance(c, VehicleCalibration) else bool(c.missing)


def _sorted(parameters: Parameters, with_offset: bool) -> tuple[list[Row], list[Row]]:
    """Rows that may be used, and rows that may not."""
    rows = [row for row in parameter_rows(parameters) if with_offset or row.key != "heading_offset_deg"]
    usable = [row for row in rows if _may_be_used(row)]
    return usable, [row for row in rows if not _may_be_used(row)]


def _deploy(usable: list[Row]) -> str:
    wheels = "Put the multipliers of ros2_control.yaml on the robot"
    if not any(row.key == "heading_offset_deg" for row in usable):
        return wheels
    return f"{wheels}, subtract the heading offset from the AHRS's yaw (both counter-clockwise from east)"


def _may_be_used(row: Row) -> bool:
    one = row.estimate
    return one.status in _USABLE and math.isfinite(one.value) and math.isfinite(one.sigma)


def _reasons(rows: Iterable[Row]) -> str:
    reasons = [row.reason.rstrip(".") for row in rows if row.reason]
    return "; ".join(dict.fromkeys(reasons)) + "." if reasons else ""


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
