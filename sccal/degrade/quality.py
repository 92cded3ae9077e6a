"""What a fix claims about itself: the GGA quality and HDOP that go with an error of a given size.

A receiver whose fixes err by σ (m per axis) would report the quality that means as much, never a better one than it
reported before. Its HDOP grows with the part of σ that the quality does not explain by itself:

    HDOP' = √(HDOP² + (σ / σ_q)²)      σ_q: what the written quality means at HDOP 1
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.logs.quality import SIGMA_M

_UP_TO_M = ((0.03, 4), (0.6, 5), (1.75, 2))
"""Qualities by the largest σ (m) for which they are written; 1 beyond."""
_OF_NO_MEANING_M = 3.0
MOST_HDOP = 99.99


def quality_of_sigma(sigma_m: float) -> int:
    """The GGA quality of fixes with an error of ``sigma_m`` per axis."""
    return next((code for limit_m, code in _UP_TO_M if sigma_m <= limit_m), 1)


def written_quality(quality: Ints, sigma_m: float, asked: int | None) -> Ints:
    """The qualities (n,) to write for fixes that had ``quality`` (n,) and got an error of ``sigma_m`` per axis.

    What was asked for is written whatever it was before, except over 0 (no fix) and -1 (not stated).
    """
    if asked is not None:
        return np.where(quality > 0, asked, quality)
    if sigma_m <= 0:
        return quality
    new = quality_of_sigma(sigma_m)
    better = np.isin(quality, [code for code, nominal in SIGMA_M.items() if nominal < SIGMA_M[new]])
    return np.where(better, new, quality)


def written_hdop(hdop: Floats, sigma_m: float, quality: Ints) -> Floats:
    """HDOPs (n,) for an error of ``sigma_m`` per axis beside the quality written (n,); NaN stays NaN."""
    nominal = np.full(quality.shape, _OF_NO_MEANING_M)
    for code, value in SIGMA_M.items():
        nominal[quality == code] = value
    return np.maximum(hdop, np.minimum(np.hypot(hdop, sigma_m / nominal), MOST_HDOP))
