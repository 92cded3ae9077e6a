"""Paths as other libraries read them: gpxpy, evo, an XML parser, and pyproj for the place."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import gpxpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from sccal.errors import DataError, UsageError
from sccal.export.geojson import cut_at_180, write_geojson
from sccal.export.gpx import write_gpx
from sccal.export.kml import write_kml
from sccal.export.result import Result, wrapped_lon_deg
from sccal.export.tum import write_tum
from sccal.results.calibration import Origin, Trajectory
from tests.results.documents import calibration, retold, saved

KML = "{http://www.opengis.net/kml/2.2}"
GX = "{http://www.google.com/kml/ext/2.2}"
GPX = "{http://www.topografix.com/GPX/1/1}"


def geojson_line(text):
    """(longitude, latitude), each (n,)."""
    return np.array(json.loads(text)["features"][0]["geometry"]["coordinates"]).T


def gpx_line(text):
    (track,) = gpxpy.parse(text).tracks
    return np.array([(point.longitude, point.latitude) for point in track.segments[0].points]).T


def kml_line(text):
    coords = [element.text.split() for element in ElementTree.fromstring(text).iter(f"{GX}coord")]
    if not coords:
        (block,) = ElementTree.fromstring(text).iter(f"{KML}coordinates")
        coords = [row.split(",") for row in block.text.split()]
    return np.array(coords, dtype=float)[:, :2].T


LINES = [(write_geojson, geojson_line), (write_gpx, gpx_line), (write_kml, kml_line)]
each_line = pytest.mark.parametrize(("write", "line_of"), LINES, ids=["geojson", "gpx", "kml"])


def placed(lat_deg, lon_deg, east_m, north_m, alt_m=0.0, **document):
    """A result whose path is made of these points."""
    east, north = np.asarray(east_m, dtype=float), np.asarray(north_m, dtype=float)
    zero = np.zeros(east.size)
    origin = {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m}
    run = retold(saved(calibration("r", "v")), **{"origin": origin, "started": None, "clock": None} | document)
    result = Result.of(run, Path("calibration.json"))
    result.__dict__["trajectory"] = Trajectory(np.arange(east.size) * 0.1, east, north, zero, zero, zero, zero)
    return result


@each_line
def test_the_path_stands_where_pyproj_puts_it(enu_robot, write, line_of):
    result = enu_robot.exported
    lon, lat = line_of(write(result))
    origin, path = vars(result.run.origin), result.trajectory
    assert origin["alt_m"] == pytest.approx(800.0, abs=5.0)
    ecef = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    centre = np.array(ecef.transform(origin["lon_deg"], origin["lat_deg"], origin["alt_m"]))
    phi, lam = np.radians((origin["lat_deg"], origin["lon_deg"]))
    east = np.array([-np.sin(lam), np.cos(lam), 0.0])
    north = np.array([-np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)])
    apart = np.array(ecef.transform(lon, lat, np.full(lon.size, origin["alt_m"]))).T - centre
    assert np.abs(apart @ east - path.east_m).max() < 1e-3
    assert np.abs(apart @ north - path.north_m).max() < 1e-3


@each_line
def test_the_path_is_the_true_drive(enu_robot, write, line_of):
    lon, lat = line_of(write(enu_robot.exported))
    path, simulated = enu_robot.exported.trajectory, enu_robot.simulated
    truth = simulated.motion.at(path.t_s)
    to_start = Geod(ellps="WGS84").inv(np.full(lon.size, -70.6), np.full(lat.size, -33.9), lon, lat)
    azimuth, distance = np.radians(to_start[0]), to_start[2]
    known = (
        path.t_s > 45.0
    )  # until its first turn, a filter that learns the antenna's place cannot tell it from the robot's
    assert np.abs(distance * np.sin(azimuth) - truth.east_m)[known].max() < 0.15
    assert np.abs(distance * np.cos(azimuth) - truth.north_m)[known].max() < 0.15


@each_line
@pytest.mark.parametrize(("lat", "lon"), [(48.0, 11.0), (-33.9, -70.6), (-41.0, 174.0), (60.0, -150.0)])
def test_east_is_east_and_north_is_north(write, line_of, lat, lon):
    lons, lats = line_of(write(placed(lat, lon, [0.0, 100.0, 100.0], [0.0, 0.0, 50.0])))
    assert lons[1] - lons[0] > 1e-4
    assert lats[2] - lats[1] > 1e-4
    assert (lons[0], lats[0]) == pytest.approx((lon, lat), abs=1e-9)


def test_height_changes_the_scale_as_it_must():
    low, high = (geojson_line(write_geojson(placed(0.0, 0.0, [0.0, 10e3], [0.0, 0.0], alt)))[0, 1] for alt in (0, 2000))
    assert low / high == pytest.approx(1 + 2000 / 6378137, abs=1e-7)


@pytest.mark.parametrize("name", ["enu_robot", "ned_robot"])
def test_times_are_utc(name, request):
    """The one logs seconds from zero, the other Unix time; the drive begins at 2024-06-01 12:00:00 UTC."""
    robot = request.getfixturevalue(name)
    result = robot.exported
    since_start_s = result.trajectory.t_s - robot.simulated.settings.clock.start_utc_s
    if name == "enu_robot":
        since_start_s = result.trajectory.t_s
    expected = 1717243200.0 + since_start_s
    (track,) = gpxpy.parse(write_gpx(result)).tracks
    points = track.segments[0].points
    assert np.abs([point.time.timestamp() for point in points] - expected).max() < 0.03
    document = ElementTree.fromstring(write_kml(result))
    when = [datetime.fromisoformat(element.text) for element in document.iter(f"{KML}when")]
    assert [time.tzinfo for time in when] == [UTC] * len(expected)
    assert np.abs([time.timestamp() for time in when] - expected).max() < 0.03
    assert len(list(document.iter(f"{GX}coord"))) == len(when)
    path = json.loads(write_geojson(result))["features"][0]
    times = path["properties"]["coordinateProperties"]["times"]
    assert len(times) == len(path["geometry"]["coordinates"])
    assert [datetime.fromisoformat(time) for time in times] == when


def test_a_clock_that_drifts_against_utc_is_followed():
    clock = {"offset_at_start_s": -1000.0, "skew_ppm": 500.0}
    east = np.zeros(10001)
    result = placed(0.0, 0.0, east, east, started="1970-01-01T00:16:40Z", clock=clock)
    assert result.utc[0] == "1970-01-01T00:16:40.000Z"
    assert result.utc[-1] == "1970-01-01T00:33:19.500Z"


def test_a_logging_clock_that_is_utc_is_taken_as_it_is():
    result = placed(0.0, 0.0, [0.0, 1.0], [0.0, 1.0], started="1970-01-01T00:00:02Z")
    assert result.utc == ["1970-01-01T00:00:00.000Z", "1970-01-01T00:00:00.100Z"]


def test_an_offset_that_does_not_lead_to_the_start_told_is_not_used():
    for offset_s in (None, 7.0e8):
        clock = {"offset_at_start_s": offset_s, "skew_ppm": 0.0}
        result = placed(0.0, 0.0, [0.0, 1.0], [0.0, 1.0], started="2024-06-01T12:00:00Z", clock=clock)
        assert result.utc == ["2024-06-01T12:00:00.000Z", "2024-06-01T12:00:00.100Z"]


def test_without_a_date_there_are_no_times():
    result = placed(48.0, 11.0, [0.0, 1.0], [0.0, 1.0], started=None)
    assert "<time>" not in write_gpx(result)
    assert "<LineString>" in write_kml(result)
    assert "gx:Track" not in write_kml(result)
    assert "time" not in write_geojson(result)


def test_gpx_elements_stand_in_the_order_of_its_schema(enu_robot):
    """gpx.xsd: metadata before trk; name before time; name, desc, trkseg; a point has ele before time."""
    root = ElementTree.fromstring(write_gpx(enu_robot.exported))
    assert root.tag == f"{GPX}gpx"
    assert root.get("version") == "1.1"
    assert root.get("creator").startswith("sccal")
    assert [child.tag for child in root] == [f"{GPX}metadata", f"{GPX}trk"]
    assert [child.tag for child in root[0]] == [f"{GPX}name", f"{GPX}time"]
    assert [child.tag for child in root[1]] == [f"{GPX}name", f"{GPX}desc", f"{GPX}trkseg"]
    assert {child.tag for point in root[1][2] for child in point} == {f"{GPX}time"}
    assert all(-180 <= float(point.get("lon")) < 180 for point in root[1][2])


def test_kml_elements_stand_in_the_order_of_its_schema(enu_robot):
    root = ElementTree.fromstring(write_kml(enu_robot.exported))
    (document,) = root
    assert [child.tag for child in document] == [f"{KML}name", f"{KML}Style", f"{KML}Placemark"]
    names = [child.tag for child in document[2]]
    assert names == [f"{KML}name", f"{KML}description", f"{KML}styleUrl", f"{GX}Track"]
    kinds = [child.tag for child in document[2][3]]
    assert kinds == sorted(kinds, key=[f"{KML}altitudeMode", f"{KML}when", f"{GX}coord"].index)


@each_line
def test_names_cannot_break_the_file(write, line_of):
    result = placed(48.0, 11.0, [0.0, 1.0], [0.0, 1.0], run='</name> & "<\x00\x0b\nyard', vehicle="é")
    assert line_of(write(result)).shape == (2, 2)


def test_a_single_point_is_no_line():
    features = json.loads(write_geojson(placed(48.0, 11.0, [0.0], [0.0])))["features"]
    assert [feature["geometry"]["type"] for feature in features] == ["Point", "Point"]


def test_a_path_across_the_180th_meridian_is_cut_there():
    result = placed(-17.0, 179.9999, [0.0, 100.0, -100.0], [0.0, 0.0, 10.0], started="2024-06-01T12:00:00Z")
    feature = json.loads(write_geojson(result))["features"][0]
    assert feature["geometry"]["type"] == "MultiLineString"
    first, second, third = feature["geometry"]["coordinates"]
    assert (first[-1][0], second[0][0], second[-1][0], third[0][0]) == (180.0, -180.0, -180.0, 180.0)
    assert first[-1][1] == second[0][1] == pytest.approx(-17.0, abs=1e-6)
    assert "coordinateProperties" not in feature["properties"]
    assert gpx_line(write_gpx(result))[0, 1] == pytest.approx(-179.99916, abs=1e-4)


@given(st.lists(st.tuples(st.floats(-180, 179.9), st.floats(-80, 80)), min_size=2, max_size=20))
def test_no_part_of_a_cut_path_jumps_and_no_point_is_lost(positions):
    parts = cut_at_180(positions)
    assert all(abs(b[0] - a[0]) <= 180.0 for part in parts for a, b in pairwise(part))
    on_the_cut = {(lon, lat) for part in parts for lon, lat in (part[0], part[-1]) if abs(lon) == 180.0}
    kept = [position for part in parts for position in part]
    assert [p for p in kept if p not in on_the_cut] == [p for p in positions if p not in on_the_cut]


@given(st.floats(-540, 540))
def test_longitudes_are_wrapped_to_what_gpx_allows(lon):
    (wrapped,) = wrapped_lon_deg(np.array([lon]))
    assert -180.0 <= wrapped < 180.0
    assert np.cos(np.radians(wrapped - lon)) == pytest.approx(1.0, abs=1e-9)
    assert wrapped == lon or not -180.0 <= lon < 180.0


def test_evo_reads_the_path_and_its_heading(enu_robot, tmp_path):
    from evo.tools.file_interface import read_tum_trajectory_file

    file = tmp_path / "path.tum"
    file.write_text(write_tum(enu_robot.exported))
    read = read_tum_trajectory_file(file)
    fine, details = read.check()
    assert fine, details
    path = enu_robot.exported.trajectory
    np.testing.assert_allclose(read.timestamps, path.t_s, atol=1e-6)
    np.testing.assert_allclose(
        read.positions_xyz, np.column_stack((path.east_m, path.north_m, 0 * path.t_s)), atol=1e-9
    )
    roll, pitch, yaw = read.get_orientations_euler(axes="sxyz").T
    truth = enu_robot.simulated.motion.at(path.t_s)
    assert np.abs(np.angle(np.exp(1j * (yaw - truth.yaw_rad)))).max() < np.radians(3.0)
    assert np.abs(np.angle(np.exp(1j * (yaw - path.yaw_rad)))).max() < 1e-6
    assert max(np.abs(roll).max(), np.abs(pitch).max()) < 1e-9


def test_tum_is_that_of_the_run(enu_robot):
    run = np.loadtxt(enu_robot.results / "trajectory.tum")
    exported = np.loadtxt(write_tum(enu_robot.exported).splitlines())
    np.testing.assert_allclose(exported, run, atol=1e-6)


def test_a_vehicle_has_no_path(enu_robot):
    result = enu_robot.exported
    vehicle = replace(result, run=None)
    for write in (write_geojson, write_kml, write_gpx, write_tum):
        with pytest.raises(UsageError, match="runs together have no path"):
            write(vehicle)


NOWHERE = math.nan


@pytest.mark.parametrize("origin", [Origin(NOWHERE, NOWHERE), Origin(48.0, NOWHERE), Origin(91.0, 0.0)])
def test_a_place_that_is_none_is_refused(origin):
    result = placed(0.0, 0.0, [0.0, 1.0], [0.0, 1.0])
    elsewhere = replace(result, run=replace(result.run, origin=origin))
    elsewhere.__dict__["trajectory"] = result.trajectory
    with pytest.raises(DataError, match="origin"):
        write_geojson(elsewhere)


@pytest.mark.filterwarnings("ignore:loadtxt")
@pytest.mark.parametrize(("rows", "says"), [("", "no rows"), ("0,nan,0,0,0,0,0\n", "line 2")])
def test_a_path_without_places_is_refused(enu_robot, tmp_path, rows, says):
    source = enu_robot.results
    (tmp_path / "calibration.json").write_bytes((source / "calibration.json").read_bytes())
    header = (source / "trajectory.csv").read_text().partition("\n")[0]
    (tmp_path / "trajectory.csv").write_text(f"{header}\n{rows}")
    result = replace(enu_robot.exported, path=tmp_path / "calibration.json")
    with pytest.raises(DataError, match=says):
        write_tum(result)
