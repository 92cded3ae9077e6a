"""What a GGA quality means: the error of such a fix, and what messages state in its place.

NavSatStatus says less than GGA: −1 no fix, 0 a fix, 1 with satellite corrections, 2 with corrections from the ground.
Drivers give 2 for RTK, fixed or float. So status 0 is quality 1, 1 is 2, and 2 is 4 (RTK fixed) unless the covariance
states more than RTK_FIXED_M, then 5 (float). A type without status is −1, not stated.

Sources of the errors: u-blox ZED-F9P data sheet UBX-17051259, table 1 (RTK 0.01 m + 1 ppm, autonomous 1.5 m CEP, SBAS
1.0 m CEP) and field reports of RTK float wander (0.2 to 0.5 m).
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats, Ints

SIGMA_M = {
    1: 3.0,  # autonomous
    2: 1.0,  # DGPS, SBAS
    3: 1.5,  # PPS
    4: 0.015,  # RTK fixed
    5: 0.35,  # RTK float
    8: 0.015,  # simulator
    9: 1.0,  # SBAS on some receivers
}
"""σ per axis (m) by GGA quality. 0 (no fix), 6 (dead reckoning: contains a filter) and 7 (typed in) mean none."""
RTK_FIXED_M = 0.1
"""Between the 0.01 to 0.03 m that receivers state for RTK fixed and the 0.2 m and more for float."""
_NAVSAT_STATUS = {0: -1, 2: 1, 3: 1, 9: 1, 4: 2, 5: 2}


def navsat_status(quality: int) -> int:
    """NavSatStatus for a GGA quality; 0, a fix, for all that have no status of their own."""
    return _NAVSAT_STATUS.get(quality, 0)


def quality_of(status: Floats, sigma_m: Floats) -> Ints:
    """GGA quality (n) for NavSatStatus or GPSStatus (n, NaN where there is none) and the stated sigma (n, m)."""
    quality = np.full(status.size, -1, dtype=np.int64)
    quality[status < 0] = 0
    quality[status == 0] = 1
    quality[(status == 1) | (status > 2)] = 2
    quality[status == 2] = 4
    quality[(status == 2) & (sigma_m > RTK_FIXED_M)] = 5
    return quality
