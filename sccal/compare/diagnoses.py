"""Two diagnosed models: findings gained, lost and kept, and the figures before and after."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Literal

from sccal.compare.pairs import figure_of, pairs_of
from sccal.results.calibration import Estimate
from sccal.results.comparison import Comparison, Figure, FoundEffect, Side
from sccal.results.converter import document_of
from sccal.results.diagnosis import Diagnosis, Finding

FIGURES = (
    "outage_rms_m",
    "outage_end_rms_m",
    "gnss_innovation_rms_m",
    "heading_innovation_rms_deg",
    "nll_per_measurement",
)


def compare_diagnoses(a: Diagnosis, b: Diagnosis, sigmas: float, paths: tuple[str, str] = ("A", "B")) -> Comparison:
    """What changed from A to B; the parameters of an effect are compared where both found it."""
    found_a, found_b = by_effect(a), by_effect(b)
    document_a, document_b = document_of(a), document_of(b)
    kept = (
        pair
        for effect in found_a
        if effect in found_b
        for pair in pairs_of(f"effects.{effect}", found_a[effect].parameters, found_b[effect].parameters, sigmas)
    )
    return Comparison(
        "diagnosis",
        _side(a, paths[0]),
        _side(b, paths[1]),
        sigmas,
        (*pairs_of("parameters", _constants(a), _constants(b), sigmas), *kept),
        tuple(
            Figure(f"{when}.{name}", figure_of(document_a, f"{when}.{name}"), figure_of(document_b, f"{when}.{name}"))
            for name in FIGURES
            for when in ("before", "after")
        ),
        tuple(_found(effect, a, b) for effect in dict.fromkeys((*found_a, *found_b))),
        tuple(_remarks(a, b)),
    )


def _found(effect: str, a: Diagnosis, b: Diagnosis) -> FoundEffect:
    in_a, in_b = by_effect(a).get(effect), by_effect(b).get(effect)
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


def _why_absent(effect: str, there: Mapping[str, Estimate], side: str, having: Diagnosis, lacking: Diagnosis) -> str:
    """What the diagnosis that lacks the effect says of it."""
    if taken := lacking.taken_back.get(effect):
        return f"{side} took it back: {taken}"
    rivals = by_effect(having)[effect].indistinguishable_from
    for other, finding in by_effect(lacking).items():
        if effect in finding.indistinguishable_from or other in rivals:
            return f"{side} has {other}, which could as well be this"
    for hidden in lacking.not_excited:
        if hidden.name == effect:
            return f"{side} could not have shown it: {hidden.advice}"
    for one in lacking.detectable:
        if one.name == effect:
            sizes = [(key, size) for key, size in one.smallest.items() if math.isfinite(size) and key in there]
            if any(abs(there[key].value) >= size for key, size in sizes):
                return f"{side} would have found it at this size"
            if sizes:
                least = ", ".join(f"{key} {size:.2g}" for key, size in sizes)
                return f"{side} would have found it from {least} on only"
    return ""


def _side(diagnosis: Diagnosis, path: str) -> Side:
    runs = f"{len(diagnosis.runs)} run{'' if len(diagnosis.runs) == 1 else 's'}"
    return Side(path, f"{runs} of {diagnosis.vehicle.name}" if diagnosis.vehicle.name else runs, "")


def _remarks(a: Diagnosis, b: Diagnosis) -> Iterator[str]:
    if a.vehicle.name != b.vehicle.name:
        yield f"two vehicles: {a.vehicle.name or 'not told'} and {b.vehicle.name or 'not told'}"
    common = [run for run in a.runs if run in b.runs]
    if common:
        yield (
            f"{len(common)} of A's {len(a.runs)} and B's {len(b.runs)} runs have the same name: if they are the same "
            f"data, the sigmas of the differences, which suppose other data, are too large"
        )
    left_a, left_b = (_unexplained(one) for one in (a, b))
    if left_a != left_b:
        yield f"left without a name: {left_a} in A, {left_b} in B"


def _constants(diagnosis: Diagnosis) -> dict[str, Estimate]:
    """The constants with the findings in the model, as far as the file tells them."""
    known = diagnosis.parameters_after.by_key
    return {key: one for key, one in known.items() if not (math.isnan(one.value) and math.isnan(one.sigma))}


def _unexplained(diagnosis: Diagnosis) -> str:
    left = diagnosis.unexplained
    return f"{left.port} following {left.depends_on}" if left.significant else "nothing"


def by_effect(diagnosis: Diagnosis) -> dict[str, Finding]:
    """The findings by their effects, in the order in which they were added."""
    return {one.name: one for one in diagnosis.findings}
