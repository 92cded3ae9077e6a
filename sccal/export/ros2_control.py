"""Parameters of ros2_controllers' diff_drive_controller, as YAML; lengths in metres.

The nominal geometry stays as declared, the multipliers carry the calibration. A multiplier departs from 1.0 only where
the data estimated it; elsewhere a comment says why not. Names and meaning: diff_drive_controller_parameter.yaml of
github.com/ros-controls/ros2_controllers.
"""

from __future__ import annotations

import math

from sccal import __version__
from sccal.export.estimates import usable, why_not, with_sigma
from sccal.export.result import Result
from sccal.results.calibration import Estimate


def write_ros2_control(result: Result) -> str:
    """The same text as the ``ros2_control.yaml`` of the run or vehicle."""
    parameters = result.parameters
    right, left, track = (parameters[key] for key in ("radius_right_m", "radius_left_m", "track_m"))
    radius = left.nominal if left.nominal is not None else right.nominal
    return "\n".join(
        [
            f"# {result.subject}",
            f"# {result.verdict}",
            f"# Written by sccal {__version__}. Nominal values are kept; the multipliers carry the calibration.",
            "diff_drive_controller:",
            "  ros__parameters:",
            f"    wheel_separation: {ros_double(track.nominal)}  # m, nominal",
            f"    wheel_radius: {ros_double(radius)}  # m, nominal",
            _multiplier("wheel_separation_multiplier", track),
            _multiplier("left_wheel_radius_multiplier", left),
            _multiplier("right_wheel_radius_multiplier", right),
            "",
        ]
    )


def _multiplier(name: str, estimate: Estimate) -> str:
    nominal = estimate.nominal
    if usable(estimate) and nominal is not None and nominal > 0.0:
        return f"    {name}: {ros_double(estimate.value / nominal)}  # {with_sigma(estimate, 'm')}"
    return f"    {name}: 1.0  # {why_not(estimate)}"


def ros_double(value: float | None, decimals: int = 9) -> str:
    """With a decimal point and no exponent: ROS 2 takes ``1`` for an integer and refuses it for a double."""
    if value is None or not math.isfinite(value):
        return ".nan"
    digits = f"{value:.{decimals}f}".rstrip("0")
    return f"{digits}0" if digits.endswith(".") else digits
