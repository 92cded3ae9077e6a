"""The fixes on the logging clock and in a plane, without asking whether they fit the other streams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.align.accuracy import fix_covariance, usable
from sccal.align.clocks import fixes_on_host_clock
from sccal.arrays import Floats, Ints
from sccal.geodesy import TangentPlane
from sccal.logs.streams import FixStream
from sccal.results.clock import Clock

LEG_M = 0.5
LEG_SCATTERS = 8.0
NORMAL_MAD = 1.4826


@dataclass(frozen=True)
class PlacedFixes:
    """Fixes (n,) in order of time, those that have a time and a position."""

    t_s: Floats
    east_m: Floats
    north_m: Floats
    sigma_m: Floats
    """Stated, or by quality; m per axis. NaN for qualities that are never used."""
    quality: Ints
    row: Ints
    """Into the stream."""
    clock: Clock
    white_m: float
    """Scatter from fix to fix, m per axis; NaN for fewer than eight fixes."""

    @property
    def leg_m(self) -> float:
        """Displacement from which on a course and a distance mean something."""
        return max(LEG_M, LEG_SCATTERS * (self.white_m if np.isfinite(self.white_m) else 0.0))


def placed_fixes(fixes: FixStream, span_s: tuple[float, float]) -> PlacedFixes:
    """All fixes of a usable quality, or all there are where none is; span_s as for fixes_on_host_clock."""
    t_s, timed, clock = fixes_on_host_clock(fixes, span_s)
    good = timed & usable(fixes.quality)
    row = np.flatnonzero(good if good.any() else timed)
    row = row[np.argsort(t_s[row], kind="stable")]
    row = row[np.concatenate(([True], np.diff(t_s[row]) > 0))] if row.size else row
    lat, lon = fixes.lat_deg[row], fixes.lon_deg[row]
    plane = TangentPlane(float(np.median(lat)), float(_middle_lon(lon))) if row.size else TangentPlane(0.0, 0.0)
    east, north = plane.to_east_north(lat, lon)
    var_east, var_north, _ = fix_covariance(
        fixes.quality[row], fixes.sigma_east_m[row], fixes.sigma_north_m[row], fixes.cov_en_m2[row]
    )
    return PlacedFixes(
        t_s=t_s[row],
        east_m=east,
        north_m=north,
        sigma_m=np.sqrt(0.5 * (var_east + var_north)),
        quality=fixes.quality[row],
        row=row,
        clock=clock,
        white_m=_white_m(t_s[row], east + 1j * north),
    )


def _middle_lon(lon_deg: Floats) -> float:
    """Of longitudes that may lie on both sides of the date line."""
    first = float(lon_deg[0])
    return float((first + np.median((lon_deg - first + 180) % 360 - 180) + 180) % 360 - 180)


def _white_m(t_s: Floats, z: np.ndarray) -> float:
    """Second differences cancel smooth motion; of white noise they have six times its variance."""
    if t_s.size < 8:
        return float("nan")
    step = np.diff(t_s)
    regular = (step[1:] < 1.5 * np.median(step)) & (step[:-1] < 1.5 * np.median(step))
    second = np.diff(z, n=2)[regular]
    if second.size < 6:
        return float("nan")
    return float(NORMAL_MAD * np.median(np.abs(np.concatenate((second.real, second.imag)))) / np.sqrt(6.0))


def legs(east_m: Floats, north_m: Floats, leg_m: float) -> Ints:
    """Indices of the fixes that are each at least ``leg_m`` from the one chosen before: noise makes no distance.

    Single fixes that jump away and come back make none either.
    """
    chosen: list[int] = []
    last_east = last_north = np.inf
    for k, (east, north) in enumerate(zip(_calmed(east_m).tolist(), _calmed(north_m).tolist(), strict=True)):
        if not chosen or (east - last_east) ** 2 + (north - last_north) ** 2 >= leg_m * leg_m:
            chosen.append(k)
            last_east, last_north = east, north
    return np.array(chosen, dtype=np.int64)


def _calmed(values: Floats) -> Floats:
    """Running median of three."""
    if values.size < 3:
        return values
    three = np.stack((values[:-2], values[1:-1], values[2:]))
    return np.concatenate((values[:1], np.median(three, axis=0), values[-1:]))
