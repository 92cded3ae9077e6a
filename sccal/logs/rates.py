"""Rates of wheels summed to angles, by the trapezoid between each two rows."""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats


def integrated(t_s: Floats, rate: Floats) -> Floats:
    """What a rate (n, per second) at increasing times (n) has come to (n), from 0."""
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t_s)
    return np.concatenate((np.zeros(1), np.cumsum(steps)))
