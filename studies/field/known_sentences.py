"""Known cases of receivers: sentences that are short, cut or void, headings in makers' sentences, other files."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from studies.arrays import stream
from studies.earth import clock_text, sentence
from studies.field.files import (
    Line,
    body_of,
    heading_of,
    nmea_lines,
    resaid,
    stamped,
    utc,
    without_fixes,
    write_encoder,
    write_lines,
    write_run,
    write_vehicle,
)
from studies.field.known_clocks import base
from studies.field.wanted import ANY_LEVEL, Chapter, Truth, refused, right
from studies.field.world import START_S, Log

SENTENCES = Chapter("known", "sentences")
HEADINGS = Chapter("known", "headings of makers")
FILES = Chapter("known", "other files")
CHAPTERS = (SENTENCES, HEADINGS, FILES)


def said(change: Callable[[Sequence[Line]], list[str]]) -> Callable[[Path], Truth]:
    """The plain log with its lines changed."""

    def build(folder: Path) -> Truth:
        log = base()
        write_run(folder, log)
        write_lines(folder / "gnss.nmea", change(nmea_lines(log)))
        return Truth.of(log)

    return build


def each(change: Callable[[int, float, str], list[str]]) -> Callable[[Sequence[Line]], list[str]]:
    """Lines made of each sentence with its number and its time."""
    return lambda lines: [
        f"{t:.4f} {text}" for number, (t, found) in enumerate(lines) for text in change(number, t, found)
    ]


def only_gga(change: Callable[[list[str]], list[str]]) -> Callable[[Path], Truth]:
    """GGA alone, with changed fields."""
    return said(each(lambda _, t, text: [resaid(text, change)] if "GGA" in text else []))


SENTENCES.add("gga-12-fields", only_gga(lambda fields: fields[:13]), right(1.3))
SENTENCES.add("gga-no-height", only_gga(lambda fields: [*fields[:9], "", "M", "", "M", *fields[13:]]), right(1.3))


@SENTENCES.case("hdt-cut", right(2.0, ("good",)))
def hdt_cut(folder: Path) -> Truth:
    """A reader with a time limit cuts some headings in two."""
    log = base()
    write_vehicle(folder, log)
    write_encoder(folder, log)
    rng, headings = stream(4, "cut lines"), heading_of(log)
    lines: list[str] = []
    fixes = 0
    for t, text in nmea_lines(log):
        lines.append(f"{t:.4f} {text}")
        if "GGA" not in text:
            continue
        heading = sentence(f"GNHDT,{headings[fixes]:.3f},T")
        fixes += 1
        at = int(rng.integers(8, 13)) if rng.random() < 0.15 else 0
        if at:
            lines += [f"{t + 0.001:.4f} {heading[:at]}", f"{t + 0.1:.4f} {heading[at:]}"]
        else:
            lines.append(f"{t + 0.001:.4f} {heading}")
    write_lines(folder / "gnss.nmea", lines)
    return Truth.of(log)


SENTENCES.add(
    "checksums-stripped",
    said(each(lambda _, t, text: [text[: text.rindex("*")]])),
    right(1.3),
)
SENTENCES.add(
    "checksums-all-wrong",
    said(each(lambda _, t, text: [text[:-2] + f"{int(text[-2:], 16) ^ 0x55:02X}"])),
    refused("checksum"),
    right(1.3, ANY_LEVEL, ("checksum",)),
)
SENTENCES.add(
    "rmc-void-1980",
    said(lambda lines: [f"{t:.4f} " + (resaid(text, void) if t - START_S < 20.0 else text) for t, text in lines]),
    right(1.5),
)


def void(fields: list[str]) -> list[str]:
    """A sentence of a receiver that has no fix yet and counts from its own zero."""
    if fields[0].endswith("RMC"):
        return [fields[0], fields[1], "V", "", "", "", "", "", "", "060180", "", "", "N"]
    return [fields[0], fields[1], "", "", "", "", "0", "00", "99.99", "", "M", "", "M", "", ""]


@SENTENCES.case("binary-between", right(1.3))
def binary_between(folder: Path) -> Truth:
    """Binary messages of receiver and corrections stand between the lines."""
    log = base()
    write_run(folder, log)
    rng = stream(5, "binary between")
    text = b""
    for number, line in enumerate(stamped(nmea_lines(log))):
        text += line.encode() + b"\r\n"
        if number % 5 == 0:
            text += b"\xb5\x62\x01\x07" + bytes(rng.integers(128, 256, 92).tolist())
        if number % 11 == 0:
            text += b"\xd3\x00\x13" + bytes(rng.integers(128, 256, 22).tolist())
    (folder / "gnss.nmea").write_bytes(text)
    return Truth.of(log)


@SENTENCES.case("gga-over-midnight", right(1.3))
def over_midnight(folder: Path) -> Truth:
    """Only GGA, over midnight, with receive times."""
    log = base()
    write_run(folder, log)
    shift_s = 12 * 3600.0 - 90.0
    lines = []
    for t, text in nmea_lines(log):
        if "GGA" in text:
            fields = body_of(text).split(",")
            at = START_S + shift_s + seconds_of_day(fields[1]) - 12 * 3600.0
            lines.append(f"{t:.4f} " + resaid(text, lambda found, at=at: [found[0], clock_text(at), *found[2:]]))  # type: ignore[misc]
    write_lines(folder / "gnss.nmea", lines)
    return Truth.of(log)


def seconds_of_day(text: str) -> float:
    """hhmmss.ss as seconds."""
    return int(text[:2]) * 3600.0 + int(text[2:4]) * 60.0 + float(text[4:])


def with_heading(
    form: Callable[[float, float], str], log_of: Callable[[], Log] = base, every: int = 1
) -> Callable[[Path], Truth]:
    """No ahrs.csv, and a heading sentence with each fix: of its UTC (Unix) and the heading, clockwise from north."""

    def build(folder: Path) -> Truth:
        log = log_of()
        write_vehicle(folder, log)
        write_encoder(folder, log)
        headings = heading_of(log)
        extra = lambda number, utc_s: [form(utc_s, float(headings[number]))] if number % every == 0 else []  # noqa: E731
        write_lines(folder / "gnss.nmea", stamped(nmea_lines(log, extra)))
        return Truth.of(log)

    return build


def week(utc_s: float) -> tuple[int, float]:
    """GPS week and seconds of it, eighteen seconds ahead of UTC."""
    since = utc_s + 18.0 - 315964800.0
    return int(since // 604800), since % 604800


def crc32(text: str) -> str:
    """The checksum of the long ASCII messages, which begin with a hash."""
    return f"#{text}*{zlib.crc32(text.encode(), 0xFFFFFFFF) ^ 0xFFFFFFFF:08x}"


def hpr(utc_s: float, heading: float) -> str:
    """A receiver with two antennas: heading, pitch, roll, quality, satellites, age, station."""
    return sentence(f"GNHPR,{clock_text(utc_s)},{heading:.2f},-00.40,000.00,4,21,0.00,0999")


def hrp(utc_s: float, heading: float) -> str:
    """Another: date, heading, roll, pitch, their sigmas, satellites, mode."""
    date = utc(utc_s).strftime("%d%m%y")
    return sentence(f"PSSN,HRP,{clock_text(utc_s)},{date},{heading:.3f},,-0.41,0.17,,0.25,19,2,0.0,E")


def uniheading(utc_s: float, heading: float) -> str:
    """A long message between the sentences, with its own time scale."""
    number, of_week = week(utc_s)
    return crc32(
        f"UNIHEADINGA,95,GPS,FINE,{number},{round(of_week * 1000.0)},0,0,18,10;SOL_COMPUTED,NARROW_INT,0.8021,"
        f'{heading:.4f},-0.4100,0.0000,0.1702,0.2520,"999",33,29,29,15,3,01,3,f3'
    )


for name, form in (("heading-hpr", hpr), ("heading-hrp", hrp), ("heading-uniheadinga", uniheading)):
    HEADINGS.add(name, with_heading(form), right(2.0))


@HEADINGS.case("hdt-zero-at-start", right(2.5, ANY_LEVEL))
def hdt_zero(folder: Path) -> Truth:
    """A heading of 0.000 for the first half minute, while the second antenna has no fix."""
    log = base()
    write_vehicle(folder, log)
    write_encoder(folder, log)
    headings = np.where(log.fix_t < 30.0, 0.0, heading_of(log))
    extra = lambda number, _: [sentence(f"GNHDT,{headings[number]:.3f},T")]  # noqa: E731
    write_lines(folder / "gnss.nmea", stamped(nmea_lines(log, extra)))
    return Truth.of(log)


@FILES.case("foreign-pos", right(1.5), refused(r"\.pos\b"))
def pos(folder: Path) -> Truth:
    """The result of a post-processor: GPS time, its own codes of quality, three sigmas."""
    without_fixes(folder, base())
    write_pos(folder / "gnss.pos", base())
    return Truth.of(base())


POS_REST = "height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"


def write_pos(path: Path, log: Log) -> None:
    """Such a file."""
    lines = [
        "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of satellites)",
        f"%  GPST   latitude(deg) longitude(deg) {POS_REST}",
    ]
    latitudes, longitudes = log.places
    for t, lat, lon in zip(log.fix_t.tolist(), latitudes.tolist(), longitudes.tolist(), strict=True):
        when = utc(round(START_S + t + 18.0, 3)).strftime("%Y/%m/%d %H:%M:%S.%f")[:-3]
        lines.append(
            f"{when} {lat:14.9f} {lon:14.9f}   450.1230   1  15   0.0120   0.0110   0.0240"
            "   0.0010   0.0000   0.0000   1.00   31.0"
        )
    write_lines(path, lines)


@FILES.case("foreign-gpsd", right(1.5), refused(r"(gpsd|TPV|JSON)"))
def gpsd(folder: Path) -> Truth:
    """The daemon's reports in place of sentences."""
    log = base()
    without_fixes(folder, log)
    write_lines(folder / "gnss.nmea", [json.dumps(report) for report in gpsd_reports(log)])
    return Truth.of(log)


def gpsd_reports(log: Log) -> list[dict[str, object]]:
    """One report of time, position and velocity for each fix."""
    latitudes, longitudes = log.places
    return [
        {
            "class": "TPV",
            "device": "/dev/ttyUSB0",
            "mode": 3,
            "status": 4,
            "time": utc(round(START_S + t, 3)).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z",
            "lat": round(lat, 9),
            "lon": round(lon, 9),
            "altHAE": 450.1,
            "eph": 0.015,
        }
        for t, lat, lon in zip(log.fix_t.tolist(), latitudes.tolist(), longitudes.tolist(), strict=True)
    ]


@FILES.case("autopilot-log", refused(r"(ArduPilot|flight\.bin|\.bin\b)"))
def autopilot(folder: Path) -> Truth:
    """Nothing but the log of an autopilot lies there."""
    folder.mkdir(parents=True)
    write_vehicle(folder, base())
    (folder / "flight.bin").write_bytes(b"\xa3\x95\x80\x80\x59FMT\x00BBnNZ" + bytes(range(256)) * 40)
    return Truth.of(base())
