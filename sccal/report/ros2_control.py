"""ros2_control.yaml: what ``sccal export ros2_control`` makes of the same results."""

from __future__ import annotations

from pathlib import Path

from sccal.export.result import Result
from sccal.export.ros2_control import write_ros2_control
from sccal.results.calibration import Calibrated


def ros2_control_yaml(calibrated: Calibrated) -> str:
    """The file's text."""
    return write_ros2_control(Result.of(calibrated, Path()))
