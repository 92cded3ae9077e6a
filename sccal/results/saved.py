"""calibration.json and vehicle.json read again (schema ``sccal.calibration/1``), and the trajectory beside them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError, UsageError
from sccal.results.document import read_document

SCHEMA = "sccal.calibration/1"
SUMMARY_SCHEMA = "sccal.summary/1"
RESULT_FILE = "calibration.json"
VEHICLE_FILE = "vehicle.json"
SUMMARY_FILE = "summary.json"
TRAJECTORY_FILE = "trajectory.csv"
VEHICLE_RUN = "(vehicle)"
"""The ``run`` of a vehicle's file; no folder of results can have that name on its own."""
PARAMETERS = ("radius_right_m", "radius_left_m", "track_m", "heading_offset_deg")
TRAJECTORY_COLUMNS = ("t", "east_m", "north_m", "yaw_rad", "sigma_east_m", "sigma_north_m", "sigma_yaw_rad")

Json = dict[str, Any]


@dataclass(frozen=True)
class SavedEstimate:
    """One parameter as a file tells it, in the unit of its key."""

    value: float
    """NaN where the file has null."""
    sigma: float
    status: str
    reason: str = ""
    nominal: float | None = None


@dataclass(frozen=True)
class Saved:
    """One calibration, of a run or of a vehicle, as its file tells it."""

    path: Path
    """Of the JSON file."""
    document: Json

    @property
    def run(self) -> str:
        """The run's name; VEHICLE_RUN for a vehicle's file."""
        return str(self.document["run"])

    @property
    def vehicle(self) -> str:
        return str(self.document["vehicle"])

    @property
    def of_vehicle(self) -> bool:
        """Whether it is several runs as one problem."""
        return self.run == VEHICLE_RUN

    @property
    def verdict(self) -> str:
        """``good``, ``partial`` or ``doubtful``, a colon and why."""
        return str(self.document.get("verdict", ""))

    @property
    def parameters(self) -> Mapping[str, SavedEstimate]:
        """Those of PARAMETERS by key, in that order; the heading offset in degrees."""
        return {key: read_estimate(self.document["parameters"][key]) for key in PARAMETERS}

    @property
    def effects(self) -> Mapping[str, Mapping[str, SavedEstimate]]:
        """Effects beyond the model, and their parameters by name."""
        return {
            effect: {name: read_estimate(block) for name, block in named.items()}
            for effect, named in self.document.get("effects", {}).items()
        }


@dataclass(frozen=True)
class SavedTrajectory:
    """trajectory.csv: the middle between the wheels in the tangent plane, each (n,)."""

    t_s: Floats
    east_m: Floats
    north_m: Floats
    yaw_rad: Floats
    sigma_east_m: Floats
    sigma_north_m: Floats
    sigma_yaw_rad: Floats


def read_saved(path: Path) -> Saved:
    """A calibration from its JSON file, or from the folder that holds calibration.json or vehicle.json.

    Raises:
        UsageError: there is no such file or folder, or the folder holds no result.
        DataError: the file is no calibration of the schema.
    """
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    if path.is_dir():
        there = [path / name for name in (RESULT_FILE, VEHICLE_FILE) if (path / name).is_file()]
        if not there:
            raise UsageError(f"{path}: holds no {RESULT_FILE}; name the folder of one run's results, as OUT/run")
        path = there[0]
    document, schema = read_document(path)
    if schema != SCHEMA:
        raise DataError(f"{path}: its schema is {schema!r}, not {SCHEMA}; name a calibration's JSON file or folder")
    saved = Saved(path, document)
    try:
        _ = saved.run, saved.vehicle, saved.parameters, saved.effects
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{path}: not all of a calibration is there ({error!r}); calibrate again") from error
    return saved


def read_trajectory(folder: Path, most_rows: int | None = None) -> SavedTrajectory:
    """trajectory.csv of a folder of results; evenly chosen rows and the last one where there are more than wanted.

    Raises:
        DataError: it is missing or damaged.
    """
    path = folder / TRAJECTORY_FILE
    try:
        with path.open(encoding="utf-8") as file:
            header = file.readline().strip().split(",")
            rows = file.read().splitlines()
            rows = rows if most_rows is None else _evenly(rows, most_rows)
            table = np.loadtxt(rows, delimiter=",", ndmin=2, dtype=np.float64) if rows else np.empty((0, 0))
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read ({error}); calibrate again") from error
    if tuple(header) != TRAJECTORY_COLUMNS or (table.size and table.shape[1] != len(TRAJECTORY_COLUMNS)):
        raise DataError(f"{path}: its columns are {','.join(header)}, expected {','.join(TRAJECTORY_COLUMNS)}")
    return SavedTrajectory(*table.reshape(-1, len(TRAJECTORY_COLUMNS)).T)


def _evenly(rows: list[str], most: int) -> list[str]:
    stride = max(1, -(-(len(rows) - 1) // max(most - 1, 1)))
    return [*rows[:-1:stride], *rows[-1:]]


def read_estimate(block: Json) -> SavedEstimate:
    """From its block in a file; raises KeyError where a part is missing, ValueError or TypeError where one is wrong."""
    nominal = block.get("nominal")
    return SavedEstimate(
        _number(block["value"]),
        _number(block["sigma"]),
        str(block["status"]),
        str(block.get("reason", "")),
        None if nominal is None else float(nominal),
    )


def _number(value: object) -> float:
    return math.nan if value is None else float(value)  # type: ignore[arg-type]
