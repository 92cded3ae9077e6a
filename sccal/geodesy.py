"""The local tangent plane: latitude and longitude to east and north metres, and back.

A topocentric frame (PROJ's ``topocentric`` after ``cart``, IOGP Guidance Note 7-2, section 4.1.2): exact at the origin,
without a map projection's scale (UTM: 0.9996, a 0.04 % radius error) or meridian convergence (a heading error).
Points are taken at the origin's height: the plane is that of a ground robot, and a receiver's height, several times
noisier than its position, must not leak into it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sccal.arrays import Floats

if TYPE_CHECKING:
    from pyproj import Transformer


@dataclass(frozen=True)
class TangentPlane:
    """East-north plane touching the WGS 84 ellipsoid's normal height ``alt_m`` at one point."""

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0

    @cached_property
    def _transformer(self) -> Transformer:
        from pyproj import Transformer

        lat, lon, alt = float(self.lat_deg), float(self.lon_deg), float(self.alt_m)
        return Transformer.from_pipeline(
            "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
            f"+step +proj=topocentric +ellps=WGS84 +lat_0={lat!r} +lon_0={lon!r} +h_0={alt!r}"
        )

    def to_east_north(self, lat_deg: Floats, lon_deg: Floats) -> tuple[Floats, Floats]:
        """East and north (m), each of the inputs' shape."""
        lat = np.asarray(lat_deg, dtype=float)
        east, north, _up = self._transformer.transform(
            np.asarray(lon_deg, dtype=float), lat, np.full(lat.shape, self.alt_m)
        )
        return np.asarray(east), np.asarray(north)

    def to_lat_lon(self, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        """Latitude and longitude (deg), each of the inputs' shape.

        The plane's points stand a little above the ellipsoid's height (the earth curves away), so the height is
        solved for: two rounds bring it to well under a millimetre within 100 km.
        """
        east, north = np.asarray(east_m, dtype=float), np.asarray(north_m, dtype=float)
        up = np.zeros(east.shape)
        for _ in range(3):
            lon, lat, height = self._transformer.transform(east, north, up, direction="INVERSE")
            up = up - (np.asarray(height) - self.alt_m)
        return np.asarray(lat), np.asarray(lon)
