"""Places on the WGS 84 ellipsoid, and NMEA 0183 sentences that tell them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from studies.arrays import FloatArray

SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY_2 = FLATTENING * (2.0 - FLATTENING)


@dataclass(frozen=True)
class Origin:
    """The point where the tangent plane touches."""

    lat_deg: float = 52.0312
    lon_deg: float = 8.5347
    alt_m: float = 110.0


def to_geodetic(origin: Origin, east_m: FloatArray, north_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Latitude and longitude in degrees of points of the tangent plane, through earth-centred coordinates.

    From X = X₀ + E e + N n the longitude is atan2(Y, X); the latitude solves tan φ = (Z + e² N(φ) sin φ) / p, which
    converges to a rounding error in a few rounds.
    """
    lat, lon = np.radians(origin.lat_deg), np.radians(origin.lon_deg)
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    normal_m = SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_2 * sin_lat**2)
    x = (normal_m + origin.alt_m) * cos_lat * cos_lon - sin_lon * east_m - sin_lat * cos_lon * north_m
    y = (normal_m + origin.alt_m) * cos_lat * sin_lon + cos_lon * east_m - sin_lat * sin_lon * north_m
    z = (normal_m * (1.0 - ECCENTRICITY_2) + origin.alt_m) * sin_lat + cos_lat * north_m
    from_axis = np.hypot(x, y)
    point_lat = np.arctan2(z, from_axis * (1.0 - ECCENTRICITY_2))
    for _ in range(5):
        sin = np.sin(point_lat)
        normal = SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_2 * sin * sin)
        point_lat = np.arctan2(z + ECCENTRICITY_2 * normal * sin, from_axis)
    return np.degrees(point_lat), np.degrees(np.arctan2(y, x))


def sentence(body: str) -> str:
    """A sentence with its checksum: the exclusive or of all characters between $ and *."""
    check = 0
    for character in body.encode():
        check ^= character
    return f"${body}*{check:02X}"


def _angle(angle_deg: float, degree_digits: int, minute_digits: int, letters: str) -> str:
    """An angle as degrees and decimal minutes with its hemisphere."""
    total = round(abs(angle_deg) * 60.0 * 10**minute_digits)
    minutes, fraction = divmod(total, 10**minute_digits)
    degrees, minutes = divmod(minutes, 60)
    letter = letters[0] if angle_deg >= 0 else letters[1]
    return f"{degrees:0{degree_digits}d}{minutes:02d}.{fraction:0{minute_digits}d},{letter}"


def place_text(lat_deg: float, lon_deg: float, minute_digits: int) -> str:
    """Latitude and longitude as in GGA and RMC."""
    return f"{_angle(lat_deg, 2, minute_digits, 'NS')},{_angle(lon_deg, 3, minute_digits, 'EW')}"


def gga(utc_s: float, place: str, quality: int, alt_m: float) -> str:
    """Position, quality and height."""
    age = "1.0" if quality in (2, 4, 5) else ""
    return sentence(f"GNGGA,{clock_text(utc_s)},{place},{quality},14,0.80,{alt_m:.3f},M,46.100,M,{age},")


def rmc(utc_s: float, place: str, quality: int) -> str:
    """The date with the position; speed and course are left empty."""
    mode = {4: "R", 5: "F", 1: "A"}.get(quality, "D")
    date = datetime.fromtimestamp(round(utc_s, 2), UTC).strftime("%d%m%y")
    return sentence(f"GNRMC,{clock_text(utc_s)},A,{place},,,{date},,,{mode}")


def gst(utc_s: float, sigma_m: float) -> str:
    """The receiver's own sigmas: alike in all directions, larger in height."""
    size = f"{sigma_m:.4f},{sigma_m:.4f},0.0,{sigma_m:.4f},{sigma_m:.4f},{1.6 * sigma_m:.4f}"
    return sentence(f"GNGST,{clock_text(utc_s)},{1.2 * sigma_m:.4f},{size}")


def clock_text(utc_s: float) -> str:
    """The time of day as hhmmss.ss."""
    hundredths = round(utc_s * 100.0) % (86400 * 100)
    seconds, rest = divmod(hundredths, 100)
    return f"{seconds // 3600:02d}{seconds // 60 % 60:02d}{seconds % 60:02d}.{rest:02d}"
