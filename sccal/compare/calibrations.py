"""Two calibrations, each of a run or of a vehicle."""

from __future__ import annotations

from collections.abc import Iterator

from sccal.compare.pairs import figure_of, pairs_of
from sccal.logs.names import VEHICLE_FILE
from sccal.results.calibration import Calibrated, VehicleCalibration
from sccal.results.comparison import Comparison, Figure, Side
from sccal.results.converter import document_of

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


def compare_calibrations(
    a: Calibrated, b: Calibrated, sigmas: float, paths: tuple[str, str] = ("A", "B")
) -> Comparison:
    """What changed from A to B by more than ``sigmas`` of the difference's sigma; ``paths`` are their files."""
    effects_a, effects_b = a.effects, b.effects
    document_a, document_b = document_of(a), document_of(b)
    effects = (
        pair
        for effect in dict.fromkeys((*effects_a, *effects_b))
        for pair in pairs_of(f"effects.{effect}", effects_a.get(effect, {}), effects_b.get(effect, {}), sigmas)
    )
    return Comparison(
        "calibration",
        _side(a, paths[0]),
        _side(b, paths[1]),
        sigmas,
        (*pairs_of("parameters", a.parameters.by_key, b.parameters.by_key, sigmas), *effects),
        tuple(Figure(name, figure_of(document_a, name), figure_of(document_b, name)) for name in FIGURES),
        (),
        tuple(_remarks(a, b)),
    )


def _side(result: Calibrated, path: str) -> Side:
    vehicle = result.vehicle.name
    what = f"vehicle {vehicle}" if result.of_vehicle else f"run {result.run} of {vehicle}"
    return Side(path, f"{what}, {result.started}" if result.started else what, str(result.verdict))


def _remarks(a: Calibrated, b: Calibrated) -> Iterator[str]:
    if a.vehicle.name != b.vehicle.name:
        yield f"two vehicles: {a.vehicle.name} and {b.vehicle.name}"
    yield from _shared(a, b)
    if a.variant != b.variant:
        yield f"variants differ: {a.variant} and {b.variant}"
    if a.provenance is None or b.provenance is None:
        return
    for title, told_a, told_b in (
        ("options", a.provenance.options, b.provenance.options),
        ("versions", a.provenance.versions, b.provenance.versions),
    ):
        if told_a and told_b and told_a != told_b:
            keys = [key for key in dict.fromkeys((*told_a, *told_b)) if told_a.get(key) != told_b.get(key)]
            each = (f"{key} {told_a.get(key, 'not told')} and {told_b.get(key, 'not told')}" for key in keys)
            yield f"{title} differ: {', '.join(each)}"


def _shared(a: Calibrated, b: Calibrated) -> Iterator[str]:
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


def _begin_apart(a: Calibrated, b: Calibrated) -> bool:
    return a.started is not None and b.started is not None and a.started != b.started


def _shared_by_name(a: Calibrated, b: Calibrated) -> str:
    if a.vehicle.name != b.vehicle.name:
        return ""
    common = [run for run in _runs(a) if run in _runs(b)]
    return "" if not common else f"the run {common[0]}" if len(common) == 1 else f"{len(common)} runs"


def _runs(result: Calibrated) -> list[str]:
    return [one.run for one in result.runs] if isinstance(result, VehicleCalibration) else [result.run]


def _data(result: Calibrated) -> set[str]:
    """Hashes of the files that hold measurements."""
    inputs = () if result.provenance is None else result.provenance.inputs
    return {one.sha256 for one in inputs if one.name.rpartition("/")[2] not in NOT_DATA}
