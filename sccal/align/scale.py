"""Do fixes, yaw and wheels speak of the same metres and radians? What is far off is a unit, and is named.

A radius or a track may be wrong by a factor of two; what differs by twenty is another unit, whatever the noise: fixes
that spread further than the wheels ever travelled, wheels that always go faster than the fixes, a yaw that turns many
times as far as the wheels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.logs.names import ENCODER_FILE

if TYPE_CHECKING:
    from sccal.align.aligned import Aligned

MOST_FACTOR = 20.0
MOST_YAW_FACTOR = 6.0
"""No track is as much wider or narrower than the tape measure says, not even where tracks skid."""
WINDOW_S = 4.0
FEWEST_WINDOWS = 10
LEAST_TRAVEL_M = 5.0
FAST = 0.9
"""The share of windows below the speed that is compared: noise makes fixes faster, never slower."""
DEGREES_PER_RADIAN = 57.29578
NEAR = 0.15


def check_scale(aligned: Aligned) -> None:
    """Raise DataError where fixes and wheels go so differently far that one of them is in another unit."""
    travel_m = float(np.abs(np.diff(aligned.travel_m)).sum())
    place = aligned.fix_east_m + 1j * aligned.fix_north_m
    if travel_m < LEAST_TRAVEL_M or place.size < FEWEST_WINDOWS:
        return
    middle = np.median(place.real) + 1j * np.median(place.imag)
    spread_m = float(np.quantile(np.abs(place - middle), FAST))
    if spread_m > MOST_FACTOR * travel_m:
        raise DataError(
            f"gnss: the fixes go far beyond what the wheels travelled: {spread_m:.4g} m from their middle, and the "
            f"wheels went {travel_m:.1f} m in all. The coordinates are in another unit (metres where degrees should "
            "be?), or the wheels are: check ticks_per_rev, the counts per turn"
        )
    factor = _times_as_fast(aligned, place)
    if factor is not None and factor > MOST_FACTOR:
        unit = ""
        if abs(factor / DEGREES_PER_RADIAN - 1.0) < NEAR:
            unit = (
                ": 57.3 degrees are one radian, so wheel angles are in degrees, not radians, or coordinates in radians"
            )
        raise DataError(
            f"{ENCODER_FILE}: the wheels go {factor:.3g} times as fast as the fixes{unit}; else check ticks_per_rev, "
            "the counts per turn of the wheel after gearing, and the coordinates' unit"
        )


def _times_as_fast(aligned: Aligned, place: np.ndarray) -> float | None:
    """How many times as fast as the fixes the wheels go; None where too little moves."""
    t_s = np.arange(aligned.fix_t_s[0], aligned.fix_t_s[-1], WINDOW_S)
    if t_s.size < FEWEST_WINDOWS:
        return None
    fixes = np.abs(np.diff(np.interp(t_s, aligned.fix_t_s, place)))
    wheels = np.abs(np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.travel_m)))
    fast_m, fast_fixes_m = float(np.quantile(wheels, FAST)), float(np.quantile(fixes, FAST))
    return fast_m / max(fast_fixes_m, 1e-9) if fast_m > 0.0 else None


def unit_of_yaw(slope: float) -> str:
    """What a yaw that turns ``slope`` times as far as the wheels may be in, for messages; empty for a usual slope."""
    if 1.0 / MOST_YAW_FACTOR < abs(slope) < MOST_YAW_FACTOR:
        return ""
    known = {
        10.0: "tenths of a degree",
        16.0: "sixteenths of a degree",
        DEGREES_PER_RADIAN: "degrees under a name in radians",
        1.0 / DEGREES_PER_RADIAN: "radians under a name in degrees",
        100.0: "hundredths of a degree",
        1.0 / 360.0: "turns",
        65536.0 / 360.0: "parts of 65536 to a turn",
        1000.0 / DEGREES_PER_RADIAN: "thousandths of a radian",
        6400.0 / 360.0: "mils",
    }
    size = min(known, key=lambda one: abs(np.log(abs(slope) / one)))
    return known[size] if abs(np.log(abs(slope) / size)) < 2.0 * NEAR else "another unit"


def increments_correlation(aligned: Aligned, t_s: Floats, yaw_steps: Floats) -> float:
    """How the wheels' values themselves, and not their steps, go with the turning of the yaw between times (n + 1)."""
    difference = aligned.right_rad - aligned.left_rad
    steps = np.diff(np.interp(t_s, aligned.wheel_t_s, np.cumsum(difference - np.median(difference))))
    a, b = steps - steps.mean(), yaw_steps - yaw_steps.mean()
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0
