"""One run with all its streams on the logging clock, in the tangent plane, and turned counter-clockwise from east."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from sccal.align.accuracy import QUALITY_NAMES, SIMULATOR_QUALITY, table_sigma_m, usable
from sccal.align.agreement import check_agreement
from sccal.align.antenna import antenna_by_path
from sccal.align.clock_motion import MotionClock
from sccal.align.clocks import require_overlap
from sccal.align.codes import by_scatter
from sccal.align.digits import OF_ROUNDING, step_of
from sccal.align.heading_clock import HeadingClock
from sccal.align.one_clock import (
    fixes_by_motion,
    heading_by_turning,
    path_along,
    told_together,
    yaw_to_enu,
)
from sccal.align.path import laid_out
from sccal.align.reference import (
    ReferenceFixes,
    in_order,
    in_plane,
    leading_fixes,
    on_host_clock,
    reference_fixes,
    rounding_steps_m,
)
from sccal.align.signs import check_signs
from sccal.align.smooth import without_white_noise
from sccal.align.standing import Spans, dither_rad, standing_spans
from sccal.arrays import Bools, Complexes, Floats, Ints
from sccal.errors import DataError
from sccal.geodesy import TangentPlane
from sccal.logs.names import AHRS_FILE, ENCODER_FILE
from sccal.logs.streams import Convention, HeadingStream, Notice, Run, Vehicle, WheelStream
from sccal.logs.windows import Window, windows_on_clock, within
from sccal.results.clock import Clock

__all__ = ["Aligned", "Moved", "Series", "align", "yaw_to_enu"]

MIN_MEASUREMENTS = 10
LONG_RUN_S = 2 * 86400.0
MOST_PAUSE_S = 5.0
"""Of the wheels' rows on average, in runs longer than LONG_RUN_S."""


MEDIAN_OF = 5
"""Fixes: two wrong ones together are common, three are a jump."""


@dataclass(frozen=True)
class Series:
    """A further column of the log: its finite values (k,) in the log's unit, and their times on the logging clock."""

    t_s: Floats
    values: Floats


@dataclass(frozen=True)
class Moved:
    """By how much a stream's times were moved to where it goes together with the wheels."""

    offset_s: float
    """Added to its stamps."""
    sigma_s: float


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
    """Nose up, at the heading's times, freed of white noise; None where the AHRS does not give it."""
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
    reference: ReferenceFixes | None = None
    """Fixes that judge and never teach; None where all fixes teach."""
    heading_source: str = AHRS_FILE
    """Where the heading comes from, for messages."""
    heading_convention: Convention | None = None
    """Of the source, where it has one of its own; None where vehicle.toml declares it."""
    yaw_floor_rad: float = 0.0
    """Standard deviation of the rounding of the AHRS reading: its error is no smaller, whatever repeats."""
    fix_floor_m: tuple[float, float] = (0.0, 0.0)
    """The same of the fixes, east and north. The variances hold it; a factor that scales them must not go below it."""
    moved: Mapping[str, Moved] = field(default_factory=dict)
    """By stream ("headings", "fixes"): what was moved although it had stamps of the logging clock."""

    @cached_property
    def steady_place_m(self) -> Complexes:
        """Medians of MEDIAN_OF neighbouring fixes (n,), east + i north: an outlier or two together move nothing."""

        def median(values: Floats) -> Floats:
            padded = np.pad(values, MEDIAN_OF // 2, mode="edge")
            return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, MEDIAN_OF), axis=1))

        return median(self.fix_east_m) + 1j * median(self.fix_north_m)

    @cached_property
    def antenna_m(self) -> tuple[float, float] | None:
        """Roughly how far ahead and to the left of the middle the antenna is; None where the log does not show it."""
        first, last = self.span_s
        inside = (self.fix_t_s >= first) & (self.fix_t_s <= last)
        t_s = self.fix_t_s[inside]
        path = np.interp(t_s, self.wheel_t_s, self.path_along_yaw)
        yaw = np.interp(t_s, self.heading_t_s, self.yaw_rad)
        return antenna_by_path(t_s, (self.fix_east_m + 1j * self.fix_north_m)[inside], path, yaw)

    @cached_property
    def standing_s(self) -> Spans:
        """Stretches of some seconds and more in which both wheels stand."""
        most_rad = dither_rad(self.vehicle.wheel_radius_m, self.vehicle.ticks_per_rev)
        return standing_spans(self.wheel_t_s, self.right_rad, self.left_rad, self.loose, most_rad)

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


def align(run: Run, withhold_s: Sequence[Window] = ()) -> Aligned:
    """Bring the streams of one run together; fixes inside the windows ``withhold_s`` judge and do not teach.

    Windows are in the log's own time, or from its start where they do not lie in it (see windows_on_clock).

    Raises DataError where clocks, amounts of data or signs make a calibration impossible, UsageError for windows
    outside the run.
    """
    try:
        aligned = _aligned(run, withhold_s)
    except DataError as error:
        raise DataError(_of_their_file(str(error), run)) from error
    return replace(aligned, notices=tuple(_told_of_their_file(one, run) for one in aligned.notices))


def _of_their_file(text: str, run: Run) -> str:
    """What is said of the contract's file of wheels, said of the one that they were read from."""
    return text.replace(ENCODER_FILE, run.wheels.source)


def _told_of_their_file(notice: Notice, run: Run) -> Notice:
    source, what, doubt = (_of_their_file(text, run) for text in (notice.source, notice.what, notice.doubt))
    return replace(notice, source=source, what=what, doubt=doubt)


def _aligned(run: Run, withhold_s: Sequence[Window]) -> Aligned:
    notices = list(run.notices)
    wheels, heading, fixes = run.wheels, run.heading, run.fixes
    whole = (float(wheels.t_s[0]), float(wheels.t_s[-1]))
    _require_dense(wheels.t_s, "encoder", MOST_PAUSE_S)
    if heading.utc_s is not None:
        fix_t_s, known, _, _ = on_host_clock(fixes, run.reference, whole)
        heading = _on_the_fixes_clock(heading, heading.utc_s, fixes.utc_s[known], fix_t_s[known])
    require_overlap(heading.t_s, whole, Clock("host", 0.0, 0.0, 0.0, 2), heading.source)
    read_rad = yaw_to_enu(heading.yaw_rad, heading.convention or run.vehicle.convention)
    yaw = np.unwrap(read_rad)
    turned = heading_by_turning(run, heading, yaw)
    notices += turned.notices
    heading = replace(heading, t_s=turned.moved(heading.t_s))
    wheels = _from_first_heading(wheels, heading)
    span = (float(wheels.t_s[0]), float(wheels.t_s[-1]))

    t_s, timed, clock, before_t_s = on_host_clock(fixes, run.reference, span, notices)
    if not timed.any():
        raise DataError("gnss: no fix has a usable time")
    _require_dense(t_s[timed], "gnss", 12 * MOST_PAUSE_S)
    one_clock = run.heading.utc_s is not None
    if one_clock:
        t_s, before_t_s, clock = turned.moved(t_s), turned.moved(before_t_s), turned.after(clock)
    # A receiver without receive times gives no path on the wheels' clock to compare its fixes with.
    agreed = one_clock and (turned.offset_s != 0.0 or not np.isfinite(fixes.host_t_s).any())
    path = path_along(heading.t_s, yaw, wheels, run.vehicle)
    unseen = clock.source == "utc" and not one_clock
    compared = fixes_by_motion(fixes, path, t_s, timed, whole, agreed, unseen)
    notices += compared.notices
    if (moved := compared.clock) is not None:
        t_s, before_t_s, clock = moved.moved(t_s), moved.moved(before_t_s), moved.after(clock)
        if one_clock:
            heading = replace(heading, t_s=moved.moved(heading.t_s))
            wheels = _from_first_heading(run.wheels, heading)
            span = (float(wheels.t_s[0]), float(wheels.t_s[-1]))
        else:
            notices += told_together(turned, moved)
    clock = replace(clock, offset_at_start_s=_offset_at_start_s(t_s, fixes.utc_s))
    require_overlap(t_s[timed], span, clock, "the fixes")

    timed &= ~compared.old
    coded = by_scatter(fixes, path, t_s, timed)
    fixes, timed, notices = coded.fixes, timed & ~coded.left_out, [*notices, *coded.notices]
    good = timed & usable(fixes.quality)
    unused = []
    for code in np.unique(fixes.quality[timed & ~good]):
        count = int((fixes.quality[timed & ~good] == code).sum())
        name = QUALITY_NAMES.get(int(code), "unknown")
        notices.append(Notice("gnss", f"fixes of quality {code} ({name}) not used", count))
        unused.append(f"{count} fixes of quality {code} ({name}) are not used")
    simulated = int((fixes.quality[good] == SIMULATOR_QUALITY).sum())
    if simulated:
        notices.append(Notice("gnss", "fixes say they come from a simulator (quality 8)", simulated, "", "warning"))
    good &= _inside(np.where(good, t_s, np.nan), span, "gnss", notices)
    received_s = np.where(np.isfinite(fixes.host_t_s), fixes.host_t_s, t_s)
    judges = good & within(received_s, windows_on_clock(withhold_s, whole))
    good_index = in_order(t_s, good & ~judges)
    if good_index.size < MIN_MEASUREMENTS:
        repeated = int(compared.old.sum())
        beside = f" (and {repeated} that repeat another's position while the wheels go on)" if repeated else ""
        advice = ", and that its positions change" if repeated else ""
        raise DataError(
            f"gnss: {good_index.size} usable fixes{beside} within the wheels' span of {span[1] - span[0]:.1f} s, "
            f"at least {MIN_MEASUREMENTS} are needed: {'; '.join([*unused, ''])}log longer, or check the receiver's "
            f"fix quality{advice}"
        )

    seen = _inside(heading.t_s, span, heading.source, notices)
    if int(seen.sum()) < MIN_MEASUREMENTS:
        raise DataError(
            f"{heading.source}: {int(seen.sum())} readings within the wheels' span of {span[1] - span[0]:.1f} s, "
            f"at least {MIN_MEASUREMENTS} are needed"
        )

    quality = fixes.quality[good_index]
    alt = fixes.alt_m[good_index]
    height = float(np.median(alt[np.isfinite(alt)])) if np.isfinite(alt).any() else 0.0
    origin = good_index[table_sigma_m(quality) <= table_sigma_m(quality).min()][0]
    plane = TangentPlane(float(fixes.lat_deg[origin]), float(fixes.lon_deg[origin]), round(height, 2))
    steps_m = rounding_steps_m(fixes, plane)
    placed = in_plane(fixes, t_s, good_index, plane, steps_m)
    withheld = [] if not judges.any() else [(fixes, np.where(judges, t_s, np.nan), judges)]
    if run.reference is not None:
        withheld.append((run.reference.fixes, before_t_s, run.reference.lost))

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
        yaw_rad=_from_first(yaw[seen], read_rad[seen]),
        yaw_sigma_rad=None if heading.yaw_sigma_rad is None else _without_gaps(heading.yaw_sigma_rad[seen]),
        pitch_rad=None if heading.pitch_rad is None else without_white_noise(heading.pitch_rad[seen]),
        roll_rad=None if heading.roll_rad is None else without_white_noise(heading.roll_rad[seen]),
        fix_t_s=t_s[good_index],
        fix_east_m=placed.east_m,
        fix_north_m=placed.north_m,
        fix_quality=quality,
        fix_var_east_m2=placed.var_east_m2,
        fix_var_north_m2=placed.var_north_m2,
        fix_cov_m2=placed.cov_m2,
        fix_leading=leading_fixes(placed),
        notices=tuple(notices),
        extras=_further_columns(
            ("encoder", wheels.t_s, wheels.extras),
            ("ahrs", heading.t_s, heading.extras),
            ("gnss", t_s[good_index], {name: values[good_index] for name, values in fixes.extras.items()}),
        ),
        reference=reference_fixes(withheld, span, plane),
        heading_source=heading.source,
        heading_convention=heading.convention,
        yaw_floor_rad=OF_ROUNDING * step_of(heading.yaw_rad),
        fix_floor_m=(OF_ROUNDING * steps_m[0], OF_ROUNDING * steps_m[1]),
        moved={} if one_clock else _moved(turned, None if unseen else compared.clock),
    )
    check_signs(aligned)
    return replace(aligned, notices=(*aligned.notices, *check_agreement(aligned)))


def _moved(heading: HeadingClock, fixes: MotionClock | None) -> dict[str, Moved]:
    found = {}
    if heading.offset_s != 0.0:
        found["headings"] = Moved(heading.offset_s, heading.sigma_s)
    if fixes is not None and fixes.fit is not None:
        found["fixes"] = Moved(fixes.fit.offset_s, fixes.fit.sigma_offset_s)
    return found


def _offset_at_start_s(t_s: Floats, utc_s: Floats) -> float | None:
    """Logging clock minus UTC at the first fix that has both."""
    both = np.flatnonzero(np.isfinite(t_s) & np.isfinite(utc_s))
    if both.size == 0:
        return None
    first = both[int(np.argmin(utc_s[both]))]
    return float(t_s[first] - utc_s[first])


def _from_first(yaw_rad: Floats, read_rad: Floats) -> Floats:
    """An unwrapped yaw (h,) that begins with the first reading (h,) as it was read."""
    turns = round(float(yaw_rad[0] - read_rad[0]) / (2.0 * np.pi))
    return yaw_rad - 2.0 * np.pi * turns if turns else yaw_rad


def _further_columns(*streams: tuple[str, Floats, Mapping[str, Floats]]) -> dict[str, Series]:
    """All streams' further columns that vary at all."""
    found: dict[str, Series] = {}
    for source, t_s, extras in streams:
        for name, values in extras.items():
            finite = np.isfinite(values) & np.isfinite(t_s)
            if finite.sum() >= MIN_MEASUREMENTS and np.ptp(values[finite]) > 0.0:
                found[f"{source}.{name}" if name in found else name] = Series(t_s[finite], values[finite])
    return found


def _on_the_fixes_clock(heading: HeadingStream, utc_s: Floats, fix_utc_s: Floats, fix_t_s: Floats) -> HeadingStream:
    """The heading with its epochs (h,) on the logging clock by the mapping that puts the fixes' epochs (k,) there."""
    if fix_utc_s.size == 0:
        return heading
    delay_s = np.interp(utc_s, fix_utc_s, fix_t_s - fix_utc_s)
    return replace(heading, t_s=utc_s + delay_s, utc_s=None)


def _from_first_heading(wheels: WheelStream, heading: HeadingStream) -> WheelStream:
    """The wheels from the last sample before the first heading on: nothing earlier says where the robot headed."""
    first = max(int(np.searchsorted(wheels.t_s, heading.t_s[0], side="right")) - 1, 0)
    if wheels.t_s.size - first < MIN_MEASUREMENTS:
        raise DataError(
            f"{heading.source} begins at {heading.t_s[0]:.3f} s, and only {wheels.t_s.size - first} encoder samples "
            "follow: the streams must overlap for at least some seconds"
        )
    return WheelStream(
        wheels.t_s[first:],
        wheels.left_rad[first:],
        wheels.right_rad[first:],
        wheels.loose[first:],
        {name: values[first:] for name, values in wheels.extras.items()},
    )


def _require_dense(t_s: Floats, source: str, most_pause_s: float) -> None:
    """Raise DataError where few rows are spread over many days: grids over time would be endless."""
    span_s = float(np.ptp(t_s)) if t_s.size else 0.0
    if span_s > max(LONG_RUN_S, most_pause_s * t_s.size):
        raise DataError(
            f"{source}: {t_s.size} rows from t = {t_s.min():.3f} to {t_s.max():.3f} s, which is one in "
            f"{span_s / t_s.size:.0f} s: t must be seconds, and a run one drive"
        )


def _without_gaps(sigma_rad: Floats) -> Floats | None:
    """Sigmas (h,) with the usual one where none is stated; None where none is stated anywhere."""
    stated = np.isfinite(sigma_rad)
    if not stated.any():
        return None
    return sigma_rad if stated.all() else np.where(stated, sigma_rad, np.median(sigma_rad[stated]))


def _inside(t_s: Floats, span: tuple[float, float], source: str, notices: list[Notice]) -> Bools:
    """Which times lie within the wheels' span; the others are counted."""
    inside = np.asarray((t_s >= span[0]) & (t_s <= span[1]))
    outside = int((np.isfinite(t_s) & ~inside).sum())
    if outside:
        notices.append(Notice(source, "measurements outside the time that wheels and heading share not used", outside))
    return inside
