"""At which offsets do the fixes move as the wheels do? Every lag at once, by Fourier transform.

Displacements d over W seconds are complex, so they hold speed and course together; turning and scaling the path does
not change their coherence with the fixes':

    γ²(lag) = |Σ conj(d_wheels(t + lag)) d_fixes(t)|² / (Σ |d_wheels|² Σ |d_fixes|²)

Sums run over what both streams cover at that lag. A lag explains −N log(1 − γ²), with N independent windows: matching
well counts, and so does matching for long.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import fft, ifft, next_fast_len

from sccal.align.clock_fit import Fixes, WheelPath
from sccal.arrays import Bools, Complexes, Floats

GRID_S = 0.5
SHORTEST_WINDOW_S = 2.0
LONGEST_WINDOW_S = 30.0
WINDOW_SIGMAS = 6.0
SMALLEST_SHARE = 0.3
"""Of the fixes' motion that must lie within the wheels' span, or the other way round."""
SMALLEST_COHERENCE = 0.3
SCALES = (0.4, 2.5)
LONGEST_GAP_S = 5.0
SMEAR_S = 2.0
"""A skew is tried where it would move the ends of the run by more than this."""
STEEPEST_SKEW = 6e-4
MOST_SKEWS = 41
CLEAREST = 1e-4
"""Coherence is never believed beyond 1 − this: headings and slip are not known that well."""


@dataclass(frozen=True)
class Lag:
    """An offset at which the streams move together."""

    offset_s: float
    skew: float
    explained: float
    """−N log(1 − γ²)."""


def find_lags(wheels: WheelPath, fixes: Fixes, most: int = 12) -> list[Lag]:
    """Local maxima of what a lag explains, best first; offsets are wheels' clock minus fixes' at the fixes' middle."""
    window_s = _window_s(wheels, fixes)
    span_s = float(np.ptp(fixes.t_s))
    reach = int(np.ceil(STEEPEST_SKEW * 0.5 * span_s / SMEAR_S))
    reach = min(reach, MOST_SKEWS // 2)
    skews = STEEPEST_SKEW * np.arange(-reach, reach + 1) / max(reach, 1)
    found = [lag for skew in skews for lag in _lags_at(wheels, fixes, float(skew), window_s)]
    found.sort(key=lambda lag: -lag.explained)
    distinct: list[Lag] = []
    for lag in found:
        if all(abs(lag.offset_s - other.offset_s) > window_s for other in distinct):
            distinct.append(lag)
        if len(distinct) == most:
            break
    return distinct


def _window_s(wheels: WheelPath, fixes: Fixes) -> float:
    """Long enough that displacements stand out from the noise of the fixes."""
    speed = np.abs(np.diff(wheels.path_m)).sum() / max(float(np.ptp(wheels.t_s)), 1e-9)
    long_s = WINDOW_SIGMAS * fixes.sigma_m / max(float(speed), 1e-3)
    step_s = float(np.median(np.diff(fixes.t_s)))
    cells = np.ceil(np.clip(max(long_s, 2.0 * step_s), SHORTEST_WINDOW_S, LONGEST_WINDOW_S) / GRID_S)
    return float(cells * GRID_S)


def _displacements(t_s: Floats, z: Complexes, window_s: float) -> tuple[Complexes, Bools]:
    """Displacements over the window on a grid from t_s[0], and where they are known."""
    grid = np.arange(t_s[0], t_s[-1], GRID_S)
    number = np.floor((t_s - t_s[0]) / GRID_S).astype(np.int64)
    count = np.bincount(number)
    filled = np.flatnonzero(count)
    mean = (np.bincount(number, z.real) + 1j * np.bincount(number, z.imag))[filled] / count[filled]
    at = np.bincount(number, t_s - t_s[0])[filled] / count[filled]
    centre = grid - t_s[0] + 0.5 * GRID_S
    on_grid = np.interp(centre, at, mean)
    after = np.minimum(np.searchsorted(at, centre), at.size - 1)
    gap = at[after] - at[np.maximum(after - 1, 0)]
    known = (
        (gap <= max(LONGEST_GAP_S, 3.0 * float(np.median(np.diff(at)))))
        & (centre >= at[0] - GRID_S)
        & (centre <= at[-1] + GRID_S)
    )
    steps = round(window_s / GRID_S)
    if grid.size <= steps + 1:
        return np.zeros(0, dtype=complex), np.zeros(0, dtype=bool)
    all_known = np.convolve(~known, np.ones(steps + 1), mode="valid") < 0.5
    return np.where(all_known, on_grid[steps:] - on_grid[:-steps], 0.0), np.asarray(all_known)


def _lags_at(wheels: WheelPath, fixes: Fixes, skew: float, window_s: float) -> list[Lag]:
    middle = fixes.middle_s
    t_s = middle + (fixes.t_s - middle) * (1.0 + skew)
    d_fix, has_fix = _displacements(t_s, fixes.z_m, window_s)
    grid_wheels = np.arange(wheels.t_s[0], wheels.t_s[-1], 0.5 * GRID_S)
    path = np.interp(grid_wheels, wheels.t_s, wheels.path_m)
    d_wheel, has_wheel = _displacements(grid_wheels, path, window_s)
    if d_fix.size < 4 or d_wheel.size < 4:
        return []
    size = next_fast_len(d_fix.size + d_wheel.size)

    def transform(x: Complexes | Floats | Bools) -> Complexes:
        return np.asarray(fft(np.asarray(x, dtype=complex), size))

    def correlate(a: Complexes, b: Complexes) -> Complexes:
        """Σ_t conj(a)(t) b(t + lag) for lag −(fixes) … (wheels)."""
        both = ifft(np.conj(a) * b)
        return np.concatenate((both[-(d_fix.size - 1) :], both[: d_wheel.size]))

    fix_f, wheel_f = transform(d_fix), transform(d_wheel)
    has_fix_f, has_wheel_f = transform(has_fix), transform(has_wheel)
    power_fix_f, power_wheel_f = transform(np.abs(d_fix) ** 2), transform(np.abs(d_wheel) ** 2)
    cross = np.abs(correlate(fix_f, wheel_f)) ** 2
    count = correlate(has_fix_f, has_wheel_f).real
    fix_power = correlate(power_fix_f, has_wheel_f).real
    wheel_power = correlate(has_fix_f, power_wheel_f).real
    all_fix, all_wheel = float((np.abs(d_fix) ** 2).sum()), float((np.abs(d_wheel) ** 2).sum())
    enough = (fix_power > SMALLEST_SHARE * all_fix) | (wheel_power > SMALLEST_SHARE * all_wheel)
    enough &= (fix_power > 0.02 * all_fix) & (wheel_power > 0.02 * all_wheel)
    enough &= count * GRID_S > 4.0 * window_s
    coherence = np.where(enough, cross / np.maximum(fix_power * wheel_power, 1e-12), 0.0)
    scale = np.sqrt(cross) / np.maximum(wheel_power, 1e-12)
    fits = (coherence > SMALLEST_COHERENCE) & (scale > SCALES[0]) & (scale < SCALES[1])
    independent = count * GRID_S / window_s
    explained = np.where(fits, -independent * np.log1p(-np.minimum(coherence, 1.0 - CLEAREST)), 0.0)
    higher = np.ones(explained.size, dtype=bool)
    higher[1:] &= explained[1:] > explained[:-1]
    higher[:-1] &= explained[:-1] >= explained[1:]
    peaks = np.flatnonzero(higher & (explained > 0.0))
    peaks = peaks[np.argsort(-explained[peaks])[:24]]
    starts = float(wheels.t_s[0] - t_s[0])
    first = -(d_fix.size - 1)
    return [Lag(starts + float(k + first) * GRID_S, skew, float(explained[k])) for k in peaks]
