"""What an export starts from: one folder of results, its path on the earth, and times in UTC where there are any."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError, UsageError
from sccal.geodesy import TangentPlane
from sccal.results.document import read_document
from sccal.results.numbers import one_line
from sccal.results.saved import RESULT_FILE, VEHICLE_FILE, Saved, SavedTrajectory, read_saved, read_trajectory
from sccal.results.saved_model import MODEL_FILE, MODEL_SCHEMA, read_saved_model

CLOCKS_AGREE_S = 60.0
"""Between the path's first time in UTC and the start that calibration.json tells, which has whole seconds and is that
of the wheels."""


@dataclass(frozen=True)
class Result:
    """A calibration as it was written; its path is read when a format asks for it."""

    saved: Saved

    @property
    def subject(self) -> str:
        """Vehicle and run, on one line, for titles and comments."""
        saved = self.saved
        if saved.of_vehicle:
            count = len(saved.document.get("runs", ()))
            runs = f"{count} run{'' if count == 1 else 's'}"
            what = f"model of {runs}" if saved.document["schema"] == MODEL_SCHEMA else f"{runs} together"
            return one_line(f"vehicle {saved.vehicle}, {what}")
        return one_line(f"vehicle {saved.vehicle}, run {saved.run}")

    @cached_property
    def trajectory(self) -> SavedTrajectory:
        """The middle between the wheels in the tangent plane, each (n,), n > 0.

        Raises:
            UsageError: the result is that of a vehicle, or a model.
            DataError: trajectory.csv is missing, damaged or empty.
        """
        if self.saved.of_vehicle:
            raise UsageError(f"{self.saved.path}: runs together have no path; name the folder of one run, as OUT/run")
        folder = self.saved.path.parent
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
        origin = self.saved.document.get("origin") or {}
        try:
            lat_deg, lon_deg = float(origin["lat_deg"]), float(origin["lon_deg"])
            alt_m = float(origin.get("alt_m") or 0.0)
        except (TypeError, KeyError, ValueError, AttributeError) as error:
            raise DataError(f"{self.saved.path}: has no origin to place the path by; calibrate again") from error
        if not (abs(lat_deg) <= 90.0 and math.isfinite(lon_deg) and math.isfinite(alt_m)):
            raise DataError(f"{self.saved.path}: its origin, {lat_deg}, {lon_deg}, is no place on the earth")
        return TangentPlane(lat_deg, lon_deg, alt_m)

    @cached_property
    def lat_lon_deg(self) -> tuple[Floats, Floats]:
        """The path's latitudes and longitudes on WGS 84, each (n,); longitudes in [-180, 180)."""
        path = self.trajectory
        lat_deg, lon_deg = self.plane.to_lat_lon(path.east_m, path.north_m)
        return np.round(lat_deg, 9), wrapped_lon_deg(np.round(lon_deg, 9))

    @cached_property
    def utc(self) -> list[str] | None:
        """The path's times in UTC as ISO 8601 to the millisecond (n); None where the log has no date."""
        started = self.saved.document.get("started")
        if not isinstance(started, str):
            return None
        try:
            started_s = datetime.fromisoformat(started).timestamp()
        except ValueError as error:
            raise DataError(f"{self.saved.path}: started {started!r} is no time; calibrate again") from error
        milliseconds = np.round(1e3 * self._utc_s(started_s)).astype(np.int64).astype("datetime64[ms]")
        return [str(text) for text in np.datetime_as_string(milliseconds, timezone="UTC")]

    def _utc_s(self, started_s: float) -> Floats:
        """The logging clock minus its offset from UTC; from the start on where that does not lead to the start told."""
        t_s = self.trajectory.t_s
        since_start_s = t_s - t_s[0]
        clock = self.saved.document.get("clock") or {}
        offset_s, skew_ppm = clock.get("offset_at_start_s"), clock.get("skew_ppm") or 0.0
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
    if path.is_file() and read_document(path)[1] == MODEL_SCHEMA:
        return Result(read_saved_model(path))
    return Result(read_saved(path))


def wrapped_lon_deg(lon_deg: Floats) -> Floats:
    """Longitudes in [-180, 180), as GPX asks; those inside stay bit for bit."""
    outside = (lon_deg < -180.0) | (lon_deg >= 180.0)
    return np.where(outside, (lon_deg + 180.0) % 360.0 - 180.0, lon_deg)
