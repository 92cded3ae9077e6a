"""Two simulated robots, calibrated and written: what exports start from, and the truth to judge them by."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.export.result import Result, read_result
from sccal.report.write import write_numbers
from sccal.results.calibration import Calibration
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import SimulatedRun, simulate_run
from tests.runs import SMALL, read

SOUTH_WEST = ("gnss.origin_lat_deg=-33.9", "gnss.origin_lon_deg=-70.6", "gnss.alt_m=800")
"""Both signs negative, and high enough for the height to show in the path."""


@dataclass(frozen=True)
class Robot:
    """One simulated drive and its results."""

    results: Path
    simulated: SimulatedRun
    calibration: Calibration

    @property
    def exported(self) -> Result:
        return read_result(self.results)

    @property
    def yaw_enu_rad(self) -> np.ndarray:
        """The AHRS readings, turned into enu as a ROS driver must, at ``simulated.ahrs.true_t_s``."""
        yaw = np.radians(self.simulated.ahrs.yaw_deg)
        return np.pi / 2 - yaw if self.simulated.settings.ahrs.convention == "ned" else yaw


def calibrated(folder: Path, *chosen: str, effects: tuple[str, ...] = (), duration_s: float = 150.0) -> Robot:
    settings = settings_from([f"drive.duration_s={duration_s}", *SMALL, *SOUTH_WEST, *chosen], seed=5)
    simulated = simulate_run(settings)
    write_run(simulated, folder / "logs" / "monday")
    write_vehicle_file(settings, folder / "logs" / "monday")
    calibration, _ = calibrate_run(read(folder / "logs" / "monday"), CalibrationOptions(effects=effects))
    results = folder / "out" / "monday"
    write_numbers(calibration, results)
    return Robot(results, simulated, calibration)


@pytest.fixture(scope="session")
def enu_robot(tmp_path_factory) -> Robot:
    """Antenna forward and to the right; an AHRS that reads too small; a logging clock that begins at zero."""
    return calibrated(
        tmp_path_factory.mktemp("enu"),
        "ahrs.heading_offset_deg=-23.5",
        "gnss.antenna_forward_m=0.4",
        "gnss.antenna_left_m=-0.25",
        "clock.host_epoch_offset_s=1717243200",
        effects=("lever_arm",),
    )


@pytest.fixture(scope="session")
def ned_robot(tmp_path_factory) -> Robot:
    """A compass, clockwise from north, mounted almost backwards."""
    return calibrated(tmp_path_factory.mktemp("ned"), "ahrs.heading_offset_deg=160", "ahrs.convention=ned")


@pytest.fixture(scope="session")
def straight_robot(tmp_path_factory) -> Robot:
    """A straight line, which shows no track."""
    return calibrated(tmp_path_factory.mktemp("straight"), "drive.path=straight", duration_s=60.0)
