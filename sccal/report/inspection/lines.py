"""What an inspection says, line by line: the same words in the terminal and on the page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sccal.inspect.drive import SECTORS, STANDSTILL_S
from sccal.report.sentences import clock_line
from sccal.results.inspection import (
    ColumnFacts,
    CourseFacts,
    DriveFacts,
    Excited,
    FixFacts,
    Inspection,
    Range,
    Shown,
    StandstillFacts,
    StreamFacts,
    StreamName,
    Witness,
)
from sccal.results.numbers import MISSING, duration, listed, one_line, plain, short

COLUMNS_TOLD = 12
LEAST_M = 0.1
"""Of driving backwards: less is a wheel that settles."""


def fixes_lines(f: FixFacts | None) -> tuple[str, ...]:
    """Qualities with their time, then what the receiver states."""
    if f is None:
        return ()
    total = sum(quality.seconds for quality in f.qualities) or 1.0
    shares = ", ".join(
        f"{quality.name} {plain(100.0 * quality.seconds / total, 3)} % ({_brief(quality.seconds)})"
        for quality in f.qualities
    )
    stated = "no sigmas stated"
    if f.stated_sigma_m is not None:
        stated = f"stated sigma {_range(f.stated_sigma_m, 'm')}"
        stated += "" if f.stated_share > 0.999 else f" for {plain(100.0 * f.stated_share, 2)} %"
    further = [
        stated,
        f"scatter from fix to fix {_length(f.white_m)}" if math.isfinite(f.white_m) else "",
        "" if f.satellites is None else f"satellites {_range(f.satellites)}",
        "" if f.hdop is None else f"HDOP {_range(f.hdop)}",
        "" if f.age_s is None else f"corrections {_range(f.age_s, 's')} old",
    ]
    return shares, ", ".join(column for column in further if column)


def clock_text(i: Inspection) -> str:
    """How the fixes came onto the logging clock."""
    if i.clock is None:
        return ""
    if i.clock.source == "utc":
        return "the NMEA lines have no receive times: the logging clock must be Unix time"
    return clock_line(i.clock)


def drive_lines(d: DriveFacts | None) -> tuple[str, ...]:
    """Distance and standing; speeds; turning."""
    if d is None:
        return ()
    ways = [
        f"{plain(way)} m by {who}"
        for way, who in ((d.distance_wheels_m, "the wheels"), (d.distance_fixes_m, "the fixes"))
        if way is not None
    ]
    back = "" if d.reversed_m is None or d.reversed_m < LEAST_M else f", {plain(d.reversed_m, 2)} m of it backwards"
    stops = f" ({_count(d.standstills, 'stop')} of {short(STANDSTILL_S)} s or more)" if d.standstills else ""
    turned = f"{_degrees(d.turned_left_rad)} left, {_degrees(d.turned_right_rad)} right"
    pieces = ", ".join(
        (_count(d.straights, "straight"), _count(d.arcs, "arc"), _count(d.pivots, "turn", " on the spot"))
    )
    return (
        f"{duration(d.duration_s)}, {' and '.join(ways)}{back}, standing {duration(d.standing_s)}{stops}",
        f"{plain(d.speed_median_mps, 2)} m/s while moving, up to {plain(d.speed_max_mps, 2)} m/s, speeding up by up to "
        f"{plain(d.acceleration_max_mps2, 2)} m/s², braking by up to {plain(d.braking_max_mps2, 2)} m/s²",
        f"{turned}, {plain(math.degrees(d.turn_rate_median_radps), 2)} deg/s while turning, up to "
        f"{plain(math.degrees(d.turn_rate_max_radps), 2)} deg/s; {d.headings} of {SECTORS} headings; {pieces}",
    )


def standstill_line(s: StandstillFacts | None) -> str:
    """Noise while the robot stands."""
    if s is None:
        return ""
    parts = [
        "" if s.fixes_m is None else f"fixes scatter by {_length(s.fixes_m)} per axis",
        "" if s.yaw_rad is None else f"yaw by {plain(math.degrees(s.yaw_rad), 2)} deg",
        ""
        if s.gyro_radps is None or s.gyro_bias_radps is None
        else f"gyro by {plain(math.degrees(s.gyro_radps), 2)} deg/s about {plain(math.degrees(s.gyro_bias_radps), 2)}",
    ]
    told = ", ".join(part for part in parts if part) or "nothing else was read"
    return f"in {_count(s.stops, 'stop')}, {duration(s.seconds)} in all: {told}"


def witness_line(w: Witness) -> str:
    """One pair of streams."""
    if not w.clear:
        return f"{w.what}: the drive does not tell"
    if w.what.startswith("course"):
        # Courses over windows are rounded off, so the slope is no figure to go by.
        way = "the same way" if w.slope > 0 else "opposite ways"
        return f"{w.what}: turn {way}, correlation {plain(w.correlation, 3)}"
    meaning = f"; {w.meaning}" if w.meaning else ""
    return f"{w.what}: slope {plain(w.slope, 3)}, correlation {plain(w.correlation, 3)}{meaning}"


def course_line(c: CourseFacts | None) -> str:
    """The yaw beside the course of the fixes."""
    if c is None:
        return ""
    return (
        f"yaw minus course of the fixes: {plain(math.degrees(c.offset_rad), 3)} deg, which is the heading offset, "
        f"spread {plain(math.degrees(c.spread_rad), 2)} deg over {_count(c.legs, 'straight leg')}"
    )


def column_lines(columns: Sequence[ColumnFacts]) -> tuple[str, ...]:
    """Further columns with their range."""
    lines = [
        f"{one_line(column.name)} ({column.source}) {_range(column.values)}"
        + ("" if column.varies else ", constant")
        + (f", {plain(100.0 * column.missing, 2)} % empty" if column.missing > 0.0 else "")
        for column in columns
    ]
    more = len(lines) - COLUMNS_TOLD
    return (*lines[:COLUMNS_TOLD], *((f"{more} more in the JSON",) if more > 0 else ()))


def excited_lines(i: Inspection) -> tuple[tuple[Shown, tuple[str, ...]], ...]:
    """What is shown well, in one line; what weakly or not, each with the drive that would show it."""
    by: dict[Shown, list[Excited]] = {"yes": [], "weak": [], "no": []}
    for one in i.excited:
        by[one.shown].append(one)
    yes = ", ".join(f"{one.name}{sigma_text(one)}" for one in by["yes"])
    return (
        ("yes", (yes,) if yes else ()),
        ("weak", _with_advice(by["weak"])),
        ("no", _with_advice(by["no"])),
    )


def _with_advice(excited: Sequence[Excited]) -> tuple[str, ...]:
    """Effects that ask for the same drive, and look like the same others, share a line."""
    lines: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for quantity in excited:
        lines.setdefault((quantity.advice, quantity.same_as), []).append(quantity.name)
    return tuple(
        f"{', '.join(names)}{f' (here the same as {listed(same)})' if same else ''}: {advice}"
        for (advice, same), names in lines.items()
    )


def sigma_text(one: Excited) -> str:
    """`` ±0.043 mm`` for the constants, whose sigma a user can judge; nothing for the rest."""
    if one.name == "radii" and one.sigmas:
        return f" ±{plain(1e3 * max(one.sigmas.values()), 2)} mm"
    if one.name == "track" and one.sigmas:
        return f" ±{plain(1e3 * one.sigmas['track_m'], 2)} mm"
    if one.name == "heading_offset" and one.sigmas:
        return f" ±{plain(one.sigmas['heading_offset_deg'], 2)} deg"
    return ""


def sigmas_text(one: Excited) -> str:
    """Every expected sigma with its unit: ``forward_m 0.003 m, left_m 0.002 m``."""
    units = {name: "" if unit == "1" else f" {unit}" for name, unit in one.units.items()}
    return ", ".join(f"{name} {plain(sigma, 2)}{units[name]}" for name, sigma in one.sigmas.items())


def stream_rows(i: Inspection) -> list[tuple[str, ...]]:
    """STREAM_HEADER's cells of every stream, those that could not be read included."""
    there = {stream.name: stream_cells(stream, i) for stream in i.streams}
    names: tuple[StreamName, ...] = ("wheels", "heading", "fixes")
    blank = ("-",) * (len(STREAM_HEADER) - 2)
    return [there.get(name, (name, "not read", *blank)) for name in names]


def stream_cells(s: StreamFacts, i: Inspection) -> tuple[str, ...]:
    """STREAM_HEADER's cells."""
    origin = _origin_s(i) if s.shares_time else 0.0
    gap = "-"
    if s.gaps:
        gap = f"{plain(s.gaps[0].length_s, 2)} s at {plain(s.gaps[0].start_s - origin, 3)} s"
        gap += f" (of {s.gap_count})" if s.gap_count > 1 else ""
    return (
        s.name,
        one_line(s.source),
        str(s.rows),
        plain(s.rate_hz, 3),
        _milliseconds(s.jitter_s),
        f"{_moment(s.first_s - origin)} … {_moment(s.last_s - origin)}" if s.shares_time else "on a time of its own",
        f"{_percent(s.covered)} %" if s.shares_time else "-",
        gap,
        _step(s),
    )


STREAM_HEADER = ("stream", "file", "rows", "rows/s", "jitter ms", "from … to (s)", "covers", "longest gap", "step")
"""Times count from the run's start."""


def run_line(i: Inspection) -> str:
    """Name, vehicle, and when on the logging clock it begins."""
    vehicle = "no vehicle.toml" if i.vehicle is None or not i.declared else one_line(i.vehicle.name)
    return f"{one_line(i.run)} ({vehicle}): {duration(i.span_s[1] - i.span_s[0])} from t = {i.span_s[0]:.3f} s"


def _origin_s(i: Inspection) -> float:
    return i.span_s[0]


def _moment(seconds: float) -> str:
    return f"{seconds + 0.0:.1f}".replace("-0.0", "0.0")


def _percent(share: float) -> str:
    """Never rounded up to all."""
    percent = 100.0 * share
    return (
        "100"
        if percent >= 99.95
        else f"{math.floor(10.0 * percent) / 10.0:.1f}"
        if percent > 99.0
        else f"{percent:.0f}"
    )


def _milliseconds(seconds: float) -> str:
    return plain(1e3 * seconds, 2) if seconds >= 5e-5 else "<0.1" if math.isfinite(seconds) else MISSING


def _step(s: StreamFacts) -> str:
    if not math.isfinite(s.resolution):
        return "-"
    return _length(s.resolution) if s.resolution_unit == "m" else f"{short(s.resolution, 2)} {s.resolution_unit}"


def _brief(seconds: float) -> str:
    return f"{plain(seconds, 2)} s" if seconds < 10.0 else duration(seconds)


def _length(metres: float) -> str:
    if metres < 1e-5:
        return "<0.01 mm"
    return f"{plain(1e3 * metres, 2)} mm" if metres < 0.1 else f"{plain(metres, 2)} m"


def _range(r: Range, unit: str = "") -> str:
    low, high = short(r.low, 3), short(r.high, 3)
    text = low if low == high else f"{low} … {high} (median {short(r.median, 3)})"
    return f"{text} {unit}".rstrip()


def _count(number: int, noun: str, rest: str = "") -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}{rest}"


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.0f} deg"
