"""Logs without any effect: is their noise found, is nothing named, and are the constants within their sigmas?"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from studies import sccal_adapter
from studies.arrays import stream
from studies.cases import Outcome, PoolOptions, run_cases
from studies.drives import KINDS, Plan
from studies.robot import Scenario, write_log
from studies.tables import coverage, median, percent, rounded, table
from studies.vehicles import FixKind, draw_instruments, draw_noise, draw_robot, with_gaps

CONSTANTS = ("radius_right_m", "radius_left_m", "track_m", "heading_offset_deg")
MARGIN_LAW_NATS = -1.0


@dataclass(frozen=True)
class NoiseCase:
    """One log: its seed makes all of it."""

    seed: int

    def __str__(self) -> str:
        return f"noise seed {self.seed}"


@dataclass(frozen=True)
class NoiseResult:
    """What came out for one log."""

    kind: str
    fix_kind: str
    margin_nats: float | None
    margin_error: str
    verdict: str
    names_a_cause: bool
    scores: dict[str, float]
    """Error over stated sigma of every constant that is called estimated."""
    statuses: dict[str, str]
    findings: list[str] | None
    diagnosis_error: str
    noise_true: dict[str, Any]
    noise_found: dict[str, Any]


def draw_scenario(seed: int) -> Scenario:
    """A log without effects: any drive, 150 to 600 s, any rates, usual and unusual noise, 0 to 6 idle columns."""
    rng = stream(seed, "noise study")
    kinds: list[FixKind] = ["rtk", "float", "autonomous"]
    fix_kind = kinds[int(rng.choice(3, p=[0.7, 0.15, 0.15]))]
    plan = Plan(
        kind=str(rng.choice(KINDS)),
        varied=bool(rng.random() < 0.5),
        duration_s=float(rng.integers(150, 601)),
        stand_first_s=float(rng.uniform(2.0, 12.0)),
    )
    instruments = draw_instruments(rng, fix_kind)
    if rng.random() < 0.15:
        instruments = with_gaps(instruments, rng, plan.duration_s)
    return Scenario(
        seed=seed,
        plan=plan,
        robot=draw_robot(rng),
        noise=draw_noise(rng, fix_kind, wandering=bool(rng.random() < 0.1)),
        instruments=instruments,
        idle_columns=int(rng.integers(0, 7)),
    )


def work(case: NoiseCase, folder: Path, diagnoses: bool = True) -> NoiseResult:
    """Write, calibrate and diagnose one log."""
    scenario = draw_scenario(case.seed)
    log = folder / f"log-{case.seed}"
    write_log(scenario, log)
    truth = json.loads((log / "truth.json").read_text(encoding="utf-8"))
    calibrated = sccal_adapter.calibrate(log, folder / "calibrated")
    findings, diagnosis_error = None, ""
    if diagnoses:
        try:
            findings = [found.effect for found in sccal_adapter.diagnose(log, folder / "diagnosed").findings]
        except Exception as error:
            diagnosis_error = f"{type(error).__name__}: {error}"
    margin_nats, margin_error = _margin(log, truth)
    return NoiseResult(
        kind=scenario.plan.kind + ("" if scenario.plan.varied else ", dull"),
        fix_kind=scenario.instruments.fix_kind,
        margin_nats=margin_nats,
        margin_error=margin_error,
        verdict=calibrated.verdict,
        names_a_cause=calibrated.names_a_cause,
        scores=constant_scores(calibrated, truth["parameters"]),
        statuses={name: told.status for name, told in calibrated.parameters.items()},
        findings=findings,
        diagnosis_error=diagnosis_error,
        noise_true=truth["noise"],
        noise_found=calibrated.noise,
    )


def _margin(log: Path, truth: dict[str, Any]) -> tuple[float | None, str]:
    """The margin of the likelihood, or None and what went wrong; the rest of the case stands without it."""
    try:
        return sccal_adapter.likelihood_margin(log, truth), ""
    except Exception as error:
        return None, f"{type(error).__name__}: {error}"


def constant_scores(calibrated: sccal_adapter.Calibrated, true: dict[str, float]) -> dict[str, float]:
    """Error over stated sigma, for the constants that were estimated."""
    scores = {}
    for name in CONSTANTS:
        told = calibrated.parameters.get(name)
        if told is None or told.status != "estimated" or not told.sigma:
            continue
        error = told.value - true[name]
        if name == "heading_offset_deg":
            error = (error + 180.0) % 360.0 - 180.0
        scores[name] = error / told.sigma
    return scores


def run(runs: int, seed: int, options: PoolOptions, diagnoses: bool = True) -> tuple[str, dict[str, Any]]:
    """The whole study: the report as Markdown, and every case as data."""
    cases = [NoiseCase(1000 * seed + number) for number in range(runs)]
    outcomes = run_cases(partial(work, diagnoses=diagnoses), cases, options)
    data = [
        {"seed": outcome.case.seed, "seconds": outcome.seconds, "error": outcome.error}
        | ({} if outcome.result is None else asdict(outcome.result))
        for outcome in outcomes
    ]
    return report(outcomes), {"study": "noise", "seed": seed, "cases": data}


def report(outcomes: Sequence[Outcome[NoiseCase, NoiseResult]]) -> str:
    """The report of all cases."""
    parts = ["# Logs without any effect", "", _summary(outcomes), "", _coverage_table(outcomes), "", _by_kind(outcomes)]
    return "\n".join([*parts, "", _what_was_wrong(outcomes)])


def _done(outcomes: Sequence[Outcome[NoiseCase, NoiseResult]]) -> list[tuple[NoiseCase, NoiseResult]]:
    return [(outcome.case, outcome.result) for outcome in outcomes if outcome.result is not None]


def _summary(outcomes: Sequence[Outcome[NoiseCase, NoiseResult]]) -> str:
    done = [result for _, result in _done(outcomes)]
    margins = [result.margin_nats for result in done if result.margin_nats is not None]
    diagnosed = [result for result in done if result.findings is not None]
    lawful = sum(margin >= MARGIN_LAW_NATS for margin in margins)
    found = sum(bool(result.findings) for result in diagnosed)
    smallest = rounded(min(margins, default=None))
    rows = [
        ["logs", str(len(outcomes))],
        ["failed", percent(len(outcomes) - len(done), len(outcomes))],
        ["likelihood found ≥ that of the true noise − 1 nat", percent(lawful, len(margins))],
        ["smallest and median margin (nats)", f"{smallest}, {rounded(median(margins))}"],
        ["verdicts that name a cause", percent(sum(result.names_a_cause for result in done), len(done))],
        ["logs with a finding of diagnose", percent(found, len(diagnosed))],
        ["findings", str(sum(len(result.findings or []) for result in diagnosed))],
        ["diagnoses that failed", str(sum(bool(result.diagnosis_error) for result in done))],
    ]
    return table(["what", "measured"], rows)


def _coverage_table(outcomes: Sequence[Outcome[NoiseCase, NoiseResult]]) -> str:
    rows = []
    for name in CONSTANTS:
        scores = [result.scores[name] for _, result in _done(outcomes) if name in result.scores]
        rows.append([name, len(scores), *coverage(scores)])
    return table(["constant", "estimated in", "within 1 σ (68 %)", "within 2 σ (95 %)", "rms of error/σ"], rows)


def _by_kind(outcomes: Sequence[Outcome[NoiseCase, NoiseResult]]) -> str:
    rows = []
    done = [result for _, result in _done(outcomes)]
    for label in sorted({result.kind for result in done} | {result.fix_kind for result in done}):
        group = [result for result in done if label in (result.kind, result.fix_kind)]
        scores = [score for result in group for score in result.scores.values()]
        found = sum(bool(result.findings) for result in group)
        named = sum(result.names_a_cause for result in group)
        rows.append([label, len(group), named, found, *coverage(scores)[:2]])
    return table(["drive or fixes", "logs", "verdicts with a cause", "logs with findings", "68 %", "95 %"], rows)


def _what_was_wrong(outcomes: Sequence[Outcome[NoiseCase, NoiseResult]]) -> str:
    rows: list[list[object]] = [
        [outcome.case.seed, "failed", outcome.error.splitlines()[-1]] for outcome in outcomes if outcome.error
    ]
    for case, result in _done(outcomes):
        told = f"{result.kind}, {result.fix_kind}"
        if result.margin_nats is not None and result.margin_nats < MARGIN_LAW_NATS:
            rows.append([case.seed, "noise not found", f"{result.margin_nats:.1f} nats; {told}"])
        if result.margin_error:
            rows.append([case.seed, "no margin", f"{result.margin_error}; {told}"])
        if result.names_a_cause:
            rows.append([case.seed, "verdict", f"{result.verdict}; {told}"])
        if result.findings:
            rows.append([case.seed, "findings", f"{', '.join(result.findings)}; {told}"])
        if result.diagnosis_error:
            rows.append([case.seed, "diagnose failed", f"{result.diagnosis_error}; {told}"])
        far = {name: round(score, 1) for name, score in result.scores.items() if abs(score) > 3.5}
        if far:
            rows.append([case.seed, "beyond 3.5 σ", f"{far}; {told}"])
    return table(["seed", "what", "detail"], rows) if rows else "Nothing was wrong."
