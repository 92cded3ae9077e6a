"""ros2_control.yaml: what ``sccal export ros2_control`` makes of the same results."""

from __future__ import annotations

from pathlib import Path

from sccal.export.result import Result
from sccal.export.ros2_control import write_ros2_control
from sccal.report.as_json import calibration_json, vehicle_json
from sccal.results.calibration import Calibration, VehicleCalibration
from sccal.results.saved import RESULT_FILE, VEHICLE_FILE, Saved


def ros2_control_yaml(calibrated: Calibration | VehicleCalibration) -> str:
    """The file's text, from the same document that the JSON file holds."""
    if isinstance(calibrated, Calibration):
        saved = Saved(Path(RESULT_FILE), calibration_json(calibrated))
    else:
        saved = Saved(Path(VEHICLE_FILE), vehicle_json(calibrated))
    return write_ros2_control(Result(saved))
