"""Arrival times at a logging computer."""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats


def in_order(stamps_s: Floats, gap_s: float) -> Floats:
    """Arrival times with the queue kept: none comes less than ``gap_s`` after the one before it."""
    ahead = np.arange(stamps_s.size) * gap_s
    return np.asarray(np.maximum.accumulate(stamps_s - ahead) + ahead)
