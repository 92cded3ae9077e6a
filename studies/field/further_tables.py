"""Further cases of tables: codes of other makers, other dialects and names, other units, and nonsense."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from studies.arrays import gauss_markov, stream, wrap_degrees
from studies.field.drives import varied
from studies.field.files import (
    FIX_HEAD,
    Row,
    ahrs_head,
    ahrs_rows,
    encoder_head,
    encoder_rows,
    fix_row,
    nmea_lines,
    resaid,
    stamped,
    utc,
    without_fixes,
    write_fixes,
    write_lines,
    write_run,
    write_table,
)
from studies.field.further_robots import Bend, Drawn, case_of
from studies.field.known_headings import FROZEN
from studies.field.known_tables import (
    CODES,
    INCREMENTS,
    MIRRORED,
    ONE_WHEEL,
    UNIT,
    ZEROS,
    unaided,
    wandering,
    wheel_rates,
)
from studies.field.wanted import ANY_LEVEL, Chapter, Diagnosis, Truth, doubted, honest, refused, right
from studies.field.world import START_S, Log, record
from studies.vehicles import Robot

QUALITY = Chapter("further", "quality codes")
HONEST = Chapter("further", "honest logs")
TABLES = Chapter("further", "tables")
NAMES = Chapter("further", "names")
UNITS = Chapter("further", "units of the yaw")
PLACES = Chapter("further", "coordinates")
NONSENSE = Chapter("further", "nonsense")
CHAPTERS = (QUALITY, HONEST, TABLES, NAMES, UNITS, PLACES, NONSENSE)


def coded(good: str, other: str, column: str = "fix_quality") -> Bend:
    """A centimetre under one code, and wandering fixes of a drawn size under another."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        without_fixes(folder, log)
        errors = wandering(log, drawn.seed, float(drawn.rng.uniform(0.5, 1.5)))

        def row(number: int, t: float, lat: float, lon: float) -> Row:
            off, code = (errors[number], other) if unaided(log, number) else ((0.0, 0.0), good)
            return [f"{t:.4f}", f"{lat + off[0]:.9f}", f"{lon + off[1]:.9f}", code]

        write_fixes(folder, [*FIX_HEAD[:3], column], row, log)
        return Truth.of(log)

    return bend


CODE_WAYS = (right(2.5, ANY_LEVEL), doubted(CODES), refused(CODES))
for number, (name, good, other, column) in enumerate(
    (
        ("codes-novatel-words", "NARROW_INT", "SINGLE", "fix_quality"),
        ("codes-novatel-numbers", "50", "16", "fix_quality"),
        ("codes-trimble", "3", "1", "fix_quality"),
        ("codes-mavlink", "6", "3", "fix_quality"),
        ("codes-carrier-flag", "2", "0", "fix_quality"),
        ("codes-fix-float-words", "fix", "single", "fix_quality"),
        ("codes-column-q", "1", "5", "Q"),
        ("codes-nav-status", "2", "0", "status"),
    )
):
    QUALITY.add(name, case_of(3000 + number, coded(good, other, column)), *CODE_WAYS)


def always_float(drawn: Drawn, folder: Path) -> Truth:
    """A receiver that never fixes, says so, and wanders slowly by some decimetres."""
    log = replaced_noise(drawn, 0.02, 0.25, 80.0, 5)
    write_run(folder, log)
    return Truth.of(log)


def replaced_noise(drawn: Drawn, white_m: float, slow_m: float, slow_s: float, quality: int) -> Log:
    """The drawn log with other errors of the fixes."""
    return drawn.log(told=replace(drawn.told, fix_white_m=white_m, fix_slow=(slow_m, slow_s), quality=quality))


def float_in_turns(drawn: Drawn, folder: Path) -> Truth:
    """Fixed and float in turns, each as good as it says."""
    log = drawn.log()
    rng = stream(drawn.seed, "float in turns")
    east, north, quality = log.east_m.copy(), log.north_m.copy(), log.quality.copy()
    at = float(rng.uniform(25.0, 40.0))
    while at < log.motion.end_s - 40.0:
        within = (log.fix_t >= at) & (log.fix_t < at + float(rng.uniform(8.0, 20.0)))
        count = int(within.sum())
        for axis in (east, north):
            axis[within] += gauss_markov(rng.standard_normal(count), 1.0 / drawn.told.fix_hz, 0.3, 30.0)
        quality[within] = 5
        at += float(rng.uniform(35.0, 55.0))
    write_run(folder, replace(log, east_m=east, north_m=north, quality=quality))
    return Truth.of(log)


HONEST.add("float-always", case_of(3100, always_float, 240.0), honest(), diagnosis=Diagnosis(nothing=True))
HONEST.add(
    "float-in-turns", case_of(3101, float_in_turns, 240.0), right(2.5, ANY_LEVEL), diagnosis=Diagnosis(nothing=True)
)


def coarse(ticks: int, speed: float) -> Callable[[Path], Truth]:
    """Few counts in a turn, and a slow robot."""

    def build(folder: Path) -> Truth:
        drawn_robot = Robot(0.0655, 0.0648, 0.31, 0.065, 0.30, ticks)
        log = record(varied(240.0, 3102, speed, 0.3), 3102, drawn_robot)
        write_run(folder, log)
        return Truth.of(log)

    return build


HONEST.add("coarse-36-slow", coarse(36, 0.16), honest(), diagnosis=Diagnosis(nothing=True))


def dialect(
    comma: str = ",",
    change: Callable[[str], str] = str,
    encoder: Row | None = None,
    ahrs: Row | None = None,
    quoted: bool = False,
    bom: str = "utf-8",
) -> Bend:
    """Wheels and heading as other programs write them."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        for name, head, found in (
            ("encoder.csv", encoder or encoder_head(log), encoder_rows(log)),
            ("ahrs.csv", ahrs or ahrs_head(log), ahrs_rows(log)),
        ):
            cells = [head, *([change(cell) for cell in row] for row in found)]
            text = [[f'"{cell}"' if quoted else cell for cell in row] for row in cells]
            write_table(folder / name, [], text, comma, "\r\n")
            if bom != "utf-8":
                path = folder / name
                path.write_bytes(path.read_text(encoding="utf-8").encode(bom))
        return Truth.of(log)

    return bend


DECIMAL = lambda cell: cell.replace(".", ",")  # noqa: E731


def with_first_line(drawn: Drawn, folder: Path) -> Truth:
    """A spreadsheet's first line, and decimal commas below it."""
    truth = dialect(";", DECIMAL)(drawn, folder)
    for name in ("encoder.csv", "ahrs.csv"):
        path = folder / name
        path.write_bytes(b"sep=;\r\n" + path.read_bytes())
    return truth


TABLES.add(
    "table-comma-tab-quoted", case_of(3200, dialect("\t", DECIMAL, quoted=True)), right(2.0), refused(r"decimal comma")
)
TABLES.add("table-utf16", case_of(3201, dialect(bom="utf-16")), right(2.0), refused(r"UTF-?16"))
TABLES.add(
    "table-sep-tab-comma",
    case_of(3202, with_first_line),
    right(2.0),
    refused(r"decimal comma"),
)


def clock_times(form: str) -> Bend:
    """Times of the day, or local dates, in the column of times."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        clock = lambda t: utc(t).strftime(form)[:-3]  # noqa: E731
        write_table(folder / "encoder.csv", encoder_head(log), encoder_rows(log, clock))
        write_table(folder / "ahrs.csv", ahrs_head(log), ahrs_rows(log, clock))
        return Truth.of(log)

    return bend


TIMES = r"(\bISO|\bdates?\b|times? of (the )?day|clock time)"
TABLES.add("table-clock-times", case_of(3203, clock_times("%H:%M:%S.%f")), right(2.0), refused(TIMES))
TABLES.add("table-date-space-time", case_of(3204, clock_times("%Y-%m-%d %H:%M:%S.%f")), right(2.0), refused(TIMES))


def milliseconds(name: str) -> Bend:
    """Whole milliseconds since the beginning; all streams alike."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)

        def clock(t: float) -> str:
            return str(round((t - START_S) * 1000.0))

        write_table(folder / "encoder.csv", [name, *encoder_head(log)[1:]], encoder_rows(log, clock))
        write_table(folder / "ahrs.csv", [name, *ahrs_head(log)[1:]], ahrs_rows(log, clock))
        (folder / "gnss.nmea").unlink()
        plain = fix_row(log)
        write_fixes(folder, [name, *FIX_HEAD[1:]], lambda k, t, lat, lon: [clock(t), *plain(k, t, lat, lon)[1:]], log)
        return Truth.of(log)

    return bend


TABLES.add("table-t-in-ms", case_of(3205, milliseconds("t")), right(2.0), refused(r"(millisecond|\bms\b|seconds)"))
TABLES.add("table-named-ms", case_of(3206, milliseconds("time_ms")), right(2.0), refused(r"time_ms"))


def long_form(drawn: Drawn, folder: Path) -> Truth:
    """One wheel in each row, named in a column."""
    log = drawn.log()
    write_run(folder, log)
    rows = []
    for t, left, right_ticks in encoder_rows(log):
        rows += [[t, "left", left], [t, "right", right_ticks]]
    write_table(folder / "encoder.csv", ["t", "wheel", "ticks"], rows)
    return Truth.of(log)


TABLES.add(
    "table-wheel-per-row",
    case_of(3207, long_form),
    right(2.0),
    refused(r"(one wheel|wheel.{0,40}(row|column)|t,wheel,ticks)"),
)


def alternating(drawn: Drawn, folder: Path) -> Truth:
    """Rows with the left wheel only and rows with the right one only, at different times."""
    log = drawn.log()
    write_run(folder, log)
    found = encoder_rows(log)
    half_s = 0.5 / drawn.told.encoder_hz
    rows = []
    for t, left, right_ticks in found:
        rows += [[t, left, "nan"], [f"{float(t) + half_s:.4f}", "nan", right_ticks]]
    late = np.interp(log.wheel_t + half_s, log.wheel_t, log.right).astype(np.int64).tolist()
    rows = [[*row[:2], str(late[number // 2])] if number % 2 else row for number, row in enumerate(rows)]
    write_table(folder / "encoder.csv", encoder_head(log), rows)
    return Truth.of(log)


TABLES.add("table-wheels-alternate", case_of(3208, alternating), right(2.0), refused(ONE_WHEEL))


def wheel_column(head: Row, cells: Callable[[Drawn, Log, tuple[float, float]], Row], running: bool = False) -> Bend:
    """Wheels as rates or travel: of counts a second of left and right; added up where they run on."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        step_s = 1.0 / drawn.told.encoder_hz
        rows, total = [], (0.0, 0.0)
        for row, rates in zip(encoder_rows(log)[1:], wheel_rates(log), strict=True):
            total = (total[0] + rates[0] * step_s, total[1] + rates[1] * step_s)
            rows.append([row[0], *cells(drawn, log, total if running else rates)])
        write_table(folder / "encoder.csv", head, rows)
        return Truth.of(log)

    return bend


def per_count(log: Log) -> tuple[float, float]:
    """Radians, and metres by the nominal radius, of one count."""
    to_rad = 2.0 * math.pi / log.robot.ticks_per_rev
    return to_rad, to_rad * log.robot.nominal_radius_m


RATES = r"(speeds?|rates?|radps|rad/s|velocit|mm/s|m/s|mmps)"
TABLES.add(
    "wheels-radps",
    case_of(
        3209,
        wheel_column(["t", "left_radps", "right_radps"], lambda d, log, w: [f"{x * per_count(log)[0]:.5f}" for x in w]),
    ),
    right(4.0, ANY_LEVEL),
    refused(RATES),
)
TABLES.add(
    "wheels-mmps",
    case_of(
        3210,
        wheel_column(
            ["t", "left_mmps", "right_mmps"], lambda d, log, w: [f"{x * per_count(log)[1] * 1e3:.2f}" for x in w]
        ),
    ),
    right(4.0, ANY_LEVEL),
    refused(RATES),
)
TABLES.add(
    "wheels-metres",
    case_of(
        3211,
        wheel_column(["t", "left_m", "right_m"], lambda d, log, w: [f"{x * per_count(log)[1]:.5f}" for x in w], True),
    ),
    right(2.5),
    refused(r"(left_m|metres|distance)"),
)


def increments(drawn: Drawn, folder: Path) -> Truth:
    """Counts since the row before, under the names of cumulative ones."""
    log = drawn.log()
    write_run(folder, log)
    rows = [
        [row[0], str(left), str(right_ticks)]
        for row, left, right_ticks in zip(
            encoder_rows(log)[1:], np.diff(log.left).tolist(), np.diff(log.right).tolist(), strict=True
        )
    ]
    write_table(folder / "encoder.csv", encoder_head(log), rows)
    return Truth.of(log)


TABLES.add("wheels-increments-again", case_of(3212, increments), right(2.0), refused(INCREMENTS))

NAMED = (right(2.0), refused(r"(enc_left|encoder_left|timestamp|heading|latitude)"))
NAMES.add(
    "names-timestamp-enc",
    case_of(3300, dialect(encoder=["timestamp", "enc_left", "enc_right"], ahrs=["timestamp", "yaw"])),
    *NAMED,
)
NAMES.add(
    "names-spaces-units",
    case_of(3301, dialect(encoder=["Time [s]", "Left Ticks", "Right Ticks"], ahrs=["Time [s]", "Yaw [deg]"])),
    right(2.0),
    refused(r"Time \[s\]"),
)


def named_fixes(head: Row) -> Bend:
    """A gnss.csv with other usual names."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        without_fixes(folder, log)
        write_fixes(folder, head, fix_row(log), log)
        return Truth.of(log)

    return bend


NAMES.add("names-latitude", case_of(3302, named_fixes(["time", "latitude", "longitude", "quality"])), *NAMED)
NAMES.add(
    "names-lat-lng", case_of(3303, named_fixes(["t", "lat", "lng", "fix_quality"])), right(2.0), refused(r"\blng\b")
)


def foreign_names(drawn: Drawn, folder: Path) -> Truth:
    """Three good tables under other names of files."""
    log = drawn.log()
    without_fixes(folder, log)
    write_fixes(folder, FIX_HEAD, fix_row(log), log)
    for old, new in (("encoder.csv", "wheel_odometry.csv"), ("ahrs.csv", "imu.csv"), ("gnss.csv", "gps.csv")):
        (folder / old).rename(folder / new)
    return Truth.of(log)


NAMES.add("files-other-names", case_of(3304, foreign_names), right(2.0), refused(r"wheel_odometry\.csv"))


def only_gpx(drawn: Drawn, folder: Path) -> Truth:
    """A track of points stands where fixes should be."""
    log = drawn.log()
    without_fixes(folder, log)
    latitudes, longitudes = log.places
    points = [
        f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"><time>{utc(round(START_S + t, 3)).isoformat()}</time></trkpt>'
        for t, lat, lon in zip(log.fix_t.tolist(), latitudes.tolist(), longitudes.tolist(), strict=True)
    ]
    head = ['<?xml version="1.0"?>', '<gpx version="1.1" creator="logger"><trk><trkseg>']
    write_lines(folder / "track.gpx", [*head, *points, "</trkseg></trk></gpx>"])
    return Truth.of(log)


NAMES.add("files-gpx", case_of(3305, only_gpx), right(2.5), refused(r"track\.gpx"))


def fixes_called(quality: int) -> Bend:
    """All fixes are of one quality that no calibration wants."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        change = lambda fields: [*fields[:6], str(quality), *fields[7:]]  # noqa: E731
        lines = [(t, resaid(text, change)) for t, text in nmea_lines(log) if "GGA" in text]
        write_lines(folder / "gnss.nmea", stamped(lines))
        return Truth.of(log)

    return bend


NAMES.add("quality-7-manual", case_of(3306, fixes_called(7)), refused(r"(quality 7|manual)"))
NAMES.add(
    "quality-8-simulator",
    case_of(3307, fixes_called(8)),
    refused(r"(quality 8|simulat(or|ed|ion))"),
    doubted(r"simulat"),
    right(2.0, ANY_LEVEL, (r"simulat",)),
)
NAMES.add("quality-0-all", case_of(3308, fixes_called(0)), refused(r"(quality 0|no fix|without a fix|invalid)"))


def yaw_as(head: str, change: Callable[[float], str]) -> Bend:
    """Yaw in another unit."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        angles = wrap_degrees(log.yaw_deg).tolist()
        times = [row[0] for row in ahrs_rows(log)]
        write_table(folder / "ahrs.csv", ["t", head], [[t, change(yaw)] for t, yaw in zip(times, angles, strict=True)])
        return Truth.of(log)

    return bend


for number, (name, head, change) in enumerate(
    (
        ("yaw-tenths", "yaw_deg", lambda yaw: str(round((yaw % 360.0) * 10.0))),
        ("yaw-sixteenths", "yaw_deg", lambda yaw: str(round((yaw % 360.0) * 16.0))),
        ("yaw-degrees-named-rad", "yaw_rad", lambda yaw: f"{yaw:.2f}"),
        ("yaw-mils", "yaw_deg", lambda yaw: str(round((yaw % 360.0) * 6400.0 / 360.0))),
        ("yaw-turns", "yaw_deg", lambda yaw: f"{(yaw % 360.0) / 360.0:.5f}"),
        ("yaw-millirad", "yaw_deg", lambda yaw: str(round(math.radians(yaw) * 1000.0))),
        ("yaw-16-bit", "yaw_deg", lambda yaw: str(round((yaw % 360.0) * 65536.0 / 360.0) % 65536)),
    )
):
    UNITS.add(
        name,
        case_of(3400 + number, yaw_as(head, change)),
        right(2.0),
        refused(UNIT),
        never=(r"shifted in time, or frozen",),
    )


def with_sentinels(value: str, share: float) -> Bend:
    """The AHRS writes a number that is no angle where it has none."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        lost = stream(drawn.seed, "sentinels").random(log.yaw_t.size) < share
        rows = [[row[0], value] if lost[number] else row for number, row in enumerate(ahrs_rows(log))]
        write_table(folder / "ahrs.csv", ahrs_head(log), rows)
        return Truth.of(log)

    return bend


TURNS = (r"shifted in time, or frozen", r"do not turn together")
for number, (name, value, portion) in enumerate(
    (("yaw-minus-1", "-1.00", 0.03), ("yaw-999", "999.90", 0.03), ("yaw-zeros-6pc", "0.00", 0.06))
):
    UNITS.add(
        name, case_of(3410 + number, with_sentinels(value, portion)), right(2.0, ANY_LEVEL), refused(ZEROS), never=TURNS
    )


def placed(form: Callable[[float, float, float, float], tuple[str, str]]) -> Bend:
    """Coordinates in another notation: of latitude, longitude, east and north."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        without_fixes(folder, log)
        row = lambda k, t, lat, lon: [f"{t:.4f}", *form(lat, lon, float(log.east_m[k]), float(log.north_m[k])), "4"]  # noqa: E731
        write_fixes(folder, FIX_HEAD, row, log)
        return Truth.of(log)

    return bend


def packed(angle_deg: float) -> str:
    """Degrees, minutes and seconds in one decimal number."""
    whole, rest = divmod(abs(angle_deg), 1.0)
    minutes, rest = divmod(rest * 60.0, 1.0)
    return f"{math.copysign(whole + minutes / 100.0 + rest * 60.0 / 10000.0, angle_deg):.9f}"


NOTATION = (
    r"(minutes|seconds of arc|notation|dd\.?mm|sexagesimal|fixes' scale|scale of the fixes|"
    r"both radii and the track|same (factor|share))"
)
SCALED = r"(scale|unit|1e-?\d|10\^|10[⁵⁶⁷]|integer|micro|million)"
FAR = r"(far|times as|metres|degrees|latitude|scale|unit|beyond)"
PLACES.add(
    "place-packed-seconds",
    case_of(3500, placed(lambda lat, lon, e, n: (packed(lat), packed(lon)))),
    right(2.0),
    refused(NOTATION),
    doubted(NOTATION),
)
PLACES.add(
    "place-radians",
    case_of(3501, placed(lambda lat, lon, e, n: (f"{math.radians(lat):.12f}", f"{math.radians(lon):.12f}"))),
    right(2.0),
    refused(r"radian"),
    doubted(r"radian"),
)
PLACES.add(
    "place-microdegrees",
    case_of(3502, placed(lambda lat, lon, e, n: (str(round(lat * 1e6)), str(round(lon * 1e6))))),
    right(4.0, ANY_LEVEL),
    refused(SCALED),
)
PLACES.add(
    "place-utm",
    case_of(3503, placed(lambda lat, lon, e, n: (f"{5249650.0 + n:.3f}", f"{462260.0 + e:.3f}"))),
    right(2.0),
    refused(r"(UTM|metres|easting|northing|grid)"),
)
PLACES.add(
    "place-south-no-sign",
    case_of(3504, placed(lambda lat, lon, e, n: (f"{94.8 - lat:.9f}", f"{lon + 143.0:.9f}"))),
    refused(MIRRORED),
    doubted(MIRRORED),
)
PLACES.add(
    "place-local-metres",
    case_of(3505, placed(lambda lat, lon, e, n: (f"{n:.4f}", f"{e:.4f}"))),
    refused(FAR),
    never=(r"\d{5,} m/s", r"\d\d,\d\d\d m/s"),
)


def other_yaw(make: Callable[[Drawn, Log], list[float]]) -> Bend:
    """Something that is no heading in the column of the heading."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, log)
        times = [row[0] for row in ahrs_rows(log)]
        rows = [[t, f"{value:.3f}"] for t, value in zip(times, make(drawn, log), strict=True)]
        write_table(folder / "ahrs.csv", ["t", "yaw_deg"], rows)
        return Truth.of(log)

    return bend


NO_HEADING = (
    r"(no heading|not a heading|do(es)? not (turn|belong|agree|follow)|together|"
    r"frozen|stuck|wrong column|constant|noise|correlation)"
)
NONSENSE.add(
    "nonsense-voltage",
    case_of(
        3600,
        other_yaw(
            lambda d, log: (
                24.5 - 0.002 * log.yaw_t + 0.02 * stream(d.seed, "v").standard_normal(log.yaw_t.size)
            ).tolist()
        ),
    ),
    refused(NO_HEADING),
)
NONSENSE.add(
    "nonsense-yaw-rate",
    case_of(3601, other_yaw(lambda d, log: np.degrees(log.motion.at(log.motion.w_radps, log.yaw_t)).tolist())),
    refused(NO_HEADING),
)
NONSENSE.add("nonsense-frozen-yaw", case_of(3602, other_yaw(lambda d, log: [87.25] * log.yaw_t.size)), refused(FROZEN))


def other_drive(which: str) -> Bend:
    """One stream is of another drive at the same hour."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        other = replace(drawn, seed=drawn.seed + 50, pieces=tuple(varied(180.0, drawn.seed + 50))).log()
        mixed = (
            replace(
                log,
                east_m=np.interp(log.fix_t, other.fix_t, other.east_m),
                north_m=np.interp(log.fix_t, other.fix_t, other.north_m),
            )
            if which == "fixes"
            else replace(
                log,
                left=np.interp(log.wheel_t, other.wheel_t, other.left).astype(np.int64),
                right=np.interp(log.wheel_t, other.wheel_t, other.right).astype(np.int64),
            )
        )
        write_run(folder, mixed)
        return Truth.of(log)

    return bend


APART = r"(do not (move|turn|agree|belong|fit)|together|another drive|shifted|correlation)"
NONSENSE.add("nonsense-other-fixes", case_of(3603, other_drive("fixes")), refused(APART), doubted(APART))
NONSENSE.add("nonsense-other-wheels", case_of(3604, other_drive("wheels")), refused(APART))


def counting_time(drawn: Drawn, folder: Path) -> Truth:
    """Both columns of counts hold the controller's milliseconds."""
    log = drawn.log()
    ticks = np.round(log.wheel_t * 1000.0).astype(np.int64)
    write_run(folder, replace(log, left=ticks, right=ticks))
    return Truth.of(log)


NONSENSE.add("nonsense-counting-time", case_of(3605, counting_time), refused(r"(wheels?|counts?|ticks|together)"))


def noise_only(drawn: Drawn, folder: Path) -> Truth:
    """Fixes that scatter about one point while the robot drives."""
    log = drawn.log()
    rng = stream(drawn.seed, "scatter")
    size = log.fix_t.size
    write_run(folder, replace(log, east_m=30.0 * rng.standard_normal(size), north_m=30.0 * rng.standard_normal(size)))
    return Truth.of(log)


NONSENSE.add("nonsense-scattered-fixes", case_of(3606, noise_only), refused(), doubted())
