"""Two results side by side as JSON: schema ``sccal.comparison/1``, strict."""

from __future__ import annotations

from sccal import __version__
from sccal.report.as_json import Json, strict_document
from sccal.results.comparison import Comparison, Pair, Side
from sccal.results.saved import SavedEstimate

SCHEMA = "sccal.comparison/1"


def compare_json(c: Comparison) -> Json:
    """Differences are B − A, in the unit of the parameter's name; what is missing is null."""
    return strict_document(
        {
            "schema": SCHEMA,
            "sccal_version": __version__,
            "kind": c.kind,
            "a": _side(c.a),
            "b": _side(c.b),
            "sigmas": c.sigmas,
            "changed": c.changed,
            "parameters": [_pair(pair) for pair in c.pairs],
            "figures": [{"name": one.name, "a": one.a, "b": one.b} for one in c.figures],
            "findings": [
                {
                    "effect": one.effect,
                    "change": one.change,
                    "evidence_nats_a": one.nats_a,
                    "evidence_nats_b": one.nats_b,
                    "held_out_gain_nats_a": one.held_out_a,
                    "held_out_gain_nats_b": one.held_out_b,
                    "reason": one.reason,
                }
                for one in c.effects
            ],
            "remarks": c.remarks,
        }
    )


def _side(side: Side) -> Json:
    return {"path": side.path, "what": side.what, "verdict": side.verdict}


def _pair(pair: Pair) -> Json:
    d = pair.difference
    return {
        "name": pair.name,
        "change": pair.change,
        "reason": pair.reason,
        "a": _estimate(pair.a),
        "b": _estimate(pair.b),
        "difference": None if d is None else d.amount,
        "sigma": None if d is None else d.sigma,
        "in_sigmas": None if d is None else d.in_sigmas,
    }


def _estimate(estimate: SavedEstimate | None) -> Json | None:
    if estimate is None:
        return None
    return {"value": estimate.value, "sigma": estimate.sigma, "status": estimate.status, "reason": estimate.reason}
