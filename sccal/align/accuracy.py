"""How far a fix may be trusted: horizontal standard deviation per axis from its GGA quality, where none is stated.

The table gives a starting level; calibration then scales the levels to what the log itself shows. Receivers that state
their own accuracy (GST, sigma_m) are believed first, but never below FLOOR_M: the place of an antenna's phase centre is
not known better than that.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.quality import SIGMA_M

FLOOR_M = 0.008
UNKNOWN_QUALITY = -1
SIMULATOR_QUALITY = 8
RTK_FIXED = 4

_SIGMA_M = SIGMA_M | {UNKNOWN_QUALITY: 1.0}
"""σ per axis (m) by GGA quality; fixes of the others are not used."""

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
    return np.isin(quality, list(_SIGMA_M))


def table_sigma_m(quality: Ints) -> Floats:
    """Standard deviation per axis (n,) by quality alone."""
    sigma = np.full(quality.shape, np.nan)
    for code, value in _SIGMA_M.items():
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
