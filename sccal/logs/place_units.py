"""In which notation coordinates stand that are no degrees: by their size, and whether they are whole numbers."""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats

_TEN_MILLION = 1e7
_MOST_LAT_DEG, _MOST_LON_DEG = 90.0, 360.0
_GRID_M = 1e5


def in_ten_millionths(lat: Floats, lon: Floats) -> bool:
    """Whether coordinates (n) are whole ten-millionths of a degree, as u-blox and MAVLink have them, and nothing else.

    A tenth of them, millionths, must be no possible latitude: else both may be meant.
    """
    whole = bool((lat == np.round(lat)).all() and (lon == np.round(lon)).all())
    most_lat, most_lon = float(np.abs(lat).max()), float(np.abs(lon).max())
    fits = most_lat <= _MOST_LAT_DEG * _TEN_MILLION and most_lon <= _MOST_LON_DEG * _TEN_MILLION
    return whole and fits and float(np.abs(lat).min()) > _MOST_LAT_DEG * _TEN_MILLION / 10.0


def notation_of(lat: Floats, lon: Floats) -> str:
    """What coordinates (n) beyond those of degrees look like, for messages."""
    most_lat, most_lon = float(np.abs(lat).max()), float(np.abs(lon).max())
    shown = f"they reach {most_lat:.10g} and {most_lon:.10g}"
    if (lat == np.round(lat)).all() and (lon == np.round(lon)).all():
        return f"{shown}: whole numbers of some scale, such as 1e-6 or 1e-7 degrees; divide them"
    if most_lat <= 100.0 * _MOST_LAT_DEG and most_lon <= 50.0 * _MOST_LON_DEG:
        return f"{shown}: degrees and minutes in one number (ddmm.mmmm, the notation of NMEA), or metres; write degrees"
    if most_lat > _GRID_M and most_lon > _GRID_M:
        return f"{shown}: metres of a grid (UTM northing and easting)? Write latitude and longitude in degrees"
    return f"{shown}: no degrees; write latitude and longitude in degrees"
