"""Do the codes of quality mean what GGA means by them? The scatter of the fixes about the wheels' path tells.

Many receivers and drivers count their qualities in another order. A code that GGA calls worse and that scatters much
less than one that it calls better is not believed: what scatters is then left out, and the rest taken at its scatter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sccal.align.accuracy import FLOOR_M, QUALITY_NAMES, UNKNOWN_QUALITY, table_sigma_m
from sccal.align.clock_fit import WheelPath
from sccal.arrays import Bools, Complexes, Floats, Ints
from sccal.logs.streams import FixStream, Notice

SPAN_S = 10.0
"""Fixes so far apart are compared: long enough for what wanders, short for wheels and yaw."""
FEWEST_PAIRS = 30
LEAST_S = 20.0
"""Of pairs within one code, all together."""
CALLED_WORSE = 2.0
"""Ratio of the errors by GGA's meaning from which two codes are told apart at all."""
SCATTERS_LESS = 3.0
"""Ratio of the scatters, the other way round: honest codes of the same receiver reach 1.5 by chance."""
PPS, DEAD_RECKONING = 3, 6
"""GGA's 3 is of military receivers; with 6 beside it, both are rather another maker's 3D and RTK fixed (MAVLink)."""
OF_PAIRS = 1.1774 * np.sqrt(2.0)
"""Median length of the difference of two fixes of standard deviation 1 in each axis."""


@dataclass(frozen=True)
class Coded:
    """The fixes with qualities that may be believed, and what is to be said of them."""

    fixes: FixStream
    left_out: Bools
    """(n,) what scatters under a code that was not believed."""
    notices: tuple[Notice, ...] = ()


def by_scatter(fixes: FixStream, path: WheelPath | None, t_s: Floats, timed: Bools) -> Coded:
    """The fixes (n,) at times (n,) on the path's clock, their codes believed only where their scatter allows it."""
    nothing = np.zeros(fixes.quality.size, dtype=np.bool_)
    unstated = timed & ~np.isfinite(fixes.sigma_east_m) & (fixes.quality > 0)
    codes = np.unique(fixes.quality[unstated])
    if path is None or codes.size < 2 or np.ptp(_called_m(codes)) == 0.0:
        return Coded(fixes, nothing)
    rows = np.flatnonzero(unstated & (t_s >= path.t_s[0]) & (t_s <= path.t_s[-1]))
    rows = rows[np.argsort(t_s[rows], kind="stable")]
    scatter = _scatter(fixes, path, t_s, rows)
    told = sorted(scatter)
    called = dict(zip(told, _called_m(np.array(told, dtype=np.int64)).tolist(), strict=True))
    wrong = [
        (one, other)
        for one in told
        for other in told
        if called[one] >= CALLED_WORSE * called[other] and SCATTERS_LESS * scatter[one] <= scatter[other]
    ]
    if not wrong:
        return Coded(fixes, nothing)
    one, other = max(wrong, key=lambda pair: scatter[pair[1]] / scatter[pair[0]])
    return _not_believed(fixes, unstated, scatter, one, other)


def _called_m(codes: Ints) -> Floats:
    """Errors (m) by GGA's meaning; dead reckoning is worse than all, and of no meaning without a 3 beside it."""
    called = table_sigma_m(codes)
    if PPS in codes:
        called[codes == DEAD_RECKONING] = 10.0
    return np.where(np.isfinite(called), called, 0.0)


def _scatter(fixes: FixStream, path: WheelPath, t_s: Floats, rows: Ints) -> dict[int, float]:
    """Standard deviation per axis (m) of fixes about the path over SPAN_S, by code, where there are enough."""
    place = _places(fixes, rows)
    at = t_s[rows]
    if at.size < FEWEST_PAIRS:
        return {}
    quality = fixes.quality[rows]
    number = np.cumsum(np.concatenate(([True], np.diff(quality) != 0)))
    later = np.searchsorted(at, at + SPAN_S)
    first = np.flatnonzero(later < at.size)
    first = first[number[later[first]] == number[first]]
    if first.size < FEWEST_PAIRS:
        return {}
    columns = np.column_stack(
        [np.interp(at, path.t_s, path.path_m), np.exp(1j * np.interp(at, path.t_s, path.yaw_rad))]
    )
    off = _left_over(columns[later[first]] - columns[first], place[later[first]] - place[first], path.arm_m)
    step_s = float(np.median(np.diff(at)))
    found = {}
    for code in np.unique(quality):
        of_code = quality[first] == code
        known = bool(np.isfinite(table_sigma_m(np.array([code]))).all()) or (code == DEAD_RECKONING and PPS in quality)
        if known and of_code.sum() >= max(FEWEST_PAIRS, LEAST_S / max(step_s, 1e-3)):
            found[int(code)] = max(float(np.median(off[of_code])) / OF_PAIRS, 1e-4)
    return found


def _left_over(columns: Complexes, steps: Complexes, arm_m: float) -> Floats:
    """Lengths (k,) that path and arm leave of the steps (k,), fitted so that the worse ones hardly count."""
    weight = np.ones(steps.size)
    ridge = np.diag([1e-6, 1.0 / max(arm_m, 1e-3) ** 2]) * 1e-3
    off = np.abs(steps)
    for _ in range(10):
        weighted = (columns * weight[:, None]).conj().T
        factor = np.linalg.solve(weighted @ columns + ridge, weighted @ steps)
        off = np.abs(steps - columns @ factor)
        weight = 1.0 / np.maximum(off / max(float(np.quantile(off, 0.25)), 1e-6), 1.0) ** 2
    return np.asarray(off)


def _places(fixes: FixStream, rows: Ints) -> Complexes:
    """East and north (k,) of rows as complex metres, good for differences of some metres."""
    lat, lon = np.radians(fixes.lat_deg[rows]), np.radians(fixes.lon_deg[rows])
    earth_m = 6.371e6
    return np.asarray(earth_m * ((lon - lon[0]) * np.cos(lat[0]) + 1j * (lat - lat[0])))


def _not_believed(fixes: FixStream, unstated: Bools, scatter: dict[int, float], one: int, other: int) -> Coded:
    """The fixes with the scatter in place of the codes, without those that scatter much more than the best."""
    best = min(scatter.values())
    kept = {code: size for code, size in scatter.items() if size < SCATTERS_LESS * best}
    quality, east, north = fixes.quality.copy(), fixes.sigma_east_m.copy(), fixes.sigma_north_m.copy()
    left_out = unstated & ~np.isin(fixes.quality, list(kept))
    for code, size in kept.items():
        rows = unstated & (fixes.quality == code)
        quality[rows] = UNKNOWN_QUALITY
        east[rows] = north[rows] = max(size, FLOOR_M)
    shown = "; ".join(
        f"{code}, in GGA {QUALITY_NAMES.get(code, 'unknown')}, scatters by {scatter[code]:.2g} m in {SPAN_S:.0f} s"
        for code in (one, other)
    )
    doubt = f"the quality codes are not GGA's: {shown}"
    used = ", ".join(str(code) for code in sorted(kept))
    what = (
        f"fixes left out, because the quality codes contradict their scatter: {shown}. The codes are another maker's; "
        f"only those of code {used} are used, at their scatter: write fix_quality as in GGA (4 RTK fixed, 5 float, "
        "2 differential, 1 autonomous), or a column sigma_m"
    )
    notice = Notice("gnss", what, int(left_out.sum()), "", "warning", doubt)
    return Coded(replace(fixes, quality=quality, sigma_east_m=east, sigma_north_m=north), left_out, (notice,))
