"""What is left of heading and fixes, against what the robot did: a residual that follows a quantity has a cause there.

A quantity must not hold the very error whose cause is sought: sorted by a noisy yaw, its own noise looks like a cause.
The heading is therefore the one that was predicted before the reading, which its innovation does not depend on, and
speed and turn rate are taken from the wheels just after the measurement, which they had no part in predicting.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.special import gammaincc

from sccal.arrays import Floats
from sccal.filter.forward import ForwardPass
from sccal.filter.iterate import RunProblem
from sccal.results.calibration import Cause

BINS = 16
FEWEST_IN_BIN = 20
SPAN_S = 0.5
"""Speeds and turn rates are means over so long …"""
PAUSE_S = 0.1
"""… beginning so long after the measurement: a count's rounding is still in the one before."""
LEAST_TILT_RAD = np.radians(2.0)
"""Roll and pitch whose middle nine tenths span less tell nothing."""
SHIFTS = 8
NEAR_EDGE = 0.1
"""Of a bin's width."""
OUTER = 0.005
"""Share of the measurements at either end of a quantity's range that the bins leave out."""


def find_causes(problem: RunProblem, found: ForwardPass, values: Floats, settled_s: float) -> tuple[Cause, ...]:
    """Residuals of one pass against yaw, turn rate, speed and, on slopes, roll and pitch; values (4 + m,) as found."""
    aligned, timeline = problem.aligned, problem.timeline
    heading_t = aligned.heading_t_s[timeline.heading_index]
    kept = found.heading_accepted & (heading_t >= settled_s)
    t_s, heading = heading_t[kept], found.heading_nu_rad[kept]
    yaw = _wrapped(aligned.yaw_rad[timeline.heading_index][kept] - heading - values[3])
    speed, turn_rate = _motion(problem, values, t_s)
    causes = [
        binned("heading", "yaw", yaw, heading),
        binned("heading", "turn_rate", turn_rate, heading),
    ]
    fix_t = aligned.fix_t_s[timeline.fix_index]
    kept = found.fix_accepted & aligned.fix_leading[timeline.fix_index] & (fix_t >= settled_s)
    t_s, nu = fix_t[kept], found.fix_nu_m[kept]
    ahead = np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad) - values[3]
    along = np.cos(ahead) * nu[:, 0] + np.sin(ahead) * nu[:, 1]
    across = -np.sin(ahead) * nu[:, 0] + np.cos(ahead) * nu[:, 1]
    speed, turn_rate = _motion(problem, values, t_s)
    causes += [
        binned("along", "speed", speed, along),
        binned("along", "turn_rate", turn_rate, along),
        binned("across", "speed", speed, across),
        binned("across", "turn_rate", turn_rate, across),
    ]
    pitch, roll = (
        None if tilt is None else np.interp(t_s, aligned.heading_t_s, tilt)
        for tilt in (aligned.pitch_rad, aligned.roll_rad)
    )
    if pitch is not None and _varies(pitch):
        causes.append(binned("along", "pitch", pitch, along))
    if roll is not None and _varies(roll):
        causes.append(binned("across", "roll", roll, across))
    return tuple(cause for cause in causes if cause.x.size)


def binned(
    residual: Literal["heading", "along", "across"],
    quantity: Literal["yaw", "turn_rate", "speed", "roll", "pitch"],
    x: Floats,
    residuals: Floats,
) -> Cause:
    """Means of the residuals (n,), in order of time, over BINS equal stretches of x (n,).

    The standard errors come from the scatter about the means, and count measurements that err alike in a row as fewer.
    """
    known = np.isfinite(x) & np.isfinite(residuals)
    x, residuals = x[known], residuals[known]
    if not x.size:
        return Cause(residual, quantity, x, residuals, x, x, x, float("nan"))
    low, high = (-np.pi, np.pi) if quantity == "yaw" else np.quantile(x, (OUTER, 1.0 - OUTER))
    width = (high - low) / BINS
    inside = (x >= low) & (x <= high)
    scaled = (x[inside] - low) / (width or 1.0)
    shift = _off_the_crowds(scaled)
    place = np.floor(scaled + shift).astype(np.int64)
    places = BINS + 1
    if quantity == "yaw":
        places = BINS
        place %= BINS  # west is one place, wherever its angle is cut
    place = np.minimum(place, places - 1)
    some = residuals[inside]
    count = np.bincount(place, minlength=places)
    enough = count >= FEWEST_IN_BIN
    n = count[enough]
    mean = np.bincount(place, some, places)[enough] / n
    square = np.bincount(place, some**2, places)[enough] / n
    whole = np.zeros(places)
    whole[enough] = mean
    sigma = np.sqrt(np.maximum(square - mean**2, 0.0) / (n - 1) * _in_a_row(some - whole[place]))
    middle = np.asarray(low + width * (np.arange(places) + 0.5 - shift), dtype=np.float64)[enough]
    told = sigma > 0.0
    chi2 = float(np.sum((mean[told] / sigma[told]) ** 2))
    chance = float(gammaincc(0.5 * told.sum(), 0.5 * chi2)) if told.any() else float("nan")
    return Cause(residual, quantity, x, residuals, middle, mean, sigma, chance)


def _off_the_crowds(scaled: Floats) -> float:
    """How far to move edges at whole numbers to the left so that few values (n,) stand at one.

    A robot drives for long at one heading or speed. An edge there would sort its measurements by their noise.
    """
    shifts = np.arange(SHIFTS) / SHIFTS
    near = [float(np.sum(np.abs(scaled + shift - np.round(scaled + shift)) < NEAR_EDGE)) for shift in shifts]
    return float(shifts[int(np.argmin(near))])


def _in_a_row(left: Floats) -> float:
    """Measurements per independent one: the sum of their autocorrelation (of n residuals), while pairs are positive.

    Geyer's initial positive sequence (Practical Markov chain Monte Carlo, Statistical Science 1992).
    """
    if left.size < 2:
        return 1.0
    size = 1 << (2 * left.size - 1).bit_length()
    spectrum = np.fft.rfft(left - left.mean(), size)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, size)[: left.size]
    if not covariance[0] > 0.0:
        return 1.0
    correlation = covariance / covariance[0]
    pairs = correlation[: left.size // 2 * 2].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs <= 0.0)
    kept = pairs[: negative[0]] if negative.size else pairs
    return max(1.0, 2.0 * float(kept.sum()) - 1.0)


def _motion(problem: RunProblem, values: Floats, t_s: Floats) -> tuple[Floats, Floats]:
    """Speed (m/s) and turn rate (rad/s) by the wheels after times (n,), with the radii and the track as found."""
    aligned = problem.aligned
    first, last = aligned.span_s
    before = np.clip(t_s + PAUSE_S, first, last)
    after = np.clip(t_s + PAUSE_S + SPAN_S, first, last)
    rims = [
        radius * (np.interp(after, aligned.wheel_t_s, angle) - np.interp(before, aligned.wheel_t_s, angle))
        for radius, angle in zip(values[:2], (aligned.right_rad, aligned.left_rad), strict=True)
    ]
    lasting = np.maximum(after - before, 1e-9)
    return 0.5 * (rims[0] + rims[1]) / lasting, (rims[0] - rims[1]) / values[2] / lasting


def _varies(tilt_rad: Floats) -> bool:
    """Whether the middle nine tenths span enough; a tilt with holes is not looked at."""
    if not tilt_rad.size or not np.isfinite(tilt_rad).all():
        return False
    low, high = np.quantile(tilt_rad, (0.05, 0.95))
    return bool(high - low > LEAST_TILT_RAD)


def _wrapped(angle_rad: Floats) -> Floats:
    """Into (−π, π]."""
    return np.asarray(np.pi - (np.pi - angle_rad) % (2.0 * np.pi))
