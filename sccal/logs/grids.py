"""Metres of a map's grid, or of a plane that lies nowhere in particular, as latitude and longitude.

Everything after that is done as for latitude and longitude: the scale of a projection and its meridian convergence are
gone with it. A local plane is laid on the ellipsoid at PLACE_DEG; the azimuthal equidistant projection keeps lengths
to (d/R)²/6, a millionth at 16 km.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats

PLACE_DEG = (45.0, 0.0)
"""Latitude and longitude of a local plane's origin: any place but the poles would do, where no receiver's zero lies."""


_CELL_M = 1e4
"""Small enough for the projection, and large enough for runs of one place to share it."""


def is_of_metres(crs: str) -> bool:
    """Whether an EPSG code is that of a projected grid. Raises ValueError where there is no such code."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return bool(CRS.from_user_input(crs.upper()).is_projected)
    except CRSError as error:
        raise ValueError(f"{crs} is not in the register of pyproj") from error


def lat_lon_of_grid(east_m: Floats, north_m: Floats, crs: str) -> tuple[Floats, Floats]:
    """Latitude and longitude (n, deg) of places (n) in the grid of an EPSG code; not finite where there is none."""
    from pyproj import Transformer

    transformer = Transformer.from_crs(crs.upper(), "EPSG:4326", always_xy=True)
    lon, lat = transformer.transform(east_m, north_m)
    return np.asarray(lat), np.asarray(lon)


def lat_lon_of_plane(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
    """Latitude and longitude (n, deg) of places (n) in a local plane, without whole cells of _CELL_M.

    So coordinates of a grid that nobody names, far from their zero, keep their lengths too.
    """
    from pyproj import Proj

    lat, lon = PLACE_DEG
    east, north = (one - _CELL_M * np.round(np.median(one) / _CELL_M) if one.size else one for one in (east_m, north_m))
    lon_deg, lat_deg = Proj(proj="aeqd", lat_0=lat, lon_0=lon, ellps="WGS84")(east, north, inverse=True)
    return np.asarray(lat_deg), np.asarray(lon_deg)
