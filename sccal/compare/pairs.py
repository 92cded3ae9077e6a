"""One estimate beside another: changed if |B − A| is more than k sigmas of the difference."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sccal.results.calibration import Estimate
from sccal.results.comparison import Change, Pair
from sccal.results.converter import Json
from sccal.results.differences import difference, why_not_estimated, why_own_log_only


def pairs_of(prefix: str, a: Mapping[str, Estimate], b: Mapping[str, Estimate], sigmas: float) -> tuple[Pair, ...]:
    """Every parameter of either, those of A first; ``prefix`` is ``parameters`` or ``effects.NAME``."""
    keys = tuple(dict.fromkeys((*a, *b)))
    return tuple(
        _pair(f"{prefix}.{key}", key, a.get(key), b.get(key), why_own_log_only(key, keys), sigmas) for key in keys
    )


def _pair(name: str, key: str, a: Estimate | None, b: Estimate | None, own: str, sigmas: float) -> Pair:
    if a is None or b is None:
        return Pair(name, a, b, None, "not comparable", f"only {'B' if a is None else 'A'} has it")
    reasons = [f"{side}: {why}" for side, one in (("A", a), ("B", b)) if (why := why_not_estimated(one))]
    if own or reasons:
        return Pair(name, a, b, None, "not comparable", own or "; ".join(reasons))
    d = difference(key, a, b)
    if math.isnan(d.sigma):
        return Pair(name, a, b, None, "not comparable", "no sigma to judge by")
    change: Change = "changed" if abs(d.amount) > sigmas * d.sigma else "unchanged"
    return Pair(name, a, b, d, change, "")


def figure_of(document: Json, name: str) -> float | None:
    """A number by its dotted name in a document; None where it is not there."""
    block, _, key = name.partition(".")
    value = (document[block] or {}).get(key)
    return float(value) if isinstance(value, int | float) else None
