"""``[files]`` of vehicle.toml: each conversion, and what is refused with file and line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from pyproj import Geod, Transformer

from sccal.align import align
from sccal.errors import DataError
from sccal.geodesy import TangentPlane
from sccal.logs.inputs import input_paths
from sccal.logs.rates import integrated
from sccal.logs.run import discover, find_runs, read_run
from sccal.logs.streams import Run

HEAD = """name = "own"
[encoder]
ticks_per_rev = 1000
[nominal]
wheel_radius_m = 0.25
track_m = 0.7
[ahrs]
convention = "ned"
"""
ENCODER = """[files.encoder]
file = "wheel.csv"
time = { column = "t", unit = "s" }
left = { column = "l", unit = "ticks" }
right = { column = "r", unit = "ticks" }
"""
AHRS = """[files.ahrs]
file = "imu.csv"
time = "t"
heading = { column = "hdg", unit = "deg" }
"""
GNSS = """[files.gnss]
file = "gps.csv"
time = "t"
latitude = "lat"
longitude = "lon"
"""
ROWS = 30
T = np.arange(ROWS) * 0.1


def table(names: str, *columns: Sequence[float] | np.ndarray, separator: str = ",") -> str:
    cells = zip(*([repr(float(one)) for one in column] for column in columns), strict=True)
    return "\n".join([names, *(separator.join(row) for row in cells)]) + "\n"


WHEEL = table("t,l,r", T, 10.0 * np.arange(ROWS), 20.0 * np.arange(ROWS))
IMU = table("t,hdg", T, np.linspace(10.0, 20.0, ROWS))
GPS = table("t,lat,lon", T, 48.0 + 1e-6 * np.arange(ROWS), 13.0 + 1e-6 * np.arange(ROWS))


def folder_of(place: Path, *sections: str, wheel: str = WHEEL, imu: str = IMU, gps: str = GPS) -> Path:
    place.mkdir(parents=True, exist_ok=True)
    (place / "vehicle.toml").write_text(HEAD + "".join(sections or (ENCODER, AHRS, GNSS)), encoding="utf-8")
    for name, text in (("wheel.csv", wheel), ("imu.csv", imu), ("gps.csv", gps)):
        if text:
            (place / name).write_text(text, encoding="utf-8")
    return place


def read(place: Path) -> Run:
    (source,) = discover([place])
    return read_run(source)


def refusal(place: Path) -> str:
    with pytest.raises(DataError) as refused:
        read(place)
    return str(refused.value)


def test_a_folder_of_own_names_is_a_run(tmp_path):
    run = read(folder_of(tmp_path))
    assert run.wheels.t_s == pytest.approx(T)
    assert run.wheels.left_rad == pytest.approx(2.0 * np.pi * np.arange(ROWS) / 100.0)
    assert run.wheels.right_rad == pytest.approx(2.0 * np.pi * np.arange(ROWS) / 50.0)
    assert np.degrees(run.heading.yaw_rad[[0, -1]]) == pytest.approx([10.0, 20.0])
    assert run.heading.source == "imu.csv"
    assert run.fixes.lat_deg[-1] == pytest.approx(48.0 + 1e-6 * (ROWS - 1))
    (source,) = discover([tmp_path])
    assert sorted(name for name, _ in input_paths(source)) == ["gps.csv", "imu.csv", "vehicle.toml", "wheel.csv"]


def test_one_vehicle_for_many_runs_by_a_pattern(tmp_path):
    for name in ("a", "b"):
        place = folder_of(tmp_path / name)
        (place / "vehicle.toml").unlink()
        (place / "wheel.csv").rename(place / f"wheel_{name}.csv")
    encoder = ENCODER.replace("wheel.csv", "wheel_*.csv")
    (tmp_path / "vehicle.toml").write_text(HEAD + encoder + AHRS + GNSS)
    assert [source.name for source in discover([tmp_path])] == ["a", "b"]
    (tmp_path / "a" / "wheel_2.csv").write_text(WHEEL)
    with pytest.raises(DataError, match=r"line 9: .*means 2 files of one folder: wheel_2.csv, wheel_a.csv"):
        read_run(discover([tmp_path])[0])


@pytest.mark.parametrize(("unit", "per_s"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_times_are_in_their_unit(tmp_path, unit, per_s):
    wheel = table("t,l,r", per_s * T, 10.0 * np.arange(ROWS), 20.0 * np.arange(ROWS))
    place = folder_of(tmp_path, ENCODER.replace('unit = "s"', f'unit = "{unit}"'), AHRS, GNSS, wheel=wheel)
    assert read(place).wheels.t_s == pytest.approx(T)


def test_times_are_dates(tmp_path):
    def dated(text: str) -> str:
        head, *rows = text.splitlines()
        cells = (row.partition(",")[2] for row in rows)
        return "\n".join([head, *(f"2024-06-01T12:00:{k / 10:07.4f}Z,{cell}" for k, cell in enumerate(cells))]) + "\n"

    iso = '{ column = "t", unit = "iso" }'
    sections = [
        ENCODER.replace('{ column = "t", unit = "s" }', iso),
        *(one.replace('"t"', iso) for one in (AHRS, GNSS)),
    ]
    run = read(folder_of(tmp_path, *sections, wheel=dated(WHEEL), imu=dated(IMU), gps=dated(GPS)))
    for times in (run.wheels.t_s, run.heading.t_s, run.fixes.host_t_s):
        assert times == pytest.approx(1717243200.0 + T, abs=1e-5)


@pytest.mark.parametrize(
    ("unit", "per_rad", "is_rate"),
    [
        *(("ticks", 1000.0 / (2.0 * np.pi), False), ("rad", 1.0, False), ("m", 0.25, False)),
        *(("rpm", 30.0 / np.pi, True), ("rad/s", 1.0, True), ("m/s", 0.25, True), ("ticks/s", 500.0 / np.pi, True)),
    ],
)
def test_wheels_are_in_their_unit(tmp_path, unit, per_rad, is_rate):
    """Two wheels that speed up: 0.5 a t² rad, so a·t rad/s, of which the trapezoid is exact."""
    left, right = (per_rad * rate * (T if is_rate else 0.5 * T**2) for rate in (2.0, 3.0))
    place = folder_of(
        tmp_path, ENCODER.replace('"ticks"', f'"{unit}"'), AHRS, GNSS, wheel=table("t,l,r", T, left, right)
    )
    run = read(place)
    assert run.wheels.left_rad == pytest.approx(T**2, abs=1e-9)
    assert run.wheels.right_rad == pytest.approx(1.5 * T**2, abs=1e-9)


def test_a_rate_between_uneven_rows_is_a_trapezoid():
    t_s = np.array([0.0, 1.0, 3.0])
    assert integrated(t_s, np.array([0.0, 2.0, 2.0])).tolist() == [0.0, 1.0, 5.0]


def test_a_gap_in_rates_is_told_and_not_relied_on(tmp_path):
    keep = (T < 1.0) | (T > 2.0)
    wheel = table("t,l,r", T[keep], 0.0 * T[keep] + 5.0, 0.0 * T[keep] + 5.0)
    run = read(folder_of(tmp_path, ENCODER.replace('"ticks"', '"rad/s"'), AHRS, GNSS, wheel=wheel))
    assert run.wheels.loose.sum() == 1
    assert any("gaps" in notice.what for notice in run.notices)


def test_a_reversed_counter_is_turned_after_it_is_unwrapped(tmp_path):
    counts = (-3000.0 * np.arange(ROWS)) % 65536
    encoder = ENCODER.replace('"l", unit = "ticks"', '"l", unit = "ticks", reversed = true').replace(
        '"r", unit', '"r", reversed = true, unit'
    )
    place = folder_of(tmp_path, encoder, AHRS, GNSS, wheel=table("t,l,r", T, counts, counts))
    (place / "vehicle.toml").write_text((place / "vehicle.toml").read_text().replace("= 1000", "= 30000"))
    run = read(place)
    assert run.wheels.left_rad - run.wheels.left_rad[0] == pytest.approx(2.0 * np.pi * 0.1 * np.arange(ROWS))


@pytest.mark.parametrize(
    ("unit", "per_deg"),
    [("deg", 1.0), ("rad", np.pi / 180.0), ("gon", 400.0 / 360.0), ("turns", 1.0 / 360.0), ("cdeg", 100.0)],
)
def test_headings_are_in_their_unit(tmp_path, unit, per_deg):
    imu = table("t,hdg", T, per_deg * np.linspace(10.0, 20.0, ROWS))
    run = read(folder_of(tmp_path, ENCODER, AHRS.replace('"deg"', f'"{unit}"'), GNSS, imu=imu))
    assert np.degrees(run.heading.yaw_rad[[0, -1]]) == pytest.approx([10.0, 20.0])


def test_a_quaternion_is_x_y_z_w(tmp_path):
    half = 0.5 * np.radians(np.linspace(10.0, 20.0, ROWS))
    imu = table("t,qx,qy,qz,qw", T, 0.0 * T, 0.0 * T, np.sin(half), np.cos(half))
    ahrs = AHRS.replace(
        'heading = { column = "hdg", unit = "deg" }', 'quaternion = { columns = ["qx", "qy", "qz", "qw"] }'
    )
    run = read(folder_of(tmp_path, ENCODER, ahrs, GNSS, imu=imu))
    assert np.degrees(run.heading.yaw_rad[[0, -1]]) == pytest.approx([10.0, 20.0])


GRID = GNSS.replace('latitude = "lat"', 'east = "e"').replace('longitude = "lon"', 'north = "n"')


@pytest.mark.parametrize("epsg", [32633, 25832, 31258])
def test_metres_of_a_grid_are_where_the_grid_has_them(tmp_path, epsg):
    """Far from the central meridian: north by the grid is degrees off, and lengths are some 1e-4 off."""
    azimuth = np.full(ROWS, 90.0)
    lon, lat, _ = Geod(ellps="WGS84").fwd(np.full(ROWS, 13.4), np.full(ROWS, 48.2), azimuth, np.arange(ROWS) * 1.0)
    east, north = Transformer.from_crs(4326, epsg, always_xy=True).transform(lon, lat)
    place = folder_of(tmp_path, ENCODER, AHRS, GRID + f'crs = "EPSG:{epsg}"\n', gps=table("t,e,n", T, east, north))
    fixes = read(place).fixes
    x, y = TangentPlane(48.2, 13.4).to_east_north(fixes.lat_deg, fixes.lon_deg)
    assert x == pytest.approx(np.arange(ROWS), abs=2e-4)
    assert y - y[0] == pytest.approx(np.zeros(ROWS), abs=2e-4)


@pytest.mark.parametrize("zero_m", [0.0, 4.5e6])
def test_metres_of_a_plane_stay_metres(tmp_path, zero_m):
    east, north = 2.0 * np.arange(ROWS), 30.0 * np.arange(ROWS)
    gps = table("t,e,n,h", T, zero_m + east, zero_m + north, 0.0 * T + 800.0)
    fixes = read(folder_of(tmp_path, ENCODER, AHRS, GRID + 'crs = "local"\nheight = "h"\n', gps=gps)).fixes
    x, y = TangentPlane(fixes.lat_deg[0], fixes.lon_deg[0]).to_east_north(fixes.lat_deg, fixes.lon_deg)
    assert x == pytest.approx(east, abs=1e-3)
    assert y == pytest.approx(north, abs=1e-3)


def test_east_is_not_north(tmp_path):
    gps = table("t,e,n", T, 5.0 * np.arange(ROWS), 0.0 * T)
    fixes = read(folder_of(tmp_path, ENCODER, AHRS, GRID + 'crs = "local"\n', gps=gps)).fixes
    assert np.ptp(fixes.lon_deg) > 1e-3 > 1e-6 > np.ptp(fixes.lat_deg)


def test_height_quality_and_sigma_are_read(tmp_path):
    gps = table("t,lat,lon,h,fix,acc", T, 48.0 + 1e-6 * T, 13.0 + 1e-6 * T, 500.0 + T, 0.0 * T + 5, 0.0 * T + 14.0)
    gnss = GNSS + 'height = "h"\nquality = "fix"\nsigma = { column = "acc", unit = "mm" }\n'
    fixes = read(folder_of(tmp_path, ENCODER, AHRS, gnss, gps=gps)).fixes
    assert fixes.alt_m[0] == 500.0
    assert set(fixes.quality.tolist()) == {5}
    assert fixes.sigma_east_m == pytest.approx(np.full(ROWS, 0.014))


def test_one_file_holds_all_streams_and_gives_its_further_columns_once(tmp_path):
    lat, lon = (start + 1e-6 * np.floor(np.arange(ROWS) / 5.0) for start in (48.0, 13.0))
    text = table("t,l,r,hdg,lat,lon,amps", T, 10.0 * T, 20.0 * T, 10.0 + T, lat, lon, T)
    sections = [one.replace("imu.csv", "wheel.csv").replace("gps.csv", "wheel.csv") for one in (ENCODER, AHRS, GNSS)]
    run = read(folder_of(tmp_path, *sections, wheel=text, imu="", gps=""))
    assert set(run.wheels.extras) == {"amps"}
    assert not run.heading.extras
    assert not run.fixes.extras
    assert run.fixes.host_t_s == pytest.approx(T[::5])


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), ("\t", ","), ("  ", "."), (",", ".")])
def test_delimiter_decimal_comma_and_encoding_are_recognised(tmp_path, separator, decimal, encoding):
    place = folder_of(tmp_path)
    text = table("t,l,r", T, 10.0 * np.arange(ROWS) + 0.5, 20.0 * np.arange(ROWS), separator="@")
    text = text.replace("t,l,r", "t@l@r").replace(".", decimal).replace("@", separator)
    (place / "wheel.csv").write_bytes(text.encode(encoding))
    assert read(place).wheels.right_rad[-1] == pytest.approx(2.0 * np.pi * (ROWS - 1) / 50.0)


def test_columns_without_names_go_by_number(tmp_path):
    encoder = ENCODER.replace('"t"', "1").replace('"l"', "2").replace('"r"', "3")
    run = read(folder_of(tmp_path, encoder, AHRS, GNSS, wheel=WHEEL.partition("\n")[2]))
    assert run.wheels.t_s == pytest.approx(T)


@pytest.mark.parametrize(
    ("wrong", "right", "says"),
    [
        (
            'left = { column = "l"',
            'lefft = { column = "l"',
            r"line 12: \[files.encoder\] lefft is not known; .*did you mean left\?",
        ),
        ("[files.ahrs]", "[files.arhs]", r"line 14: \[files\] arhs is not known; .*did you mean ahrs\?"),
        (
            'column = "l", unit = "ticks"',
            'colum = "l", unit = "ticks"',
            r"line 12: \[files.encoder\] left must name its column",
        ),
        ('"l", unit = "ticks"', '"l", unit = "tick"', r"line 12: .*none of ticks, .*did you mean ticks"),
        ('"l", unit = "ticks"', '"l"', r"line 12: .*left needs a unit"),
        ('"l", unit = "ticks"', '"l", unit = "rad"', r"line 13: .*both must have the same"),
        (
            '"l", unit = "ticks"',
            '"L_enc", unit = "ticks"',
            r"header \(line 1\) has no column \"L_enc\", which .*line 12 asks for; it has t, l, r",
        ),
        ('"l", unit', '"r", unit', r'names the column "r" twice'),
        ('file = "wheel.csv"', 'file = "../wheel.csv"', r"line 10: .*without a folder"),
        (
            'longitude = "lon"\n',
            "",
            r"line 18: \[files.gnss\] must name time, latitude, longitude or time, east, north",
        ),
        ('longitude = "lon"', 'longitude = "lon"\ncrs = "EPSG:32633"', r"line 23: .*belongs to east and north"),
        ("heading =", 'convention = "enu"\nheading =', r"line 17: .*convention stands below \[ahrs\]"),
        ('time = "t"\nheading', 'time = { column = "t", unit = "iso" }\nheading', "numbers, and no dates"),
    ],
)
def test_what_is_not_understood_is_refused_with_file_and_line(tmp_path, wrong, right, says):
    place = folder_of(tmp_path)
    text = (place / "vehicle.toml").read_text()
    assert wrong in text
    (place / "vehicle.toml").write_text(text.replace(wrong, right, 1))
    with pytest.raises(DataError, match=says):
        read(place)


@pytest.mark.parametrize(
    ("crs", "says"),
    [
        ('crs = "EPSG:4326"\n', "no projected grid"),
        ('crs = "EPSG:99999"\n', "not in the register"),
        ('crs = "UTM 33"\n', "must be an EPSG code"),
        ("", "needs crs"),
        ('crs = "EPSG:32633"\n', "no place of the grid"),
    ],
)
def test_a_grid_that_cannot_be_is_refused(tmp_path, crs, says):
    gps = table("t,e,n", T, 1e12 + T, 1e12 + T)
    assert says in refusal(folder_of(tmp_path, ENCODER, AHRS, GRID + crs, gps=gps))


def test_times_of_the_wrong_unit_are_refused(tmp_path):
    wheel = table("t,l,r", 1.7e12 + T, T, T)
    assert "milliseconds since 1970" in refusal(folder_of(tmp_path, wheel=wheel))


def test_a_column_that_is_not_there_is_named_without_the_rows(tmp_path):
    wheel = WHEEL.replace("t,l,r", f"t,\x1b[2J{'x' * 300},r")
    text = refusal(folder_of(tmp_path, wheel=wheel))
    assert "?[2Jxxx" in text
    assert len(text) < 400 + 2 * len(str(tmp_path))


def test_a_mapped_file_that_is_missing_is_named(tmp_path):
    text = refusal(folder_of(tmp_path, imu=""))
    assert "lacks imu.csv ([files.ahrs] of vehicle.toml)" in text


def test_files_of_the_contract_stand_in_for_sections_that_are_not_there(tmp_path):
    place = folder_of(tmp_path, ENCODER)
    (place / "imu.csv").rename(place / "ahrs.csv")
    (place / "ahrs.csv").write_text(IMU.replace("hdg", "yaw_deg"))
    (place / "gnss.csv").write_text(GPS.replace("lat,lon", "lat_deg,lon_deg"))
    run = read(place)
    assert run.wheels.t_s.size == run.heading.t_s.size == run.fixes.lat_deg.size == ROWS


def test_tables_that_nobody_maps_are_named_with_what_they_hold(tmp_path):
    place = folder_of(tmp_path)
    (place / "vehicle.toml").unlink()
    _, failures = find_runs([place])
    text = str(failures[0].error)
    assert "found gps.csv, imu.csv, wheel.csv; gps.csv has in line 1 the columns t, lat, lon" in text
    assert text.endswith(f"`sccal init {place}` proposes a mapping")


def test_what_is_said_of_the_wheels_names_their_own_file(tmp_path):
    lat = 48.0 + np.concatenate((np.zeros(ROWS // 2), 1e-3 * np.ones(ROWS - ROWS // 2)))
    run = read(folder_of(tmp_path, gps=table("t,lat,lon", 1e6 + T, lat, 13.0 + 1e-6 * T)))
    with pytest.raises(DataError, match=r"wheel\.csv") as refused:
        align(run)
    assert "encoder.csv" not in str(refused.value)
