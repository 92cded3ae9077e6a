"""Known cases of tables: spreadsheets, plotting tools and other programs write them, and AHRS and wheels fill them."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from studies.arrays import gauss_markov, stream
from studies.field.files import (
    FIX_HEAD,
    Row,
    ahrs_head,
    ahrs_rows,
    encoder_head,
    encoder_rows,
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
from studies.field.known_clocks import base
from studies.field.wanted import ANY_LEVEL, Chapter, Truth, doubted, inspected, refused, right
from studies.field.world import ORIGIN, Log

QUALITY = Chapter("known", "quality codes")
TABLES = Chapter("known", "tables")
COUNTS = Chapter("known", "what the counts are")
YAW = Chapter("known", "what the yaw is")
NUMBERS = Chapter("known", "coordinates in tables")
CHAPTERS = (QUALITY, TABLES, COUNTS, YAW, NUMBERS)

CODES = (
    r"(quality codes?|codes? of (the )?quality|fix_quality [^.;]{0,40}(unknown|contradict|scatter|better|worse|words)|"
    r"RTKLIB|vocabular|RTK_FIXED|in words|(says|called) .{0,60}scatters)"
)


def unaided(log: Log, number: int) -> bool:
    """Whether a fix belongs to the two stretches, 40 % in all, in which the receiver had no corrections."""
    share = number / log.fix_t.size
    return 0.27 < share < 0.53 or 0.73 < share < 0.87


def wandering(log: Log, seed: int, sigma_m: float, tau_s: float = 100.0) -> list[tuple[float, float]]:
    """A slow error of unaided fixes in degrees of latitude and longitude, for every fix."""
    rng, step_s = stream(seed, "unaided fixes"), float(log.fix_t[1] - log.fix_t[0])
    east, north = (gauss_markov(rng.standard_normal(log.fix_t.size), step_s, sigma_m, tau_s) for _ in range(2))
    metres = 111_200.0
    scale = metres * math.cos(math.radians(ORIGIN.lat_deg))
    return list(zip((north / metres).tolist(), (east / scale).tolist(), strict=True))


def coded(good: str, other: str, sigma_m: float, column: str = "fix_quality") -> Callable[[Path], Truth]:
    """Fixes of one centimetre with one code, and wandering ones with another."""

    def build(folder: Path) -> Truth:
        log = base()
        without_fixes(folder, log)
        errors = wandering(log, 7, sigma_m)

        def row(number: int, t: float, lat: float, lon: float) -> Row:
            off, code = (errors[number], other) if unaided(log, number) else ((0.0, 0.0), good)
            return [f"{t:.4f}", f"{lat + off[0]:.9f}", f"{lon + off[1]:.9f}", code]

        write_fixes(folder, [*FIX_HEAD[:3], column], row, log)
        return Truth.of(log)

    return build


CODE_WAYS = (right(2.0, ANY_LEVEL), doubted(CODES), refused(CODES))
QUALITY.add("quality-rtklib", coded("1", "5", 0.7), *CODE_WAYS)
QUALITY.add("quality-words", coded("RTK_FIXED", "SINGLE", 2.0), *CODE_WAYS)
QUALITY.add("quality-gga", coded("4", "1", 0.7), right(2.0))

DEAD = r"(quality 6|dead.?reckon|estimated \(6\))"


@QUALITY.case("quality-6", refused(DEAD), doubted(DEAD))
def quality_6(folder: Path) -> Truth:
    """All fixes are called dead reckoning, as some receivers with inertial sensors do."""
    log = base()
    write_run(folder, log)
    said = [(t, resaid(text, dead_reckoned) if "GGA" in text else text) for t, text in nmea_lines(log)]
    write_lines(folder / "gnss.nmea", stamped(said))
    return Truth.of(log)


def dead_reckoned(fields: list[str]) -> list[str]:
    """A GGA of quality 6."""
    return [*fields[:6], "6", *fields[7:]]


def tables(
    change: Callable[[str], str] = str, comma: str = ",", first: str = "", head: Callable[[Row], Row] | None = None
) -> Callable[[Path], Truth]:
    """Wheels and heading as another program writes them: cells, separator, a first line, and header."""

    def build(folder: Path) -> Truth:
        log = base()
        write_run(folder, log)
        for name, top, found in (
            ("encoder.csv", encoder_head(log), encoder_rows(log)),
            ("ahrs.csv", ahrs_head(log), ahrs_rows(log)),
        ):
            rows = [[change(cell) for cell in row] for row in found]
            write_table(folder / name, head(top) if head else top, rows, comma, "\r\n")
            if first:
                path = folder / name
                path.write_bytes(first.encode() + b"\r\n" + path.read_bytes())
        return Truth.of(log)

    return build


TABLES.add("csv-decimal-comma", tables(lambda cell: cell.replace(".", ","), ";"), right(1.2), refused(r"decimal comma"))
TABLES.add("csv-sep-line", tables(comma=";", first="sep=;"), right(1.2))
TABLES.add("csv-upper", tables(head=lambda top: [name.upper() for name in top]), right(1.2))


@TABLES.case("csv-iso-time", right(1.2), refused(r"(\bISO|\bdates?\b|times? of (the )?day|clock time)"))
def iso_time(folder: Path) -> Truth:
    """Dates and times in the column of times."""
    log = base()
    write_run(folder, log)
    clock = lambda t: utc(t).strftime("%Y-%m-%dT%H:%M:%S.%fZ")  # noqa: E731
    write_table(folder / "encoder.csv", encoder_head(log), encoder_rows(log, clock))
    write_table(folder / "ahrs.csv", ahrs_head(log), ahrs_rows(log, clock))
    return Truth.of(log)


ONE_WHEEL = r"(rows? of (their|its) own|one wheel|own rows?|alternat|in turn|other (cell|wheel))"


@TABLES.case("csv-own-rows", right(1.5), refused(ONE_WHEEL))
def own_rows(folder: Path) -> Truth:
    """Left and right have rows of their own, and the other cell is empty."""
    log = base()
    write_run(folder, log)
    rows = []
    for t, left, right_ticks in encoder_rows(log):
        rows += [[t, left, ""], [f"{float(t) + 0.0004:.4f}", "", right_ticks]]
    write_table(folder / "encoder.csv", encoder_head(log), rows)
    return Truth.of(log)


@TABLES.case("nmea-utf16", right(1.2), refused(r"UTF-?16"))
def utf16(folder: Path) -> Truth:
    """The shell of Windows redirects into UTF-16."""
    log = base()
    write_run(folder, log)
    path = folder / "gnss.nmea"
    path.write_bytes(b"\xff\xfe" + path.read_text(encoding="utf-8").encode("utf-16-le"))
    return Truth.of(log)


@TABLES.case("names-case", right(1.2), refused(r"(?-i:Encoder\.csv)"))
def names_case(folder: Path) -> Truth:
    """Names of files in capitals, as copies made on Windows have them."""
    write_run(folder, base())
    for name in ("encoder.csv", "ahrs.csv", "gnss.nmea"):
        (folder / name).rename(folder / {"encoder.csv": "Encoder.csv"}.get(name, name.upper()))
    return Truth.of(base())


@TABLES.case("utf8-bom", right(1.2))
def utf8_bom(folder: Path) -> Truth:
    """A mark of the byte order before every file."""
    write_run(folder, base())
    for name in ("encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"):
        path = folder / name
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    return Truth.of(base())


NO_DIRECTION = (
    r"(no (sense|sign|direction)|without (a )?(sense|sign|direction)|unsigned|"
    r"(never|do not|does not|cannot) (go(es)? back|fall|decrease|count (back|down))|"
    r"(only|just) (count|rise|go|grow)|count(s|ers?)? up (only|whichever|in both)|lost? (its|their) (sign|direction))"
)


@COUNTS.case("wheels-only-up", refused(NO_DIRECTION), doubted(NO_DIRECTION))
def only_up(folder: Path) -> Truth:
    """Counters that rise whichever way the wheels turn."""
    log = base()
    write_run(folder, log)
    write_encoder_of(folder, log, lambda steps: [abs(step) for step in steps], total=True)
    return Truth.of(log)


def write_encoder_of(folder: Path, log: Log, change: Callable[[list[int]], list[int]], total: bool) -> None:
    """Wheels whose steps are changed, and added up again or not."""
    columns = []
    for counts in (log.left, log.right):
        steps = change([b - a for a, b in zip(counts.tolist()[:-1], counts.tolist()[1:], strict=True)])
        if total:
            running = 0
            steps = [running := running + step for step in steps]
        columns.append(steps)
    times = [row[0] for row in encoder_rows(log)][1:]
    rows = [[t, str(left), str(right_ticks)] for t, left, right_ticks in zip(times, *columns, strict=True)]
    write_table(folder / "encoder.csv", ["t", "left_ticks", "right_ticks"], rows)


INCREMENTS = r"(increment|not cumulative|since the (last|row before)|per row|differences)"


@COUNTS.case("wheels-increments", right(1.2), refused(INCREMENTS))
def increments(folder: Path) -> Truth:
    """Counts since the row before."""
    log = base()
    write_run(folder, log)
    write_encoder_of(folder, log, list, total=False)
    return Truth.of(log)


@COUNTS.case("wheels-rpm", right(3.0, ANY_LEVEL), refused(r"(rpm|speed|rate|revolutions)"))
def rpm(folder: Path) -> Truth:
    """Revolutions a minute in place of counts."""
    log = base()
    write_run(folder, log)
    to_rpm = 60.0 / log.robot.ticks_per_rev
    rows = [
        [row[0], *(f"{rate * to_rpm:.3f}" for rate in rates)]
        for row, rates in zip(encoder_rows(log)[1:], wheel_rates(log), strict=True)
    ]
    write_table(folder / "encoder.csv", ["t", "left_rpm", "right_rpm"], rows)
    return Truth.of(log)


def wheel_rates(log: Log) -> list[tuple[float, float]]:
    """Counts a second of the left and the right wheel, since the row before."""
    step_s = float(log.wheel_t[1] - log.wheel_t[0])
    pairs = list(zip(log.left.tolist(), log.right.tolist(), strict=True))
    return [((b[0] - a[0]) / step_s, (b[1] - a[1]) / step_s) for a, b in pairwise(pairs)]


def yaws(head: Row, row: Callable[[int, Row], Row]) -> Callable[[Path], Truth]:
    """An ahrs.csv made row by row of the plain one."""

    def build(folder: Path) -> Truth:
        log = base()
        write_run(folder, log)
        write_table(folder / "ahrs.csv", head, [row(number, found) for number, found in enumerate(ahrs_rows(log))])
        return Truth.of(log)

    return build


def zeroed(share: float) -> Callable[[int, Row], Row]:
    """Rows that read zero now and then."""
    lost = stream(3, "zeros of an AHRS").random(200_000) < share
    return lambda number, row: [row[0], "0.00"] if lost[number] else row


ZEROS = r"(exactly 0|0\.00|zeros?\b)"
SHIFTED = ("shifted in time, or frozen", "do not turn together")
YAW.add(
    "yaw-zeros-2pc", yaws(["t", "yaw_deg"], zeroed(0.02)), right(1.3), right(1.3, ANY_LEVEL, (ZEROS,)), never=SHIFTED
)
YAW.add("yaw-zeros-10pc", yaws(["t", "yaw_deg"], zeroed(0.1)), right(2.0, ANY_LEVEL), refused(ZEROS), never=SHIFTED)

HUNDREDTHS = r"(hundred|centi|0\.01|1/100|× ?100|factor of (about )?(100|9\d|10\d)|100 times)"
UNIT = r"(\bunits?\b|hundred|centi|radian|57\.\d|of a turn|times too|parts? of a degree)"
YAW.add(
    "yaw-centidegrees",
    yaws(["t", "yaw_deg"], lambda _, row: [row[0], f"{round(float(row[1]) % 360.0 * 100.0)}"]),
    right(1.2),
    refused(HUNDREDTHS),
)
YAW.add(
    "yaw-radians",
    yaws(["t", "yaw_deg"], lambda _, row: [row[0], f"{math.radians(float(row[1])):.5f}"]),
    right(1.2),
    refused(r"radian"),
    never=SHIFTED[:1],
)


def placed(
    row: Callable[[float, float], Row], head: tuple[str, str] = ("lat_deg", "lon_deg")
) -> Callable[[Path], Truth]:
    """A gnss.csv with the two coordinates in another notation."""

    def build(folder: Path) -> Truth:
        log = base()
        without_fixes(folder, log)
        write_fixes(folder, ["t", *head, "fix_quality"], lambda k, t, lat, lon: [f"{t:.4f}", *row(lat, lon), "4"], log)
        return Truth.of(log)

    return build


def ddmm(angle_deg: float) -> str:
    """Degrees and minutes in one number, as NMEA has it."""
    whole = int(angle_deg)
    return f"{whole * 100 + (angle_deg - whole) * 60.0:.7f}"


MIRRORED = r"(exchang|swap|latitude .{0,80}longitude|sign of the longitude|mirror)"
MINUTES = r"(minutes|ddmm|NMEA notation)"
NUMBERS.add(
    "places-exchanged", placed(lambda lat, lon: [f"{lon:.9f}", f"{lat:.9f}"]), refused(MIRRORED), doubted(MIRRORED)
)
NUMBERS.add(
    "places-1e7",
    placed(lambda lat, lon: [str(round(lat * 1e7)), str(round(lon * 1e7))]),
    right(1.5),
    refused(r"(1e-?7|10⁷|10\^7|10 ?000 ?000|ten million|scale|integers)"),
)
NUMBERS.add(
    "places-ddmm", placed(lambda lat, lon: [ddmm(lat), ddmm(lon)]), right(1.5), refused(MINUTES), doubted(MINUTES)
)


@NUMBERS.case(
    "metres-as-degrees",
    refused(r"(degree|metre|latitude|far|times as)"),
    asked=(inspected(exits=(0, 3)),),
    never=(r"\d\d,\d\d\d m/s", r"\d{5,} m/s"),
)
def metres(folder: Path) -> Truth:
    """Metres of a plane stand where latitudes should, and a part of a quaternion where yaw should."""
    log = base()
    without_fixes(folder, log)
    places = iter(zip(log.north_m.tolist(), log.east_m.tolist(), strict=True))

    def row(number: int, t: float, _lat: float, _lon: float) -> Row:
        north, east = next(places)
        return [f"{t:.4f}", f"{north:.4f}", f"{east:.4f}", "4"]

    write_fixes(folder, FIX_HEAD, row, log)
    halves = [[t, f"{math.sin(math.radians(float(yaw)) / 2.0):.5f}"] for t, yaw in ahrs_rows(log)]
    write_table(folder / "ahrs.csv", ["t", "yaw_deg"], halves)
    return Truth.of(log)
