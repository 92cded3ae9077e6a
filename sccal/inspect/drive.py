"""What the robot did, by wheels, yaw and fixes, whichever are there; and what the sensors read while it stands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.inspect.coverage import longest_step_s
from sccal.inspect.place import PlacedFixes, legs
from sccal.inspect.together import Together, rate
from sccal.results.inspection import DriveFacts, Series, StandstillFacts

GRID_S = 0.5
MOST_STEPS = 40_000
STANDING_MPS = 0.02
STANDING_RADPS = 0.02
STANDSTILL_S = 3.0
EDGE_S = 0.5
"""Left out at both ends of a standstill: suspension and filters settle."""
TURNING_RADPS = 0.05
SECTORS = 12
STRAIGHT = 0.03
"""Difference of the wheels over their mean below which a stretch is straight: 23 m of radius on a track of 0.7 m."""
PIVOT = 2.0
"""Beyond this the middle moves less than the wheels move against each other: the robot turns on the spot."""
SHORTEST_STRAIGHT_M = 3.0
SMALLEST_TURN_RAD = np.radians(30.0)
FIX_SPEED_SIGMA_MPS = 0.05
LONGEST_FIX_WINDOW_S = 5.0


@dataclass(frozen=True)
class Motion:
    """Rates on a common grid (n,) of ``step_s``; NaN where a stream does not say."""

    t_s: Floats
    step_s: float
    speed_mps: Floats
    """Signed, by the wheels."""
    wheel_turn_radps: Floats
    yaw_turn_radps: Floats
    fix_speed_mps: Floats
    """Not signed."""
    standing: Bools

    @property
    def turn_radps(self) -> Floats:
        """By the yaw where it is there, else by the wheels."""
        return np.where(np.isfinite(self.yaw_turn_radps), self.yaw_turn_radps, self.wheel_turn_radps)

    @property
    def by_wheels(self) -> bool:
        """False where only the fixes tell of motion."""
        return bool(np.isfinite(self.speed_mps).any())


def motion(together: Together) -> Motion:
    """Rates by every stream; a stream that shares no time with the reference is left out, unless it is alone."""
    first, last = together.span_s
    step = max(GRID_S, (last - first) / MOST_STEPS)
    t_s = np.arange(first + 0.5 * step, last, step)

    def of(name: str, t_of: Floats, cumulative: Floats, window_s: float) -> Floats:
        if name in together.apart or cumulative.size < 2:
            return np.full(t_s.size, np.nan)
        return rate(t_s, t_of, cumulative, window_s, longest_step_s(t_of))

    speed = of("wheels", together.wheel_t_s, together.travel_m, step)
    wheel_turn = of("wheels", together.wheel_t_s, together.turn_rad, step)
    yaw_turn = of("heading", together.yaw_t_s, together.yaw_rad, step)
    fix_speed = np.full(t_s.size, np.nan)
    if together.meets("fixes") and together.fixes is not None:
        window = max(fix_window_s(together.fixes), step)
        east, north = (of("fixes", together.fixes.t_s, one, window) for one in _plane(together.fixes))
        fix_speed = np.hypot(east, north)
    if np.isfinite(speed).any():
        standing = (np.abs(speed) < STANDING_MPS) & (np.nan_to_num(np.abs(wheel_turn)) < STANDING_RADPS)
    else:
        standing = fix_speed < max(STANDING_MPS, 3.0 * FIX_SPEED_SIGMA_MPS)
        # Turning on the spot moves no antenna; a yaw that drifts is slower than any turn.
        standing &= ~(np.abs(yaw_turn) > TURNING_RADPS)
    return Motion(t_s, step, speed, wheel_turn, yaw_turn, fix_speed, standing)


def fix_window_s(fixes: PlacedFixes) -> float:
    """Over which the fixes show a speed to FIX_SPEED_SIGMA_MPS, within limits."""
    white = fixes.white_m if np.isfinite(fixes.white_m) else 0.0
    usual = float(np.median(np.diff(fixes.t_s))) if fixes.t_s.size > 1 else 1.0
    return float(np.clip(np.sqrt(2.0) * white / FIX_SPEED_SIGMA_MPS, max(1.0, 2.0 * usual), LONGEST_FIX_WINDOW_S))


def drive_facts(together: Together, moved: Motion, track_m: float) -> DriveFacts | None:
    """None where neither wheels nor fixes tell of motion."""
    if moved.t_s.size < 2 or not (moved.by_wheels or np.isfinite(moved.fix_speed_mps).any()):
        return None
    speed = moved.speed_mps if moved.by_wheels else moved.fix_speed_mps
    moving = np.isfinite(speed) & ~moved.standing
    change = np.diff(np.abs(speed)) / moved.step_s
    turn = moved.turn_radps
    turning = np.isfinite(turn) & (np.abs(turn) > TURNING_RADPS) & moving
    if np.isfinite(moved.wheel_turn_radps).any():
        turning &= ~(np.abs(moved.wheel_turn_radps) < 0.2 * TURNING_RADPS)
    steps = np.abs(np.diff(together.travel_m))
    stops = standstills(moved)
    straights, arcs, pivots = _pieces(moved, speed, turn, track_m)
    return DriveFacts(
        duration_s=together.span_s[1] - together.span_s[0],
        distance_wheels_m=float(steps.sum()) if moved.by_wheels else None,
        distance_fixes_m=_distance_by_fixes(together),
        reversed_m=float(steps[np.diff(together.travel_m) < 0].sum()) if moved.by_wheels else None,
        standing_s=float(moved.step_s * moved.standing.sum()),
        standstills=len(stops),
        speed_median_mps=_or_zero(np.median, np.abs(speed[moving])),
        speed_max_mps=_or_zero(np.max if moved.by_wheels else _high, np.abs(speed[moving])),
        acceleration_max_mps2=_or_zero(_high, change[np.isfinite(change)]),
        braking_max_mps2=_or_zero(_high, -change[np.isfinite(change)]),
        turned_left_rad=float(moved.step_s * turn[turning & (turn > 0)].sum()),
        turned_right_rad=abs(float(moved.step_s * turn[turning & (turn < 0)].sum())),
        turn_rate_median_radps=_or_zero(np.median, np.abs(turn[turning])),
        turn_rate_max_radps=_or_zero(_high, np.abs(turn[turning])),
        headings=_sectors(together, moved, moving),
        straights=straights,
        arcs=arcs,
        pivots=pivots,
        by="wheels" if moved.by_wheels else "fixes",
    )


def standstills(moved: Motion) -> Floats:
    """(k, 2) start and end of each stretch of STANDSTILL_S or more in which the robot stands."""
    spans = [
        (moved.t_s[a] - 0.5 * moved.step_s, moved.t_s[b - 1] + 0.5 * moved.step_s)
        for a, b in _runs(moved.standing)
        if (b - a) * moved.step_s >= STANDSTILL_S
    ]
    return np.array(spans).reshape(-1, 2)


def standstill_facts(together: Together, moved: Motion) -> StandstillFacts | None:
    """Scatter about the mean of each standstill, pooled; None where the robot never stands."""
    stops = standstills(moved)
    if not len(stops):
        return None
    inner = [(a + EDGE_S, b - EDGE_S) for a, b in stops.tolist()]
    fixes = together.fixes if together.meets("fixes") else None
    across = [] if fixes is None else [_pooled(fixes.t_s, one, inner) for one in _plane(fixes)]
    known = [one for one in across if one is not None]
    gyro = together.gyro_radps if together.meets("heading") else None
    still = _within(together.yaw_t_s, inner) if gyro is not None else np.zeros(0, dtype=np.bool_)
    finite = gyro[still & np.isfinite(gyro)] if gyro is not None else np.zeros(0)
    return StandstillFacts(
        stops=len(stops),
        seconds=float((stops[:, 1] - stops[:, 0]).sum()),
        fixes_m=float(np.sqrt(np.mean(np.square(known)))) if known else None,
        yaw_rad=_pooled(together.yaw_t_s, together.yaw_rad, inner) if together.meets("heading") else None,
        gyro_radps=float(finite.std()) if finite.size > 1 else None,
        gyro_bias_radps=float(finite.mean()) if finite.size > 1 else None,
    )


def series(together: Together, moved: Motion) -> Series:
    """What the pictures show."""
    east, north = (np.zeros(0), np.zeros(0)) if together.fixes is None else _plane(together.fixes)
    quality = np.zeros(0, dtype=np.int64) if together.fixes is None else together.fixes.quality
    if east.size:
        east, north = east - east[0], north - north[0]
    return Series(
        t_s=moved.t_s,
        speed_wheels_mps=moved.speed_mps,
        speed_fixes_mps=np.where(moved.speed_mps < 0.0, -1.0, 1.0) * moved.fix_speed_mps,
        turn_wheels_radps=moved.wheel_turn_radps,
        turn_yaw_radps=moved.yaw_turn_radps,
        standing_s=standstills(moved),
        fix_east_m=east,
        fix_north_m=north,
        fix_quality=quality,
    )


def _plane(fixes: PlacedFixes) -> tuple[Floats, Floats]:
    return fixes.east_m, fixes.north_m


def _distance_by_fixes(together: Together) -> float | None:
    fixes = together.fixes
    if fixes is None or fixes.t_s.size < 2:
        return None
    at = legs(fixes.east_m, fixes.north_m, fixes.leg_m)
    return float(np.abs(np.diff((fixes.east_m + 1j * fixes.north_m)[at])).sum())


def _pieces(moved: Motion, speed: Floats, turn: Floats, track_m: float) -> tuple[int, int, int]:
    """Straights, arcs and pivots: stretches in which the difference of the wheels keeps its place beside their mean."""
    unknown = ~np.isfinite(speed) | ~np.isfinite(turn) | moved.standing
    bend = np.abs(turn) * track_m
    pace = np.abs(speed)
    kind = np.where(bend < STRAIGHT * pace, 1, np.where(bend > PIVOT * pace, 3, 2))
    kind = np.where(unknown, 0, kind) * np.where((kind == 1) | unknown, 1, np.sign(turn)).astype(np.int64)
    straights = arcs = pivots = 0
    for one in (1, 2, -2, 3, -3):
        for a, b in _runs(kind == one):
            own = slice(a, b)
            turned, driven = moved.step_s * np.abs(turn[own]).sum(), moved.step_s * pace[own].sum()
            straights += abs(one) == 1 and driven >= SHORTEST_STRAIGHT_M
            arcs += abs(one) == 2 and turned >= SMALLEST_TURN_RAD
            pivots += abs(one) == 3 and turned >= SMALLEST_TURN_RAD
    return int(straights), int(arcs), int(pivots)


def _sectors(together: Together, moved: Motion, moving: Bools) -> int:
    """Sectors of 30° that the robot moved in: of its yaw, or of its course where there is none."""
    if together.meets("heading"):
        angle = np.interp(moved.t_s, together.yaw_t_s, together.yaw_rad)[moving & np.isfinite(moved.yaw_turn_radps)]
    elif together.meets("fixes") and together.fixes is not None:
        at = legs(together.fixes.east_m, together.fixes.north_m, together.fixes.leg_m)
        angle = np.angle(np.diff((together.fixes.east_m + 1j * together.fixes.north_m)[at]))
    else:
        return 0
    return int(np.unique(np.floor(np.mod(angle, 2 * np.pi) / (2 * np.pi / SECTORS)).clip(0, SECTORS - 1)).size)


def _pooled(t_s: Floats, values: Floats, spans: Sequence[tuple[float, float]]) -> float | None:
    """Standard deviation about the mean of each span, all spans together."""
    squares, freedom = 0.0, 0
    for begin, end in spans:
        own = values[np.searchsorted(t_s, begin) : np.searchsorted(t_s, end, side="right")]
        if own.size > 1:
            squares += float(((own - own.mean()) ** 2).sum())
            freedom += own.size - 1
    return float(np.sqrt(squares / freedom)) if freedom else None


def _within(t_s: Floats, spans: Sequence[tuple[float, float]]) -> Bools:
    inside = np.zeros(t_s.size, dtype=np.bool_)
    for begin, end in spans:
        inside[np.searchsorted(t_s, begin) : np.searchsorted(t_s, end, side="right")] = True
    return inside


def _runs(mask: Bools) -> list[tuple[int, int]]:
    """First and past-the-last index of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _high(values: Floats) -> float:
    """Near the largest: a single stamp or count that is off makes no acceleration."""
    return float(np.quantile(values, 0.995))


def _or_zero(of: Callable[[Floats], Any], values: Floats) -> float:
    return float(of(values)) if values.size else 0.0
