"""The faults that a log can be given, and what they do to fixes; in files and in memory the same.

Noise belongs to the time of day of a fix, to 0.1 ms (``sccal.randomness``), not to its row: the same seed and run name
displace the same fix alike, whether it comes out of a file or out of a reader, and whatever the other faults are.

    latency     position(t) becomes position(t − latency), on the cubic through the fixes around
    sigma       + white N(0, σ²) east and north, scaled to a root mean square of σ over all fixes of the run
    multipath   + Gauss-Markov (σ, τ) east and north
    outliers    + a jump of 5 to 50 m in any direction, for this fraction of the fixes, which keep their claims
    loss        no fix from a to b, both ends included
    quality     what the fixes claim: as asked, else what √(sigma² + multipath²) means (``quality``)

``from`` is the start of sigma, multipath, outliers and quality; the others last throughout.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.degrade.places import between, moved, offset_m
from sccal.degrade.quality import written_hdop, written_quality
from sccal.errors import UsageError
from sccal.logs.encoder import GAP_S
from sccal.logs.streams import Convention, FixStream, HeadingStream, Run, WheelStream
from sccal.logs.windows import windows_on_clock, within
from sccal.randomness import gauss_markov_at, normals_at, time_keys, uniforms_at

SHORTEST_JUMP_M, LONGEST_JUMP_M = 5.0, 50.0
BURST_ROWS = 5
"""Rows over which a stalled encoder logger remembers that it stalls: how long its bursts are, about."""
_PAUSE_STEPS, _PAUSE_S = 3.0, 2.0
_FEWEST_TO_LEVEL = 100


@dataclass(frozen=True)
class Faults:
    """What to do to a log; the default is nothing. Raises UsageError where a number makes no sense."""

    sigma_m: float = 0.0
    losses_s: tuple[tuple[float, float], ...] = ()
    from_s: float | None = None
    quality: int | None = None
    """GGA quality to write; None: what the noise means."""
    multipath_m: float = 0.0
    tau_s: float = 30.0
    outliers: float = 0.0
    heading_drift_deg_per_hour: float = 0.0
    """Positive: the reading turns counter-clockwise with time."""
    encoder_dropout: float = 0.0
    latency_s: float = 0.0
    """Positive: the fix shows where the antenna was that much earlier."""
    seed: int = 0
    drop: bool = False
    """Leave lost fixes out, instead of writing that there is none."""
    gst: bool = False
    """Write the noise into GST too."""

    def __post_init__(self) -> None:
        """Refuse what cannot be meant."""
        for name in ("sigma_m", "multipath_m"):
            value = getattr(self, name)
            _require(math.isfinite(value) and 0 <= value <= 10_000, _option(name), value, "0 m or more, up to 10 km")
        _require(math.isfinite(self.tau_s) and 0.01 <= self.tau_s <= 1e6, "--tau", self.tau_s, "0.01 s to 1e6 s")
        _require(0 <= self.outliers <= 1, "--outliers", self.outliers, "a fraction from 0 to 1")
        _require(0 <= self.encoder_dropout <= 0.9, "--encoder-dropout", self.encoder_dropout, "a fraction up to 0.9")
        _require(abs(self.latency_s) <= 60, "--latency", self.latency_s, "within 60 s")
        drift = self.heading_drift_deg_per_hour
        _require(math.isfinite(drift) and abs(drift) <= 1e6, "--heading-drift", drift, "finite, degrees per hour")
        _require(self.quality is None or 0 <= self.quality <= 9, "--quality", self.quality, "a GGA quality, 0 to 9")
        _require(self.from_s is None or math.isfinite(self.from_s), "--from", self.from_s, "seconds")
        _require(self.seed >= 0, "--seed", self.seed, "0 or more")
        for begin, end in self.losses_s:
            sensible = math.isfinite(begin) and math.isfinite(end) and begin < end
            _require(sensible, "--loss", f"{begin:g}:{end:g}", "BEGIN:END in seconds with BEGIN before END")

    @property
    def noise_m(self) -> float:
        """Standard deviation per axis of the noise on the fixes that they tell of."""
        return math.hypot(self.sigma_m, self.multipath_m)

    @property
    def touch_fixes(self) -> bool:
        """Whether anything happens to the fixes."""
        noise = self.noise_m > 0 or self.outliers > 0 or self.latency_s != 0
        return noise or bool(self.losses_s) or self.quality is not None

    @property
    def none(self) -> bool:
        """Whether nothing happens at all."""
        return not (self.touch_fixes or self.heading_drift_deg_per_hour or self.encoder_dropout)


def _option(field: str) -> str:
    return f"--{field.removesuffix('_m').replace('_', '-')}"


def _require(sensible: bool, option: str, value: object, what: str) -> None:
    if not sensible:
        raise UsageError(f"{option} {value}: must be {what}")


@dataclass(frozen=True)
class Windows:
    """Times of one run, on its own clock (s)."""

    losses_s: tuple[tuple[float, float], ...]
    from_s: float | None


@dataclass(frozen=True)
class FaultedFixes:
    """What becomes of n fixes; every array (n,)."""

    east_m: Floats
    """From the original position; 0 for lost fixes and where there was no position."""
    north_m: Floats
    lat_deg: Floats
    """The position to write; the original one where nothing moves it."""
    lon_deg: Floats
    quality: Ints
    """To write; 0 for lost fixes."""
    noisy: Bools
    """Where the noise (sigma, multipath, quality) is on, position or not."""
    lost: Bools
    displaced: Bools
    outlier: Bools


def resolve(faults: Faults, span_s: tuple[float, float]) -> Windows:
    """The windows on the clock of a run that lasts from ``span_s[0]`` to ``span_s[1]``.

    Numbers within the span are times of that clock (of a window: both); others are seconds from the span's begin.

    Raises:
        UsageError: a window outside the run.
    """
    begin_s, end_s = span_s
    try:
        losses = windows_on_clock(faults.losses_s, span_s)
    except UsageError as error:
        raise UsageError(f"--loss: {error} (t = {begin_s:.3f} s to {end_s:.3f} s)") from error
    from_s = faults.from_s
    if from_s is not None:
        from_s += 0.0 if begin_s <= from_s <= end_s else begin_s
        if from_s > end_s:
            raise UsageError(
                f"--from {faults.from_s:g}: after the run, which lasts {end_s - begin_s:.1f} s "
                f"(t = {begin_s:.3f} s to {end_s:.3f} s)"
            )
    return Windows(tuple(losses), from_s)


def fault_fixes(
    t_s: Floats,
    lat_deg: Floats,
    lon_deg: Floats,
    quality: Ints,
    faults: Faults,
    span_s: tuple[float, float],
    stream_name: str,
    epoch_s: Floats | None = None,
    read: Bools | None = None,
) -> FaultedFixes:
    """What the faults make of n fixes in the order of time; arrays (n,).

    Args:
        t_s: on the clock of the windows; NaN where not known, which is then in no window.
        lat_deg, lon_deg: NaN where there is no position.
        quality: as in GGA; 0 no fix, -1 not stated.
        span_s: of the run on the same clock, for the windows.
        stream_name: the run's name; with the seed it chooses the noise.
        epoch_s: the receiver's own times, increasing, with which noise and latency go; ``t_s`` where there are none.
        read: which of them a reader takes for fixes: these make the path and jump; all of them where None.

    Raises:
        UsageError: a window outside the run.
    """
    windows = resolve(faults, span_s)
    epoch_s = t_s if epoch_s is None else epoch_s
    keys = time_keys(epoch_s)
    placed: Bools = np.isfinite(lat_deg) & np.isfinite(lon_deg)
    fix: Bools = placed & (quality != 0) if read is None else placed & read
    lost = within(t_s, windows.losses_s)
    noisy = np.ones(t_s.size, dtype=np.bool_) if windows.from_s is None else t_s >= windows.from_s
    lat, lon = lat_deg.copy(), lon_deg.copy()
    if faults.latency_s:
        lat, lon, there = _late(epoch_s, lat_deg, lon_deg, placed, fix, faults.latency_s)
        lost |= placed & ~there
    push_m = np.zeros((t_s.size, 2))
    if faults.sigma_m:
        white = normals_at(faults.seed, f"{stream_name}/sigma", keys)
        push_m += faults.sigma_m * (white / _level(white[fix]))
    known = placed & np.isfinite(epoch_s)
    if faults.multipath_m and known.any():
        wander = gauss_markov_at(faults.seed, f"{stream_name}/multipath", epoch_s[known], faults.tau_s)
        push_m[known] += faults.multipath_m * wander
    outlier = _outliers(keys, fix, faults, stream_name)
    push_m[outlier] += _jumps_m(keys[outlier], faults.seed, stream_name)
    outlier &= noisy & ~lost
    push_m[~noisy] = 0.0
    pushed = placed & ~lost & (push_m != 0).any(axis=1)
    lat[pushed], lon[pushed] = moved(lat[pushed], lon[pushed], push_m[pushed, 0], push_m[pushed, 1])
    gone = placed & lost
    lat[gone], lon[gone] = lat_deg[gone], lon_deg[gone]
    east_m, north_m = np.where(pushed, push_m[:, 0], 0.0), np.where(pushed, push_m[:, 1], 0.0)
    if faults.latency_s:
        seen = placed & ~lost
        east_m[seen], north_m[seen] = offset_m(lat_deg[seen], lon_deg[seen], lat[seen], lon[seen])
    displaced = placed & ~lost & ((lat != lat_deg) | (lon != lon_deg))
    claims = np.where(noisy, written_quality(quality, faults.noise_m, faults.quality), quality)
    return FaultedFixes(
        east_m=east_m,
        north_m=north_m,
        lat_deg=lat,
        lon_deg=lon,
        quality=np.where(lost, 0, claims),
        noisy=noisy & (faults.noise_m > 0 or faults.quality is not None),
        lost=lost,
        displaced=displaced,
        outlier=outlier,
    )


def _level(white: Floats) -> Floats:
    """Root mean square (2,) of a run's noise, so that a log gets the sigma asked for and not that of a draw."""
    return np.sqrt(np.mean(white**2, axis=0)) if len(white) >= _FEWEST_TO_LEVEL else np.ones(2)


def _late(
    epoch_s: Floats, lat_deg: Floats, lon_deg: Floats, placed: Bools, fix: Bools, latency_s: float
) -> tuple[Floats, Floats, Bools]:
    """Where each was ``latency_s`` earlier, by the fixes alone, and where that is known (n,)."""
    rows = np.flatnonzero(fix & np.isfinite(epoch_s))
    order = rows[np.argsort(epoch_s[rows], kind="stable")]
    order = order[np.diff(epoch_s[order], prepend=-np.inf) > 0]
    step_s = float(np.median(np.diff(epoch_s[order]))) if order.size > 1 else 0.0
    gap_s = max(_PAUSE_STEPS * step_s, min(_PAUSE_S, 20 * step_s))
    lat, lon, there = between(epoch_s[order], lat_deg[order], lon_deg[order], epoch_s - latency_s, gap_s)
    use = placed & there
    return np.where(use, lat, lat_deg), np.where(use, lon, lon_deg), use


def _outliers(keys: Ints, fix: Bools, faults: Faults, stream_name: str) -> Bools:
    """The fixes (n,) with the lowest numbers, as many as the fraction asks for."""
    chosen = np.zeros(keys.size, dtype=np.bool_)
    rows = np.flatnonzero(fix)
    count = round(faults.outliers * rows.size)
    if count:
        lots = uniforms_at(faults.seed, f"{stream_name}/outliers", keys[rows])
        chosen[rows[np.argsort(lots, kind="stable")[:count]]] = True
    return chosen


def _jumps_m(keys: Ints, seed: int, stream_name: str) -> Floats:
    """East and north (k, 2) of jumps, their length even between the limits."""
    length_m = SHORTEST_JUMP_M + (LONGEST_JUMP_M - SHORTEST_JUMP_M) * uniforms_at(
        seed, f"{stream_name}/jump.length", keys
    )
    bearing = 2 * math.pi * uniforms_at(seed, f"{stream_name}/jump.bearing", keys)
    return np.column_stack((length_m * np.sin(bearing), length_m * np.cos(bearing)))


def dropped_rows(t_s: Floats, fraction: float, seed: int, stream_name: str) -> Bools:
    """Rows (n,) of an encoder log that a stalling logger loses: that fraction of them, in bursts of a few.

    They are the rows where a moving average of ``BURST_ROWS`` random numbers is highest. The first and the last stay.
    """
    dropped = np.zeros(t_s.size, dtype=np.bool_)
    count = min(round(fraction * t_s.size), t_s.size - 2)
    if count <= 0:
        return dropped
    lots = normals_at(seed, f"{stream_name}/encoder_dropout", time_keys(t_s))[:, 0]
    stall = np.convolve(lots, np.ones(BURST_ROWS), mode="same")
    stall[[0, -1]] = -np.inf
    dropped[np.argsort(-stall, kind="stable")[:count]] = True
    return dropped


def drift_deg(t_s: Floats, deg_per_hour: float, convention: Convention) -> Floats:
    """What to add to AHRS readings (n,), degrees in their own convention; 0 at the first."""
    sign = -1.0 if convention == "ned" else 1.0
    return sign * deg_per_hour / 3600.0 * (t_s - t_s[0]) if t_s.size else np.zeros(0)


def fault_run(run: Run, faults: Faults) -> tuple[Run, FixStream]:
    """The faults on the streams of a read run, as reading its degraded files would give them.

    Returns the run with the fixes that are left, and the fixes as they were (all of them, in their order).

    Raises:
        UsageError: a window outside the run.
    """
    span_s = (float(run.wheels.t_s[0]), float(run.wheels.t_s[-1]))
    fixes = run.fixes
    if faults.touch_fixes:
        fixes = _fault_stream(run.fixes, faults, span_s, run.name)
    return (
        replace(
            run,
            wheels=_thinned(run.wheels, faults, run.name),
            heading=_drifted(run.heading, faults, run.vehicle.convention),
            fixes=fixes,
        ),
        run.fixes,
    )


def _fault_stream(fixes: FixStream, faults: Faults, span_s: tuple[float, float], name: str) -> FixStream:
    dated = np.isfinite(fixes.utc_s).all()
    t_s = fixes.host_t_s
    if dated and not np.isfinite(t_s).all():
        t_s = filled_times(t_s, fixes.utc_s)
    if dated and not fixes.utc_has_date and not np.isfinite(fixes.host_t_s).any():
        t_s = on_the_day(fixes.utc_s, span_s)
    epoch_s = fixes.utc_s if dated else t_s
    faulted = fault_fixes(t_s, fixes.lat_deg, fixes.lon_deg, fixes.quality, faults, span_s, name, epoch_s)
    kept = np.flatnonzero(~faulted.lost & (faulted.quality != 0))
    added_m = np.where(faulted.noisy & (not dated or faults.gst), faults.noise_m, 0.0)
    extras = dict(fixes.extras)
    if dated and "hdop" in extras and faults.noise_m:
        raised = written_hdop(extras["hdop"], faults.noise_m, faulted.quality)
        extras["hdop"] = np.where(faulted.noisy, raised, extras["hdop"])
    whole = replace(
        fixes,
        lat_deg=faulted.lat_deg,
        lon_deg=faulted.lon_deg,
        quality=faulted.quality,
        sigma_east_m=np.hypot(fixes.sigma_east_m, added_m),
        sigma_north_m=np.hypot(fixes.sigma_north_m, added_m),
        extras=extras,
    )
    return whole.take(kept)


def filled_times(t_s: Floats, epoch_s: Floats) -> Floats:
    """Receive times (n,), those that are missing put in from the receiver's own; all of them where none is there."""
    there = np.isfinite(t_s)
    if not there.any():
        return epoch_s
    return np.where(there, t_s, epoch_s + float(np.median((t_s - epoch_s)[there])))


def on_the_day(time_of_day_s: Floats, span_s: tuple[float, float]) -> Floats:
    """Unix times (n,) of running times of day without a date, on the day on which the run lies."""
    known = time_of_day_s[np.isfinite(time_of_day_s)]
    if known.size == 0:
        return time_of_day_s
    middle_s = 0.5 * (span_s[0] + span_s[1]) - 0.5 * float(known.min() + known.max())
    return time_of_day_s + round(middle_s / 86400.0) * 86400.0


def _thinned(wheels: WheelStream, faults: Faults, name: str) -> WheelStream:
    dropped = dropped_rows(wheels.t_s, faults.encoder_dropout, faults.seed, name)
    if not dropped.any():
        return wheels
    kept = np.flatnonzero(~dropped)
    since = np.cumsum(wheels.loose)[kept]
    loose = np.diff(since, prepend=0) > 0
    step_s = np.diff(wheels.t_s[kept], prepend=wheels.t_s[0])
    loose |= step_s > max(5 * float(np.median(step_s[1:])), GAP_S)
    return WheelStream(
        t_s=wheels.t_s[kept],
        left_rad=wheels.left_rad[kept],
        right_rad=wheels.right_rad[kept],
        loose=loose,
        extras={column: values[kept] for column, values in wheels.extras.items()},
    )


def _drifted(heading: HeadingStream, faults: Faults, convention: Convention) -> HeadingStream:
    if not faults.heading_drift_deg_per_hour:
        return heading
    drift = drift_deg(heading.t_s, faults.heading_drift_deg_per_hour, convention)
    return replace(heading, yaw_rad=heading.yaw_rad + np.radians(drift))
