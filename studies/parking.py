"""A robot that parks: does the time that it stands change its constants?

One drive is logged with 0, 5, 15 and 60 minutes of parking, before it or in its middle, by a receiver that repeats its
last position while the robot stands, or one whose fixes go on scattering. Drive, slip and all noise outside of the
parking are the same to the last draw, so the constants have to be the same too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from studies import sccal_adapter
from studies.arrays import stream
from studies.cases import Outcome, PoolOptions, run_cases
from studies.drives import Plan
from studies.noise import CONSTANTS
from studies.robot import Scenario, write_log
from studies.sccal_adapter import Estimate
from studies.tables import percent, rounded, table
from studies.vehicles import draw_instruments, draw_noise, draw_robot

MINUTES = (0, 5, 15, 60)
PLACES = ("midway", "first")


@dataclass(frozen=True)
class ParkingCase:
    """One log."""

    seed: int
    where: str
    held: bool
    minutes: int

    def __str__(self) -> str:
        return f"parking seed {self.seed}: {self.minutes} min {self.where}, fixes {self.fixes}"

    @property
    def fixes(self) -> str:
        """What the receiver does while the robot stands."""
        return "held" if self.held else "noisy"

    @property
    def without(self) -> ParkingCase:
        """The same log without parking."""
        return replace(self, minutes=0)


@dataclass(frozen=True)
class ParkingResult:
    """The constants, and the truth."""

    verdict: str
    parameters: dict[str, Estimate]
    true: dict[str, float]
    noise: dict[str, Any]


def draw_scenario(case: ParkingCase) -> Scenario:
    """A varied drive of 400 s with RTK fixes, and its parking."""
    rng = stream(case.seed, "parking study")
    parked_s = 60.0 * case.minutes
    plan = Plan("mixed", duration_s=400.0)
    midway = case.where == "midway"
    plan = replace(plan, parked_midway_s=parked_s) if midway else replace(plan, parked_first_s=parked_s)
    robot, noise, instruments = draw_robot(rng), draw_noise(rng), draw_instruments(rng)
    return Scenario(
        case.seed, plan, robot, replace(noise, outlier_share=0.0), replace(instruments, holds_still=case.held)
    )


def work(case: ParkingCase, folder: Path) -> ParkingResult:
    """Write and calibrate one log."""
    scenario = draw_scenario(case)
    log = folder / "log"
    write_log(scenario, log)
    calibrated = sccal_adapter.calibrate(log, folder / "calibrated")
    true = {name: float(getattr(scenario.robot, name)) for name in CONSTANTS}
    return ParkingResult(calibrated.verdict, calibrated.parameters, true, calibrated.noise)


def run(drives: int, seed: int, options: PoolOptions) -> tuple[str, dict[str, Any]]:
    """The whole study: the report as Markdown, and every case as data."""
    cases = [
        ParkingCase(1000 * seed + number, where, held, minutes)
        for number in range(drives)
        for where in PLACES
        for held in (True, False)
        for minutes in MINUTES
    ]
    outcomes = run_cases(work, cases, options)
    data = [
        asdict(outcome.case) | {"error": outcome.error} | ({} if outcome.result is None else asdict(outcome.result))
        for outcome in outcomes
    ]
    return report(outcomes), {"study": "parking", "seed": seed, "cases": data}


def moved(parked: ParkingResult, without: ParkingResult, name: str) -> float | None:
    """How far a constant lies from its value without parking, in sigmas of the latter; None where either has none."""
    one, other = parked.parameters.get(name), without.parameters.get(name)
    if one is None or other is None or not other.sigma:
        return None
    off = one.value - other.value
    if name == "heading_offset_deg":
        off = (off + 180.0) % 360.0 - 180.0
    return off / other.sigma


def report(outcomes: Sequence[Outcome[ParkingCase, ParkingResult]]) -> str:
    """The report of all cases."""
    results = {outcome.case: outcome.result for outcome in outcomes if outcome.result is not None}
    rows, same, compared = [], 0, 0
    for case, result in results.items():
        without = results.get(case.without)
        shifts = {name: moved(result, without, name) for name in CONSTANTS} if without else {}
        known = [abs(shift) for shift in shifts.values() if shift is not None]
        if case.minutes and known:
            compared += 1
            same += max(known) <= 1.0
        cells = [rounded(shifts.get(name), 2) for name in CONSTANTS]
        rows.append(
            [case.seed, case.where, case.fixes, case.minutes, *cells, _widest(result, without), _farthest(result)]
        )
    header = ["seed", "where", "fixes", "min", *CONSTANTS, "largest σ ratio", "farthest from the truth"]
    failed = [[outcome.case, outcome.error.splitlines()[-1]] for outcome in outcomes if outcome.error]
    parts = [
        "# A robot that parks",
        "",
        f"All four constants within 1 σ of those without parking: {percent(same, compared)}. The cells hold the change "
        "in sigmas of the log without parking, and at the end the farthest constant from its true value, in its own.",
        "",
        table(header, rows),
    ]
    return "\n".join(parts + (["", table(["failed", "how"], failed)] if failed else []))


def _widest(result: ParkingResult, without: ParkingResult | None) -> str:
    """The largest factor between a sigma with and without parking, either way."""
    ratios = []
    for name in CONSTANTS if without else ():
        sigma, before = result.parameters[name].sigma, without.parameters[name].sigma if without else None
        if sigma and before:
            ratios.append(max(sigma / before, before / sigma))
    return rounded(max(ratios, default=None), 3)


def _farthest(result: ParkingResult) -> str:
    """The largest error over the stated sigma."""
    scores = []
    for name in CONSTANTS:
        told = result.parameters[name]
        off = told.value - result.true[name]
        if name == "heading_offset_deg":
            off = (off + 180.0) % 360.0 - 180.0
        if told.sigma:
            scores.append(abs(off) / told.sigma)
    return rounded(max(scores, default=None), 2)
