"""vehicle.toml, ahrs.csv and gnss.csv."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sccal.errors import DataError
from sccal.logs.ahrs import read_ahrs
from sccal.logs.gnss_csv import read_gnss_csv
from sccal.logs.streams import Vehicle
from sccal.logs.vehicle import read_vehicle
from sccal.logs.write import write_table, write_vehicle

NOMINAL = "[nominal]\nwheel_radius_m = 0.08\ntrack_m = 0.7\n"


def toml(folder: Path, text: str) -> Path:
    path = folder / "vehicle.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("ticks_per_rev", [None, 32768.0, 1000.5])
@pytest.mark.parametrize("bits", [None, 16])
@pytest.mark.parametrize("convention", ["enu", "ned"])
def test_a_vehicle_survives(tmp_path: Path, ticks_per_rev: float | None, bits: int | None, convention: str) -> None:
    path = tmp_path / "vehicle.toml"
    vehicle = Vehicle('a "tracked" démo', path, 0.0812, 0.703, ticks_per_rev, bits, convention)  # type: ignore[arg-type]
    write_vehicle(path, vehicle)
    assert read_vehicle(path) == (vehicle, ())


def test_the_folder_names_a_vehicle_without_name(tmp_path: Path) -> None:
    (tmp_path / "mower").mkdir()
    vehicle, _ = read_vehicle(toml(tmp_path / "mower", NOMINAL))
    assert (vehicle.name, vehicle.convention, vehicle.ticks_per_rev) == ("mower", "enu", None)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[nominal]\ntrack_m = 0.7\n", "lacks wheel_radius_m; add a line such as wheel_radius_m = 0.08"),
        ("[nominal]\nwheel_radius_m = 0.1\n", "lacks track_m; add a line such as track_m = 0.70"),
        ("", "lacks wheel_radius_m"),
        ("[nominal]\nwheel_radius_m = -0.1\ntrack_m = 1\n", "must be positive"),
        ("[nominal]\nwheel_radius_m = inf\ntrack_m = 1\n", "must be positive and finite"),
        ("[nominal]\nwheel_radius_m = '8 cm'\ntrack_m = 1\n", "must be a number"),
        ("[nominal]\nwheel_radius_m = true\ntrack_m = 1\n", "must be a number"),
        (NOMINAL + "[encoder]\nticks_per_rev = 0\n", "ticks_per_rev = 0 must be positive"),
        (NOMINAL + "[encoder]\ncounter_bits = 7\n", "from 8 to 64"),
        (NOMINAL + "[encoder]\ncounter_bits = 16.5\n", "from 8 to 64"),
        (NOMINAL + "[ahrs]\nconvention = 'nwu'\n", '"enu"'),
        ("name = 3\n" + NOMINAL, "must be text"),
        ("nominal = 3\n", "must be a table"),
        ("[nominal\n", "not valid TOML"),
    ],
)
def test_wrong_vehicles_say_what_to_change(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(DataError) as caught:
        read_vehicle(toml(tmp_path, text))
    assert words in str(caught.value)
    assert "vehicle.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_keys_are_told(tmp_path: Path) -> None:
    _, notices = read_vehicle(toml(tmp_path, "owner = 'me'\n" + NOMINAL + "width_m = 1\n"))
    assert notices[0].count == 2
    assert "nominal.width_m, owner" in notices[0].what


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_an_ahrs_file_in_either_unit(tmp_path: Path, unit: str) -> None:
    scale = np.pi / 180 if unit == "deg" else 1.0
    t = np.arange(5.0) / 5
    names = ["t", f"yaw_{unit}", f"pitch_{unit}", f"roll_{unit}", f"yaw_sigma_{unit}", "temperature_c"]
    names.append("gyro_z_dps" if unit == "deg" else "gyro_z_radps")
    columns = {name: t * (k + 1) + (name != "t") for k, name in enumerate(names)}
    write_table(tmp_path / "ahrs.csv", columns, dict.fromkeys(names, "%.6f"))
    stream, notices = read_ahrs(tmp_path / "ahrs.csv")
    assert not notices
    np.testing.assert_allclose(stream.yaw_rad, columns[names[1]] * scale)
    for got, name in (
        (stream.pitch_rad, names[2]),
        (stream.roll_rad, names[3]),
        (stream.yaw_sigma_rad, names[4]),
        (stream.gyro_z_radps, names[6]),
    ):
        assert got is not None
        np.testing.assert_allclose(got, columns[name] * scale)
    assert list(stream.extras) == ["temperature_c"]


def test_degrees_named_radians_are_told(tmp_path: Path) -> None:
    (tmp_path / "ahrs.csv").write_text("t,yaw_rad\n0,1\n1,170\n2,-90\n")
    _, notices = read_ahrs(tmp_path / "ahrs.csv")
    assert [(n.count, n.where, n.severity) for n in notices] == [(2, "line 3", "warning")]


def test_a_yaw_sigma_of_zero_is_not_stated(tmp_path: Path) -> None:
    (tmp_path / "ahrs.csv").write_text("t,yaw_deg,yaw_sigma_deg\n0,1,0\n1,170,2\n")
    stream, notices = read_ahrs(tmp_path / "ahrs.csv")
    assert stream.yaw_sigma_rad is not None
    np.testing.assert_allclose(stream.yaw_sigma_rad, [np.nan, np.radians(2)])
    assert notices[0].count == 1


def test_gnss_csv(tmp_path: Path) -> None:
    (tmp_path / "gnss.csv").write_text(
        "t,lat_deg,lon_deg,alt_m,fix_quality,sigma_m,payload_kg\n"
        "0,52.1,5.3,40,4,0.02,7\n1,0,0,0,4,0.02,7\n2,95,5.3,40,4,0.02,7\n3,52.1,5.3,40,0,0.02,7\n"
        "4,52.2,-354.7,,5,0,7\n5,52.2,5.3,,,,8\n"
    )
    stream, notices = read_gnss_csv(tmp_path / "gnss.csv")
    assert stream.host_t_s.tolist() == [0, 4, 5]
    assert stream.quality.tolist() == [4, 5, -1]
    np.testing.assert_allclose(stream.lon_deg, 5.3)
    np.testing.assert_allclose(stream.sigma_east_m, [0.02, np.nan, np.nan])
    assert np.isnan(stream.utc_s).all()
    assert not stream.utc_has_date
    assert stream.extras["payload_kg"].tolist() == [7, 7, 8]
    assert [(n.count, n.where) for n in notices] == [(1, "line 4"), (1, "line 3"), (1, "line 5")]


def test_gnss_csv_without_a_position_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "gnss.csv").write_text("t,lat_deg,lon_deg\n0,0,0\n1,0,0\n")
    with pytest.raises(DataError, match="none of 2 rows"):
        read_gnss_csv(tmp_path / "gnss.csv")


def test_a_table_survives(tmp_path: Path) -> None:
    t = np.arange(50_000) / 100
    columns = {"t": t, "yaw_deg": np.sin(t) * 180, "count": np.arange(t.size), "gap": np.where(t > 100, np.nan, t)}
    write_table(tmp_path / "ahrs.csv", columns, {"t": "%.4f", "yaw_deg": "%.3f", "count": "%d", "gap": "%.2f"})
    stream, _ = read_ahrs(tmp_path / "ahrs.csv")
    np.testing.assert_allclose(np.degrees(stream.yaw_rad), columns["yaw_deg"], atol=6e-4)
    np.testing.assert_array_equal(stream.extras["count"], columns["count"])
    np.testing.assert_allclose(stream.extras["gap"], columns["gap"], atol=6e-3)
    assert [path.name for path in tmp_path.iterdir()] == ["ahrs.csv"]
