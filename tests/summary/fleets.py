"""Fleets whose past is known: results of runs as files would tell them, with dates, drifts and steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from sccal.arrays import Floats
from sccal.report.run.trajectory import CSV_HEADER
from sccal.results.calibration import CALIBRATION_SCHEMA, VEHICLE_RUN, Calibration, VehicleCalibration
from sccal.results.converter import document_of, json_text
from tests.results.documents import retold, saved

FIRST_DAY = datetime(2026, 5, 3, 9, 30, tzinfo=UTC)
TRUE = {"radius_right_m": 0.0808, "radius_left_m": 0.0796, "track_m": 0.728, "heading_offset_deg": 12.5}
SIGMA = {"radius_right_m": 2.5e-5, "radius_left_m": 2.5e-5, "track_m": 9e-4, "heading_offset_deg": 0.15}


def estimate(value: float, sigma: float, status: str = "estimated") -> dict[str, Any]:
    return {"value": value, "sigma": sigma, "status": status, "reason": "", "nominal": None, "prior_sigma": None}


def document(
    run: str,
    started: datetime | None,
    parameters: dict[str, dict[str, Any]],
    vehicle: str = "tracked-demo",
    **more: Any,
) -> dict[str, Any]:
    """What stands in a run's calibration.json, as far as a summary reads it."""
    return {
        "schema": CALIBRATION_SCHEMA,
        "sccal_version": "0.1.0",
        "run": run,
        "vehicle": vehicle,
        "started": None if started is None else started.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "verdict": "good: all four parameters estimated, predictions consistent with the measurements",
        "parameters": parameters,
        "effects": {},
        "fit": {"gnss_innovation_rms_m": 0.0152, "nis_gnss": 1.01, "fixes_used": 588, "recoveries": 0},
        "outage": {"each": [{}] * 8, "window_s": 30.0, "rms_m": 0.06, "end_rms_m": 0.08, "percent_of_distance": 0.4},
        "drive": {"duration_s": 300.0, "distance_m": 160.0},
        "notices": [],
        "provenance": {
            "inputs": [{"name": f"{run}/encoder.csv", "bytes": 10, "sha256": "ab" * 32}],
            "options": {},
            "versions": {"sccal": "0.1.0", "numpy": "2.0.0"},
        },
        **more,
    }


def history(
    count: int,
    seed: int = 0,
    days: float = 60.0,
    change: dict[str, Floats] | None = None,
    vehicle: str = "tracked-demo",
    prefix: str = "run",
    with_dates: bool = True,
    **more: Any,
) -> list[Calibration]:
    """Runs evenly over so many days; ``change`` (count,) is added to the truth of a parameter."""
    rng = np.random.default_rng(seed)
    change = change or {}
    made = []
    for k in range(count):
        parameters = {
            key: estimate(
                TRUE[key] + float(change[key][k] if key in change else 0.0) + SIGMA[key] * rng.normal(), SIGMA[key]
            )
            for key in TRUE
        }
        started = FIRST_DAY + timedelta(days=days * k / max(count - 1, 1)) if with_dates else None
        run = f"{prefix}{k:03d}"
        made.append(saved(document(run, started, parameters, vehicle, **more)))
    return made


def of_vehicle(runs: Sequence[Calibration], file: str = "vehicle.json") -> dict[str, VehicleCalibration]:
    """The runs' vehicle by the name of its file, with their plain means."""
    means = {
        key: estimate(float(np.mean([one.parameters.by_key[key].value for one in runs])), SIGMA[key] / len(runs) ** 0.5)
        for key in TRUE
    }
    made = document(VEHICLE_RUN, None, means, runs[0].vehicle.name)
    return {file: replace(saved(made), runs=tuple(runs))}


def with_parameter(run: Calibration, key: str, block: dict[str, Any]) -> Calibration:
    """The run with one parameter told otherwise."""
    return retold(run, parameters=document_of(run)["parameters"] | {key: block})


def written(runs: Sequence[Calibration], out: Path, rows: int = 300, seed: int = 1) -> None:
    """Each run's calibration.json and a trajectory of so many rows, into its folder below ``out``."""
    rng = np.random.default_rng(seed)
    for run in runs:
        folder = out / run.run
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "calibration.json").write_text(json_text(document_of(run)), encoding="utf-8")
        yaw = np.cumsum(rng.normal(0.0, 0.02, rows) + 0.02 * np.sin(np.arange(rows) / 200.0))
        table = np.column_stack([0.1 * np.arange(rows), np.cumsum(np.cos(yaw)) / 10, np.cumsum(np.sin(yaw)) / 10, yaw])
        lines = [f"{t:.6f},{e:.4f},{n:.4f},{y:.6f},0.01000,0.01000,0.0020000\n" for t, e, n, y in table.tolist()]
        (folder / "trajectory.csv").write_text(CSV_HEADER + "".join(lines), encoding="utf-8")
