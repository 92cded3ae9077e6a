"""What an export starts from: one folder of results, its path on the earth, and times in UTC where there are any."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError, UsageError
from sccal.geodesy import TangentPlane
from sccal.results.calibration import VEHICLE_RUN, Calibrated, Calibration, Estimate, Trajectory, VehicleCalibration
from sccal.results.converter import read_json
from sccal.results.files import (
    MODEL_FILE,
    RESULT_FILE,
    VEHICLE_FILE,
    calibration_file,
    read_calibration,
    read_model,
    read_trajectory,
)
from sccal.results.model import JudgedModel
from sccal.results.numbers import one_line, plain

CLOCKS_AGREE_S = 60.0
"""Between the path's first time in UTC and the start that calibration.json tells, which has whole seconds and is that
of the wheels."""


@dataclass(frozen=True)
class Result:
    """A calibration as it was written, or a model; its path is read when a format asks for it."""

    path: Path
    """Of the JSON file."""
    subject: str
    """Vehicle and run, on one line, for titles and comments."""
    vehicle: str
    """Its name."""
    verdict: str
    """On one line; of a model how it was judged."""
    parameters: Mapping[str, Estimate]
    """By PARAMETERS, the heading offset in degrees."""
    effects: Mapping[str, Mapping[str, Estimate]]
    run: Calibration | None = None
    """None for runs together, which have no path."""

    @classmethod
    def of(cls, result: Calibrated, path: Path) -> Result:
        """Of a run's or a vehicle's calibration."""
        what = f"{_count(len(result.runs))} together" if isinstance(result, VehicleCalibration) else f"run {result.run}"
        return cls(
            path,
            one_line(f"vehicle {result.vehicle.name}, {what}"),
            result.vehicle.name,
            one_line(str(result.verdict)),
            result.parameters.by_key,
            result.effects,
            result if isinstance(result, Calibration) else None,
        )

    @classmethod
    def of_model(cls, model: JudgedModel, path: Path) -> Result:
        """Of a model that a diagnosis judged; an effect of one run alone goes by the run's name too."""
        drift = model.outage_end_rms_m
        judged = "" if drift is None else f": drift without fixes, held out, {plain(drift, 2)} m rms"
        return cls(
            path,
            one_line(f"vehicle {model.vehicle}, model of {_count(len(model.noises))}"),
            model.vehicle,
            f"model of a diagnosis{judged}",
            model.parameters.by_key,
            {f"{one.name} of run {one.run}" if one.run else one.name: one.parameters for one in model.effects},
        )

    @property
    def name(self) -> str:
        """The run's."""
        return VEHICLE_RUN if self.run is None else self.run.run

    @cached_property
    def trajectory(self) -> Trajectory:
        """The middle between the wheels in the tangent plane, each (n,), n > 0.

        Raises:
            UsageError: the result is that of a vehicle, or a model.
            DataError: trajectory.csv is missing, damaged or empty.
        """
        if self.run is None:
            raise UsageError(f"{self.path}: runs together have no path; name the folder of one run, as OUT/run")
        folder = self.path.parent
        trajectory = read_trajectory(folder)
        if trajectory.t_s.size == 0:
            raise DataError(f"{folder}: its trajectory has no rows; calibrate again")
        rows = np.column_stack((trajectory.t_s, trajectory.east_m, trajectory.north_m, trajectory.yaw_rad))
        if not np.isfinite(rows).all():
            row = int(np.argmin(np.isfinite(rows).all(axis=1)))
            raise DataError(f"{folder}: line {row + 2} of its trajectory is not finite; calibrate again")
        return trajectory

    @cached_property
    def plane(self) -> TangentPlane:
        """The run's tangent plane; at height 0 where calibration.json has none, 1.6e-7 of scale for each metre.

        Raises:
            DataError: calibration.json has no origin.
        """
        if self.run is None or math.isnan(self.run.origin.lat_deg + self.run.origin.lon_deg):
            raise DataError(f"{self.path}: has no origin to place the path by; calibrate again")
        lat_deg, lon_deg = self.run.origin.lat_deg, self.run.origin.lon_deg
        if not (abs(lat_deg) <= 90.0 and math.isfinite(lon_deg)):
            raise DataError(f"{self.path}: its origin, {lat_deg}, {lon_deg}, is no place on the earth")
        return TangentPlane(lat_deg, lon_deg, self.run.origin.alt_m)

    @cached_property
    def lat_lon_deg(self) -> tuple[Floats, Floats]:
        """The path's latitudes and longitudes on WGS 84, each (n,); longitudes in [-180, 180)."""
        path = self.trajectory
        lat_deg, lon_deg = self.plane.to_lat_lon(path.east_m, path.north_m)
        return np.round(lat_deg, 9), wrapped_lon_deg(np.round(lon_deg, 9))

    @cached_property
    def utc(self) -> list[str] | None:
        """The path's times in UTC as ISO 8601 to the millisecond (n); None where the log has no date."""
        started = None if self.run is None else self.run.started
        if started is None:
            return None
        try:
            started_s = datetime.fromisoformat(started).timestamp()
        except ValueError as error:
            raise DataError(f"{self.path}: started {started!r} is no time; calibrate again") from error
        milliseconds = np.round(1e3 * self._utc_s(started_s)).astype(np.int64).astype("datetime64[ms]")
        return [str(text) for text in np.datetime_as_string(milliseconds, timezone="UTC")]

    def _utc_s(self, started_s: float) -> Floats:
        """The logging clock minus its offset from UTC; from the start on where that does not lead to the start told."""
        t_s = self.trajectory.t_s
        since_start_s = t_s - t_s[0]
        assert self.run is not None
        offset_s, skew_ppm = self.run.clock.offset_at_start_s, self.run.clock.skew_ppm
        if offset_s is not None and abs(t_s[0] - offset_s - started_s) < CLOCKS_AGREE_S:
            return np.asarray(t_s - offset_s - 1e-6 * skew_ppm * since_start_s)
        if abs(t_s[0] - started_s) < CLOCKS_AGREE_S:
            return t_s
        return np.asarray(started_s + since_start_s)


def read_result(path: Path) -> Result:
    """The result in a JSON file, or in the folder that holds calibration.json, vehicle.json or model.json.

    Raises:
        UsageError: nothing of that name, or a folder without results.
        DataError: neither a calibration nor a model of the schemas.
    """
    if path.is_dir() and not any((path / name).is_file() for name in (RESULT_FILE, VEHICLE_FILE)):
        path = path / MODEL_FILE if (path / MODEL_FILE).is_file() else path
    path = calibration_file(path)
    if read_json(path)[1] == JudgedModel.SCHEMA:
        return Result.of_model(read_model(path), path)
    return Result.of(read_calibration(path), path)


def _count(runs: int) -> str:
    return f"{runs} run{'' if runs == 1 else 's'}"


def wrapped_lon_deg(lon_deg: Floats) -> Floats:
    """Longitudes in [-180, 180), as GPX asks; those inside stay bit for bit."""
    outside = (lon_deg < -180.0) | (lon_deg >= 180.0)
    return np.where(outside, (lon_deg + 180.0) % 360.0 - 180.0, lon_deg)
