"""A log as a folder: rows and sentences first, so that a case can bend them, then text."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from studies.arrays import FloatArray, wrap_degrees
from studies.earth import gga, gst, place_text, rmc, sentence
from studies.field.world import ORIGIN, START_S, Log

Row = list[str]
Line = tuple[float, str]
"""When a sentence was received, by the logging clock (Unix seconds), and the sentence."""
Clock = Callable[[float], str]
"""A moment (Unix seconds) as text."""


def seconds(unix_s: float) -> str:
    """Plain seconds with four decimals."""
    return f"{unix_s:.4f}"


def utc(unix_s: float) -> dt.datetime:
    """A moment as a date and time in UTC."""
    return dt.datetime.fromtimestamp(unix_s, dt.UTC)


def write_vehicle(
    folder: Path, log: Log, convention: str = "enu", ticks: int | None = None, name: str = "field-robot"
) -> None:
    """The declaration; `ticks` where it declares another number than there are."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vehicle.toml").write_text(
        f'name = "{name}"\n[encoder]\nticks_per_rev = {ticks or log.robot.ticks_per_rev}\n[nominal]\n'
        f"wheel_radius_m = {log.robot.nominal_radius_m}\ntrack_m = {log.robot.nominal_track_m}\n"
        f'[ahrs]\nconvention = "{convention}"\n',
        encoding="utf-8",
    )


def encoder_rows(log: Log, clock: Clock = seconds) -> list[Row]:
    """Time and counts, left first, and any further columns."""
    extra = [[f"{value:.4f}" for value in column.tolist()] for column in log.columns.values()]
    counts = zip(log.wheel_t.tolist(), log.left.tolist(), log.right.tolist(), strict=True)
    return [
        [clock(START_S + t), str(left), str(right), *(column[number] for column in extra)]
        for number, (t, left, right) in enumerate(counts)
    ]


def encoder_head(log: Log) -> Row:
    """The header of these rows."""
    return ["t", "left_ticks", "right_ticks", *log.columns]


def ahrs_rows(log: Log, clock: Clock = seconds, convention: str = "enu") -> list[Row]:
    """Time and yaw in degrees, and pitch and roll where there are any."""
    yaw = 90.0 - log.yaw_deg if convention == "ned" else log.yaw_deg
    tilt = [] if log.tilt_deg is None else [[f"{value:.2f}" for value in one.tolist()] for one in log.tilt_deg]
    wrapped = np.round(wrap_degrees(yaw), 2).tolist()
    return [
        [clock(START_S + t), f"{angle:.2f}", *(one[number] for one in tilt)]
        for number, (t, angle) in enumerate(zip(log.yaw_t.tolist(), wrapped, strict=True))
    ]


def ahrs_head(log: Log) -> Row:
    """The header of these rows."""
    return ["t", "yaw_deg"] + ([] if log.tilt_deg is None else ["pitch_deg", "roll_deg"])


def write_table(path: Path, head: Row, rows: Iterable[Row], comma: str = ",", end: str = "\n") -> None:
    """Rows as text."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = end.join(comma.join(row) for row in ([head] if head else []) + list(rows)) + end
    path.write_bytes(text.encode("utf-8"))


def write_encoder(folder: Path, log: Log, clock: Clock = seconds) -> None:
    """The usual wheels."""
    write_table(folder / "encoder.csv", encoder_head(log), encoder_rows(log, clock))


def write_ahrs(folder: Path, log: Log, clock: Clock = seconds, convention: str = "enu") -> None:
    """The usual heading."""
    write_table(folder / "ahrs.csv", ahrs_head(log), ahrs_rows(log, clock, convention))


def epochs(log: Log, digits: int = 8) -> Iterable[tuple[int, float, float, str]]:
    """Of each fix: its number, its UTC, when it was received, and its place as text."""
    latitudes, longitudes = log.places
    for number, (t, received) in enumerate(zip(log.fix_t.tolist(), log.received_t.tolist(), strict=True)):
        place = place_text(float(latitudes[number]), float(longitudes[number]), digits)
        yield number, START_S + t, START_S + received, place


Extra = Callable[[int, float], list[str]]
"""Further sentences of an epoch: of its number and its UTC."""


def nmea_lines(log: Log, extra: Extra | None = None, sigma: Callable[[int], float] | None = None) -> list[Line]:
    """GGA of each fix, RMC once a second, GST where sigmas are stated, and what a case adds."""
    lines: list[Line] = []
    dated = -1
    for number, utc_s, received_s, place in epochs(log):
        quality = int(log.quality[number])
        said = [gga(utc_s, place, quality, ORIGIN.alt_m)]
        if sigma is not None:
            said.append(gst(utc_s, sigma(quality)))
        if int(utc_s + 1e-3) != dated:
            dated = int(utc_s + 1e-3)
            said.append(rmc(utc_s, place, quality))
        said += extra(number, utc_s) if extra is not None else []
        lines += [(received_s + 0.0005 * place_in_burst, text) for place_in_burst, text in enumerate(said)]
    return lines


def heading_of(log: Log) -> FloatArray:
    """What a receiver with two antennas says at each epoch, clockwise from true north."""
    return log.clockwise_deg(log.fix_t)


def stamped(lines: Sequence[Line]) -> list[str]:
    """Lines with plain receive times."""
    return [f"{t:.4f} {text}" for t, text in lines]


def bare(lines: Sequence[Line]) -> list[str]:
    """Lines without receive times."""
    return [text for _, text in lines]


def body_of(text: str) -> str:
    """A sentence without its dollar and checksum."""
    return text[1 : text.rindex("*")]


def resaid(text: str, change: Callable[[list[str]], list[str]]) -> str:
    """A sentence with changed fields and its new checksum."""
    return sentence(",".join(change(body_of(text).split(","))))


def write_lines(path: Path, lines: Iterable[str], end: str = "\r\n") -> None:
    """Lines as a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes((end.join(lines) + end).encode("utf-8"))


def write_run(folder: Path, log: Log, convention: str = "enu", name: str = "field-robot") -> None:
    """The plain folder: everything as the contract has it."""
    write_vehicle(folder, log, convention, name=name)
    write_encoder(folder, log)
    write_ahrs(folder, log, convention=convention)
    write_lines(folder / "gnss.nmea", stamped(nmea_lines(log)))


def without_fixes(folder: Path, log: Log) -> None:
    """The plain folder but for its fixes."""
    write_vehicle(folder, log)
    write_encoder(folder, log)
    write_ahrs(folder, log)


def write_fixes(
    folder: Path, head: Row, row: Callable[[int, float, float, float], Row], log: Log, comma: str = ","
) -> None:
    """A gnss.csv: each row of number, time (Unix), latitude and longitude; the logger knows the transport's delay."""
    latitudes, longitudes = (angles.tolist() for angles in log.places)
    times = (log.received_t - 0.02 + START_S).tolist()
    cells = [row(number, *found) for number, found in enumerate(zip(times, latitudes, longitudes, strict=True))]
    write_table(folder / "gnss.csv", head, cells, comma)


FIX_HEAD = ["t", "lat_deg", "lon_deg", "fix_quality"]


def fix_row(log: Log) -> Callable[[int, float, float, float], Row]:
    """The plain row of a gnss.csv."""
    return lambda number, t, lat, lon: [f"{t:.4f}", f"{lat:.9f}", f"{lon:.9f}", str(int(log.quality[number]))]
