"""The files that results stand in: their names, and reading them again."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import numpy as np

from sccal.errors import DataError, UsageError
from sccal.results.calibration import (
    CALIBRATION_SCHEMA,
    VEHICLE_RUN,
    Calibrated,
    Calibration,
    Trajectory,
    VehicleCalibration,
)
from sccal.results.converter import WrongPartError, read_json, result_from
from sccal.results.diagnosis import Diagnosis
from sccal.results.model import JudgedModel

RESULT_FILE = "calibration.json"
VEHICLE_FILE = "vehicle.json"
SUMMARY_FILE = "summary.json"
DIAGNOSIS_FILE = "diagnosis.json"
MODEL_FILE = "model.json"
TRAJECTORY_FILE = "trajectory.csv"
TRAJECTORY_COLUMNS = ("t", "east_m", "north_m", "yaw_rad", "sigma_east_m", "sigma_north_m", "sigma_yaw_rad")

Kind = TypeVar("Kind")


def calibration_file(path: Path) -> Path:
    """A calibration's JSON file: itself, or calibration.json or vehicle.json in a folder.

    Raises:
        UsageError: there is no such file or folder, or the folder holds no result.
    """
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    if not path.is_dir():
        return path
    there = [path / name for name in (RESULT_FILE, VEHICLE_FILE) if (path / name).is_file()]
    if not there:
        raise UsageError(f"{path}: holds no {RESULT_FILE}; name the folder of one run's results, as OUT/run")
    return there[0]


def read_calibration(path: Path) -> Calibrated:
    """A calibration of a run or of a vehicle, from its JSON file.

    Raises:
        DataError: the file is no calibration of the schema.
    """
    document, schema = read_json(path)
    if schema != CALIBRATION_SCHEMA:
        raise DataError(
            f"{path}: its schema is {schema!r}, not {CALIBRATION_SCHEMA}; name a calibration's JSON file or folder"
        )
    if document.get("run") == VEHICLE_RUN:
        return _whole(document, VehicleCalibration, path, "a calibration", "calibrate")
    return _whole(document, Calibration, path, "a calibration", "calibrate")


def read_diagnosis(path: Path) -> Diagnosis:
    """A diagnosis from its JSON file.

    Raises:
        DataError: the file is no diagnosis of the schema.
    """
    document, schema = read_json(path)
    if schema != Diagnosis.SCHEMA:
        raise DataError(f"{path}: its schema is {schema!r}, not {Diagnosis.SCHEMA}")
    return _whole(document, Diagnosis, path, "a diagnosis", "diagnose")


def read_model(path: Path) -> JudgedModel:
    """A model from its JSON file; whether this version has its effects is for its user to ask.

    Raises:
        DataError: it is no model of the schema; the message says what is wrong, and where.
    """
    document, schema = read_json(path)
    if schema != JudgedModel.SCHEMA:
        raise DataError(
            f"{path}: its schema is {schema!r}, not {JudgedModel.SCHEMA}; name the model.json of a diagnosis"
        )
    try:
        return result_from(document, JudgedModel)
    except WrongPartError as error:
        raise DataError(f"{path}: {error}") from error


def read_trajectory(folder: Path, most_rows: int | None = None) -> Trajectory:
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
    return Trajectory(*table.reshape(-1, len(TRAJECTORY_COLUMNS)).T)


def _whole(document: object, kind: type[Kind], path: Path, what: str, again: str) -> Kind:
    try:
        return result_from(document, kind)
    except WrongPartError as error:
        raise DataError(f"{path}: not all of {what} is there ({error}); {again} again") from error


def _evenly(rows: list[str], most: int) -> list[str]:
    stride = max(1, -(-(len(rows) - 1) // max(most - 1, 1)))
    return [*rows[:-1:stride], *rows[-1:]]
