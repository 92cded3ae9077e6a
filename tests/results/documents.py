"""Documents of results, as files hold them, made of a few numbers."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import jsonschema

from sccal.results.calibration import VEHICLE_RUN, Calibrated, Calibration, VehicleCalibration
from sccal.results.converter import document_of, result_from
from sccal.results.files import read_calibration

Json = dict[str, Any]
SCHEMAS = Path(__file__).resolve().parents[2] / "docs" / "schemas"

_ESTIMATES = {
    "radius_right_m": (0.0808, 2e-5, 0.08),
    "radius_left_m": (0.0796, 2e-5, 0.08),
    "track_m": (0.728, 1e-3, 0.70),
    "heading_offset_deg": (12.5, 0.2, None),
}


def estimate(
    value: float | None, sigma: float | None, status: str = "estimated", reason: str = "", **more: Any
) -> Json:
    """One parameter's block."""
    return {"value": value, "sigma": sigma, "status": status, "reason": reason, "nominal": None, **more}


def calibration(run: str = "yard", vehicle: str = "demo", **parameters: Json) -> Json:
    """A good run's calibration.json; ``parameters`` replace whole blocks by their key."""
    return {
        "schema": "sccal.calibration/1",
        "run": run,
        "vehicle": vehicle,
        "started": "2026-05-01T12:00:00Z",
        "variant": "sc_ekf_offset",
        "verdict": "good: all four parameters estimated; nothing to doubt",
        "parameters": {
            key: estimate(value, sigma, nominal=nominal) for key, (value, sigma, nominal) in _ESTIMATES.items()
        }
        | copy.deepcopy(parameters),
        "effects": {},
        "origin": {"lat_deg": 37.5, "lon_deg": 15.1, "alt_m": 20.0},
        "fit": {"nis_gnss": 1.01, "nis_heading": 0.98, "fixes_rejected": 0, "gnss_innovation_rms_m": 0.015},
        "outage": {"window_s": 30.0, "windows": 8, "rms_m": 0.05, "end_rms_m": 0.08, "percent_of_distance": 0.4},
        "reference": None,
        "provenance": None,
    }


def vehicle(name: str = "demo", **parameters: Json) -> Json:
    """A vehicle.json of two runs, ``yard`` and ``lane``."""
    document = calibration(VEHICLE_RUN, name, **parameters)
    del document["started"]
    runs = [calibration(run, name) for run in ("yard", "lane")]
    document["runs"] = [{key: one[key] for key in ("run", "verdict", "parameters")} for one in runs]
    return document


def saved(document: Json) -> Calibrated:
    """As if read from its file."""
    return result_from(document, VehicleCalibration if document["run"] == VEHICLE_RUN else Calibration)


def retold(result: Calibrated, **blocks: Any) -> Calibrated:
    """The result as its document would tell it with some blocks exchanged."""
    return saved(document_of(result) | blocks)


def stored(folder: Path, document: Json, name: str = "calibration.json") -> Calibrated:
    """Written and read again."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(json.dumps(document), encoding="utf-8")
    return read_calibration(folder / name)


def schema_file(document: Json) -> Path:
    """Where docs has the schema of such a document."""
    name = document["schema"].partition(".")[2].partition("/")[0]
    return SCHEMAS / f"{'vehicle' if document.get('run') == VEHICLE_RUN else name}.json"


def held_to_its_schema(document: Json | str) -> None:
    """Raises jsonschema.ValidationError where a document is not what docs/schemas says."""
    document = json.loads(document) if isinstance(document, str) else document
    jsonschema.validate(document, json.loads(schema_file(document).read_text("utf-8")))
