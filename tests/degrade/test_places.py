"""Places moved by metres and back, anywhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.degrade.places import between, moved, offset_m
from sccal.geodesy import TangentPlane


@given(st.floats(-90, 90), st.floats(-180, 180), st.floats(-50, 50), st.floats(-50, 50))
def test_a_step_is_what_the_tangent_plane_says(lat: float, lon: float, east: float, north: float) -> None:
    at = np.array([lat]), np.array([lon])
    new_lat, new_lon = moved(*at, np.array([east]), np.array([north]))
    found = TangentPlane(lat, lon).to_east_north(new_lat, new_lon)
    np.testing.assert_allclose(np.concatenate(found), [east, north], atol=2e-5)
    back = offset_m(*at, new_lat, new_lon)
    np.testing.assert_allclose(np.concatenate(back), [east, north], atol=1e-7)


def test_fixes_stand_on_their_own_path_exactly_and_pauses_are_empty() -> None:
    t_s = np.array([0.0, 1, 2, 3, 4, 10, 11])
    lat, lon = 52 + 1e-5 * t_s**2, 179.9999 + 5e-5 * t_s
    lon = np.where(lon > 180, lon - 360, lon)
    at_s = np.array([-1, 0, 2, 2.5, 4.5, 9.9, 10, 11, 11.5])
    found_lat, found_lon, there = between(t_s, lat, lon, at_s, 2.0)
    assert there.tolist() == [False, True, True, True, False, False, True, True, False]
    np.testing.assert_array_equal(found_lat[[1, 2, 6, 7]], lat[[0, 2, 5, 6]])
    np.testing.assert_array_equal(found_lon[[1, 2, 6, 7]], lon[[0, 2, 5, 6]])
    assert found_lat[3] == pytest.approx(52 + 1e-5 * 6.25, abs=1e-9)
    assert abs(found_lon[3]) == pytest.approx(179.999975, abs=1e-7)
