"""Logs with effects: is what is there named, and nothing else, with sigmas that hold and a drift as small as can be?

Every effect of the catalogue and every port of the logged columns alone (once as usual, and again under one of the
harder conditions), and drawn pairs and triples. Where an effect does not show, by the figure of
`studies/visibility.py`, another robot, drive and size is drawn; what never shows is told and not counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from studies import sccal_adapter
from studies.arrays import Effects, stream
from studies.cases import Outcome, PoolOptions, run_cases
from studies.causes import Label, all_labels, draw_labels
from studies.conditions import CONDITIONS, draw_visible
from studies.robot import write_log
from studies.scoring import Score, described, judge
from studies.tables import coverage, median, percent, rounded, table
from studies.visibility import MINIMUM_NATS
from studies.writing import ORIGIN

SIZED_CONDITIONS = [condition for condition in CONDITIONS if condition != "usual"]


@dataclass(frozen=True)
class EffectCase:
    """One log: labels of its effects, a condition, and the seed that makes the rest."""

    seed: int
    labels: tuple[str, ...]
    condition: str

    def __str__(self) -> str:
        return f"effects seed {self.seed}: {' + '.join(self.labels)} ({self.condition})"


@dataclass(frozen=True)
class EffectResult:
    """What came out for one log."""

    effects: Effects
    nats: dict[str, float]
    shows: bool
    drive: str
    idle_columns: int
    score: Score | None
    findings: list[dict[str, Any]]
    drift_before_m: float | None
    drift_after_m: float | None
    drift_true_model_m: float | None
    drift_error: str = ""

    @property
    def drift_ratio(self) -> float | None:
        """Drift after the diagnosis over that of the true model."""
        if not self.drift_after_m or not self.drift_true_model_m:
            return None
        return self.drift_after_m / self.drift_true_model_m


def single_cases(seed: int, repeats: int) -> list[EffectCase]:
    """Every label alone: in even repeats as usual, in odd ones under a harder condition."""
    cases = []
    for repeat in range(repeats):
        rng = stream(seed, f"singles {repeat}")
        for number, label in enumerate(all_labels(rng)):
            hard = SIZED_CONDITIONS[(number + repeat // 2) % len(SIZED_CONDITIONS)]
            condition = "usual" if repeat % 2 == 0 else hard
            cases.append(EffectCase(100_000 * seed + 1000 * repeat + number, (label.text,), condition))
    return cases


def joint_cases(seed: int, count: int) -> list[EffectCase]:
    """Drawn pairs and triples, two of three pairs; every third of all under a harder condition."""
    cases = []
    for number in range(count):
        rng = stream(seed, f"joint {number}")
        labels = draw_labels(rng, 3 if number % 3 == 2 else 2)
        condition = str(rng.choice(SIZED_CONDITIONS)) if rng.random() < 0.33 else "usual"
        cases.append(EffectCase(100_000 * seed + 50_000 + number, tuple(label.text for label in labels), condition))
    return cases


def work(case: EffectCase, folder: Path) -> EffectResult:
    """Draw a log in which the effects show, write it, diagnose it and judge the diagnosis."""
    drawn = draw_visible(case.seed, [Label(text) for text in case.labels], case.condition)
    scenario = drawn.scenario
    told = f"{scenario.plan.kind}, {scenario.plan.duration_s:.0f} s"
    if not drawn.shows:
        return EffectResult(
            scenario.effects, drawn.nats, False, told, scenario.idle_columns, None, [], None, None, None
        )
    log = folder / f"log-{case.seed}"
    simulated = write_log(scenario, log)
    references = {column.name: column.reference for column in simulated.columns}
    effects = sccal_adapter.as_told(scenario.effects, references, sccal_adapter.counted_from(log))
    diagnosed = sccal_adapter.diagnose(log, folder / "diagnosed")
    true_drift_m, drift_error = _true_model_drift(log, effects)
    return EffectResult(
        effects=effects,
        nats=drawn.nats,
        shows=True,
        drive=told,
        idle_columns=scenario.idle_columns,
        score=judge(diagnosed, effects, asdict(ORIGIN)),
        findings=described(diagnosed.findings),
        drift_before_m=diagnosed.drift_before_m,
        drift_after_m=diagnosed.drift_after_m,
        drift_true_model_m=true_drift_m,
        drift_error=drift_error,
    )


def _true_model_drift(log: Path, effects: Effects) -> tuple[float | None, str]:
    """The drift of the true model, or None and what went wrong; the rest of the case stands without it."""
    try:
        return sccal_adapter.true_model_drift(log, effects), ""
    except Exception as error:
        return None, f"{type(error).__name__}: {error}"


def run(seed: int, repeats: int, joint: int, options: PoolOptions) -> tuple[str, dict[str, Any]]:
    """The whole study: the report as Markdown, and every case as data."""
    outcomes = run_cases(work, [*single_cases(seed, repeats), *joint_cases(seed, joint)], options)
    data = [
        asdict(outcome.case)
        | {"seconds": outcome.seconds, "error": outcome.error}
        | ({} if outcome.result is None else asdict(outcome.result))
        for outcome in outcomes
    ]
    return report(outcomes), {"study": "effects", "seed": seed, "cases": data}


Judged = tuple[EffectCase, EffectResult, Score]


def judged(outcomes: Sequence[Outcome[EffectCase, EffectResult]]) -> list[Judged]:
    """The cases that have a score."""
    return [
        (outcome.case, outcome.result, outcome.result.score)
        for outcome in outcomes
        if outcome.result is not None and outcome.result.score is not None
    ]


HEADER = [
    "what",
    "logs",
    "first is a cause",
    "causes named, or alias",
    "causes named plainly",
    "false findings",
    "68 %",
    "95 %",
    "drift ratio, median (largest)",
    "nats, smallest",
]


def row(label: str, group: Sequence[Judged]) -> list[object]:
    """One row of a table: everything about a group of cases."""
    causes = sum(len(result.effects) for _, result, _ in group)
    ratios = [result.drift_ratio for _, result, _ in group if result.drift_ratio is not None]
    within_1, within_2, _ = coverage([error for _, _, score in group for error in score.errors.values()])
    return [
        label,
        len(group),
        percent(sum(score.first_named for _, _, score in group), len(group)),
        percent(sum(len(score.named) for _, _, score in group), causes),
        percent(sum(len(score.named_plainly) for _, _, score in group), causes),
        sum(len(score.false) for _, _, score in group),
        within_1,
        within_2,
        f"{rounded(median(ratios))} ({rounded(max(ratios, default=None))})" if ratios else "—",
        rounded(min((min(result.nats.values()) for _, result, _ in group), default=None)),
    ]


def report(outcomes: Sequence[Outcome[EffectCase, EffectResult]]) -> str:
    """The report of all cases."""
    cases = judged(outcomes)
    failed = [outcome for outcome in outcomes if outcome.error]
    hidden = [outcome for outcome in outcomes if outcome.result is not None and not outcome.result.shows]
    logs_with_false = sum(bool(score.false) for _, _, score in cases)
    parts = [
        "# Logs with effects",
        "",
        f"{len(outcomes)} cases: {len(cases)} judged, {len(failed)} failed, {len(hidden)} in which no draw showed the "
        f"effect (below {MINIMUM_NATS:.0f} nats by the rough figure). Logs with a false finding: "
        f"{percent(logs_with_false, len(cases))}.",
        "",
        table(HEADER, [row(label, group) for label, group in _groups(cases)]),
        "",
        "## One by one",
        "",
        table(HEADER, [row(label, group) for label, group in _singles(cases)]),
        "",
        _what_was_wrong(cases, failed, hidden),
    ]
    return "\n".join(parts)


def _groups(cases: Sequence[Judged]) -> list[tuple[str, list[Judged]]]:
    """All cases together, by number of effects and by condition."""
    groups = [("all", list(cases))]
    for count, name in ((1, "alone"), (2, "pairs"), (3, "triples")):
        groups.append((name, [item for item in cases if len(item[0].labels) == count]))
    groups += [(f"condition: {name}", [item for item in cases if item[0].condition == name]) for name in CONDITIONS]
    return [(name, group) for name, group in groups if group]


def _singles(cases: Sequence[Judged]) -> list[tuple[str, list[Judged]]]:
    """The cases with one effect by its label; the logged columns by their port."""
    grouped: dict[str, list[Judged]] = {}
    for item in cases:
        if len(item[0].labels) == 1:
            text = item[0].labels[0]
            grouped.setdefault(f"{text.split('~')[0]}~column" if "~" in text else text, []).append(item)
    return list(grouped.items())


def _what_was_wrong(
    cases: Sequence[Judged],
    failed: Sequence[Outcome[EffectCase, EffectResult]],
    hidden: Sequence[Outcome[EffectCase, EffectResult]],
) -> str:
    rows: list[list[object]] = [[str(outcome.case), "failed", outcome.error.splitlines()[-1], ""] for outcome in failed]
    rows += [
        [str(outcome.case), "does not show", _numbers(outcome.result.nats), ""] for outcome in hidden if outcome.result
    ]
    for case, result, score in cases:
        found = ", ".join(
            finding["effect"] + (f" (= {', '.join(finding['aliases'])})" if finding["aliases"] else "")
            for finding in result.findings
        )
        seen = f"{result.drive}; found: {found or 'nothing'}; nats {_numbers(result.nats)}"
        if result.drift_error:
            rows.append([str(case), "no drift of the true model", result.drift_error, seen])
        if score.missed:
            rows.append([str(case), "missed", ", ".join(score.missed), seen])
        if score.false:
            rows.append([str(case), "false", ", ".join(score.false), seen])
        far = {name: error for name, error in score.errors.items() if abs(error) > 3.5}
        if far:
            rows.append([str(case), "beyond 3.5 σ", _numbers(far), result.drive])
    if not rows:
        return "Nothing was wrong."
    return "\n".join(["## What was wrong", "", table(["case", "what", "which", "seen"], rows)])


def _numbers(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {rounded(value)}" for name, value in values.items())
