"""Fixes that judge and never teach: taken out by the user's choice, or a degraded log's own fixes as they were before.

They are brought onto the logging clock through the map of the fixes that the log does have: the receive times of lost
lines are known, only their positions were taken away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sccal.align.accuracy import fix_covariance, usable
from sccal.align.clocks import fixes_on_host_clock
from sccal.align.digits import OF_ROUNDING, step_of
from sccal.arrays import Bools, Floats, Ints
from sccal.geodesy import TangentPlane
from sccal.logs.streams import FixStream, Notice, Reference
from sccal.results.clock import Clock


@dataclass(frozen=True)
class PlaneFixes:
    """Fixes (n,) on the logging clock and in the tangent plane, strictly later one after the other."""

    t_s: Floats
    east_m: Floats
    north_m: Floats
    quality: Ints
    var_east_m2: Floats
    var_north_m2: Floats
    cov_m2: Floats


@dataclass(frozen=True)
class ReferenceFixes:
    """What the log's fixes were before, in the order of time."""

    fixes: PlaneFixes
    lost: Bools
    """(n,) True where the log has no fix; False where it has one that was displaced, or the same."""
    leading: Bools
    """(n,) of the quality that carries most of the information: the ones to judge by."""


def in_plane(
    fixes: FixStream, t_s: Floats, rows: Ints, plane: TangentPlane, steps_m: tuple[float, float] | None = None
) -> PlaneFixes:
    """The fixes at the indices ``rows``, which are in order of their times on the logging clock ``t_s`` (n,).

    No variance is below that of the coordinates' rounding; steps_m as from rounding_steps_m, where known already.
    """
    east, north = plane.to_east_north(fixes.lat_deg[rows], fixes.lon_deg[rows])
    var_east, var_north, cov = fix_covariance(
        fixes.quality[rows], fixes.sigma_east_m[rows], fixes.sigma_north_m[rows], fixes.cov_en_m2[rows]
    )
    steps = rounding_steps_m(fixes, plane) if steps_m is None else steps_m
    least_east, least_north = ((OF_ROUNDING * step) ** 2 for step in steps)
    var_east, var_north = np.maximum(var_east, least_east), np.maximum(var_north, least_north)
    return PlaneFixes(t_s[rows], east, north, fixes.quality[rows], var_east, var_north, cov)


def rounding_steps_m(fixes: FixStream, plane: TangentPlane) -> tuple[float, float]:
    """The steps east and north (m) to which the log rounds its coordinates; 0 where it does not."""
    of_lon, of_lat = step_of(fixes.lon_deg), step_of(fixes.lat_deg)
    east, north = plane.to_east_north(
        np.array([plane.lat_deg, plane.lat_deg + of_lat]), np.array([plane.lon_deg + of_lon, plane.lon_deg])
    )
    return float(abs(east[0])), float(abs(north[1]))


def in_order(t_s: Floats, good: Bools) -> Ints:
    """Indices of the good rows in order of time, the first of those that share one."""
    index = np.flatnonzero(good)[np.argsort(t_s[good], kind="stable")]
    fresh = np.concatenate(([True], np.diff(t_s[index]) > 0)) if index.size else np.zeros(0, dtype=np.bool_)
    return np.asarray(index[fresh])


def on_host_clock(
    fixes: FixStream, reference: Reference | None, span_s: tuple[float, float], notices: list[Notice] | None = None
) -> tuple[Floats, Bools, Clock, Floats]:
    """As fixes_on_host_clock, and the times of the reference's fixes (m,), NaN where they have none.

    Lines whose positions were taken out keep their share in the map: it is the map of the log as it was.
    """
    if reference is None:
        return (*fixes_on_host_clock(fixes, span_s, notices), np.zeros(0))
    there = fixes.lat_deg.size
    whole = joined(fixes, reference.fixes.take(np.flatnonzero(reference.lost)))
    order = np.argsort(np.where(np.isfinite(whole.utc_s), whole.utc_s, whole.host_t_s), kind="stable")
    t_ordered, timed_ordered, clock = fixes_on_host_clock(whole.take(order), span_s, notices)
    t_s, timed = np.empty(order.size), np.zeros(order.size, dtype=np.bool_)
    t_s[order], timed[order] = t_ordered, timed_ordered
    back = np.full(reference.lost.size, np.nan)
    back[reference.lost] = np.where(timed[there:], t_s[there:], np.nan)
    stays = np.flatnonzero(~reference.lost)
    back[stays] = _times_of_same(reference.fixes.take(stays), fixes, t_s[:there])
    return t_s[:there], timed[:there], clock, back


def _times_of_same(before: FixStream, now: FixStream, t_s: Floats) -> Floats:
    """(k,) times of the fixes that stand at the same epoch in the log, NaN where none does."""
    by_utc = bool(np.isfinite(now.utc_s).any())
    key, wanted = (now.utc_s, before.utc_s) if by_utc else (now.host_t_s, before.host_t_s)
    order = np.argsort(key, kind="stable")
    at = order[np.minimum(np.searchsorted(key[order], wanted - 5e-4), key.size - 1)]
    return np.where(np.abs(key[at] - wanted) < 1e-3, t_s[at], np.nan)


def reference_fixes(
    parts: Sequence[tuple[FixStream, Floats, Bools]], span_s: tuple[float, float], plane: TangentPlane
) -> ReferenceFixes | None:
    """One reference from several streams, each with its times and which of its fixes are lost; None where all is empty.

    Fixes outside the span, or of a quality that is not used, are left out.
    """
    if not parts:
        return None
    stream, t_s, lost = parts[0]
    for more, more_t_s, more_lost in parts[1:]:
        stream, t_s = joined(stream, more), np.concatenate((t_s, more_t_s))
        lost = np.concatenate((lost, more_lost))
    good = np.isfinite(t_s) & usable(stream.quality)
    good &= np.where(good, (t_s >= span_s[0]) & (t_s <= span_s[1]), False)
    rows = in_order(t_s, good)
    if rows.size == 0:
        return None
    fixes = in_plane(stream, t_s, rows, plane)
    return ReferenceFixes(fixes, lost[rows], leading_fixes(fixes))


def leading_fixes(fixes: PlaneFixes) -> Bools:
    """(n,) fixes of the quality with the largest sum of 1/σ²."""
    codes = np.unique(fixes.quality)
    information = [float((1.0 / (fixes.var_east_m2 + fixes.var_north_m2)[fixes.quality == c]).sum()) for c in codes]
    return np.asarray(fixes.quality == codes[int(np.argmax(information))])


def joined(one: FixStream, other: FixStream) -> FixStream:
    """Both streams' fixes one after the other, without further columns."""

    def both(name: str) -> Floats:
        return np.concatenate((getattr(one, name), getattr(other, name)))

    return FixStream(
        host_t_s=both("host_t_s"),
        utc_s=both("utc_s"),
        utc_has_date=one.utc_has_date and other.utc_has_date,
        lat_deg=both("lat_deg"),
        lon_deg=both("lon_deg"),
        alt_m=both("alt_m"),
        quality=np.concatenate((one.quality, other.quality)),
        sigma_east_m=both("sigma_east_m"),
        sigma_north_m=both("sigma_north_m"),
        cov_en_m2=both("cov_en_m2"),
    )
