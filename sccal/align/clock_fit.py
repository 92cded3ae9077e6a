"""Offset and skew between two clocks from one path seen on both: fixes on one, wheels and yaw on the other.

    z(u) = c + α (p(t) + b e^{iψ(t)} + ε ∫ (t − t_m) dp)          t = u + offset + skew (u − u_m)

p is the wheels' travel laid along the yaw, α turns and scales it, b is the antenna's place, ε a drift of the heading.
What is left is a random walk (slip, and heading errors while driving) under white noise of the fixes. Its innovations
are a linear filter, e = (1 − L) / (1 − λL), so filtering the residual and its derivatives alike and then taking least
squares is generalised least squares. λ is chosen by likelihood, a short autoregression takes what correlation is left,
and blocks of the log tell whether the sigmas are too small. The antenna's place and the drift of the heading have
priors: at one speed the first is an offset, on a circle the second is a skew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.align.path import laid_out
from sccal.align.standing import Spans, rows_in_stands
from sccal.align.whitening import innovations
from sccal.arrays import Bools, Complexes, Floats, Ints

CELL_S = 1.0
MOST_CELLS = 2400
"""Fixes, and the path at their times, are averaged over a second, over more in a log of hours: little is lost."""
MEMORIES_S = (0.5, 1.5, 5.0, 15.0, 50.0)
AUTOREGRESSION = 12
ROUNDS = 12
CONVERGED_S = 2e-4
NEIGHBOURS = 9
OUTLIER_SPREADS = 6.0
HUBER = 2.5
FEWEST_CELLS = 20
BLOCK_S = 30.0
MOST_BLOCKS = 40
FEWEST_IN_BLOCK = 5
SLOPE_S = 0.1
FARTHEST_STEP_S = 2.0
LARGEST_SKEW = 1.5e-3
FASTEST_SKEW = 1e-3
STAND_S = 10.0
"""Of a stand, at both its ends, in which fixes count: they show when it begins and ends. What lies between, for hours
perhaps, is the receiver's noise alone, and not the one it has on the way."""
PRIOR_SKEW = 4e-4
PRIOR_DRIFT_RADPS = np.radians(3.0) / 3600.0
PRIOR_SCALE = 0.2


@dataclass(frozen=True)
class Filters:
    """What makes the innovations of both channels white: for each λ, and an autoregression."""

    in_body: bool
    """Channels are forward and left (slip and heading errors rule), else east and north (the fixes' noise rules)."""
    channels: tuple[tuple[float, Floats], tuple[float, Floats]]


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
    standing_s: Spans = ()
    """Stretches in which the wheels stand."""

    def mirrored(self) -> WheelPath:
        """As it would be if the yaw counted the other way round."""
        return WheelPath(self.t_s, np.conj(self.path_m), -self.yaw_rad, self.arm_m, self.standing_s)


def wheel_path(t_s: Floats, travel_m: Floats, yaw_rad: Floats, arm_m: float, standing_s: Spans = ()) -> WheelPath:
    """The path of signed cumulative travel (n,) along a yaw (n,), both at t_s."""
    return WheelPath(t_s, laid_out(travel_m, yaw_rad), yaw_rad, arm_m, standing_s)


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
    """Mean squared innovation (m²) in each block of the fixes' time, NaN where the wheels do not cover it."""
    cells: int
    scale: float
    """|α|: metres by the fixes per metre by the wheels."""
    covered: float
    """Share of the fixes' time in which the wheels' path is known."""
    filters: Filters
    """Of the two channels: what makes two fits comparable."""

    @property
    def sigma_offset_s(self) -> float:
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def sigma_skew(self) -> float:
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def skew_is_possible(self) -> bool:
        """Whether a clock may run at such a rate: time daemons steer by 500 ppm."""
        return abs(self.skew) - self.sigma_skew < FASTEST_SKEW

    def at(self, since_middle_s: float) -> tuple[float, float]:
        """The wheels' clock minus the fixes' so long after the fixes' middle, and its sigma."""
        direction = np.array([1.0, since_middle_s])
        return self.offset_s + self.skew * since_middle_s, float(np.sqrt(direction @ self.covariance @ direction))


def fit_clock(
    wheels: WheelPath,
    fixes: Fixes,
    offset_s: float,
    skew: float = 0.0,
    filters: Filters | None = None,
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
                    alpha * turn,
                ]
            ),
            z - model,
        )
        if whole is None:
            return None
        rows, at_s = whole
        blocks = _blocks(at_s[1:], fixes.t_s)
        if filters is None and round_ >= min(2, rounds):
            filters = _choose_filters(rows, at_s, blocks, wheels.arm_m)
        use = filters if filters is not None else Filters(False, ((_memory(15.0, at_s), np.zeros(0)),) * 2)
        white = _whitened(_steps(rows, at_s, use.in_body), use)
        solution = _solve(white, blocks, wheels.arm_m, (arm, drift, skew))
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
        solution.covariance[5:7, 5:7],
        _cost(solution, blocks, fixes.t_s),
        at_s.size,
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
    covered = float(inside.mean())
    long = tuple((begin + STAND_S, end - STAND_S) for begin, end in wheels.standing_s if end - begin > 2.0 * STAND_S)
    inside[rows_in_stands(t, long)[0]] = False
    if int(inside.sum()) < FEWEST_CELLS:
        return None
    t, since, z = t[inside], since[inside], fixes.z_m[inside]
    p = np.interp(t, wheels.t_s, wheels.path_m)
    before, after = (np.interp(t + way * SLOPE_S, wheels.t_s, wheels.path_m) for way in (-1.0, 1.0))
    slope = (after - before) / (2.0 * SLOPE_S)
    turn = np.exp(1j * np.interp(t, wheels.t_s, wheels.yaw_rad))
    bent = np.concatenate(([0.0], np.cumsum(0.5 * (since[1:] + since[:-1]) * np.diff(p))))
    return z, p, slope, turn, bent, since, fixes.t_s[inside], covered


def _cells(t_s: Floats, rows: Complexes, left: Complexes) -> tuple[Complexes, Floats] | None:
    """Means over CELL_S of the rows (n, k) whose residual does not stand out from its neighbours', and cell times."""
    keep = _no_outliers(left)
    t_s, rows = t_s[keep], rows[keep]
    cell_s = max(CELL_S, float(t_s[-1] - t_s[0]) / MOST_CELLS)
    number = np.floor((t_s - t_s[0]) / cell_s).astype(np.int64)
    start = np.flatnonzero(np.concatenate(([True], np.diff(number) > 0)))
    if start.size < FEWEST_CELLS:
        return None
    count = np.diff(np.append(start, t_s.size))
    mean = np.asarray(np.add.reduceat(rows, start, axis=0) / count[:, None], dtype=np.complex128)
    return mean, np.add.reduceat(t_s, start) / count


def _no_outliers(left: Complexes) -> Bools:
    """Residuals (n,) that lie near the running median of their neighbours."""
    padded = np.pad(left, NEIGHBOURS // 2, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, NEIGHBOURS)
    east, north = np.median(around.real, axis=1), np.median(around.imag, axis=1)
    off = np.hypot(left.real - east, left.imag - north)
    usual = float(np.median(off))
    return np.asarray(off <= OUTLIER_SPREADS * max(1.48 * usual, 1e-3))


def _memory(memory_s: float, at_s: Floats) -> float:
    return float(np.exp(-float(np.median(np.diff(at_s))) / memory_s))


def _steps(rows: Complexes, at_s: Floats, in_body: bool) -> tuple[Floats, Floats]:
    """Changes of the columns from cell to cell in both channels; the last column heads forward and is left out."""
    steps = np.diff(rows[:, :-1], axis=0)
    if in_body:
        ahead = rows[1:, -1] + rows[:-1, -1]
        steps *= np.conj(ahead / np.maximum(np.abs(ahead), 1e-12))[:, None]
    gap = np.diff(at_s) > 1.5 * float(np.median(np.diff(at_s)))
    steps[gap] = 0.0
    return steps.real, steps.imag


def _filtered(steps: Floats, lam: float, ar: Floats) -> Floats:
    """Innovations of the columns (n, k) of one channel, and (n,) of what stood before its first step."""
    before = np.zeros((steps.shape[0], 1))
    before[0] = -lam
    return innovations(np.hstack((steps, before)), lam, ar)


def _whitened(steps: tuple[Floats, Floats], filters: Filters) -> tuple[Floats, Floats]:
    (a, b), (for_a, for_b) = steps, filters.channels
    return _filtered(a, *for_a), _filtered(b, *for_b)


def _choose_filters(rows: Complexes, at_s: Floats, blocks: Ints, arm_m: float) -> Filters:
    """By likelihood: the channels, λ for each of them, and then an autoregression of what correlation is left."""
    nothing = np.zeros(0)
    tried: list[tuple[float, Filters]] = []
    for in_body in (False, True):
        steps = _steps(rows, at_s, in_body)
        best = []
        for channel in steps:
            fits = []
            for memory_s in MEMORIES_S:
                lam = _memory(memory_s, at_s)
                solution = _solve((_filtered(channel, lam, nothing),), blocks, arm_m, (0j, 0.0, 0.0))
                fits.append((solution.score, lam, solution.residual))
            best.append(min(fits, key=lambda fit: fit[0]))
        (score_a, lam_a, left_a), (score_b, lam_b, left_b) = best
        channels = ((lam_a, _yule_walker(left_a)), (lam_b, _yule_walker(left_b)))
        tried.append((score_a + score_b, Filters(in_body, channels)))
    return min(tried, key=lambda each: each[0])[1]


def _yule_walker(e: Floats) -> Floats:
    """Autoregression of e (n,), of an order that its length can bear."""
    order = min(AUTOREGRESSION, e.size // 25)
    limit = 3.0 * float(np.median(np.abs(e))) / 0.6745 + 1e-9
    e = np.clip(e, -limit, limit)
    r = np.array([float(e[: e.size - k] @ e[k:]) for k in range(order + 1)])
    if order == 0 or r[0] <= 0:
        return np.zeros(0)
    lags = np.abs(np.subtract.outer(np.arange(order), np.arange(order)))
    return np.asarray(np.linalg.solve(r[:-1][lags] + 1e-3 * r[0] * np.eye(order), r[1:]))


@dataclass(frozen=True)
class _Solution:
    values: Floats
    covariance: Floats
    squared: Floats
    score: float
    residual: Floats


def _solve(channels: tuple[Floats, ...], block: Ints, arm_m: float, now: tuple[complex, float, float]) -> _Solution:
    """Robust least squares of each channel's first column on the others, with priors; block-robust covariance."""
    n, parts = block.size, len(channels)
    y = np.concatenate([white[:, 0] for white in channels])
    before = np.zeros((y.size, parts))
    for part, white in enumerate(channels):
        before[part * n : (part + 1) * n, part] = white[:, -1]
    x = np.hstack((np.concatenate([white[:, 1:-1] for white in channels]), before))
    arm, drift, skew = now
    prior_sigma = np.array([PRIOR_SCALE, np.pi, arm_m, arm_m, PRIOR_DRIFT_RADPS, np.inf, PRIOR_SKEW])
    prior_mean = np.array([0.0, 0.0, -arm.real, -arm.imag, -drift, 0.0, -skew] + parts * [0.0])
    e = y
    for _ in range(4):
        spread = np.repeat([float(np.median(np.abs(part))) / 0.6745 + 1e-6 for part in np.split(e, parts)], n)
        weight = 1.0 / np.maximum(np.abs(e) / (HUBER * spread), 1.0)
        variance = np.repeat([float(part.mean()) for part in np.split(weight * e**2, parts)], n) + 1e-12
        precision = np.concatenate((1.0 / prior_sigma**2, 1.0 / variance[::n]))
        normal = (x * (weight / variance)[:, None]).T @ x + np.diag(precision)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        inverse = np.linalg.pinv(normal * np.outer(scale, scale), rcond=1e-13) * np.outer(scale, scale)
        values = inverse @ (x.T @ (weight * y / variance) + precision * prior_mean)
        e = y - x @ values
    number = np.tile(block, parts)
    influence = x * (weight * e / variance)[:, None]
    per_block = np.array([np.bincount(number, influence[:, k], block.max() + 1) for k in range(x.shape[1])]).T
    sandwich = inverse @ (per_block.T @ per_block) @ inverse
    inflate = np.sqrt(np.maximum(np.diag(sandwich) / np.maximum(np.diag(inverse), 1e-300), 1.0))
    robust = weight * e**2
    score = float(np.log(robust.mean() + 1e-18))
    return _Solution(values, inverse * np.outer(inflate, inflate), robust.reshape(parts, n).sum(0), score, e)


def _blocks(at_s: Floats, all_t_s: Floats) -> Ints:
    """Number of the block of the fixes' time in which each cell lies (n,): the same whatever the offset."""
    width = max(BLOCK_S, float(np.ptp(all_t_s)) / MOST_BLOCKS)
    return np.asarray(np.floor((at_s - all_t_s[0]) / width).astype(np.int64))


def _cost(solution: _Solution, block: Ints, all_t_s: Floats) -> Floats:
    blocks = int(_blocks(all_t_s[-1:], all_t_s)[0]) + 1
    count = np.bincount(block, minlength=blocks)
    total = np.bincount(block, solution.squared, minlength=blocks)
    return np.where(count >= FEWEST_IN_BLOCK, total / np.maximum(count, 1), np.nan)
