"""The tangent plane against geodesics on the ellipsoid, and against UTM, whose scale it must not have."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod, Proj

from sccal.geodesy import TangentPlane

GEOD = Geod(ellps="WGS84")
PLACES = {
    "Catania": (37.5256, 15.0744),
    "Wageningen": (51.98, 5.66),
    "Sydney": (-33.87, 151.21),
    "Quito": (0.0, -78.5),
    "Ushuaia": (-54.8, -68.3),
    "Fiji, just west of the date line": (-17.0, 179.9999),
    "Fiji, just east of the date line": (-17.0, -179.9999),
    "Svalbard": (78.2, 15.6),
}
places = pytest.mark.parametrize(("lat_deg", "lon_deg"), PLACES.values(), ids=PLACES)
BEARINGS_DEG = np.arange(0.0, 360.0, 15.0)


def at_bearing(lat_deg: float, lon_deg: float, bearing_deg: np.ndarray, distance_m: float) -> tuple[np.ndarray, ...]:
    """Latitude and longitude at the end of geodesics from one point."""
    many = np.ones(bearing_deg.size)
    lon, lat, _ = GEOD.fwd(lon_deg * many, lat_deg * many, bearing_deg, distance_m * many)
    return np.asarray(lat), np.asarray(lon)


@places
@pytest.mark.parametrize("distance_m", [1.0, 100.0, 2000.0])
def test_distances_and_bearings_are_those_of_geodesics(lat_deg, lon_deg, distance_m):
    plane = TangentPlane(lat_deg, lon_deg)
    east, north = plane.to_east_north(*at_bearing(lat_deg, lon_deg, BEARINGS_DEG, distance_m))
    assert np.hypot(east, north) == pytest.approx(distance_m, rel=1e-7, abs=1e-8)
    off_deg = (np.degrees(np.arctan2(east, north)) - BEARINGS_DEG + 180.0) % 360.0 - 180.0
    assert np.abs(off_deg).max() < 2e-5


@places
def test_east_is_east_and_north_is_north(lat_deg, lon_deg):
    plane = TangentPlane(lat_deg, lon_deg)
    east, north = plane.to_east_north(*at_bearing(lat_deg, lon_deg, np.array([0.0, 90.0, 180.0, 270.0]), 50.0))
    assert east == pytest.approx([0.0, 50.0, 0.0, -50.0], abs=1e-3)
    assert north == pytest.approx([50.0, 0.0, -50.0, 0.0], abs=1e-3)


@pytest.mark.parametrize(("lat_deg", "lon_deg"), [(45.0, 7.0), (-45.0, 7.0), (45.0, -7.0), (-45.0, -7.0)])
def test_more_latitude_is_north_and_more_longitude_is_east_in_every_hemisphere(lat_deg, lon_deg):
    east, north = TangentPlane(lat_deg, lon_deg).to_east_north(
        np.array([lat_deg + 1e-4, lat_deg]), np.array([lon_deg, lon_deg + 1e-4])
    )
    assert north[0] == pytest.approx(11.113, abs=0.002)
    assert east[1] == pytest.approx(7.884, abs=0.02)
    assert abs(east[0]) < 1e-3
    assert abs(north[1]) < 1e-3


@pytest.mark.parametrize("origin_lon_deg", [179.9999, -179.9999])
def test_the_date_line_is_no_wall(origin_lon_deg):
    plane = TangentPlane(-17.0, origin_lon_deg)
    lon_deg = np.array([179.9998, 180.0, -180.0, -179.9998])
    east, _ = plane.to_east_north(np.full(4, -17.0), lon_deg)
    assert np.diff(east) == pytest.approx([21.3, 0.0, 21.3], abs=0.1)
    assert np.abs(east).max() < 40.0


@given(
    st.floats(-80.0, 80.0),
    st.floats(-180.0, 180.0),
    st.floats(-100.0, 5000.0),
    st.floats(-14000.0, 14000.0),
    st.floats(-14000.0, 14000.0),
)
def test_there_and_back(lat_deg, lon_deg, alt_m, east_m, north_m):
    plane = TangentPlane(lat_deg, lon_deg, alt_m)
    east, north = plane.to_east_north(*plane.to_lat_lon(np.array([east_m]), np.array([north_m])))
    assert abs(east[0] - east_m) < 1e-6
    assert abs(north[0] - north_m) < 1e-6


def test_the_origin_is_zero_and_comes_back():
    plane = TangentPlane(37.5256, 15.0744, 110.0)
    east, north = plane.to_east_north(np.array([37.5256]), np.array([15.0744]))
    assert np.hypot(east, north)[0] < 1e-8
    lat, lon = plane.to_lat_lon(np.zeros(1), np.zeros(1))
    assert (lat[0], lon[0]) == pytest.approx((37.5256, 15.0744), abs=1e-13)


def test_height_above_the_ellipsoid_scales_distances():
    lat, lon = np.array([45.001]), np.array([9.0])
    _, low = TangentPlane(45.0, 9.0, 0.0).to_east_north(lat, lon)
    _, high = TangentPlane(45.0, 9.0, 2000.0).to_east_north(lat, lon)
    assert high[0] / low[0] == pytest.approx(1.0 + 2000.0 / 6.37e6, abs=2e-6)


def test_numpy_scalars_give_the_same_plane():
    lat, lon = np.array([45.01, 44.99]), np.array([9.01, 8.99])
    plain = TangentPlane(45.0, 9.0, 100.0).to_east_north(lat, lon)
    scalars = TangentPlane(np.float64(45.0), np.float64(9.0), np.float64(100.0)).to_east_north(lat, lon)
    assert np.array_equal(plain, scalars)
    east, north = TangentPlane(45.0, 9.0, 100.0).to_east_north(np.float64(45.01), np.float64(9.01))
    assert (float(east), float(north)) == (plain[0][0], plain[1][0])


@pytest.mark.parametrize("shape", [(0,), (1,), (7,), (2, 3)])
def test_shapes_are_kept(shape):
    plane = TangentPlane(45.0, 9.0)
    east, north = plane.to_east_north(np.full(shape, 45.001), np.full(shape, 9.001))
    lat, lon = plane.to_lat_lon(east, north)
    assert east.shape == north.shape == lat.shape == lon.shape == shape


def test_no_scale_and_no_convergence_of_utm():
    """On UTM's central meridian 1 km measures 0.9996 km, and two degrees beside it north is 1.4° off."""
    lat, lon = at_bearing(45.0, 9.0, np.array([0.0, 90.0]), 1000.0)
    utm_east, utm_north = Proj(proj="utm", zone=32, ellps="WGS84")(np.append(lon, 9.0), np.append(lat, 45.0))
    utm_m = np.hypot(utm_east[:2] - utm_east[2], utm_north[:2] - utm_north[2])
    plane_m = np.hypot(*TangentPlane(45.0, 9.0).to_east_north(lat, lon))
    assert utm_m / plane_m == pytest.approx(0.9996, abs=1e-6)
    assert plane_m == pytest.approx(1000.0, abs=1e-4)

    lat, lon = at_bearing(45.0, 11.0, np.array([0.0]), 1000.0)
    utm_east, utm_north = Proj(proj="utm", zone=32, ellps="WGS84")(np.append(11.0, lon), np.append(45.0, lat))
    east, north = TangentPlane(45.0, 11.0).to_east_north(lat, lon)
    assert np.degrees(np.arctan2(np.diff(utm_east), np.diff(utm_north)))[0] == pytest.approx(-1.41, abs=0.02)
    assert abs(np.degrees(np.arctan2(east, north))[0]) < 1e-4
