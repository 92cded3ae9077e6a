"""What the facts mean for a calibration: what makes it impossible, what may spoil it, what would make it better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sccal.align.accuracy import QUALITY_NAMES, RTK_FIXED
from sccal.arrays import Floats
from sccal.filter.start import ODD_SCALE
from sccal.inspect.coverage import longest_step_s
from sccal.inspect.place import PlacedFixes
from sccal.inspect.read import LogStreams
from sccal.inspect.together import Together
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.streams import Notice
from sccal.results.inspection import CourseFacts, DriveFacts, Finding, FixFacts, Gap, StreamFacts, Weight, Witness

COVERED = 0.9
ODD_COURSE_RAD = np.radians(5.0)
MISSING = 0.05
SLOW_HZ = {"wheels": 8.0, "heading": 4.0, "fixes": 0.5}
COARSE_M = {RTK_FIXED: 0.02, 5: 0.2}
COARSE_DEG = 0.5
POOR_SHARE = 0.2
HARDLY_M = 1.0
FROZEN_S = 3.0
FROZEN_TRAVEL_M = 1.0
FROZEN_TURN_RAD = np.radians(10.0)
CLOCK_JITTER_S = 0.1
OLD_S = 20.0
_NAMED = {"wheels": "the wheels", "heading": "the heading", "fixes": "the fixes"}
_OTHER_SIGN = {
    "yaw against wheels": "the AHRS convention (enu or ned) is wrong, or left and right wheels are swapped",
    "course of the fixes against wheels": "left and right wheels are swapped, or both count backwards",
    "course of the fixes against yaw": f"the AHRS convention in {VEHICLE_FILE} (enu or ned) is wrong",
}


def findings(
    streams: LogStreams,
    together: Together,
    facts: Sequence[StreamFacts],
    fixes: FixFacts | None,
    drive: DriveFacts | None,
    seen: Sequence[Witness],
    course: CourseFacts | None,
    refusal: str,
    doubts: Sequence[Notice],
) -> tuple[Finding, ...]:
    """Weightiest first. ``refusal`` is the error of the alignment ("" where there is none), ``doubts`` its warnings."""
    found = [Finding("refused", one.why) for one in streams.unread]
    if refusal:
        found.append(Finding("refused", refusal))
    found += [Finding("warning", str(notice)) for notice in doubts if notice.severity == "warning" and notice.doubt]
    found += _of_scale(streams, seen)
    # The alignment names the wrong sign itself; where it was not asked, or stopped earlier, the witnesses do.
    if not refusal or together.apart:
        found += [wrong for witness in seen if (wrong := _of_sign(witness, streams.declared))]
    if not refusal:
        found += _of_course(course)
    if streams.unread:
        found += _apart(together)
    for one in facts:
        found += _of_stream(one, together.span_s[0])
    found += _frozen(together)
    found += _of_fixes(fixes, facts)
    found += _of_clock(together)
    found += _of_drive(drive)
    weight = {"refused": 0, "warning": 1, "note": 2}
    return tuple(sorted(found, key=lambda one: weight[one.weight]))


def _of_scale(streams: LogStreams, seen: Sequence[Witness]) -> Iterator[Finding]:
    if not streams.declared and streams.wheels is not None and streams.vehicle is not None:
        vehicle = streams.vehicle
        if vehicle.ticks_per_rev == 1.0:
            scale = f"{1e3 * 2 * np.pi * vehicle.wheel_radius_m:.4g} mm for each tick"
        elif vehicle.ticks_per_rev is not None:
            scale = f"ticks_per_rev of about {vehicle.ticks_per_rev:.0f} at the declared radius"
        else:
            scale = f"a wheel radius of about {vehicle.wheel_radius_m:.4g} m"
        track = ""
        if streams.track_known and vehicle.ticks_per_rev in (1.0, None):
            track = f", and the yaw a track of about {vehicle.track_m:.3g} m"
        yield Finding("note", f"the wheels are scaled by the fixes here, which show {scale}{track}")
        return
    for one in seen:
        if one.what.startswith("distance") and one.clear and abs(one.slope - 1.0) > ODD_SCALE:
            yield Finding(
                "warning",
                f"the fixes move {one.slope:.3g} times as far as the wheels: check ticks_per_rev and wheel_radius_m in "
                f"{VEHICLE_FILE}",
            )


def _of_course(course: CourseFacts | None) -> Iterator[Finding]:
    if course is None or course.spread_rad < max(ODD_COURSE_RAD, 2.0 * course.expected_rad):
        return
    yield Finding(
        "warning",
        f"on {course.legs} straight legs the yaw differs from the course of the fixes by "
        f"{np.degrees(course.spread_rad):.0f}° (1σ) beside a constant offset: iron near the compass, "
        "a clock that is off, or an AHRS that wanders; `sccal diagnose` tells which",
    )


def _of_sign(witness: Witness, declared: bool) -> Finding | None:
    if not witness.clear or witness.slope >= 0.0 or witness.what not in _OTHER_SIGN:
        return None
    first, _, second = witness.what.partition(" against ")
    advice = _OTHER_SIGN[witness.what]
    if not declared and "yaw" in witness.what:
        advice = "taken as enu here, so declare ned, unless left and right wheels are swapped"
    return Finding(
        "warning",
        f"the {first} turns against the {second} (slope {witness.slope:+.2f}, correlation {witness.correlation:+.2f}): "
        f"{advice}",
    )


def _apart(together: Together) -> Iterator[Finding]:
    first, last = together.span_s
    for name in together.apart:
        t_s = together.times(name)
        yield Finding(
            "refused",
            f"{_NAMED[name]} ({t_s[0]:.3f} … {t_s[-1]:.3f} s) share no time with the rest ({first:.3f} … "
            f"{last:.3f} s): all streams must be on the logging computer's clock",
        )


def _of_stream(one: StreamFacts, origin_s: float) -> Iterator[Finding]:
    named = _NAMED[one.name]
    length = one.last_s - one.first_s
    if one.shares_time and one.covered < COVERED:
        covers = "covers" if one.name == "heading" else "cover"
        gap = f"; the longest gap: {_told(one.gaps[0], origin_s)}" if one.gaps else ""
        # A stream that begins late costs its part of the run, and nothing else.
        weight: Weight = "warning" if one.gap_total_s > (1.0 - COVERED) * length else "note"
        yield Finding(weight, f"{named} {covers} {100 * one.covered:.0f} % of the run only{gap}")
    elif one.gap_count:
        gaps = f"{one.gap_count} gaps, {one.gap_total_s:.1f} s in all, the longest" if one.gap_count > 1 else "a gap of"
        yield Finding(
            "note", f"{one.source}: {gaps} {_told(one.gaps[0], origin_s if one.shares_time else one.first_s)}"
        )
    if one.missing > MISSING:
        yield Finding(
            "note",
            f"{one.source}: {100 * one.missing:.0f} % of the rows that {one.rate_hz:.3g} a second would give are "
            "missing: the logger loses some",
        )
    if one.rate_hz < SLOW_HZ[one.name]:
        yield Finding(
            "note", f"{one.source}: {one.rate_hz:.2g} rows a second are few; log {SLOW_HZ[one.name]:g} or more"
        )
    if one.name == "heading" and np.isfinite(one.resolution) and one.resolution > COARSE_DEG:
        yield Finding(
            "warning", f"{one.source}: the yaw is logged in steps of {one.resolution:.2g}°; log more decimals"
        )


def _told(gap: Gap, origin_s: float) -> str:
    return f"{gap.length_s:.1f} s, {gap.start_s - origin_s:.1f} s after the start"


def _frozen(together: Together) -> Iterator[Finding]:
    """A sensor that repeats one value while the robot moves."""
    if not together.meets("wheels"):
        return
    t_s = together.wheel_t_s
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(together.travel_m)))))
    fixes: PlacedFixes | None = together.fixes if together.meets("fixes") else None
    if fixes is not None:
        start, end = _longest_same(fixes.t_s, fixes.east_m + 1j * fixes.north_m, t_s, way)
        moved = float(np.diff(np.interp((start, end), t_s, way))[0])
        if end - start > FROZEN_S and moved > max(FROZEN_TRAVEL_M, fixes.leg_m):
            yield Finding(
                "warning",
                f"the fixes repeat one position for {end - start:.1f} s, {start - together.span_s[0]:.1f} s after the "
                f"start, while the wheels move {moved:.1f} m: the receiver, or its logging, was stuck",
            )
    if together.meets("heading") and together.turn_rad.size:
        turned = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(together.turn_rad)))))
        start, end = _longest_same(together.yaw_t_s, together.yaw_rad, t_s, turned)
        by = float(np.diff(np.interp((start, end), t_s, turned))[0])
        if end - start > FROZEN_S and by > FROZEN_TURN_RAD:
            yield Finding(
                "warning",
                f"the yaw repeats one value for {end - start:.1f} s, {start - together.span_s[0]:.1f} s after the "
                f"start, while the wheels turn the robot by {np.degrees(by):.0f}°: the AHRS, or its logging, was stuck",
            )


def _longest_same(t_s: Floats, values: np.ndarray, motion_t_s: Floats, moved: Floats) -> tuple[float, float]:
    """Start and end of the stretch without a gap in which a value is repeated while the robot moves furthest."""
    if t_s.size < 2:
        return 0.0, 0.0
    new = np.flatnonzero((np.diff(values) != 0) | (np.diff(t_s) > longest_step_s(t_s))) + 1
    starts, ends = np.concatenate(([0], new)), np.concatenate((new, [t_s.size])) - 1
    by = np.interp(t_s[ends], motion_t_s, moved) - np.interp(t_s[starts], motion_t_s, moved)
    k = int(np.argmax(by))
    return float(t_s[starts[k]]), float(t_s[ends[k]])


def _of_fixes(fixes: FixFacts | None, facts: Sequence[StreamFacts]) -> Iterator[Finding]:
    if fixes is None or not fixes.qualities:
        return
    best = fixes.qualities[0]
    step = next((one.resolution for one in facts if one.name == "fixes"), np.nan)
    limit = COARSE_M.get(best.code)
    if limit is not None and np.isfinite(step) and step > limit:
        yield Finding(
            "warning",
            f"positions are logged in steps of {step:.2g} m, coarser than {best.name} is: log more decimals of "
            "latitude and longitude (8 of degrees, or 6 of minutes)",
        )
    total = sum(one.seconds for one in fixes.qualities)
    fixed = sum(one.seconds for one in fixes.qualities if one.code == RTK_FIXED)
    if 0.0 < fixed < (1.0 - POOR_SHARE) * total:
        yield Finding(
            "note",
            f"{QUALITY_NAMES[RTK_FIXED]} for {100 * fixed / total:.0f} % of the time; the map shows where it is lost",
        )
    if best.code in (1, 2, 9):
        yield Finding("note", f"fixes are {best.name}: metres, not centimetres; longer drives make up for some of it")
    if fixes.age_s is not None and fixes.age_s.high > OLD_S:
        yield Finding("note", f"corrections are up to {fixes.age_s.high:.0f} s old: look at the correction link")


def _of_clock(together: Together) -> Iterator[Finding]:
    clock = together.clock
    if clock is None:
        return
    if clock.source == "utc_mapped" and clock.jitter_s > CLOCK_JITTER_S:
        yield Finding(
            "note", f"NMEA lines arrive with {1e3 * clock.jitter_s:.0f} ms of jitter: stamp them nearer to the receiver"
        )
    if clock.knots > 2:
        yield Finding(
            "note", "the logging clock was being steered during the run: keep NTP still while logging, or use PTP"
        )


def _of_drive(drive: DriveFacts | None) -> Iterator[Finding]:
    if drive is None:
        return
    wheels_m, fixes_m = drive.distance_wheels_m, drive.distance_fixes_m
    if wheels_m is not None and fixes_m is not None and wheels_m < HARDLY_M < 0.1 * fixes_m:
        yield Finding(
            "warning",
            f"the wheels hardly turn ({wheels_m:.2f} m) while the fixes move {fixes_m:.0f} m: check the encoder "
            "and its columns",
        )
        return
    distance = wheels_m if wheels_m is not None else fixes_m
    if distance is not None and distance < HARDLY_M:
        yield Finding("warning", f"the robot hardly moves: {distance:.2f} m in {drive.duration_s:.0f} s")
