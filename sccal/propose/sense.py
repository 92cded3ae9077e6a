"""Which way a heading turns, by the whole path: the wheels' way laid out along it, or along its mirror image."""

from __future__ import annotations

import numpy as np

from sccal.align.path import laid_out
from sccal.align.signs import CLEARLY_WORSE, Slope
from sccal.propose.headings import Heading
from sccal.propose.places import Places
from sccal.propose.wheels import Wheels

_FITS = 0.3
"""Of the fixes' own spread about their middle: a path in a wrong unit of the heading, or of wheels that are none,
leaves nearly all of it."""


def turning_by_path(places: Places, wheels: Wheels, heading: Heading) -> Slope | None:
    """The wheels' turns on those of the fixes' path, as a slope of 1 or −1; None where both senses fit, or none does.

    The wheels' way along the heading is turned, scaled and moved to where it fits the fixes best.
    """
    inside = (places.path.t_s > max(wheels.t_s[0], heading.t_s[0])) & (
        places.path.t_s < min(wheels.t_s[-1], heading.t_s[-1])
    )
    t_s, fixes = places.path.t_s[inside], (places.path.east_m + 1j * places.path.north_m)[inside]
    if t_s.size < 3:
        return None
    yaw = np.interp(wheels.t_s, heading.t_s, heading.yaw_rad)
    left = []
    for sign in (1.0, -1.0):
        path = np.interp(t_s, wheels.t_s, laid_out(wheels.left_sum + wheels.right_sum, sign * yaw))
        columns = np.column_stack((path, np.ones(t_s.size)))
        solution, *_ = np.linalg.lstsq(columns, fixes, rcond=None)
        left.append(float(np.sqrt(np.mean(np.abs(fixes - columns @ solution) ** 2))))
    if max(left) < CLEARLY_WORSE * min(left) or min(left) > _FITS * float(np.std(fixes)):
        return None
    rises = left[0] < left[1]
    by_wheels = heading.convention == "enu"
    return Slope(1.0 if rises == by_wheels else -1.0, 1.0 if rises == by_wheels else -1.0, t_s.size)
