"""Documents of results, as files hold them, made of a few numbers."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

from sccal.results.saved import VEHICLE_RUN, Saved, read_saved

Json = dict[str, Any]

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


def saved(document: Json) -> Saved:
    """As if read from its file."""
    name = "vehicle.json" if document["run"] == VEHICLE_RUN else "calibration.json"
    return Saved(Path("out") / name, document)


def stored(folder: Path, document: Json, name: str = "calibration.json") -> Saved:
    """Written and read again."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(json.dumps(document), encoding="utf-8")
    return read_saved(folder / name)
