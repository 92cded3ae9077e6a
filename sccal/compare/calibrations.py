"""Two calibrations, each of a run or of a vehicle."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from sccal.compare.pairs import pairs_of
from sccal.logs.names import VEHICLE_FILE
from sccal.results.comparison import Comparison, Figure, Side
from sccal.results.saved import Saved

FIGURES = (
    "fit.gnss_innovation_rms_m",
    "fit.nis_gnss",
    "fit.fixes_rejected",
    "fit.heading_innovation_rms_deg",
    "fit.nis_heading",
    "fit.headings_rejected",
    "outage.rms_m",
    "outage.end_rms_m",
    "outage.percent_of_distance",
)
NOT_DATA = (VEHICLE_FILE,)
"""Inputs that results may share and still be of different data."""


def compare_calibrations(a: Saved, b: Saved, sigmas: float) -> Comparison:
    """What changed from A to B by more than ``sigmas`` of the difference's sigma."""
    effects_a, effects_b = a.effects, b.effects
    effects = (
        pair
        for effect in dict.fromkeys((*effects_a, *effects_b))
        for pair in pairs_of(f"effects.{effect}", effects_a.get(effect, {}), effects_b.get(effect, {}), sigmas)
    )
    return Comparison(
        "calibration",
        _side(a),
        _side(b),
        sigmas,
        (*pairs_of("parameters", a.parameters, b.parameters, sigmas), *effects),
        tuple(Figure(name, _figure(a, name), _figure(b, name)) for name in FIGURES),
        (),
        tuple(_remarks(a, b)),
    )


def _side(saved: Saved) -> Side:
    what = f"vehicle {saved.vehicle}" if saved.of_vehicle else f"run {saved.run} of {saved.vehicle}"
    started = saved.document.get("started")
    return Side(str(saved.path), f"{what}, {started}" if started else what, saved.verdict)


def _figure(saved: Saved, name: str) -> float | None:
    block, _, key = name.partition(".")
    value = (saved.document.get(block) or {}).get(key)
    return float(value) if isinstance(value, int | float) else None


def _remarks(a: Saved, b: Saved) -> Iterator[str]:
    if a.vehicle != b.vehicle:
        yield f"two vehicles: {a.vehicle} and {b.vehicle}"
    yield from _shared(a, b)
    if a.document.get("variant") != b.document.get("variant"):
        yield f"variants differ: {a.document.get('variant')} and {b.document.get('variant')}"
    for block, title in (("options", "options"), ("versions", "versions")):
        told_a, told_b = _provenance(a).get(block), _provenance(b).get(block)
        if told_a and told_b and told_a != told_b:
            keys = [key for key in dict.fromkeys((*told_a, *told_b)) if told_a.get(key) != told_b.get(key)]
            each = (f"{key} {told_a.get(key, 'not told')} and {told_b.get(key, 'not told')}" for key in keys)
            yield f"{title} differ: {', '.join(each)}"


def _shared(a: Saved, b: Saved) -> Iterator[str]:
    """Whether the two share data, so far as they tell: then the sigma of the difference does not hold."""
    alike = "their errors are alike, so that the sigmas of the differences, which suppose other data, are too large"
    data_a, data_b = _data(a), _data(b)
    common = data_a & data_b
    if common and data_a == data_b:
        yield f"both are of the same data: {alike}"
    elif common:
        yield f"A and B share {len(common)} files of data ({len(data_a)} in A, {len(data_b)} in B): {alike}"
    elif not (data_a and data_b) and (named := _shared_by_name(a, b)):
        yield f"both have {named}, by its name: if that is the same data, {alike}"
    elif not (data_a and data_b) and not _begin_apart(a, b):
        yield "whether A and B share data is not told in their files; the sigmas of the differences suppose other data"


def _begin_apart(a: Saved, b: Saved) -> bool:
    begun = (a.document.get("started"), b.document.get("started"))
    return None not in begun and begun[0] != begun[1]


def _shared_by_name(a: Saved, b: Saved) -> str:
    if a.vehicle != b.vehicle:
        return ""
    common = [run for run in _runs(a) if run in _runs(b)]
    return "" if not common else f"the run {common[0]}" if len(common) == 1 else f"{len(common)} runs"


def _runs(saved: Saved) -> list[str]:
    return [str(one["run"]) for one in saved.document.get("runs", [])] if saved.of_vehicle else [saved.run]


def _data(saved: Saved) -> set[str]:
    """Hashes of the files that hold measurements."""
    return {
        str(one["sha256"])
        for one in _provenance(saved).get("inputs", [])
        if str(one["name"]).rpartition("/")[2] not in NOT_DATA
    }


def _provenance(saved: Saved) -> Mapping[str, Any]:
    told = saved.document.get("provenance")
    return told if isinstance(told, dict) else {}
