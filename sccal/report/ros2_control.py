"""ros2_control.yaml: parameters of ros2_controllers' diff_drive_controller.

The nominal geometry stays as declared, the multipliers carry the calibration. A multiplier departs from 1.0 only where
the data estimated it; elsewhere a comment says why not.
"""

from __future__ import annotations

import math

from sccal import __version__
from sccal.calibration.result import Calibration, Estimate, VehicleCalibration
from sccal.report.numbers import one_line, value_and_sigma
from sccal.report.verdict import run_verdict, vehicle_verdict


def ros2_control_yaml(calibrated: Calibration | VehicleCalibration) -> str:
    """The file's text; comments are the only place of names and reasons."""
    vehicle, parameters = calibrated.vehicle, calibrated.parameters
    if isinstance(calibrated, Calibration):
        subject, verdict = f"run {calibrated.run}", run_verdict(calibrated)
    else:
        subject, verdict = f"{len(calibrated.runs)} runs together", vehicle_verdict(calibrated)
    return "\n".join(
        [
            f"# {one_line(f'vehicle {vehicle.name}, {subject}')}",
            f"# {verdict}",
            f"# Written by sccal {__version__}. Nominal values are kept; the multipliers carry the calibration.",
            "diff_drive_controller:",
            "  ros__parameters:",
            f"    wheel_separation: {_double(vehicle.track_m)}  # m, nominal",
            f"    wheel_radius: {_double(vehicle.wheel_radius_m)}  # m, nominal",
            _multiplier("wheel_separation_multiplier", parameters.track_m, vehicle.track_m),
            _multiplier("left_wheel_radius_multiplier", parameters.radius_left_m, vehicle.wheel_radius_m),
            _multiplier("right_wheel_radius_multiplier", parameters.radius_right_m, vehicle.wheel_radius_m),
            "",
        ]
    )


def _multiplier(name: str, estimate: Estimate, nominal: float) -> str:
    ratio = estimate.value / nominal if nominal > 0.0 else math.nan
    if estimate.status == "estimated" and math.isfinite(ratio):
        value, sigma = value_and_sigma(estimate.value, estimate.sigma)
        return f"    {name}: {_double(ratio)}  # {value} +/- {sigma} m"
    why = {
        "estimated": "no value",
        "unobserved": "not observed in this data",
        "at_bound": "stopped at its bound, not to be trusted",
        "held": "held, not estimated",
    }[estimate.status]
    reason = one_line(estimate.reason)
    return f"    {name}: 1.0  # {why}{f': {reason}' if reason else ''}"


def _double(value: float) -> str:
    """With a decimal point and no exponent: ROS 2 takes ``1`` for an integer and refuses it for a double."""
    if not math.isfinite(value):
        return ".nan"
    digits = f"{value:.9f}".rstrip("0")
    return f"{digits}0" if digits.endswith(".") else digits
