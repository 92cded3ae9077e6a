"""Is the heading on the wheels' clock? If it clearly is not, by how much, from the turning alone.

    ψ(t + W) − ψ(t) = g(ψ) Δw + k Δs      Δ from t + o to t + W + o
    w = R (φ_r − φ_l) / L                 g(ψ) = g₀ + g₁ cos ψ + g₂ sin ψ + g₃ cos 2ψ + g₄ sin 2ψ
    s = R (φ_r + φ_l) / 2

ψ is the yaw at its own stamps, w and s the wheels' turning and travel, o what has to be added to the heading's times, g
how much the reading turns for the wheels' turning (track, turn slip; iron near a compass makes it depend on the
heading), and k what unequal radii add. Over a second neither a heading that wanders nor a slow drift matters. All lags
within reach are correlated first; then the cost, summed robustly over blocks of the log, is followed to its minimum.
Its curvature tells how sharp the minimum is, the blocks' own slopes there how sure.

Turning at one rate looks the same at any lag, and a drive may repeat itself. So a heading is moved only where its own
stamps fit clearly worse than one other lag, several turns say so, and no part of the log fits better as logged; and
only by more than the filter's own latency term can make good. A smaller lag is an effect, and diagnosed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.streams import Notice, Vehicle, WheelStream
from sccal.results.clock import Clock

LATENCY_S = 0.18
"""The filter's term is linear in the lag τ and errs by ½ τ² of the turn's acceleration: at 0.8 rad/s², as robots begin
a pivot, by 0.7°, which is what an AHRS errs by anyway."""
REACH_S = 12.0
GRID_S = 0.2
FINE_S = 0.04
"""Fine enough that interpolation between the points does not make some lags look smoother than others."""
WINDOW_S = 1.0
"""Longer than a turn takes to begin, shorter than an AHRS takes to wander."""
LONGEST_GAP_S = 2.0
"""A heading in longer pauses is a guess."""
MOST_TURN = 2.0
"""Times what the wheels turn at most: more is a reading gone wrong, whatever the track."""
SMALLEST_TURN_RAD = np.radians(30.0)
"""Of the wheels, in all: less is hardly a turn."""
SMALLEST_COHERENCE = 0.3
SCAN_S = 0.2
STEPS_S = (0.1, 0.05, 0.05)
"""Apart from the middle are the costs through which the parabola for the minimum goes; the last tell its sigma."""
HUBER = 2.5
BLOCK_S = 30.0
MOST_BLOCKS = 120
FEWEST_TURNS = 3
"""Blocks that must show the lag: one turn alone may be a slip, or the AHRS's own."""
SHOWN = 2.0
"""Of a block's cost: half a minute of changes over a second scatters by a quarter by chance."""
CLEAR_SIGMAS = 8.0
CLEARLY_WORSE = 4.0
WORSE_RATIO = 1.25
"""The mean of the blocks' costs must be larger by so many standard errors, and by this factor, as for fixes."""
MUCH_WORSE = 6.0
"""Of a block's cost: noise does not make it so much larger."""
ALIKE = 1e-6
"""Motions that go so much together (turning and travel on a circle) are one."""
SAME_S = 1.0
MOST_FITTED = 8
MOST_CHANGES = 9000
"""Half an hour of them; in longer drives every second or third does as well."""
NORMAL_MAD = 1.4826


@dataclass(frozen=True)
class Turning:
    """Cumulative motion by the wheels on an even grid, as means over GRID_S: so are the readings compared with it."""

    t_s: Floats
    """(n,), FINE_S apart."""
    turn_rad: Floats
    """(n,), with the nominal radius and track."""
    travel_m: Floats
    """(n,), of the middle between the wheels."""
    unknown: Floats
    """(n,), grows where the motion is not known."""

    def known(self, begin_s: Floats, end_s: Floats) -> Bools:
        """Whether the wheels were read all the way from times (k,) to later ones (k,)."""
        inside = (begin_s >= self.t_s[0] + 0.5 * GRID_S) & (end_s <= self.t_s[-1] - 0.5 * GRID_S)
        if self.unknown[-1] == self.unknown[0]:
            return np.asarray(inside)
        begin, end = (np.interp(each, self.t_s, self.unknown) for each in (begin_s, end_s))
        return np.asarray(inside & (begin == end))

    def between(self, begin_s: Floats, end_s: Floats) -> tuple[Floats, Floats]:
        """How far the robot turns and travels from times (k,) to later ones (k,)."""
        turn, travel = (
            np.interp(end_s, self.t_s, each) - np.interp(begin_s, self.t_s, each)
            for each in (self.turn_rad, self.travel_m)
        )
        return turn, travel


@dataclass(frozen=True)
class HeadingClock:
    """What to add to the heading's times, and what is to be said about it."""

    offset_s: float = 0.0
    """0 where the heading stays as logged."""
    sigma_s: float = 0.0
    notices: tuple[Notice, ...] = ()

    def moved(self, t_s: Floats) -> Floats:
        """Times (n,) of the heading's clock on the wheels'."""
        return t_s if self.offset_s == 0.0 else np.asarray(t_s + self.offset_s)

    def after(self, clock: Clock) -> Clock:
        """Both steps as one clock, for fixes whose clock is the heading's."""
        if self.offset_s == 0.0:
            return clock
        return replace(
            clock,
            source="motion",
            offset_s=clock.offset_s + self.offset_s,
            sigma_offset_s=float(np.hypot(clock.sigma_offset_s, self.sigma_s)),
        )


@dataclass(frozen=True)
class _Fit:
    offset_s: float
    sigma_s: float
    cost: Floats
    """Mean robust square (rad²) in each block (b,), NaN where it holds too little."""
    turns: int
    """In how many blocks a lag of SAME_S more or less would show."""


@dataclass(frozen=True)
class _Steps:
    """Changes of the yaw over WINDOW_S."""

    begin_s: Floats
    end_s: Floats
    yaw_rad: Floats
    facing: Floats
    """(5, k) 1, and cosine and sine of the yaw between and of twice that."""
    block: Ints


def wheel_turning(wheels: WheelStream, vehicle: Vehicle) -> Turning:
    """From cumulative wheel angles; where the travel is loose, and in long gaps, the motion is not known."""
    t_s = wheels.t_s
    grid = np.arange(t_s[0], t_s[-1], FINE_S)
    points = round(GRID_S / FINE_S)
    right, left = (
        vehicle.wheel_radius_m
        * np.convolve(
            np.pad(np.interp(grid, t_s, each), points // 2, mode="edge"), np.full(points, 1.0 / points), mode="valid"
        )
        for each in (wheels.right_rad, wheels.left_rad)
    )
    gap = np.diff(t_s, prepend=t_s[:1]) > LONGEST_GAP_S
    unknown = np.interp(grid, t_s, np.cumsum(wheels.loose | gap))
    return Turning(grid, (right - left) / vehicle.track_m, 0.5 * (right + left), unknown)


def clock_by_turning(wheels: Turning, t_s: Floats, yaw_rad: Floats, source: str, who: str = "headings") -> HeadingClock:
    """How far a heading's times (n,) are off the wheels' clock; 0 where they agree or the turning does not tell.

    yaw_rad (n,) is unwrapped; source and who are for messages. A heading that turns with the wheels at no lag is for
    others to refuse.
    """
    if t_s.size < 2 or wheels.t_s.size < 3 or float(np.abs(np.diff(wheels.turn_rad)).sum()) < SMALLEST_TURN_RAD:
        return HeadingClock()
    count = int(t_s.size)
    t_s, yaw_rad = _settled(t_s, yaw_rad)
    lags = _lags(wheels, t_s, yaw_rad)
    if not lags or abs(lags[0]) < 0.25 * GRID_S:
        return HeadingClock()
    steps = _changes(t_s, yaw_rad)
    if steps is None:
        return HeadingClock()
    logged = _fit(wheels, steps, 0.0)
    if logged is None or abs(logged.offset_s) > LATENCY_S:
        logged = _at(wheels, steps, 0.0)
    elif abs(lags[0]) < SAME_S:
        return HeadingClock()
    fits = _distinct([fit for lag in lags if (fit := _fit(wheels, steps, lag)) is not None])
    if not fits:
        return HeadingClock()
    best = min(fits, key=lambda fit: float(np.nanmean(fit.cost)))
    good = [fit for fit in fits if not _clearly_worse(fit, best)]
    if not _is_off(best, logged) or any(abs(fit.offset_s) < LATENCY_S for fit in good):
        return HeadingClock()
    if len(good) > 1:
        return HeadingClock(notices=(_unclear(good, count, source, who),))
    if _fails_elsewhere(best, logged):
        return HeadingClock()
    return HeadingClock(best.offset_s, best.sigma_s, (_told(best, count, source, who),))


def _is_off(best: _Fit, logged: _Fit) -> bool:
    """Whether the heading does not turn with the wheels as stamped, by more than a latency and than chance."""
    if best.turns < FEWEST_TURNS or abs(best.offset_s) < max(LATENCY_S, CLEAR_SIGMAS * best.sigma_s):
        return False
    return abs(best.offset_s) < SAME_S or _clearly_worse(logged, best)


def _settled(t_s: Floats, yaw_rad: Floats) -> tuple[Floats, Floats]:
    """Means of times and readings over GRID_S: white noise is less, and there are fewer of them."""
    number = np.floor((t_s - t_s[0]) / GRID_S).astype(np.int64)
    start = np.flatnonzero(np.concatenate(([True], np.diff(number) > 0)))
    if start.size == t_s.size:
        return t_s, yaw_rad
    count = np.diff(np.append(start, t_s.size))
    since = np.add.reduceat(t_s - t_s[0], start) / count
    return np.asarray(t_s[0] + since), np.add.reduceat(yaw_rad, start) / count


def _lags(wheels: Turning, t_s: Floats, yaw_rad: Floats) -> list[float]:
    """Offsets at which yaw and wheels turn together, those that explain most first.

    An offset explains −N log(1 − γ²), with γ the correlation of the changes over WINDOW_S where both are known.
    """
    every = round(GRID_S / FINE_S)
    grid, turn = wheels.t_s[::every], wheels.turn_rad[::every]
    known_turn = np.diff(wheels.unknown[::every]) == 0.0
    window, reach = round(WINDOW_S / GRID_S), round(REACH_S / GRID_S)
    yaw = np.interp(grid, t_s, yaw_rad)
    after = np.clip(np.searchsorted(t_s, grid), 1, t_s.size - 1)
    inside = (grid >= t_s[0]) & (grid <= t_s[-1]) & (t_s[after] - t_s[after - 1] <= LONGEST_GAP_S)
    if grid.size <= window + 2 * reach:
        return []

    def changes(values: Floats, known: Bools) -> tuple[Floats, Floats]:
        """Over WINDOW_S, and where they are known: 1 or 0."""
        whole = np.convolve(~known, np.ones(window), mode="valid") < 0.5
        return np.where(whole, values[window:] - values[:-window], 0.0), whole.astype(np.float64)

    by_wheels, has_wheels = changes(turn, known_turn)
    by_yaw, has_yaw = changes(yaw, inside[1:] & inside[:-1])
    most = MOST_TURN * float(np.abs(by_wheels).max())
    by_yaw = np.clip(by_yaw, -most, most)
    yaw_power, wheel_power = by_yaw**2, by_wheels**2
    explained = np.zeros(2 * reach + 1)
    for k in range(2 * reach + 1):
        lag = k - reach
        w = slice(max(lag, 0), min(by_wheels.size + lag, by_wheels.size))
        y = slice(max(-lag, 0), min(by_wheels.size - lag, by_wheels.size))
        cross = _dot(by_yaw[y], by_wheels[w])
        power = _dot(yaw_power[y], has_wheels[w]) * _dot(has_yaw[y], wheel_power[w])
        coherence = cross**2 / power if power > 0.0 else 0.0
        if coherence > SMALLEST_COHERENCE:
            explained[k] = -_dot(has_yaw[y], has_wheels[w]) * np.log1p(-min(coherence, 1.0 - 1e-9))
    inner = explained[1:-1]
    peaks = 1 + np.flatnonzero((inner > explained[:-2]) & (inner >= explained[2:]))
    peaks = peaks[np.argsort(-explained[peaks])][:MOST_FITTED]
    below, here, above = explained[peaks - 1], explained[peaks], explained[peaks + 1]
    between = 0.5 * (below - above) / (below - 2.0 * here + above)
    return [float(lag) for lag in (peaks - reach + between) * GRID_S]


def _dot(one: Floats, other: Floats) -> float:
    """Σ of products of two (n,), in this thread: so small a sum is not worth waking the others for."""
    return float(np.einsum("i,i->", one, other))


def _changes(t_s: Floats, yaw_rad: Floats) -> _Steps | None:
    """From each reading to the first at least WINDOW_S later, where there is one in time."""
    later = np.searchsorted(t_s, t_s + WINDOW_S)
    first = np.flatnonzero(later < t_s.size)
    first = first[t_s[later[first]] - t_s[first] <= LONGEST_GAP_S]
    first = first[:: max(1, first.size // MOST_CHANGES)]
    if first.size < FEWEST_TURNS:
        return None
    width = max(BLOCK_S, float(np.ptp(t_s)) / MOST_BLOCKS)
    block = np.floor((t_s[first] - t_s[0]) / width).astype(np.int64)
    middle = 0.5 * (yaw_rad[first] + yaw_rad[later[first]])
    facing = np.array([np.ones(first.size), *(of(n * middle) for n in (1.0, 2.0) for of in (np.cos, np.sin))])
    return _Steps(t_s[first], t_s[later[first]], yaw_rad[later[first]] - yaw_rad[first], facing, block)


def _residual(wheels: Turning, steps: _Steps, offset_s: float, weight: Floats) -> tuple[Floats, Bools]:
    """What the wheels' motion leaves of the yaw's changes (k,), and where the wheels are known there (k,)."""
    begin, end = steps.begin_s + offset_s, steps.end_s + offset_s
    inside = wheels.known(begin, end)
    turn, travel = wheels.between(begin, end)
    columns = np.vstack((steps.facing * turn, travel))
    weighted = columns * (weight * inside)
    normal = np.einsum("ik,jk->ij", weighted, columns)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    inverse = np.linalg.pinv(normal * np.outer(scale, scale), rcond=ALIKE, hermitian=True)
    values = scale * (inverse @ (scale * np.einsum("ik,k->i", weighted, steps.yaw_rad)))
    return steps.yaw_rad - np.einsum("i,ik->k", values, columns), inside


class _Costs:
    """Huber's cost of any offset near one, block by block; its scale is the residuals' there."""

    def __init__(self, wheels: Turning, steps: _Steps, near_s: float) -> None:
        self.wheels, self.steps = wheels, steps
        self.weight = np.ones(steps.yaw_rad.size)
        self.limit_rad = np.inf
        for _ in range(3):
            self.settle(near_s)

    def settle(self, offset_s: float) -> None:
        """Take scale and weights from the residuals at an offset."""
        residual, inside = _residual(self.wheels, self.steps, offset_s, self.weight)
        size = np.abs(residual)
        usual = float(np.median(size[inside])) if inside.any() else np.inf
        self.limit_rad = HUBER * max(NORMAL_MAD * usual, 1e-6)
        self.weight = 1.0 / np.maximum(size / self.limit_rad, 1.0)

    def at(self, offset_s: float) -> tuple[Floats, Floats]:
        """Sum of robust squares (rad²) and number of changes in each block (b,)."""
        residual, inside = _residual(self.wheels, self.steps, offset_s, self.weight)
        size = np.abs(residual)
        robust = np.where(size < self.limit_rad, size**2, self.limit_rad * (2.0 * size - self.limit_rad))
        blocks = int(self.steps.block[-1]) + 1
        total, count = (np.bincount(self.steps.block, each, blocks) for each in (inside * robust, inside))
        return np.asarray(total), np.asarray(count)


def _fit(wheels: Turning, steps: _Steps, offset_s: float) -> _Fit | None:
    """The least cost near an offset; None where there is none within SAME_S."""
    costs = _Costs(wheels, steps, offset_s)

    def mean(at_s: float) -> float:
        total, count = costs.at(at_s)
        return float(total.sum() / max(float(count.sum()), 1.0))

    around = offset_s + SCAN_S * np.arange(-round(SAME_S / SCAN_S), round(SAME_S / SCAN_S) + 1)
    least = int(np.argmin([mean(float(at_s)) for at_s in around]))
    if least in (0, around.size - 1):
        return None
    offset_s = float(around[least])
    costs.settle(offset_s)
    for step_s in STEPS_S:
        below, here, above = (mean(offset_s + way * step_s) for way in (-1.0, 0.0, 1.0))
        for _ in range(round(SCAN_S / step_s)):
            if here <= min(below, above):
                break
            way = 1.0 if above < below else -1.0
            offset_s += way * step_s
            beyond = mean(offset_s + way * step_s)
            below, here, above = (here, above, beyond) if way > 0 else (beyond, below, here)
        curve = above - 2.0 * here + below
        if curve <= 0.0 or here > min(below, above):
            return None
        offset_s -= 0.5 * step_s * (above - below) / curve
    return _at(wheels, steps, offset_s)


def _at(wheels: Turning, steps: _Steps, offset_s: float) -> _Fit:
    """An offset as it stands."""
    costs, step_s = _Costs(wheels, steps, offset_s), STEPS_S[-1]
    (below, _), (here, count), (above, _) = (costs.at(offset_s + way * step_s) for way in (-1.0, 0.0, 1.0))
    slope, curve = (above - below) / (2.0 * step_s), (above - 2.0 * here + below) / step_s**2
    total = float(curve.sum())
    mean = float(here.sum()) / max(float(count.sum()), 1.0)
    # White noise of neighbouring changes is shared with opposite signs, so that they count as if they were independent.
    by_model = 2.0 * mean / max(total, 1e-12)
    by_blocks = float((slope**2).sum()) / max(total, 1e-12) ** 2
    enough = count > 0.5 * np.median(count)
    cost = np.where(enough, here / np.maximum(count, 1.0), np.nan)
    beside = np.minimum(*(costs.at(offset_s + way * SAME_S)[0] for way in (-1.0, 1.0)))
    turns = int((beside[enough] > SHOWN * here[enough]).sum())
    sigma_s = float(np.sqrt(max(by_model, by_blocks))) if total > 0.0 else np.inf
    return _Fit(offset_s, sigma_s, cost, turns)


def _distinct(fits: list[_Fit]) -> list[_Fit]:
    """Fits SAME_S and more apart, within reach; the first of those that are not."""
    kept: list[_Fit] = []
    for fit in fits:
        if abs(fit.offset_s) <= REACH_S and all(abs(fit.offset_s - other.offset_s) > SAME_S for other in kept):
            kept.append(fit)
    return kept


def _clearly_worse(one: _Fit, other: _Fit) -> bool:
    """Whether the same blocks leave clearly more under one fit than under the other, by the better one's scatter."""
    common = np.isfinite(one.cost) & np.isfinite(other.cost)
    if int(common.sum()) < FEWEST_TURNS:
        return False
    usual = float(other.cost[common].mean())
    error = float(other.cost[common].std(ddof=1)) * float(np.sqrt(2.0 / float(common.sum())))
    excess = float(one.cost[common].mean()) - usual
    return bool(excess > max(CLEARLY_WORSE * error, (WORSE_RATIO - 1.0) * usual))


def _fails_elsewhere(found: _Fit, logged: _Fit) -> bool:
    """Whether some block that fits as logged does not fit at the offset found: then it is no clock that is off."""
    common = np.isfinite(found.cost) & np.isfinite(logged.cost)
    usual = float(np.median(np.minimum(found.cost, logged.cost)[common])) if common.any() else 0.0
    worse = (found.cost > MUCH_WORSE * usual) & (logged.cost < found.cost / MUCH_WORSE)
    return bool(worse[common].any())


def _told(fit: _Fit, count: int, source: str, who: str) -> Notice:
    late = fit.offset_s < 0.0
    what = (
        f"{who} put on the wheels' clock by their turning: {abs(fit.offset_s):.3f} ± {fit.sigma_s:.3f} s "
        f"{'earlier' if late else 'later'} than stamped; {'they' if late else 'the wheels'} are stamped late, or have "
        "another clock"
    )
    return Notice(source, what, count, "", "warning")


def _unclear(good: list[_Fit], count: int, source: str, who: str) -> Notice:
    lags = " and ".join(f"{fit.offset_s:+.2f} s" for fit in good[:3])
    what = (
        f"{who} do not turn with the wheels as stamped, and would alike if they were moved by {lags}: left as they "
        "are; turn at times that do not repeat"
    )
    doubt = f"the clock of the {who} is off the wheels', and the drive repeats itself: {lags} fit equally well"
    return Notice(source, what, count, "", "warning", doubt)
