"""A run whose heading only the receiver gives calibrates as the same heading in ahrs.csv does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.logs.write import write_table, write_text
from sccal.simulate.choose import settings_from
from sccal.simulate.files import nmea_lines, write_run, write_vehicle_file
from sccal.simulate.run import SimulatedRun, simulate_run
from tests.receiver import avr, hdt, ksxt, pashr, ths
from tests.runs import read

MAKE = {
    "hdt": lambda utc_s, compass: hdt(compass),
    "ths": lambda utc_s, compass: ths(compass),
    "pashr": pashr,
    "avr": avr,
    "ksxt": lambda utc_s, compass: ksxt(utc_s, quality=0, compass_deg=compass),
}


@pytest.fixture(scope="module")
def simulated() -> SimulatedRun:
    chosen = ["drive.path=general", "drive.duration_s=200", "encoder.rate_hz=20", "ahrs.rate_hz=100"]
    return simulate_run(settings_from([*chosen, "gnss.receive_delay_s=0.004", "gnss.receive_jitter_s=0.001"], 1))


def compass_deg(simulated: SimulatedRun) -> np.ndarray:
    """At the fixes' epochs, to two places."""
    yaw_deg = np.unwrap(simulated.ahrs.yaw_deg, period=360)
    epochs_s = simulated.gnss.utc_s - simulated.settings.clock.host_epoch_offset_s
    return np.round((90.0 - np.interp(epochs_s, simulated.ahrs.host_t_s, yaw_deg)) % 360.0, 2) % 360.0


def with_receiver_heading(simulated: SimulatedRun, folder: Path, kind: str) -> Path:
    write_run(simulated, folder)
    write_vehicle_file(simulated.settings, folder)
    (folder / "ahrs.csv").unlink()
    headings = dict(zip(np.round(simulated.gnss.utc_s, 2).tolist(), compass_deg(simulated).tolist(), strict=True))
    lines = []
    for line in nmea_lines(simulated):
        lines.append(line)
        if "GGA" in line:
            utc_s, compass = next(iter(headings.items()))
            headings.pop(utc_s)
            lines.append(line.split()[0] + " " + MAKE[kind](utc_s, compass))
    write_text(folder / "gnss.nmea", "\n".join(lines) + "\n")
    return folder


def with_ahrs(simulated: SimulatedRun, folder: Path) -> Path:
    write_run(simulated, folder)
    write_vehicle_file(simulated.settings, folder)
    epochs_s = simulated.gnss.utc_s - simulated.settings.clock.host_epoch_offset_s
    columns = {"t": epochs_s, "yaw_deg": 90.0 - compass_deg(simulated)}
    write_table(folder / "ahrs.csv", columns, {"t": "%.4f", "yaw_deg": "%.2f"})
    return folder


def test_the_same_parameters_within_a_tenth_of_their_sigmas(simulated: SimulatedRun, tmp_path: Path) -> None:
    parameters = [
        calibrate_run(read(folder), CalibrationOptions())[0].parameters
        for folder in (with_ahrs(simulated, tmp_path / "a"), with_receiver_heading(simulated, tmp_path / "b", "hdt"))
    ]
    for name in ("radius_right_m", "radius_left_m", "track_m", "heading_offset_rad"):
        by_ahrs, by_receiver = (getattr(one, name) for one in parameters)
        assert abs(by_receiver.value - by_ahrs.value) < 0.1 * by_ahrs.sigma, name
    offset = parameters[1].heading_offset_rad
    assert abs(offset.value - np.radians(simulated.settings.ahrs.heading_offset_deg)) < 4 * offset.sigma


@pytest.mark.parametrize("kind", ["ths", "pashr", "avr", "ksxt"])
def test_every_kind_is_the_same_heading(simulated: SimulatedRun, tmp_path: Path, kind: str) -> None:
    by_hdt = read(with_receiver_heading(simulated, tmp_path / "hdt", "hdt")).heading
    heading = read(with_receiver_heading(simulated, tmp_path / kind, kind)).heading
    np.testing.assert_allclose(heading.utc_s, by_hdt.utc_s, atol=1e-6)
    np.testing.assert_allclose(np.exp(1j * heading.yaw_rad), np.exp(1j * by_hdt.yaw_rad), atol=1e-12)
    assert heading.convention == "ned"
