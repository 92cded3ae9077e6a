"""One case from its log to its mark: the commands are called, and what they say is held against what is wanted."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from studies.field.commands import Said, run_command
from studies.field.wanted import ANY, SIGMAS, Asked, Diagnosis, FieldCase, True_, Truth, Way

WRONG_SIGMAS = 4.0
"""An estimate further off than this is wrong, whatever the verdict."""
OWN_SIGMAS = 1.5
"""A finding none of whose parameters is so many sigmas from zero says nothing."""
RISE = 1.1
"""A finding is no help where the held-out drift grows by this factor."""
COULD_BE = ("detectable", "not_excited", "excited", "unseen", "chance", "noise", "provenance", "options", "catalogue")
"""Keys of a diagnosis that tell of effects without having found them."""
HEADLINE = 700
"""So many characters of a printed diagnosis belong to its headline."""
SHAPES = ("at_s", "until_s", "from_s", "radius_m", "east_m", "north_m", "above_radps", "tau_s")


@dataclass(frozen=True)
class Told:
    """The constants of one calibration."""

    run: str
    verdict: str
    parameters: Mapping[str, Mapping[str, Any]]

    @property
    def is_run(self) -> bool:
        """Whether this is a run's result; the vehicle's counts where there are several runs."""
        return self.run.endswith("calibration.json")

    @property
    def level(self) -> str:
        """The verdict's first word."""
        return self.verdict.split(":")[0].split(" ")[0].strip().lower()


@dataclass(frozen=True)
class Mark:
    """How a case came out."""

    ok: bool
    way: str
    """The acceptable ending that it took, if any."""
    got: str
    scores: dict[str, float]
    """Errors over stated sigmas of what is estimated, the worst of all results."""
    faults: tuple[str, ...]


def judge(case: FieldCase, folder: Path) -> Mark:
    """Write the log, call the commands, and compare."""
    log, out = folder / "log", folder / "out"
    truth = case.build(log)
    said = _run(["calibrate", str(log), "--out", str(out), "--jobs", "1", *case.options], folder)
    told = list(_results(out)) if said.code != 2 else []
    scores = _scores(told, truth)
    faults = [f"{name} estimated {score:+.1f}σ off" for name, score in scores.items() if abs(score) > WRONG_SIGMAS]
    faults += _never(said, case.never, "calibrate")
    if said.code == 4:
        faults.append("internal error")
    misses = [_miss(way, said, told, scores) for way in case.ways]
    taken = next((way.name for way, miss in zip(case.ways, misses, strict=True) if not miss), "")
    if not taken:
        faults.insert(0, " | ".join(f"{way.name}: {miss}" for way, miss in zip(case.ways, misses, strict=True)))
    for asked in case.asked:
        faults += _ask(asked, case, log, out)
    if case.diagnosis is not None:
        faults += _diagnose(case.diagnosis, case, truth, log, folder / "diagnosed")
    return Mark(not faults, taken, _got(said, told), scores, tuple(faults))


def _run(arguments: list[str], folder: Path) -> Said:
    """A command; the names of the folders above the log say nothing and are left out of its text."""
    said = run_command(arguments)
    return replace(said, text=said.text.replace(str(folder), ""), last=said.last.replace(str(folder), ""))


def _results(out: Path) -> Iterator[Told]:
    """Every result that a calibration left."""
    for path in sorted([*out.rglob("calibration.json"), *out.glob("vehicle*.json")]):
        data = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(data.get("parameters"), dict):
            yield Told(path.relative_to(out).as_posix(), str(data.get("verdict", "")), data["parameters"])


def _scores(told: list[Told], truth: Truth) -> dict[str, float]:
    """Errors over sigmas under the reading that fits best; of several results the worst."""
    worst: dict[str, float] = {}
    for one in told:
        readings = [_against(one, reading) for reading in truth.readings]
        best = min(readings, key=lambda scores: max((abs(score) for score in scores.values()), default=0.0))
        for name, score in best.items():
            if abs(score) >= abs(worst.get(name, 0.0)):
                worst[name] = score
    return worst


def _against(told: Told, reading: Mapping[str, True_]) -> dict[str, float]:
    """Scores of one result."""
    scores = {}
    for name, true in reading.items():
        found = told.parameters.get(name)
        if found and found.get("status") == "estimated" and true != ANY:
            scores[name] = _score(found.get("value"), found.get("sigma"), true, name == "heading_offset_deg")
    return scores


def _score(value: float | None, sigma: float | None, true: True_, angle: bool) -> float:
    """The error over the sigma; an estimate without a sigma is infinitely wrong."""
    if value is None or not sigma or not math.isfinite(sigma):
        return math.inf
    if isinstance(true, list):
        return min((_score(value, sigma, one, angle) for one in true), key=abs)
    if isinstance(true, tuple):
        low, high = true
        return (min(value - low, 0.0) + max(value - high, 0.0)) / sigma
    off = value - true
    return ((off + 180.0) % 360.0 - 180.0 if angle else off) / sigma


def _miss(way: Way, said: Said, told: list[Told], scores: Mapping[str, float]) -> str:
    """Why an ending is not this one; nothing if it is."""
    if said.code not in way.exits:
        return f"exit {said.code}"
    unsaid = [pattern for pattern in way.says if not said.has(pattern)]
    if unsaid:
        return f"does not say /{unsaid[0]}/"
    runs = sum(one.is_run for one in told)
    levels = {one.level for one in told if one.is_run == (runs == 1)}
    if way.levels and (not levels or levels - set(way.levels)):
        return f"verdict {', '.join(sorted(levels)) or 'missing'}"
    if way.runs is not None and runs != way.runs:
        return f"{runs} runs"
    for name in way.estimated:
        for one in told:
            flaw = _flaw(one.parameters.get(name), name, way.wider)
            if flaw:
                return f"{name} {flaw}"
        if abs(scores.get(name, 0.0)) > WRONG_SIGMAS:
            return f"{name} {scores[name]:+.1f}σ"
    return ""


def _flaw(found: Mapping[str, Any] | None, name: str, wider: float) -> str:
    """What makes an estimate useless."""
    if found is None or found.get("status") != "estimated":
        return "missing" if found is None else str(found.get("status"))
    most = SIGMAS[name] * wider * (1.0 if name == "heading_offset_deg" else abs(found["value"]))
    return "" if found["sigma"] <= most else f"sigma {found['sigma']:.2g} above {most:.2g}"


def _never(said: Said, patterns: tuple[str, ...], command: str) -> list[str]:
    """What must not be printed and is."""
    return [f"{command} says /{pattern}/" for pattern in patterns if said.has(pattern)]


def _ask(asked: Asked, case: FieldCase, log: Path, out: Path) -> list[str]:
    """Faults of another command."""
    results = sorted(out.rglob("calibration.json"))
    stands = {"RUN": str(log), "OUT": str(results[0].parent if results else out)}
    options = case.options if asked.command[0] in ("inspect", "diagnose") else ()
    said = _run([*(stands.get(word, word) for word in asked.command), *options], log.parent)
    command = asked.command[0]
    faults = [f"{command} exit {said.code}: {said.last[:120]}"] if said.code not in asked.exits else []
    faults += [f"{command} does not say /{pattern}/" for pattern in asked.says if not said.has(pattern)]
    return faults + _never(said, (*asked.never, *case.never), command)


def _diagnose(wanted: Diagnosis, case: FieldCase, truth: Truth, log: Path, out: Path) -> list[str]:
    """Faults of a diagnosis."""
    said = _run(["diagnose", str(log), "--out", str(out), *case.options], log.parent)
    path = out / "diagnosis.json"
    if said.code or not path.exists():
        accepted = any(said.has(pattern) for pattern in wanted.or_says)
        return [] if accepted and said.code == 3 else [f"diagnose exit {said.code}: {said.last[:120]}"]
    data = json.loads(path.read_text(encoding="utf-8"))
    findings = data["findings"]
    named = [finding["effect"] for finding in findings]
    known = {*named, *(alias for finding in findings for alias in finding.get("indistinguishable_from") or ())}
    faults = []
    if wanted.nothing and findings:
        faults.append(f"diagnose finds {', '.join(named)}")
    said_instead = any(_stated(said, data).has(pattern) for pattern in wanted.or_says)
    if wanted.names and not known & set(wanted.names) and not said_instead:
        faults.append(f"diagnose finds {', '.join(named) or 'nothing'} instead of {' or '.join(wanted.names)}")
    faults += [f"diagnose finds {name}" for name in wanted.not_named if name in named]
    faults += [f"diagnose does not say /{pattern}/" for pattern in wanted.says if not said.has(pattern)]
    faults += _never(said, (*wanted.never, *case.never), "diagnose")
    for finding in findings:
        faults += _finding_faults(finding, truth)
    before, after = ((data.get(when) or {}).get("outage_end_rms_m") for when in ("before", "after"))
    if findings and before and after and after > RISE * before:
        faults.append(f"drift rises with the findings, {before:.3g} to {after:.3g} m")
    return faults


def _stated(said: Said, data: Mapping[str, Any]) -> Said:
    """What a diagnosis says of this log: its headline and results, without the lists of what it could have found."""
    results = {key: value for key, value in data.items() if key not in COULD_BE}
    return replace(said, text=said.text[:HEADLINE] + " " + json.dumps(results, ensure_ascii=False))


def _finding_faults(finding: Mapping[str, Any], truth: Truth) -> list[str]:
    """Values of a finding that are wrong, or nothing beside their own sigmas."""
    effect = finding["effect"]
    values = {name: told for name, told in finding["parameters"].items() if name not in SHAPES}
    sizes = [abs(told["value"]) / told["sigma"] for told in values.values() if told.get("sigma")]
    faults = []
    if sizes and max(sizes) < OWN_SIGMAS:
        faults.append(f"{effect} within its own sigma")
    for name, true in truth.effects.get(effect, {}).items():
        told = finding["parameters"].get(name)
        if told and told.get("sigma"):
            score = _score(told["value"], told["sigma"], true, False)
            if abs(score) > WRONG_SIGMAS:
                faults.append(f"{effect}.{name} {score:+.1f}σ")
    return faults


def _got(said: Said, told: list[Told]) -> str:
    """A short text of what calibrate said."""
    if told and not said.code:
        runs = sum(one.is_run for one in told)
        return f"{said.code} {next(one.verdict for one in told if one.is_run == (runs == 1))}"
    return f"{said.code} {said.last}"
