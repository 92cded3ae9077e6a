"""Wheel counters: unwrapping, and finding the rows and steps that do not count travel.

A step between two rows is judged by the travel it implies, with an allowance for arrival stamps: the counts of a step
must lie within [v_lo, v_hi]·dt ± |v|·allowance, where v_lo and v_hi are the speeds of the stretches around it. Steps
that fail cut the rows into segments. Segments that continue one another form a chain; a chain inside another one's
time is bogus values, a chain after another one is a counter reset.

Units: "counts" are the file's own (ticks or radians); ``counts_per_m`` turns them into travel at the rim.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from sccal.arrays import Bools, Floats, Ints

SPEED_LIMIT_MPS = 60.0
"""No field robot is faster."""
_STRETCH_S = 0.3
_ACCELERATION_MPS2 = 5.0
_SPEED_MARGIN_MPS = 0.5
_CHAIN_MEMORY_S = 10.0
_CHAINS_AT_ONCE = 8
_STALE_S = 2.0
_SHORT_ROWS = 5
_SHORT_S = 1.0
_WIDTHS_TO_DETECT = (8, 10, 12, 14, 16, 20, 24, 32)


@dataclass(frozen=True)
class Scale:
    """How counts relate to travel."""

    counts_per_m: float
    quantum: float
    """The smallest step that the counter can show."""


@dataclass(frozen=True)
class Repair:
    """What to do with the rows of a counter file."""

    keep: Bools
    """(n) False for rows whose values are bogus or stale."""
    stale: Ints
    """Indices of all n: rows dropped because the counts lagged there and then caught up in one step."""
    counts: Floats
    """(m, 2) unwrapped counts of the kept rows, resets bridged."""
    reset: Ints
    """Indices into the kept rows: the counter was reset before this row, and expected travel bridges the step."""
    unlikely: Ints
    """Indices into the kept rows: the step before this row does not fit the speeds around it, but is possible."""
    wraps: int
    aliased: bool
    """Steps come near half the counter's width: the direction of travel is not certain."""


@dataclass(frozen=True)
class _Motion:
    """Speeds around every step of the rows judged (counts/s), and what a step may differ from them."""

    low: Floats
    """(n - 1, 2)"""
    high: Floats
    top: Floats
    """(2) highest speed of the file with a margin."""
    allowance_s: float
    usual_dt_s: float


def detect_width(t_s: Floats, counts: Floats, scale: Scale) -> int | None:
    """The width in bits at which the counters (n, 2) wrap, or None where no jump looks like a wrap.

    A wrap is a jump by more than half the width whose remainder is what the speed around it leads to expect.
    """
    steps = np.diff(counts, axis=0)
    largest = float(np.abs(steps).max(initial=0.0))
    motion: _Motion | None = None
    for bits in _WIDTHS_TO_DETECT:
        modulus = 2.0**bits
        if largest <= modulus / 2:
            return None
        unsigned = np.mean((counts >= 0) & (counts < modulus))
        signed = np.mean((counts >= -modulus / 2) & (counts < modulus / 2))
        if max(unsigned, signed) < 0.99:
            continue
        motion = motion or _motion(t_s, steps, scale)
        jumps: Bools = np.abs(steps) > modulus / 2
        remainder = steps - modulus * np.round(steps / modulus)
        fits = _fits(np.diff(t_s), remainder, motion, scale)
        if (jumps & fits).any() and not (jumps & fits).sum() * 4 < _bridged(jumps & ~fits):
            return bits
    return None


def _bridged(odd: Bools) -> int:
    """Jumps that do not undo the jump just before: a bogus value makes a pair of them."""
    alone = _any_wheel(odd)
    pairs = int((alone[1:] & alone[:-1]).sum())
    return int(alone.sum()) - 2 * pairs


def _any_wheel(wheels: Bools) -> Bools:
    either: Bools = wheels[:, 0] | wheels[:, 1]
    return either


def repair(t_s: Floats, counts: Floats, scale: Scale, bits: int | None) -> Repair:
    """Unwrap and repair the counters (n, 2) of both wheels at increasing times ``t_s`` (n), n >= 1.

    Raises:
        ValueError: more than half of the steps make no sense at any speed up to 60 m/s.
    """
    modulus = None if bits is None else 2.0**bits
    zeros = _zeros_out_of_place(counts, modulus, scale)
    if zeros.size == 0:
        return _repaired(t_s, counts, scale, modulus)
    rows = np.delete(np.arange(t_s.size), zeros)
    repaired = _repaired(t_s[rows], counts[rows], scale, modulus)
    keep = np.zeros(t_s.size, dtype=np.bool_)
    keep[rows] = repaired.keep
    return replace(repaired, keep=keep, stale=rows[repaired.stale])


def _zeros_out_of_place(counts: Floats, modulus: float | None, scale: Scale) -> Ints:
    """Rows of a few (0, 0) between counts that did not pass zero: a driver without news, whatever the speed."""
    zero = (counts[:, 0] == 0) & (counts[:, 1] == 0)
    edges = np.flatnonzero(np.diff(zero)) + 1
    lost: list[int] = []
    for first, stop in pairwise(edges.tolist()):
        if not zero[first] or stop - first > _SHORT_ROWS:
            continue
        travel, offset = counts[stop] - counts[first - 1], -counts[first - 1]
        if modulus is not None:
            travel = travel - modulus * np.round(travel / modulus)
            offset = offset - modulus * np.round(offset / modulus)
        slack = 3 * scale.quantum
        passed = (offset >= np.minimum(travel, 0) - slack) & (offset <= np.maximum(travel, 0) + slack)
        started_anew = np.abs(travel - offset) < 0.25 * np.abs(offset)
        if not (passed | started_anew).all():
            lost.extend(range(first, stop))
    return np.array(lost, dtype=np.int64)


def _repaired(t_s: Floats, counts: Floats, scale: Scale, modulus: float | None) -> Repair:
    dt_s = np.diff(t_s)
    steps = _unwrapped_steps(counts, modulus)
    motion = _motion(t_s, steps, scale)
    if modulus is not None:
        steps = _nearest(steps, modulus, 0.5 * (motion.low + motion.high) * dt_s[:, None], motion, dt_s)
    odd = _any_wheel(~_fits(dt_s, steps, motion, scale))
    if odd.any():
        motion = _distrust_messy(motion, odd)
        odd = _any_wheel(~_fits(dt_s, steps, motion, scale))
    if int(odd.sum()) > max(20, odd.size // 2):
        raise ValueError(f"{int(odd.sum())} of {odd.size} steps")
    rows = _Rows(t_s, counts, modulus, motion, scale)
    verdict = _judged(rows, np.flatnonzero(odd) + 1) if odd.any() else _Verdict(np.ones(t_s.size, dtype=np.bool_))
    return _assembled(rows, verdict)


def _unwrapped_steps(counts: Floats, modulus: float | None) -> Floats:
    steps = np.diff(counts, axis=0)
    return steps if modulus is None else steps - modulus * np.round(steps / modulus)


def _nearest(steps: Floats, modulus: float, expected: Floats, motion: _Motion, dt_s: Floats) -> Floats:
    """Choose the number of wraps nearest to the expected travel, where a step may hold more than half a width."""
    long = dt_s[:, None] * motion.top[None, :] > 0.5 * modulus
    wrapped = steps + modulus * np.round((expected - steps) / modulus)
    return np.where(long & np.isfinite(expected), wrapped, steps)


def _motion(t_s: Floats, steps: Floats, scale: Scale) -> _Motion:
    dt_s = np.diff(t_s)
    limit = SPEED_LIMIT_MPS * scale.counts_per_m
    margin = _SPEED_MARGIN_MPS * scale.counts_per_m
    if dt_s.size == 0:
        none = np.zeros((0, 2))
        return _Motion(none, none, np.full(2, margin), 0.02, 0.1)
    usual_dt_s = float(np.median(dt_s))
    length = int(np.clip(np.ceil(_STRETCH_S / usual_dt_s), 5, 200))
    blocks = -(-dt_s.size // length)
    pad = blocks * length - dt_s.size
    in_stretch = np.where(dt_s > max(10 * usual_dt_s, _STRETCH_S), np.nan, dt_s)
    dt_blocks = np.concatenate((in_stretch, np.full(pad, np.nan))).reshape(blocks, length)
    seen = np.isfinite(dt_blocks)
    mean_dt_s = np.where(seen.any(axis=1), np.nansum(dt_blocks, axis=1) / np.maximum(seen.sum(axis=1), 1), usual_dt_s)
    block_of = np.arange(dt_s.size) // length
    low, high, top = np.empty_like(steps), np.empty_like(steps), np.empty(2)
    late_s = np.zeros(dt_s.size)
    for wheel in range(2):
        # The last block borrows the end of the one before it, so that its median does not rest on a step or two.
        tail = steps[-length:, wheel] if dt_s.size >= length else steps[:, wheel]
        whole = steps[: (blocks - 1) * length, wheel].reshape(blocks - 1, length)
        typical = np.concatenate((np.median(whole, axis=1), [np.median(tail)]))
        speed = typical / mean_dt_s
        speed = np.where(np.abs(speed) <= limit, speed, 0.0)
        around = np.concatenate(([speed[0]], speed, [speed[-1]]))
        triples = np.stack((around[:-2], around[1:-1], around[2:]))
        low[:, wheel] = triples.min(axis=0)[block_of]
        high[:, wheel] = triples.max(axis=0)[block_of]
        top[wheel] = 1.5 * float(np.abs(speed).max()) + margin
        v = speed[block_of]
        moving = np.abs(v) > 0.1 * scale.counts_per_m
        excess = np.maximum(low[:, wheel] * dt_s - steps[:, wheel], steps[:, wheel] - high[:, wheel] * dt_s)
        late_s = np.maximum(late_s, np.where(moving, excess / np.where(moving, np.abs(v), 1.0), 0.0))
    floor_s = max(0.02, 0.5 * usual_dt_s)
    usual_late_s = float(np.quantile(late_s, 0.995))
    allowance_s = float(np.clip(2.0 * usual_late_s, floor_s, max(0.3, floor_s)))
    return _Motion(low, high, np.minimum(top, limit + margin), allowance_s, usual_dt_s)


def _distrust_messy(motion: _Motion, odd: Bools) -> _Motion:
    """Where many steps are odd the stretches' speeds rest on bogus values: allow any speed of the file there."""
    length = int(np.clip(np.ceil(_STRETCH_S / motion.usual_dt_s), 5, 200))
    width = 2 * length + 1
    crowd = np.convolve(odd.astype(np.float64), np.ones(width), mode="same")[: odd.size]
    messy = crowd > max(3.0, 0.1 * width)
    low = np.where(messy[:, None], -motion.top, motion.low)
    high = np.where(messy[:, None], motion.top, motion.high)
    return _Motion(low, high, motion.top, motion.allowance_s, motion.usual_dt_s)


def _tolerance(dt_s: Floats, speed: Floats, motion: _Motion, scale: Scale) -> Floats:
    blur_s = dt_s + np.minimum(motion.allowance_s, dt_s)
    change = 0.5 * _ACCELERATION_MPS2 * scale.counts_per_m * blur_s**2
    change = np.minimum(change, 2 * float(motion.top.max()) * dt_s)
    return speed * (motion.allowance_s + 0.25 * dt_s) + change + 3 * scale.quantum


def _fits(dt_s: Floats, steps: Floats, motion: _Motion, scale: Scale) -> Bools:
    """(n - 1, 2) True where a step's travel agrees with the speeds around it."""
    dt = dt_s[:, None]
    speed = np.maximum(np.abs(motion.low), np.abs(motion.high))
    tolerance = _tolerance(dt, speed, motion, scale)
    fits: Bools = (steps >= motion.low * dt - tolerance) & (steps <= motion.high * dt + tolerance)
    return fits


@dataclass(frozen=True)
class _Rows:
    """The rows judged, and how a row may continue an earlier one."""

    t_s: Floats
    counts: Floats
    modulus: float | None
    motion: _Motion
    scale: Scale

    def travel(self, a: int, b: int) -> Floats:
        """(2) counts from row a to row b, with the number of wraps nearest to the speed around."""
        travel: Floats = self.counts[b] - self.counts[a]
        if self.modulus is not None:
            low, high = self._speeds(a, b)
            expected = 0.5 * (low + high) * (self.t_s[b] - self.t_s[a])
            travel = travel + self.modulus * np.round((expected - travel) / self.modulus)
        return travel

    def follows(self, a: int, b: int) -> bool:
        """Whether row b continues row a at the speeds around the two."""
        dt_s = self.t_s[b] - self.t_s[a]
        travel = self.travel(a, b)
        low, high = self._speeds(a, b)
        tolerance = _tolerance(dt_s, np.maximum(np.abs(low), np.abs(high)), self.motion, self.scale)
        return bool(((travel >= low * dt_s - tolerance) & (travel <= high * dt_s + tolerance)).all())

    def possible(self, a: int, b: int) -> bool:
        """Whether the machine could have moved so at its highest speed; a fresh start from zero is taken as a reset."""
        top, usual_dt_s = self.motion.top, self.motion.usual_dt_s
        if self.restarts(a, b):
            return False
        reach = top * (self.t_s[b] - self.t_s[a] + max(self.motion.allowance_s, 1.5 * usual_dt_s, 0.05))
        return bool((np.abs(self.travel(a, b)) <= reach + 3 * self.scale.quantum).all())

    def restarts(self, a: int, b: int) -> bool:
        """Whether row b stands near zero and row a does not."""
        near_zero = self.motion.top * self.motion.usual_dt_s + 3 * self.scale.quantum
        return bool((np.abs(self.counts[b]) <= near_zero).all() and (np.abs(self.counts[a]) > near_zero).all())

    def still_since(self, first: int, last: int) -> int:
        """The earliest row, not before ``first``, from which the counts are those of row ``last``."""
        moved = (np.abs(self.counts[first : last + 1] - self.counts[last]) > 2 * self.scale.quantum).any(axis=1)
        return first + int(np.flatnonzero(moved)[-1]) + 1 if moved.any() else first

    def _speeds(self, a: int, b: int) -> tuple[Floats, Floats]:
        """(2), (2) lowest and highest speed before row a and after row b, counts/s."""
        before, after = max(a - 1, 0), min(b, len(self.motion.low) - 1)
        low = np.minimum(self.motion.low[before], self.motion.low[after])
        return low, np.maximum(self.motion.high[before], self.motion.high[after])


@dataclass
class _Chain:
    """Segments that continue one another: [start, stop) of rows, in order."""

    segments: list[tuple[int, int]]
    rows: int = 0

    @property
    def first(self) -> int:
        return self.segments[0][0]

    @property
    def last(self) -> int:
        return self.segments[-1][1] - 1


@dataclass
class _Verdict:
    """What becomes of the rows."""

    keep: Bools
    resets: list[int] = field(default_factory=list)
    unlikely: list[int] = field(default_factory=list)
    stale: list[int] = field(default_factory=list)


def _judged(rows: _Rows, cuts: Ints) -> _Verdict:
    """Chain the segments between ``cuts``, and keep the chains that do not lie inside another one's time."""
    t_s = rows.t_s
    verdict = _Verdict(np.ones(t_s.size, dtype=np.bool_))
    chains = _chained(rows, cuts, verdict)
    accepted: list[_Chain] = []
    for chain in sorted(chains, key=lambda chain: -chain.rows):
        apart = all(chain.last < other.first or chain.first > other.last for other in accepted)
        if apart and (not accepted or not _negligible(chain, rows)):
            accepted.append(chain)
        else:
            for start, stop in chain.segments:
                verdict.keep[start:stop] = False
    verdict.keep[np.array(verdict.stale, dtype=np.int64)] = False
    accepted.sort(key=lambda chain: chain.first)
    verdict.resets = [chain.first for chain in accepted[1:]]
    verdict.unlikely = [row for row in verdict.unlikely if verdict.keep[row] and row not in verdict.resets]
    return verdict


def _chained(rows: _Rows, cuts: Ints, verdict: _Verdict) -> list[_Chain]:
    t_s = rows.t_s
    bounds = [0, *cuts.tolist(), t_s.size]
    chains: list[_Chain] = []
    recent: list[_Chain] = []
    for start, stop in pairwise(bounds):
        recent = _candidates(recent, start, rows)
        host = next((c for c in recent if rows.follows(c.last, start)), None)
        if host is None and stop - start >= _SHORT_ROWS:
            settled = [c for c in recent if c.rows >= _SHORT_ROWS]
            host = next((c for c in settled if rows.possible(c.last, start)), None)
            host = host or next((c for c in settled if _caught_up(c, start, rows, verdict)), None)
            if host is not None:
                verdict.unlikely.append(start)
        if host is None:
            host = _Chain([])
            chains.append(host)
        host.segments.append((start, stop))
        host.rows += stop - start
        recent = [host, *(c for c in recent if c is not host)]
    return chains


def _candidates(recent: list[_Chain], start: int, rows: _Rows) -> list[_Chain]:
    """The chains, latest first, that row ``start`` may continue: none from before a counter that has counted since."""
    t_s = rows.t_s
    candidates: list[_Chain] = []
    for chain in recent[:_CHAINS_AT_ONCE]:
        if candidates and t_s[start] - t_s[chain.last] > _CHAIN_MEMORY_S:
            continue
        candidates.append(chain)
        first, last = chain.first, chain.last
        if t_s[last] - t_s[first] > _SHORT_S and (rows.counts[last] != rows.counts[first]).any():
            break
    return candidates


def _caught_up(chain: _Chain, start: int, rows: _Rows, verdict: _Verdict) -> bool:
    """Whether row ``start`` continues the chain from before it lagged; if so, the rows between are stale.

    The counts lagged since they stood still last, or since the chain's last odd steps.
    """
    if rows.restarts(chain.last, start):
        return False
    begin, stop = chain.segments[-1]
    halt = rows.still_since(begin, stop - 1) + 1
    if begin + 1 < halt < stop:
        chain.segments[-1:] = [(begin, halt), (halt, stop)]
    for kept in range(len(chain.segments) - 1, 0, -1):
        a = chain.segments[kept - 1][1] - 1
        stale = [row for piece in chain.segments[kept:] for row in range(*piece)]
        if rows.t_s[start] - rows.t_s[a] > _STALE_S or chain.rows - len(stale) < _SHORT_ROWS:
            return False
        if rows.follows(a, start):
            verdict.stale.extend(stale)
            chain.rows -= len(stale)
            del chain.segments[kept:]
            return True
    return False


def _negligible(chain: _Chain, rows: _Rows) -> bool:
    """Too short to be the counter's new life, or a value that never changes: at the start, zeros of a driver not up."""
    if chain.rows < _SHORT_ROWS:
        return True
    first, last = chain.first, chain.last
    constant = bool((rows.counts[first : last + 1] == rows.counts[first]).all())
    waiting = first == 0 and not rows.counts[first].any()
    return constant and (waiting or rows.t_s[last] - rows.t_s[first] <= _SHORT_S)


def _assembled(rows: _Rows, verdict: _Verdict) -> Repair:
    keep, modulus = verdict.keep, rows.modulus
    kept = np.flatnonzero(keep)
    place = np.cumsum(keep) - 1
    t_s, counts = rows.t_s[kept], rows.counts[kept]
    dt_s = np.diff(t_s)
    steps = _unwrapped_steps(counts, modulus)
    motion = rows.motion if kept.size == rows.t_s.size else _motion(t_s, steps, rows.scale)
    aliased, wraps = False, 0
    if modulus is not None:
        for step in np.flatnonzero((dt_s[:, None] * motion.top > 0.3 * modulus).any(axis=1)).tolist():
            expected = _speed_beside(t_s, steps, step, motion.usual_dt_s) * dt_s[step]
            steps[step] += modulus * np.round((expected - steps[step]) / modulus)
        ordinary = dt_s <= 2 * motion.usual_dt_s
        aliased = bool(np.quantile(np.abs(steps[ordinary]), 0.99) > 0.4 * modulus) if ordinary.any() else False
        wraps = int(np.abs(np.round((steps - np.diff(counts, axis=0)) / modulus)).sum())
    resets = place[np.array(verdict.resets, dtype=np.int64)]
    for row in resets.tolist():
        steps[row - 1] = _speed_beside(t_s, steps, row - 1, motion.usual_dt_s) * dt_s[row - 1]
    unlikely = place[np.array(verdict.unlikely, dtype=np.int64)]
    total = np.concatenate((counts[:1], counts[:1] + np.cumsum(steps, axis=0)))
    return Repair(keep, np.array(verdict.stale, dtype=np.int64), total, resets, unlikely, wraps, aliased)


def _speed_beside(t_s: Floats, steps: Floats, step: int, usual_dt_s: float) -> Floats:
    """(2) mean of the speeds just before and just after a step, counts/s: exact where the speed changes evenly."""
    length = int(np.clip(np.ceil(0.15 / usual_dt_s), 2, 30))
    speeds = []
    for a, b in ((max(step - length, 0), step), (step + 1, min(step + 1 + length, len(steps)))):
        dt_s = np.diff(t_s[a : b + 1])
        if dt_s.size and dt_s.max() <= max(10 * usual_dt_s, _STRETCH_S):
            speeds.append(np.median(steps[a:b], axis=0) / float(dt_s.mean()))
    return np.mean(speeds, axis=0) if speeds else np.zeros(2)
