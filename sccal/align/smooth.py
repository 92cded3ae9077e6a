"""A reading freed of its white noise, for what is a regressor: noise in it makes everything that follows it too small.

A reading z of something that wanders is taken for a random walk with white noise on top,

    z_k = x_k + e_k      x_k = x_{k−1} + w_k      V_m = var(z_{k+m} − z_k) = m q + 2 r

so that its own changes tell q and r, those over one reading and those over so many that the walk has doubled them; and
the expectation of x given all of z is an exponential average to both sides
with the gain g = (−a + √(a² + 4 a))/2, a = q/r (the steady smoother of the local level model; Durbin and Koopman 2012,
Time Series Analysis by State Space Methods, chapter 2). The attenuation that is left is that of regression on E(x | z),
which has none (Carroll et al. 2006, Measurement Error in Nonlinear Models, on regression calibration).
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from sccal.arrays import Floats

FEWEST = 50
"""Readings from which their noise can be told."""
LONGEST_LAG = 512


def without_white_noise(z: Floats) -> Floats:
    """The smoothed reading (n,); as it is where it is too short, holds gaps or shows no white noise."""
    if z.size < FEWEST or not np.isfinite(z).all():
        return z
    at_once = float(np.mean(np.diff(z) ** 2))
    lag, later = 1, at_once
    while later < 2.0 * at_once and lag < min(LONGEST_LAG, z.size // 4):
        lag *= 2
        later = float(np.mean((z[lag:] - z[:-lag]) ** 2))
    if lag == 1 or at_once == 0.0:
        return z
    walk2 = max(later - at_once, 0.0) / (lag - 1)
    white2 = 0.5 * (at_once - walk2)
    if white2 <= 0.0:
        return z
    ratio = max(walk2 / white2, 1e-6)
    gain = 0.5 * (np.sqrt(ratio * ratio + 4.0 * ratio) - ratio)
    # Forward the filter, backward the smoother: x_k|n = x_k|k + (1 − g) (x_{k+1}|n − x_k|k).
    forward, _ = lfilter([gain], [1.0, gain - 1.0], z, zi=[(1.0 - gain) * z[0]])
    backward, _ = lfilter([gain], [1.0, gain - 1.0], forward[::-1], zi=[(1.0 - gain) * forward[-1]])
    return np.asarray(backward[::-1])
