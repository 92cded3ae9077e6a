"""Offset and skew between two clocks from one path seen on both: fixes on one, wheels and yaw on the other.

    z(u) = c + α (p(t) + b e^{iψ(t)} + ε ∫ (t − t_m) dp)          t = u + offset + skew (u − u_m)

p is the wheels' travel laid along the yaw, α turns and scales it, b is the antenna's place, ε a drift of the heading.
What is left is a random walk (slip, and heading errors while driving) under white noise of the fixes. Its innovations
are a linear filter, e = (1 − L) / (1 − λL), so filtering the residual and its derivatives alike and then taking least
squares is generalised least squares. λ is chosen by likelihood, a short autoregression takes what correlation is left,
and blocks of the log tell whether the sigmas are too small. The antenna's place and the drift of the heading have priors:
at one speed the first is an offset, on a circle the second is a skew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import lfilter

from sccal.align.path import laid_out
from sccal.arrays import Bools, Complexes, Floats, Ints

CELL_S = 1.0
"""Fixes, and the path at their times, are averaged over this long: nothing that slow robots do is lost."""
MEMORIES_S = (0.5, 1.5, 5.0, 15.0, 50.0)
AUTOREGRESSION = 4
ROUNDS = 12
CONVERGED_S = 2e-4
NEIGHBOURS = 9
OUTLIER_SPREADS = 6.0
HUBER = 2.5
FEWEST_CELLS = 20
BLOCK_S = 30.0
MOST_BLOCKS = 40
SLOPE_S = 0.1
FARTHEST_STEP_S = 2.0
LARGEST_SKEW = 1.5e-3
PRIOR_SKEW = 3e-4
PRIOR_DRIFT_RADPS = np.radians(10.0) / 3600.0
PRIOR_SCALE = 0.2


@dataclass(frozen=True)
class WheelPath:
    """What wheels and yaw say of the motion, on their own clock."""

    t_s: Floats
    """(n,), increasing."""
    path_m: Complexes
    """Signed travel laid along the yaw (n,), with the nominal radius."""
    yaw_rad: Floats
    """(n,), unwrapped."""
    arm_m: float
    """How far from the middle between the wheels an antenna may well be: the prior's sigma."""

    def mirrored(self) -> WheelPath:
        """As it would be if the yaw counted the other way round."""
        return WheelPath(self.t_s, np.conj(self.path_m), -self.yaw_rad, self.arm_m)


def wheel_path(t_s: Floats, travel_m: Floats, yaw_rad: Floats, arm_m: float) -> WheelPath:
    """The path of signed cumulative travel (n,) along a yaw (n,), both at t_s."""
    return WheelPath(t_s, laid_out(travel_m, yaw_rad), yaw_rad, arm_m)


@dataclass(frozen=True)
class Fixes:
    """Positions on a clock of their own."""

    t_s: Floats
    """(n,), increasing."""
    z_m: Complexes
    """East + i north (n,)."""
    sigma_m: float
    """Stated, per axis: only a scale."""

    @property
    def middle_s(self) -> float:
        """The time to which an offset refers."""
        return float(np.median(self.t_s))


@dataclass(frozen=True)
class ClockFit:
    """Wheels' clock minus fixes' clock, at the fixes' middle, and its rate; how well the path then fits."""

    offset_s: float
    skew: float
    covariance: Floats
    """Of (offset, skew), (2, 2), the larger of what the model and what the blocks of the log say."""
    cost: Floats
    """Mean squared innovation (m²) in each block of the log that could be judged."""
    cells: int
    scale: float
    """|α|: metres by the fixes per metre by the wheels."""
    covered: float
    """Share of the fixes' time in which the wheels' path is known."""
    filters: tuple[float, Floats]
    """λ and the autoregression: what makes two fits comparable."""

    @property
    def sigma_offset_s(self) -> float:
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def sigma_skew(self) -> float:
        return float(np.sqrt(self.covariance[1, 1]))

    def at(self, since_middle_s: float) -> tuple[float, float]:
        """The wheels' clock minus the fixes' so long after the fixes' middle, and its sigma."""
        direction = np.array([1.0, since_middle_s])
        return self.offset_s + self.skew * since_middle_s, float(np.sqrt(direction @ self.covariance @ direction))


def fit_clock(
    wheels: WheelPath,
    fixes: Fixes,
    offset_s: float,
    skew: float = 0.0,
    filters: tuple[float, Floats] | None = None,
    rounds: int = ROUNDS,
) -> ClockFit | None:
    """Least squares from a first guess that is right to about a second; None where too little of the path is shared.

    filters, where given, are used instead of chosen. rounds = 0 judges the guess as it stands.
    """
    alpha, arm, drift = 1.0 + 0.0j, 0.0 + 0.0j, 0.0
    first = True
    for round_ in range(rounds + 1):
        columns = _columns(wheels, fixes, offset_s, skew)
        if columns is None:
            return None
        z, p, slope, turn, bent, since_s, cell_s, covered = columns
        if first:
            alpha = _turn_and_scale(p, z)
            first = False
        model = alpha * (p + arm * turn + drift * 1j * bent)
        whole = _cells(
            cell_s,
            np.column_stack(
                [
                    z - model,
                    alpha * p,
                    1j * alpha * p,
                    alpha * turn,
                    1j * alpha * turn,
                    1j * alpha * bent,
                    alpha * slope,
                    alpha * slope * since_s,
                ]
            ),
            z - model,
        )
        if whole is None:
            return None
        rows, at_s = whole
        gap = np.diff(at_s) > 1.5 * max(CELL_S, float(np.median(np.diff(at_s))))
        if filters is None and round_ >= min(2, rounds):
            filters = _choose_filters(rows, gap, at_s, wheels.arm_m)
        use = filters if filters is not None else (_memory(15.0, at_s), np.zeros(0))
        white, keep = _whitened(rows, gap, use)
        solution = _solve(white[keep], at_s[1:][keep], wheels.arm_m, (arm, drift, skew))
        if rounds == 0 or round_ == rounds:
            break
        step, step_skew = float(solution.values[5]), float(solution.values[6])
        step = float(np.clip(step, -FARTHEST_STEP_S, FARTHEST_STEP_S))
        skew_now = float(np.clip(skew + step_skew, -LARGEST_SKEW, LARGEST_SKEW))
        moved = abs(step) + abs(skew_now - skew) * 0.5 * float(np.ptp(fixes.t_s))
        offset_s, skew = offset_s + step, skew_now
        arm += complex(solution.values[2], solution.values[3])
        drift += float(solution.values[4])
        alpha *= 1.0 + complex(solution.values[0], solution.values[1])
        if filters is not None and moved < CONVERGED_S and round_ >= 3:
            break
    return ClockFit(
        offset_s,
        skew,
        solution.covariance[5:, 5:],
        solution.cost,
        int(keep.sum()),
        float(abs(alpha)),
        covered,
        filters if filters is not None else use,
    )


def _turn_and_scale(p: Complexes, z: Complexes) -> complex:
    """α from displacements, so that a drift of the path does not matter."""
    stride = max(1, p.size // 400)
    dp, dz = p[stride:] - p[:-stride], z[stride:] - z[:-stride]
    power = float((np.abs(dp) ** 2).sum())
    alpha = complex((np.conj(dp) * dz).sum() / power) if power > 0 else 1.0 + 0.0j
    size = abs(alpha)
    return alpha / size if size > 0 else 1.0 + 0.0j


def _columns(
    wheels: WheelPath, fixes: Fixes, offset_s: float, skew: float
) -> tuple[Complexes, Complexes, Complexes, Complexes, Complexes, Floats, Floats, float] | None:
    """Fixes that the wheels cover; path, its slope, e^{iψ} and the bent path at their times; their own times."""
    since = fixes.t_s - fixes.middle_s
    t = fixes.t_s + (offset_s + skew * since)
    inside = (t >= wheels.t_s[0] + SLOPE_S) & (t <= wheels.t_s[-1] - SLOPE_S)
    if int(inside.sum()) < FEWEST_CELLS:
        return None
    t, since, z = t[inside], since[inside], fixes.z_m[inside]
    p = np.interp(t, wheels.t_s, wheels.path_m)
    before, after = (np.interp(t + way * SLOPE_S, wheels.t_s, wheels.path_m) for way in (-1.0, 1.0))
    slope = (after - before) / (2.0 * SLOPE_S)
    turn = np.exp(1j * np.interp(t, wheels.t_s, wheels.yaw_rad))
    bent = np.concatenate(([0.0], np.cumsum(0.5 * (since[1:] + since[:-1]) * np.diff(p))))
    return z, p, slope, turn, bent, since, fixes.t_s[inside], float(inside.mean())


def _cells(t_s: Floats, rows: Complexes, left: Complexes) -> tuple[Complexes, Floats] | None:
    """Means over CELL_S of the rows (n, k) whose residual does not stand out from its neighbours', and cell times."""
    keep = _no_outliers(left)
    t_s, rows = t_s[keep], rows[keep]
    number = np.floor((t_s - t_s[0]) / CELL_S).astype(np.int64)
    start = np.flatnonzero(np.concatenate(([True], np.diff(number) > 0)))
    if start.size < FEWEST_CELLS:
        return None
    count = np.diff(np.append(start, t_s.size))
    return np.add.reduceat(rows, start, axis=0) / count[:, None], np.add.reduceat(t_s, start) / count


def _no_outliers(left: Complexes) -> Bools:
    """Residuals (n,) that lie near the running median of their neighbours."""
    off = np.abs(
        left - (median_filter(left.real, NEIGHBOURS, mode="nearest") + 1j * median_filter(left.imag, NEIGHBOURS, mode="nearest"))
    )
    usual = float(np.median(off))
    return np.asarray(off <= OUTLIER_SPREADS * max(1.48 * usual, 1e-3))


def _memory(memory_s: float, at_s: Floats) -> float:
    return float(np.exp(-float(np.median(np.diff(at_s))) / memory_s))


def _whitened(rows: Complexes, gap: Bools, filters: tuple[float, Floats]) -> tuple[Complexes, Bools]:
    """Innovations (n − 1, k) of the columns, and which rows do not step over a gap."""
    lam, ar = filters
    steps = np.diff(rows, axis=0)
    steps[gap] = 0.0
    white = lfilter([1.0], [1.0, -lam], steps, axis=0)
    if ar.size:
        white = lfilter(np.concatenate(([1.0], -ar)), [1.0], white, axis=0)
    return white, ~gap


def _choose_filters(rows: Complexes, gap: Bools, at_s: Floats, arm_m: float) -> tuple[float, Floats]:
    """λ by likelihood, then an autoregression of what correlation is left."""
    best: tuple[float, float, Complexes] | None = None
    for memory_s in MEMORIES_S:
        lam = _memory(memory_s, at_s)
        white, keep = _whitened(rows, gap, (lam, np.zeros(0)))
        solution = _solve(white[keep], at_s[1:][keep], arm_m, (0j, 0.0, 0.0))
        if best is None or solution.score < best[0]:
            best = (solution.score, lam, solution.residual)
    assert best is not None
    spread = float(np.median(np.abs(best[2])))
    clipped = best[2] / np.maximum(np.abs(best[2]) / max(3.0 * spread, 1e-9), 1.0)
    return best[1], _yule_walker(clipped)


def _yule_walker(e: Complexes) -> Floats:
    """Real autoregression (AUTOREGRESSION,) of both parts of e."""
    n = e.size
    if n < 10 * AUTOREGRESSION:
        return np.zeros(0)
    r = np.array([float((np.conj(e[: n - k]) * e[k:]).real.sum()) for k in range(AUTOREGRESSION + 1)])
    if r[0] <= 0:
        return np.zeros(0)
    lags = np.abs(np.subtract.outer(np.arange(AUTOREGRESSION), np.arange(AUTOREGRESSION)))
    matrix = r[:-1][lags] + 1e-3 * r[0] * np.eye(AUTOREGRESSION)
    return np.asarray(np.linalg.solve(matrix, r[1:]))


@dataclass(frozen=True)
class _Solution:
    values: Floats
    covariance: Floats
    cost: Floats
    score: float
    residual: Complexes


def _solve(white: Complexes, at_s: Floats, arm_m: float, now: tuple[complex, float, float]) -> _Solution:
    """Robust least squares of the first column on the others, with priors; block-robust covariance."""
    y = np.concatenate((white[:, 0].real, white[:, 0].imag))
    x = np.concatenate((white[:, 1:].real, white[:, 1:].imag))
    arm, drift, skew = now
    prior_sigma = np.array([PRIOR_SCALE, np.pi, arm_m, arm_m, PRIOR_DRIFT_RADPS, np.inf, PRIOR_SKEW])
    prior_mean = np.array([0.0, 0.0, -arm.real, -arm.imag, -drift, 0.0, -skew])
    precision = 1.0 / prior_sigma**2
    weight = np.ones(y.size)
    variance = float(np.median(y**2)) / 0.455 + 1e-12
    for _ in range(3):
        normal = (x * (weight / variance)[:, None]).T @ x + np.diag(precision)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        inverse = np.linalg.pinv(normal * np.outer(scale, scale), rcond=1e-13) * np.outer(scale, scale)
        values = inverse @ (x.T @ (weight * y / variance) + precision * prior_mean)
        e = y - x @ values
        size = np.abs(e[: e.size // 2] + 1j * e[e.size // 2 :])
        spread = float(np.median(size)) / 1.1774 + 1e-9
        w = 1.0 / np.maximum(size / (HUBER * spread), 1.0)
        weight = np.concatenate((w, w))
        variance = float((weight * e**2).sum() / max(e.size - x.shape[1], 1)) + 1e-12
    block = _blocks(at_s)
    score_rows = x * (weight * e / variance)[:, None]
    number = np.concatenate((block, block))
    per_block = np.array([np.bincount(number, score_rows[:, k], block.max() + 1) for k in range(x.shape[1])]).T
    sandwich = inverse @ (per_block.T @ per_block) @ inverse
    inflate = np.sqrt(np.maximum(np.diag(sandwich) / np.maximum(np.diag(inverse), 1e-300), 1.0))
    covariance = inverse * np.outer(inflate, inflate)
    half = e.size // 2
    robust = weight[:half] * (e[:half] ** 2 + e[half:] ** 2)
    count = np.bincount(block)
    cost = np.bincount(block, robust) / np.maximum(count, 1)
    return _Solution(
        values, covariance, cost[count >= 5], float(np.log(robust.mean() + 1e-18)), e[:half] + 1j * e[half:]
    )


def _blocks(at_s: Floats) -> Ints:
    """Number of the block of the log in which each cell lies (n,)."""
    width = max(BLOCK_S, float(np.ptp(at_s)) / MOST_BLOCKS)
    number = np.floor((at_s - at_s[0]) / width).astype(np.int64)
    return np.unique(number, return_inverse=True)[1]
