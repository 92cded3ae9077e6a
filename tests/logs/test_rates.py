"""Wheels as speeds or metres: units, signs, gaps, and what no robot drives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sccal.arrays import Floats
from sccal.convert.from_folder import tables_of_folder
from sccal.errors import DataError
from sccal.inspect.read import read_streams
from sccal.logs.encoder import read_encoder
from sccal.logs.rates import integrated
from sccal.logs.run import discover
from sccal.logs.streams import Notice, Vehicle, WheelStream
from sccal.logs.wheel_units import UNITS

T_S = 0.02 * np.arange(500)
LEFT_RADPS, RIGHT_RADPS = 3.0 + np.sin(T_S), -1.0 + 0.5 * np.cos(T_S)
LEFT_RAD, RIGHT_RAD = 3.0 * T_S + 1.0 - np.cos(T_S), -T_S + 0.5 * np.sin(T_S)
RADIUS_M = 0.25
IN_RADIANS = {
    "radps": 1.0, "degps": 57.29577951308232, "rpm": 9.549296585513721, "rps": 0.15915494309189535,
    "mps": RADIUS_M, "mmps": 1000.0 * RADIUS_M, "m": RADIUS_M, "mm": 1000.0 * RADIUS_M,
}  # fmt: skip


def read(
    folder: Path, left: Floats, right: Floats, names: str = "left_radps,right_radps", t_s: Floats = T_S
) -> tuple[WheelStream, tuple[Notice, ...]]:
    rows = [f"{t:.4f},{a:.9f},{b:.9f}" for t, a, b in zip(t_s, left, right, strict=True)]
    (folder / "encoder.csv").write_text("\n".join([f"t,{names}", *rows, ""]))
    return read_encoder(folder / "encoder.csv", Vehicle("demo", folder / "vehicle.toml", RADIUS_M, 0.7))


def test_the_integral_is_the_trapezoids() -> None:
    np.testing.assert_allclose(integrated(np.array([0.0, 1.0, 3.0]), np.array([1.0, 2.0, -4.0])), [0.0, 1.5, -0.5])


@pytest.mark.parametrize("name", UNITS)
def test_each_unit_gives_the_same_angles_with_their_signs(tmp_path: Path, name: str) -> None:
    per_rad = IN_RADIANS[name]
    left, right = (LEFT_RADPS, RIGHT_RADPS) if UNITS[name].rate else (LEFT_RAD, RIGHT_RAD)
    stream, notices = read(tmp_path, per_rad * left, per_rad * right, f"left_{name},right_{name}")
    np.testing.assert_allclose(stream.left_rad, LEFT_RAD, atol=1e-3)
    np.testing.assert_allclose(stream.right_rad, RIGHT_RAD, atol=1e-3)
    assert not stream.loose.any()
    told = [notice for notice in notices if f"left_{name}" in notice.what]
    assert [notice.count for notice in told] == [500]
    assert ("nominal radius 0.25 m" in told[0].what) == (UNITS[name].m > 0)
    assert ("integrated" in told[0].what) == UNITS[name].rate


@pytest.mark.parametrize(
    "names",
    [
        "Left RPM,Right RPM", "left_wheel_rpm,right_wheel_rpm", "rpm_left,rpm_right", "left_speed_rpm,right_speed_rpm",
        "speed_left_rpm,speed_right_rpm", "l_rpm,r_rpm", "wheel_left_vel_rpm,wheel_right_vel_rpm",
    ],
)  # fmt: skip
def test_usual_spellings_are_taken(tmp_path: Path, names: str) -> None:
    per_rad = IN_RADIANS["rpm"]
    stream, _ = read(tmp_path, per_rad * LEFT_RADPS, per_rad * RIGHT_RADPS, names)
    np.testing.assert_allclose(stream.left_rad, LEFT_RAD, atol=1e-3)


@pytest.mark.parametrize(
    "names", ["left_rad_s,right_rad_s", "left_m_s,right_m_s", "left_velocity_m_per_s,right_velocity_m_per_s"]
)
def test_units_in_words_are_taken(tmp_path: Path, names: str) -> None:
    per_rad = RADIUS_M if "m_" in names else 1.0
    stream, _ = read(tmp_path, per_rad * LEFT_RADPS, per_rad * RIGHT_RADPS, names)
    np.testing.assert_allclose(stream.right_rad, RIGHT_RAD, atol=1e-3)


@pytest.mark.parametrize("names", ["left_speed,right_speed", "left_cmd_rpm,right_cmd_rpm", "left_rpm,right_radps"])
def test_what_is_no_measured_speed_of_both_wheels_is_refused(tmp_path: Path, names: str) -> None:
    with pytest.raises(DataError, match=r"needs t,left_ticks,right_ticks or .*left_rpm"):
        read(tmp_path, LEFT_RADPS, RIGHT_RADPS, names)


def test_counts_come_before_speeds(tmp_path: Path) -> None:
    rows = [f"{t:.4f},{a:.6f},{a:.6f},9,9" for t, a in zip(T_S, LEFT_RAD, strict=True)]
    (tmp_path / "encoder.csv").write_text("\n".join(["t,left_rad,right_rad,left_rpm,right_rpm", *rows, ""]))
    stream, _ = read_encoder(tmp_path / "encoder.csv", Vehicle("demo", tmp_path / "vehicle.toml", RADIUS_M, 0.7))
    np.testing.assert_allclose(stream.left_rad, LEFT_RAD, atol=1e-5)
    assert set(stream.extras) == {"left_rpm", "right_rpm"}


@pytest.mark.parametrize("standing", [False, True])
def test_nothing_relies_on_a_gap_and_it_is_told(tmp_path: Path, standing: bool) -> None:
    """Also where both ends stand: a speed says nothing of the time between."""
    keep = (T_S < 4.0) | (T_S > 6.0)
    speed = np.where(np.abs(T_S - 5.0) < 2.0, 0.0, LEFT_RADPS) if standing else LEFT_RADPS
    stream, notices = read(tmp_path, speed[keep], RIGHT_RADPS[keep] * (0.0 if standing else 1.0), t_s=T_S[keep])
    assert stream.t_s[stream.loose].tolist() == [pytest.approx(6.02)]
    assert any("gaps, 2.0 s in all" in notice.what and notice.count == 1 for notice in notices)


def test_speeds_that_no_robot_has_are_dropped_and_counted(tmp_path: Path) -> None:
    left = LEFT_RADPS.copy()
    left[100] = 1e5
    stream, notices = read(tmp_path, left, RIGHT_RADPS)
    assert stream.t_s.size == 499
    np.testing.assert_allclose(stream.left_rad[-1], LEFT_RAD[-1], atol=1e-3)
    (told,) = [notice for notice in notices if "60 m/s" in notice.what]
    assert (told.count, told.where, told.severity) == (1, "line 102", "warning")
    with pytest.raises(DataError, match="check the unit"):
        read(tmp_path, 1e3 * LEFT_RADPS, RIGHT_RADPS + 1.0)


def test_speeds_are_inspected_without_a_vehicle_and_are_not_converted(tmp_path: Path) -> None:
    """The stand-in wheels go as far as the fixes, whatever unit the speeds have."""
    run = tmp_path / "run"
    run.mkdir()
    read(run, 0.05 * LEFT_RADPS + 1.0, 0.05 * RIGHT_RADPS + 1.0, "left_mps,right_mps")
    travel_m = np.interp(T_S, T_S, integrated(T_S, 1.0 + 0.025 * (LEFT_RADPS + RIGHT_RADPS)))
    rows = [f"{t:.4f},{52.0 + m / 111_320.0:.9f},5.0,4" for t, m in zip(T_S[::5], travel_m[::5], strict=True)]
    (run / "gnss.csv").write_text("\n".join(["t,lat_deg,lon_deg,fix_quality", *rows, ""]))
    (run / "ahrs.csv").write_text("\n".join(["t,yaw_deg", *(f"{t:.4f},90" for t in T_S[::5]), ""]))
    (source,) = discover([run])
    streams = read_streams(source)
    assert streams.vehicle is not None
    assert streams.wheels is not None
    went_m = 0.5 * streams.vehicle.wheel_radius_m * (streams.wheels.left_rad[-1] + streams.wheels.right_rad[-1])
    assert went_m == pytest.approx(travel_m[-1], rel=0.01)
    (run / "vehicle.toml").write_text("[nominal]\nwheel_radius_m = 0.25\ntrack_m = 0.7\n")
    (source,) = discover([run])
    with pytest.raises(DataError, match=r"wheels as m/s \(left_mps, right_mps\) are .* not converted"):
        tables_of_folder(source)
