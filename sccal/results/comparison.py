"""What a comparison found. A comes first, B second; differences are B − A."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from sccal.results.calibration import Estimate
from sccal.results.differences import Difference

Change = Literal["changed", "unchanged", "not comparable"]
Kind = Literal["calibration", "diagnosis"]


@dataclass(frozen=True)
class Side:
    """One of the two results."""

    path: str
    what: str
    """``run general of tracked-demo``."""
    verdict: str
    """Empty for a diagnosis."""


@dataclass(frozen=True)
class Pair:
    """One parameter in both results."""

    name: str
    """Dotted, as in the file: ``parameters.track_m``, ``effects.lever_arm.left_m``."""
    a: Estimate | None
    """None where the result does not have it."""
    b: Estimate | None
    difference: Difference | None
    """None where the two cannot be compared."""
    change: Change
    reason: str
    """Why they cannot be compared; empty where they can."""

    WRITTEN: ClassVar[str] = (
        "name change reason a=a(value sigma status reason) b=b(value sigma status reason) "
        "difference=difference.amount sigma=difference.sigma in_sigmas=difference.in_sigmas"
    )


@dataclass(frozen=True)
class Figure:
    """One figure of both results that has no sigma of its own."""

    name: str
    """Dotted, as in the file: ``outage.end_rms_m``."""
    a: float | None
    b: float | None


@dataclass(frozen=True)
class FoundEffect:
    """An effect that at least one of two diagnoses found; its parameters stand among the pairs."""

    effect: str
    change: Literal["gained", "lost", "kept"]
    nats_a: float | None
    """Evidence for it where A found it."""
    nats_b: float | None
    held_out_a: float | None
    """Gain on data that did not fit it, nats."""
    held_out_b: float | None
    reason: str
    """What the diagnosis without it says of it; empty where it says nothing."""

    WRITTEN: ClassVar[str] = (
        "effect change evidence_nats_a=nats_a evidence_nats_b=nats_b held_out_gain_nats_a=held_out_a "
        "held_out_gain_nats_b=held_out_b reason"
    )


@dataclass(frozen=True)
class Comparison:
    """Two results of one kind."""

    kind: Kind
    a: Side
    b: Side
    sigmas: float
    """A difference of more than so many of its sigmas is a change."""
    pairs: tuple[Pair, ...]
    figures: tuple[Figure, ...]
    effects: tuple[FoundEffect, ...]
    """Empty for calibrations."""
    remarks: tuple[str, ...]
    """What the reader must know: data shared, vehicles or options that differ."""

    SCHEMA: ClassVar[str] = "sccal.comparison/1"
    WRITTEN: ClassVar[str] = "kind a b sigmas changed parameters=pairs figures findings=effects remarks"

    @property
    def changed(self) -> tuple[str, ...]:
        """Names of what changed: parameters beyond their uncertainty, findings gained and lost."""
        found = tuple(one.effect for one in self.effects if one.change != "kept")
        return found + tuple(pair.name for pair in self.pairs if pair.change == "changed")

    @property
    def comparable(self) -> bool:
        """Whether anything could be compared."""
        return self.kind == "diagnosis" or any(pair.change != "not comparable" for pair in self.pairs)
