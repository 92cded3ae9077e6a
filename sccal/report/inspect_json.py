"""inspect.json and ``--json``: schema ``sccal.inspect/1``, strict JSON. Angles in degrees; what cannot be told is null.

One shape everywhere: a list of runs under ``runs``, and what could not be inspected under ``failures``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from sccal import __version__
from sccal.report.as_json import Json, clock_block, notice_blocks, strict_document
from sccal.results.inspection import DriveFacts, Excited, FixFacts, Inspection, StandstillFacts, StreamFacts

SCHEMA = "sccal.inspect/1"
SPANS_TOLD = 500


def inspections_json(inspections: Sequence[Inspection], failures: Iterable[tuple[str, str]] = ()) -> Json:
    """Every run, and what could not be inspected: (name, error)."""
    return strict_document(
        {
            "schema": SCHEMA,
            "sccal_version": __version__,
            "runs": [_run(one) for one in inspections],
            "failures": [{"name": name, "error": error} for name, error in failures],
        }
    )


def _run(i: Inspection) -> Json:
    vehicle = i.vehicle
    return {
        "run": i.run,
        "path": str(i.path),
        "vehicle": None
        if vehicle is None
        else {
            "name": vehicle.name,
            "declared": i.declared,
            "wheel_radius_m": vehicle.wheel_radius_m,
            "track_m": vehicle.track_m,
            "ticks_per_rev": vehicle.ticks_per_rev,
            "convention": vehicle.convention,
        },
        "verdict": str(i.verdict),
        "calibratable": not i.refused,
        "unread": [{"what": one.what, "error": one.why} for one in i.unread],
        "span": {"start_s": i.span_s[0], "end_s": i.span_s[1]},
        "streams": {one.name: _stream(one) for one in i.streams},
        "fixes": None if i.fixes is None else _fixes(i.fixes),
        "clock": None if i.clock is None else clock_block(i.clock),
        "drive": None if i.drive is None else _drive(i.drive),
        "standstill": None if i.standstill is None else _standstill(i.standstill, i.series.standing_s.tolist()),
        "witnesses": [asdict(one) for one in i.witnesses],
        "yaw_minus_course": None if i.course is None else _in_degrees(asdict(i.course)),
        "columns": [
            {"source": one.source, "name": one.name, **asdict(one.values), "varies": one.varies, "missing": one.missing}
            for one in i.columns
        ],
        "excited": {"how": i.excited_how if i.excited else None, "effects": [_excited(one) for one in i.excited]},
        "findings": [{"weight": one.weight, "text": one.text} for one in i.findings],
        "notices": notice_blocks(i.notices),
    }


def _stream(one: StreamFacts) -> Json:
    facts = asdict(one)
    del facts["name"]
    return facts


def _fixes(f: FixFacts) -> Json:
    facts: dict[str, Any] = asdict(f)
    del facts["fine_strip"]
    facts["spans"] = facts["spans"][:SPANS_TOLD]
    facts["spans_left_out"] = max(len(f.spans) - SPANS_TOLD, 0)
    return facts


def _drive(d: DriveFacts) -> Json:
    return _in_degrees(asdict(d))


def _standstill(s: StandstillFacts, spans: list[list[float]]) -> Json:
    return {**_in_degrees(asdict(s)), "spans_s": spans}


def _in_degrees(facts: dict[str, Any]) -> Json:
    """Names and values: turned_left_rad becomes turned_left_deg, turn_rate_max_radps turn_rate_max_dps."""
    turned: Json = {}
    for name, value in facts.items():
        for unit, instead in (("_radps", "_dps"), ("_rad", "_deg")):
            if name.endswith(unit):
                name = name.removesuffix(unit) + instead
                value = None if value is None else math.degrees(value)
                break
        turned[name] = value
    return turned


def _excited(one: Excited) -> Json:
    return {
        "effect": one.name,
        "title": one.title,
        "shown": one.shown,
        "advice": one.advice,
        "expected_sigma": dict(one.sigmas),
        "units": dict(one.units),
        "same_as": list(one.same_as),
    }
