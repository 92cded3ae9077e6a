"""Places on the ellipsoid moved by metres, and between fixes, at any latitude.

A place is its ellipsoid normal n (a unit vector), which has neither poles nor an antimeridian. A step of e, n metres to
the east and north turns it by

    n' = n + (north / M) ê_north + (east / N) ê_east      M, N: radii of curvature of WGS 84, meridian and normal
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Bools, Floats

_A_M = 6378137.0
_E2 = 0.00669437999014132
_UNEVEN = 0.2
"""Steps of a cubic's four fixes may differ by this ratio; stamps that jitter more are joined by straight lines."""


def moved(lat_deg: Floats, lon_deg: Floats, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
    """Latitudes and longitudes (deg), all of shape (n,), of places moved by ``east_m`` and ``north_m``."""
    normal, east, north = _frames(lat_deg, lon_deg)
    along_m, across_m = _radii_m(lat_deg)
    return _angles(normal + (north_m / along_m)[:, None] * north + (east_m / across_m)[:, None] * east)


def offset_m(lat_deg: Floats, lon_deg: Floats, to_lat_deg: Floats, to_lon_deg: Floats) -> tuple[Floats, Floats]:
    """East and north (m) from places to others nearby (n,): the inverse of ``moved``."""
    normal, east, north = _frames(lat_deg, lon_deg)
    other, _, _ = _frames(to_lat_deg, to_lon_deg)
    along_m, across_m = _radii_m(lat_deg)
    step = other / (other * normal).sum(axis=1)[:, None]
    return (step * east).sum(axis=1) * across_m, (step * north).sum(axis=1) * along_m


def between(t_s: Floats, lat_deg: Floats, lon_deg: Floats, at_s: Floats, gap_s: float) -> tuple[Floats, Floats, Bools]:
    """Places at ``at_s`` (m,) on the path through fixes at increasing ``t_s`` (n,), and where there is one.

    A fix at exactly that time is taken as it is. Between two fixes the path is the cubic through the four around, or a
    straight line where the four are not all there or not evenly spaced. There is no place before the first fix, after
    the last, or within a pause longer than ``gap_s``.
    """
    none = np.full(at_s.size, np.nan)
    if t_s.size == 0:
        return none, none.copy(), np.zeros(at_s.size, dtype=np.bool_)
    normal, _, _ = _frames(lat_deg, lon_deg)
    last = t_s.size - 1
    right = np.clip(np.searchsorted(t_s, at_s), 0, last)
    left = np.maximum(right - 1, 0)
    nearest = np.where(np.abs(t_s[left] - at_s) < np.abs(t_s[right] - at_s), left, right)
    exact: Bools = np.abs(t_s[nearest] - at_s) < 1e-5
    inside: Bools = (at_s > t_s[left]) & (at_s < t_s[right]) & (t_s[right] - t_s[left] <= gap_s)
    step_s = np.where(inside, t_s[right] - t_s[left], 1.0)
    share = np.where(inside, (at_s - t_s[left]) / step_s, 0.0)[:, None]
    path = normal[left] * (1.0 - share) + normal[right] * share
    cubic = inside & (left >= 1) & (right < last)
    corners = np.stack([left - 1, left, right, right + 1])[:, cubic]
    steps_s = np.diff(t_s[corners], axis=0)
    even = (steps_s.max(axis=0, initial=0.0) <= gap_s) & (steps_s.min(axis=0) > _UNEVEN * steps_s.max(axis=0))
    rows = np.flatnonzero(cubic)[even]
    path[rows] = _cubic(t_s[corners[:, even]], normal[corners[:, even]], at_s[rows])
    lat, lon = _angles(path)
    lat = np.where(exact, lat_deg[nearest], np.where(inside, lat, np.nan))
    lon = np.where(exact, lon_deg[nearest], np.where(inside, lon, np.nan))
    return lat, lon, exact | inside


def _cubic(t_s: Floats, normal: Floats, at_s: Floats) -> Floats:
    """Lagrange's cubic through four points: times (4, k), normals (4, k, 3), at times (k,)."""
    path = np.zeros((at_s.size, 3))
    for i in range(4):
        weight = np.ones(at_s.size)
        for j in range(4):
            if j != i:
                weight *= (at_s - t_s[j]) / (t_s[i] - t_s[j])
        path += weight[:, None] * normal[i]
    return path


def _frames(lat_deg: Floats, lon_deg: Floats) -> tuple[Floats, Floats, Floats]:
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    normal = np.column_stack((cos_lat * cos_lon, cos_lat * sin_lon, sin_lat))
    east = np.column_stack((-sin_lon, cos_lon, np.zeros_like(lat)))
    north = np.column_stack((-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat))
    return normal, east, north


def _angles(normal: Floats) -> tuple[Floats, Floats]:
    lat = np.degrees(np.arctan2(normal[:, 2], np.hypot(normal[:, 0], normal[:, 1])))
    lon = np.degrees(np.arctan2(normal[:, 1], normal[:, 0]))
    return lat, lon


def _radii_m(lat_deg: Floats) -> tuple[Floats, Floats]:
    curvature = 1.0 - _E2 * np.sin(np.radians(lat_deg)) ** 2
    return _A_M * (1.0 - _E2) / curvature**1.5, _A_M / np.sqrt(curvature)
