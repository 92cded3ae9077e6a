"""How noisy this log is: levels and correlation times that make its innovations most likely.

White, hand-set sigmas make a filter far too sure: the error of an AHRS stays for 10 to 30 s, that of a fix for minutes.
The heading error and the fix error are each white noise plus a first-order Gauss-Markov process; each wheel's slip is a
random walk along the distance. The seven numbers maximise the likelihood of the innovations (Schweppe 1965) of the
filter itself over a stretch of the run, with wide log-normal priors that only matter where the log says nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from sccal.align import Aligned, build_timeline
from sccal.align.accuracy import table_sigma_m
from sccal.arrays import Floats
from sccal.filter.forward import Noise
from sccal.filter.iterate import RunProblem, iterate
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants, Start, coarse_constants, path_along_yaw

STRETCH_S = 600.0
WHEEL_RATE_HZ = 20.0
FIX_RATE_HZ = 5.0
NORMAL_MAD = 1.4826
DEFAULT_COLOURED_TAU_S = 30.0


@dataclass(frozen=True)
class _Scale:
    """Prior of the logarithm of one level: its centre, its width, and hard limits."""

    centre: float
    width: float
    low: float
    high: float


def _scales(fix_sigma_m: float) -> tuple[_Scale, ...]:
    """In the order of Noise's first seven fields; fix_sigma_m is the leading quality's typical sigma."""
    return (
        _Scale(np.radians(0.2), 1.5, np.radians(0.005), np.radians(30.0)),
        _Scale(np.radians(0.5), 1.5, np.radians(0.005), np.radians(60.0)),
        _Scale(15.0, 0.7, 1.0, 300.0),
        _Scale(1.0, 2.0, 0.02, 1000.0),
        _Scale(fix_sigma_m, 1.5, 1e-4, 100.0),
        _Scale(40.0, 0.7, 2.0, 600.0),
        _Scale(0.005, 1.5, 2e-4, 1.0),
    )


def estimate_noise(aligned: Aligned, start: Start, options: FilterOptions, heading_rate_hz: float) -> Noise:
    """The log's own noise: first rough constants under assumed noise, then the noise given them."""
    fix_sigma = float(np.median(np.sqrt(aligned.fix_var_east_m2[aligned.fix_leading])))
    scales = _scales(fix_sigma)
    others = _other_scales(aligned, start)
    centre = np.log([s.centre for s in scales])
    width = np.array([s.width for s in scales])
    free = np.ones(centre.size, dtype=bool)
    if not options.with_offset:
        free[[1, 2]] = False

    first = centre.copy()
    white = max(_white_level_m(aligned, start, aligned.fix_leading), 1e-4) / fix_sigma
    first[3] = np.log(np.clip(white, scales[3].low, scales[3].high))
    first[4] = np.log(np.clip(white * fix_sigma, scales[4].low, scales[4].high))

    def noise_at(logs: Floats) -> Noise:
        return Noise(*(float(v) for v in np.exp(logs)), other_fix_scale=others)

    begin = aligned.span_s[0]
    still = start.moving_from_s - begin
    stretch = (begin, (start.moving_from_s if still > 0.25 * STRETCH_S else begin) + STRETCH_S)
    timeline = build_timeline(aligned, 0.01, heading_rate_hz, FIX_RATE_HZ, stretch, WHEEL_RATE_HZ)
    rough = RunProblem(aligned, timeline, start, noise_at(first), options)
    mode, _ = iterate(rough, coarse_constants(aligned, start), max_rounds=3)
    constants = Constants(*(float(v) for v in mode[:3]))

    clear = rough.clear_steps(constants)

    def cost(part: Floats) -> float:
        logs = centre.copy()
        logs[free] = part
        problem = RunProblem(aligned, timeline, start, noise_at(logs), options)
        found = problem.begun(constants, constants, clear).finish()
        value = found.nll_heading + found.nll_fix + 0.5 * float((((logs - centre) / width)[free] ** 2).sum())
        return value if np.isfinite(value) else 1e12

    best = centre.copy()
    best[free] = minimize(
        cost,
        first[free],
        method="L-BFGS-B",
        bounds=[(np.log(s.low), np.log(s.high)) for s, on in zip(scales, free, strict=True) if on],
        options={"eps": 0.02, "maxiter": 25, "ftol": 1e-6},
    ).x
    return noise_at(best)


def _white_level_m(aligned: Aligned, start: Start, rows: np.ndarray) -> float:
    """White part of the fix error (m per axis) from second differences against the wheels; NaN where too few.

    Second differences of fix minus path cancel the slow errors; of white noise they have 6 times its variance.
    """
    index = np.flatnonzero(rows)
    if index.size < 8:
        return float("nan")
    t_s = aligned.fix_t_s[index]
    turn = start.wheel_scale * np.exp(-1j * start.offset_rad)
    path = turn * np.interp(t_s, aligned.wheel_t_s, path_along_yaw(aligned))
    second = np.diff(aligned.fix_east_m[index] + 1j * aligned.fix_north_m[index] - path, n=2)
    regular = second[t_s[2:] - t_s[:-2] < 2.5 * float(np.median(t_s[2:] - t_s[:-2]))]
    parts = np.concatenate((regular.real, regular.imag))
    return NORMAL_MAD * float(np.median(np.abs(parts))) / np.sqrt(6.0)


def _other_scales(aligned: Aligned, start: Start) -> dict[int, float]:
    """Factors for the qualities that do not lead: too few fixes to fit a correlated part, so it is priced in.

    Their white part is measured; what the table's sigma holds beyond it is taken as correlated over 30 s, and its
    variance multiplied by the number of fixes that share it.
    """
    scales: dict[int, float] = {}
    leading = aligned.fix_quality[aligned.fix_leading]
    for code in np.unique(aligned.fix_quality):
        if leading.size and code == leading[0]:
            continue
        rows = aligned.fix_quality == code
        stated = float(np.median(np.sqrt(aligned.fix_var_east_m2[rows])))
        table = float(table_sigma_m(np.array([code]))[0])
        white = _white_level_m(aligned, start, rows)
        white = stated if not np.isfinite(white) else white
        coloured2 = max(max(table, stated) ** 2 - white**2, 0.0)
        interval = float(np.median(np.diff(aligned.fix_t_s[rows]))) if rows.sum() > 1 else DEFAULT_COLOURED_TAU_S
        shared = max(1.0, 2.0 * DEFAULT_COLOURED_TAU_S / max(interval, 0.02))
        scales[int(code)] = float(np.sqrt(white**2 + coloured2 * shared)) / stated
    return scales
