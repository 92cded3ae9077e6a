"""The wheels' travel laid out along a heading: the path, but for where it starts and how it is turned and scaled."""

from __future__ import annotations

import numpy as np

from sccal.arrays import Complexes, Floats


def laid_out(travel_m: Floats, heading_rad: Floats) -> Complexes:
    """Positions (n,) in complex metres from 0, for signed cumulative travel (n,) and headings (n,), mid-step."""
    middle = 0.5 * (heading_rad[1:] + heading_rad[:-1])
    return np.concatenate(([0.0], np.cumsum(np.diff(travel_m) * np.exp(1j * middle))))
