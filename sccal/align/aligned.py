"""One run with all its streams on the logging clock, in the tangent plane, and turned counter-clockwise from east."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from sccal.align.accuracy import (
    QUALITY_NAMES,
    SIMULATOR_QUALITY,
    fix_covariance,
    table_sigma_m,
    usable,
)
from sccal.align.agreement import check_agreement
from sccal.align.clock_fit import Fixes, wheel_path
from sccal.align.clock_motion import clock_by_motion
from sccal.align.clocks import Clock, fixes_on_host_clock, require_overlap
from sccal.align.path import laid_out
from sccal.align.signs import check_signs
from sccal.arrays import Bools, Complexes, Floats, Ints
from sccal.errors import DataError
from sccal.geodesy import TangentPlane
from sccal.logs.streams import Convention, HeadingStream, Notice, Run, Vehicle, WheelStream

MIN_MEASUREMENTS = 10
WHEEL_RATE_HZ = 20.0
"""As fine as the path need be for comparing clocks."""


@dataclass(frozen=True)
class Series:
    """A further column of the log: its finite values (k,) in the log's unit, and their times on the logging clock."""

    t_s: Floats
    values: Floats


@dataclass(frozen=True)
class Aligned:
    """One run, ready to be filtered. Times are on the logging clock and lie within the wheels' span."""

    name: str
    vehicle: Vehicle
    plane: TangentPlane
    clock: Clock
    wheel_t_s: Floats
    right_rad: Floats
    """Cumulative angle of the right wheel (n,), from 0."""
    left_rad: Floats
    loose: Bools
    heading_t_s: Floats
    yaw_rad: Floats
    """AHRS reading turned into enu (h,), unwrapped."""
    yaw_sigma_rad: Floats | None
    pitch_rad: Floats | None
    """Nose up, at the heading's times; None where the AHRS does not give it."""
    roll_rad: Floats | None
    fix_t_s: Floats
    fix_east_m: Floats
    fix_north_m: Floats
    fix_quality: Ints
    fix_var_east_m2: Floats
    fix_var_north_m2: Floats
    fix_cov_m2: Floats
    fix_leading: Bools
    """Fixes of the quality that carries most of the information: the ones that outages are judged by."""
    notices: tuple[Notice, ...]
    extras: Mapping[str, Series] = field(default_factory=dict)
    """The log's further columns by name; where two files share a name, the later one's carries its file's."""

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last time of the wheels."""
        return float(self.wheel_t_s[0]), float(self.wheel_t_s[-1])

    @property
    def travel_m(self) -> Floats:
        """Signed distance of the middle between the wheels (n,), with the nominal radius."""
        return self.vehicle.wheel_radius_m * 0.5 * (self.right_rad + self.left_rad)

    @property
    def yaw_at_wheels_rad(self) -> Floats:
        """The AHRS reading at the wheels' times (n,)."""
        return np.interp(self.wheel_t_s, self.heading_t_s, self.yaw_rad)

    @property
    def path_along_yaw(self) -> Complexes:
        """The wheels' signed travel laid out along the AHRS yaw, (n,) complex metres from 0, at the wheels' times."""
        return laid_out(self.travel_m, self.yaw_at_wheels_rad)


def yaw_to_enu(yaw_rad: Floats, convention: Convention) -> Floats:
    """A yaw in the file's convention, counter-clockwise from east (same shape, not wrapped)."""
    return yaw_rad if convention == "enu" else 0.5 * np.pi - yaw_rad


def align(run: Run) -> Aligned:
    """Bring the streams of one run together.

    Raises DataError where clocks, amounts of data or signs make a calibration impossible.
    """
    notices = list(run.notices)
    wheels, heading, fixes = run.wheels, run.heading, run.fixes
    whole = (float(wheels.t_s[0]), float(wheels.t_s[-1]))
    require_overlap(heading.t_s, whole, Clock("host", 0.0, 0.0, 0.0, 2), "ahrs.csv")
    wheels = _from_first_heading(wheels, heading)
    span = (float(wheels.t_s[0]), float(wheels.t_s[-1]))

    t_s, timed, clock = fixes_on_host_clock(fixes, span, notices)
    if not timed.any():
        raise DataError("gnss: no fix has a usable time")
    t_s, clock = _clocks_by_motion(run, wheels, t_s, timed, clock, notices)
    require_overlap(t_s[timed], span, clock, "the fixes")

    good = timed & usable(fixes.quality)
    for code in np.unique(fixes.quality[timed & ~good]):
        count = int((fixes.quality[timed & ~good] == code).sum())
        name = QUALITY_NAMES.get(int(code), "unknown")
        notices.append(Notice("gnss", f"fixes of quality {code} ({name}) not used", count))
    simulated = int((fixes.quality[good] == SIMULATOR_QUALITY).sum())
    if simulated:
        notices.append(Notice("gnss", "fixes say they come from a simulator (quality 8)", simulated, "", "warning"))
    good &= _inside(np.where(good, t_s, np.nan), span, "gnss", notices)
    order = np.argsort(t_s[good], kind="stable")
    good_index = np.flatnonzero(good)[order]
    fresh = np.concatenate(([True], np.diff(t_s[good_index]) > 0)) if good_index.size else np.zeros(0, bool)
    good_index = good_index[fresh]
    if good_index.size < MIN_MEASUREMENTS:
        raise DataError(
            f"gnss: {good_index.size} usable fixes within the wheels' span of {span[1] - span[0]:.1f} s, "
            f"at least {MIN_MEASUREMENTS} are needed: log longer, or check the receiver's fix quality"
        )

    seen = _inside(heading.t_s, span, "ahrs.csv", notices)
    if int(seen.sum()) < MIN_MEASUREMENTS:
        raise DataError(
            f"ahrs.csv: {int(seen.sum())} readings within the wheels' span of {span[1] - span[0]:.1f} s, "
            f"at least {MIN_MEASUREMENTS} are needed"
        )

    lat, lon = fixes.lat_deg[good_index], fixes.lon_deg[good_index]
    quality = fixes.quality[good_index]
    alt = fixes.alt_m[good_index]
    height = float(np.median(alt[np.isfinite(alt)])) if np.isfinite(alt).any() else 0.0
    best = table_sigma_m(quality) <= table_sigma_m(quality).min()
    plane = TangentPlane(float(lat[best][0]), float(lon[best][0]), round(height, 2))
    east, north = plane.to_east_north(lat, lon)
    var_east, var_north, cov = fix_covariance(
        quality, fixes.sigma_east_m[good_index], fixes.sigma_north_m[good_index], fixes.cov_en_m2[good_index]
    )

    aligned = Aligned(
        name=run.name,
        vehicle=run.vehicle,
        plane=plane,
        clock=clock,
        wheel_t_s=wheels.t_s,
        right_rad=wheels.right_rad - wheels.right_rad[0],
        left_rad=wheels.left_rad - wheels.left_rad[0],
        loose=wheels.loose,
        heading_t_s=heading.t_s[seen],
        yaw_rad=np.unwrap(yaw_to_enu(heading.yaw_rad[seen], run.vehicle.convention)),
        yaw_sigma_rad=None if heading.yaw_sigma_rad is None else heading.yaw_sigma_rad[seen],
        pitch_rad=None if heading.pitch_rad is None else heading.pitch_rad[seen],
        roll_rad=None if heading.roll_rad is None else heading.roll_rad[seen],
        fix_t_s=t_s[good_index],
        fix_east_m=east,
        fix_north_m=north,
        fix_quality=quality,
        fix_var_east_m2=var_east,
        fix_var_north_m2=var_north,
        fix_cov_m2=cov,
        fix_leading=_leading(quality, var_east + var_north),
        notices=tuple(notices),
        extras=_further_columns(
            ("encoder", wheels.t_s, wheels.extras),
            ("ahrs", heading.t_s, heading.extras),
            ("gnss", t_s[good_index], {name: values[good_index] for name, values in fixes.extras.items()}),
        ),
    )
    check_signs(aligned)
    return replace(aligned, notices=(*aligned.notices, *check_agreement(aligned)))


def _clocks_by_motion(
    run: Run, wheels: WheelStream, t_s: Floats, timed: Bools, clock: Clock, notices: list[Notice]
) -> tuple[Floats, Clock]:
    """The fixes' times moved onto the wheels' clock where the motion shows that they are clearly off it."""
    fixes, vehicle = run.fixes, run.vehicle
    rows = np.flatnonzero(timed & usable(fixes.quality))
    rows = rows[np.argsort(t_s[rows], kind="stable")]
    if rows.size < MIN_MEASUREMENTS:
        return t_s, clock
    var_east, var_north, _ = fix_covariance(
        fixes.quality[rows], fixes.sigma_east_m[rows], fixes.sigma_north_m[rows], fixes.cov_en_m2[rows]
    )
    leading = _leading(fixes.quality[rows], var_east + var_north)
    rows, sigma = rows[leading], float(np.sqrt(np.median((var_east + var_north)[leading]) / 2.0))
    plane = TangentPlane(float(fixes.lat_deg[rows[0]]), float(fixes.lon_deg[rows[0]]), 0.0)
    east, north = plane.to_east_north(fixes.lat_deg[rows], fixes.lon_deg[rows])
    every = max(1, round(WHEEL_RATE_HZ**-1 / max(float(np.median(np.diff(wheels.t_s))), 1e-6)))
    covered = (wheels.t_s >= run.heading.t_s[0]) & (wheels.t_s <= run.heading.t_s[-1])
    index = np.flatnonzero(covered)[::every]
    if index.size < MIN_MEASUREMENTS:
        return t_s, clock
    yaw = np.unwrap(yaw_to_enu(run.heading.yaw_rad, vehicle.convention))
    travel = vehicle.wheel_radius_m * 0.5 * (wheels.right_rad[index] + wheels.left_rad[index])
    path = wheel_path(wheels.t_s[index], travel, np.interp(wheels.t_s[index], run.heading.t_s, yaw), vehicle.track_m)
    span = (float(run.wheels.t_s[0]), float(run.wheels.t_s[-1]))
    found = clock_by_motion(path, Fixes(t_s[rows], east + 1j * north, sigma), span)
    if found is None:
        return t_s, clock
    notices += found.notices
    return found.moved(t_s), found.after(clock)


def _further_columns(*streams: tuple[str, Floats, Mapping[str, Floats]]) -> dict[str, Series]:
    """All streams' further columns that vary at all."""
    found: dict[str, Series] = {}
    for source, t_s, extras in streams:
        for name, values in extras.items():
            finite = np.isfinite(values) & np.isfinite(t_s)
            if finite.sum() >= MIN_MEASUREMENTS and np.ptp(values[finite]) > 0.0:
                found[f"{source}.{name}" if name in found else name] = Series(t_s[finite], values[finite])
    return found


def _from_first_heading(wheels: WheelStream, heading: HeadingStream) -> WheelStream:
    """The wheels from the last sample before the first heading on: nothing earlier says where the robot headed."""
    first = max(int(np.searchsorted(wheels.t_s, heading.t_s[0], side="right")) - 1, 0)
    if wheels.t_s.size - first < MIN_MEASUREMENTS:
        raise DataError(
            f"ahrs.csv begins at {heading.t_s[0]:.3f} s, and only {wheels.t_s.size - first} encoder samples follow: "
            "the streams must overlap for at least some seconds"
        )
    return WheelStream(
        wheels.t_s[first:],
        wheels.left_rad[first:],
        wheels.right_rad[first:],
        wheels.loose[first:],
        {name: values[first:] for name, values in wheels.extras.items()},
    )


def _inside(t_s: Floats, span: tuple[float, float], source: str, notices: list[Notice]) -> Bools:
    """Which times lie within the wheels' span; the others are counted."""
    inside = np.asarray((t_s >= span[0]) & (t_s <= span[1]))
    outside = int((np.isfinite(t_s) & ~inside).sum())
    if outside:
        notices.append(Notice(source, "measurements outside the time that wheels and heading share not used", outside))
    return inside


def _leading(quality: Ints, variance_m2: Floats) -> Bools:
    """Fixes of the quality with the largest sum of 1/σ²."""
    codes = np.unique(quality)
    information = [float((1.0 / variance_m2[quality == code]).sum()) for code in codes]
    return np.asarray(quality == codes[int(np.argmax(information))])
