"""Two diagnosed models: findings gained, lost and kept, and the figures before and after."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Literal

from sccal.compare.pairs import pairs_of
from sccal.results.comparison import Comparison, Figure, FoundEffect, Side
from sccal.results.saved import SavedEstimate
from sccal.results.saved_diagnosis import SavedDiagnosis

FIGURES = (
    "outage_rms_m",
    "outage_end_rms_m",
    "gnss_innovation_rms_m",
    "heading_innovation_rms_deg",
    "nll_per_measurement",
)


def compare_diagnoses(a: SavedDiagnosis, b: SavedDiagnosis, sigmas: float) -> Comparison:
    """What changed from A to B; the parameters of an effect are compared where both found it."""
    found_a, found_b = a.findings, b.findings
    kept = (
        pair
        for effect in found_a
        if effect in found_b
        for pair in pairs_of(f"effects.{effect}", found_a[effect].parameters, found_b[effect].parameters, sigmas)
    )
    return Comparison(
        "diagnosis",
        _side(a),
        _side(b),
        sigmas,
        (*pairs_of("parameters", a.parameters_after, b.parameters_after, sigmas), *kept),
        tuple(
            Figure(f"{when}.{name}", a.judged(when).get(name), b.judged(when).get(name))
            for name in FIGURES
            for when in ("before", "after")
        ),
        tuple(_found(effect, a, b) for effect in dict.fromkeys((*found_a, *found_b))),
        tuple(_remarks(a, b)),
    )


def _found(effect: str, a: SavedDiagnosis, b: SavedDiagnosis) -> FoundEffect:
    in_a, in_b = a.findings.get(effect), b.findings.get(effect)
    change: Literal["gained", "lost", "kept"] = "kept"
    reason = ""
    if in_a is None and in_b is not None:
        change, reason = "gained", _why_absent(effect, in_b.parameters, "A", b, a)
    elif in_b is None and in_a is not None:
        change, reason = "lost", _why_absent(effect, in_a.parameters, "B", a, b)
    return FoundEffect(
        effect,
        change,
        None if in_a is None else in_a.evidence_nats,
        None if in_b is None else in_b.evidence_nats,
        None if in_a is None else in_a.held_out_gain_nats,
        None if in_b is None else in_b.held_out_gain_nats,
        reason,
    )


def _why_absent(
    effect: str, there: Mapping[str, SavedEstimate], side: str, having: SavedDiagnosis, lacking: SavedDiagnosis
) -> str:
    """What the diagnosis that lacks the effect says of it."""
    document = lacking.document
    if taken := (document.get("taken_back") or {}).get(effect):
        return f"{side} took it back: {taken}"
    rivals = having.findings[effect].indistinguishable_from
    for other, finding in lacking.findings.items():
        if effect in finding.indistinguishable_from or other in rivals:
            return f"{side} has {other}, which could as well be this"
    for one in document.get("not_excited", []):
        if one.get("effect") == effect:
            return f"{side} could not have shown it: {one.get('advice', 'not excited')}"
    for one in document.get("detectable", []):
        if one.get("effect") == effect:
            smallest: Mapping[str, float | None] = one.get("smallest") or {}
            sizes = [(key, size) for key, size in smallest.items() if size is not None and key in there]
            if any(abs(there[key].value) >= size for key, size in sizes):
                return f"{side} would have found it at this size"
            if sizes:
                least = ", ".join(f"{key} {size:.2g}" for key, size in sizes)
                return f"{side} would have found it from {least} on only"
    return ""


def _side(saved: SavedDiagnosis) -> Side:
    runs = f"{len(saved.runs)} run{'' if len(saved.runs) == 1 else 's'}"
    return Side(str(saved.path), f"{runs} of {saved.vehicle}" if saved.vehicle else runs, "")


def _remarks(a: SavedDiagnosis, b: SavedDiagnosis) -> Iterator[str]:
    if a.vehicle != b.vehicle:
        yield f"two vehicles: {a.vehicle or 'not told'} and {b.vehicle or 'not told'}"
    common = [run for run in a.runs if run in b.runs]
    if common:
        yield (
            f"{len(common)} of A's {len(a.runs)} and B's {len(b.runs)} runs have the same name: if they are the same "
            f"data, the sigmas of the differences, which suppose other data, are too large"
        )
    left_a, left_b = (_unexplained(one) for one in (a, b))
    if left_a != left_b:
        yield f"left without a name: {left_a} in A, {left_b} in B"


def _unexplained(saved: SavedDiagnosis) -> str:
    left = saved.document.get("unexplained") or {}
    if not left.get("significant"):
        return "nothing"
    return f"{left.get('port')} following {left.get('depends_on')}"
