"""How far a fix may be trusted: horizontal standard deviation per axis from its GGA quality, where none is stated.

The table gives a starting level; calibration then scales the levels to what the log itself shows. Sources of the
figures: u-blox ZED-F9P data sheet UBX-17051259, table 1 (RTK 0.01 m + 1 ppm, autonomous 1.5 m CEP, SBAS 1.0 m CEP) and
field reports of RTK float wander (0.2 to 0.5 m). Receivers that state their own accuracy (GST, sigma_m) are believed
first, but never below FLOOR_M: the place of an antenna's phase centre is not known better than that.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Bools, Floats, Ints

FLOOR_M = 0.008
UNKNOWN_QUALITY = -1
SIMULATOR_QUALITY = 8
RTK_FIXED = 4

SIGMA_M = {
    1: 3.0,  # autonomous
    2: 1.0,  # DGPS, SBAS
    3: 1.5,  # PPS
    4: 0.015,  # RTK fixed
    5: 0.35,  # RTK float
    8: 0.015,  # simulator
    9: 1.0,  # SBAS on some receivers
    UNKNOWN_QUALITY: 1.0,
}
"""σ per axis (m) by GGA quality. 0 (no fix), 6 (dead reckoning: contains a filter) and 7 (typed in) are not used."""

QUALITY_NAMES = {
    -1: "not stated",
    0: "no fix",
    1: "autonomous",
    2: "differential",
    3: "PPS",
    4: "RTK fixed",
    5: "RTK float",
    6: "dead reckoning",
    7: "manual",
    8: "simulator",
    9: "SBAS",
}


def usable(quality: Ints) -> Bools:
    """Which fixes (n,) may be used at all."""
    return np.isin(quality, list(SIGMA_M))


def table_sigma_m(quality: Ints) -> Floats:
    """Standard deviation per axis (n,) by quality alone."""
    sigma = np.full(quality.shape, np.nan)
    for code, value in SIGMA_M.items():
        sigma[quality == code] = value
    return sigma


def fix_covariance(
    quality: Ints, sigma_east_m: Floats, sigma_north_m: Floats, cov_en_m2: Floats
) -> tuple[Floats, Floats, Floats]:
    """Variances east and north and their covariance (n,), m²: stated where stated, else from the table."""
    table = table_sigma_m(quality)
    stated = np.isfinite(sigma_east_m) & np.isfinite(sigma_north_m) & (sigma_east_m > 0) & (sigma_north_m > 0)
    east = np.maximum(np.where(stated, sigma_east_m, table), FLOOR_M)
    north = np.maximum(np.where(stated, sigma_north_m, table), FLOOR_M)
    limit = 0.95 * east * north
    covariance = np.where(stated, np.clip(np.nan_to_num(cov_en_m2), -limit, limit), 0.0)
    return east**2, north**2, covariance
