"""What a diagnosis got right: causes named, findings that are none, and errors over stated sigmas."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from studies.arrays import Effects
from studies.causes import SHAPES
from studies.columns import PER_UNIT
from studies.sccal_adapter import Diagnosed, Estimate, Finding

METRES_PER_DEGREE = 111_200.0


@dataclass(frozen=True)
class Score:
    """One diagnosis, judged. *Plainly* means as a finding; else a cause may also be an alias of one."""

    first_named: bool
    first_named_plainly: bool
    named: tuple[str, ...]
    named_plainly: tuple[str, ...]
    missed: tuple[str, ...]
    false: tuple[str, ...]
    """Findings that are no cause, and not told to be indistinguishable from one."""
    errors: dict[str, float]
    """Error over stated sigma of each parameter of a cause that was named plainly."""
    shape_errors: dict[str, float]
    """Found less true for what is searched for: moments, places, thresholds."""


def judge(diagnosed: Diagnosed, effects: Effects, origin: Mapping[str, float]) -> Score:
    """Compare findings with the truth."""
    findings = diagnosed.findings
    plain = {found.effect for found in findings}
    known = plain | {alias for found in findings for alias in found.aliases}
    false = [found.effect for found in findings if not _explains(found, effects)]
    errors: dict[str, float] = {}
    shapes: dict[str, float] = {}
    for found in findings:
        if found.effect in effects:
            for name, told, true in _pairs(found, effects[found.effect]):
                label = f"{found.effect}.{name}"
                if name in SHAPES or (found.effect == "local_field" and name in ("east_m", "north_m")):
                    shapes[label] = told.value - true - _shift(name, diagnosed, origin)
                elif told.sigma:
                    errors[label] = (told.value - true) / told.sigma
    return Score(
        first_named=bool(findings) and _explains(findings[0], effects),
        first_named_plainly=bool(findings) and findings[0].effect in effects,
        named=tuple(name for name in effects if name in known),
        named_plainly=tuple(name for name in effects if name in plain),
        missed=tuple(name for name in effects if name not in known),
        false=tuple(false),
        errors=errors,
        shape_errors=shapes,
    )


def _explains(found: Finding, effects: Effects) -> bool:
    """Whether a finding is a cause, or told to be indistinguishable from one."""
    return found.effect in effects or any(alias in effects for alias in found.aliases)


def _pairs(found: Finding, true: Mapping[str, float]) -> Iterator[tuple[str, Estimate, float]]:
    """Parameters with their true values; the one parameter of a logged column may have any name."""
    if set(true) == {PER_UNIT} and len(found.parameters) == 1:
        yield PER_UNIT, next(iter(found.parameters.values())), true[PER_UNIT]
        return
    for name, value in true.items():
        if name in found.parameters:
            yield name, found.parameters[name], value


def _shift(name: str, diagnosed: Diagnosed, origin: Mapping[str, float]) -> float:
    """Where the results' plane begins, in the plane of the truth; only a place needs it."""
    if name not in ("east_m", "north_m") or diagnosed.origin is None:
        return 0.0
    lat_deg, lon_deg = diagnosed.origin
    if name == "north_m":
        return -(lat_deg - origin["lat_deg"]) * METRES_PER_DEGREE
    return -(lon_deg - origin["lon_deg"]) * METRES_PER_DEGREE * math.cos(math.radians(lat_deg))


def described(findings: tuple[Finding, ...]) -> list[dict[str, Any]]:
    """Findings as plain data for a report."""
    return [
        {
            "effect": found.effect,
            "aliases": list(found.aliases),
            "parameters": {name: [told.value, told.sigma] for name, told in found.parameters.items()},
        }
        for found in findings
    ]
