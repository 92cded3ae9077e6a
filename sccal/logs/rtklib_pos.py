"""``*.pos``: the solutions of RTKLIB's post-processor and its kin, one row for each epoch.

A header line that begins with ``%`` names the columns: a time (GPST or UTC; as date and clock, or as week and seconds),
latitude and longitude (in degrees, or in degrees, minutes and seconds), height, Q and standard deviations.
Source: RTKLIB manual, appendix B.1, "Positioning solution file".
"""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.logs.compressed import bytes_of
from sccal.logs.limits import SIGMA_LIMIT_M
from sccal.logs.nmea.times import LEAP_SECONDS
from sccal.logs.quality_words import RTKLIB, mapped
from sccal.logs.streams import FixStream, Notice

_HEAD = re.compile(r"%\s*(?P<clock>GPST|UTC|JST)\b(?P<names>.*latitude.*longitude.*)", re.IGNORECASE)
_GPS_EPOCH_S = datetime(1980, 1, 6, tzinfo=UTC).timestamp()
_WEEK_S = 604800.0
_JAPAN_S = 9 * 3600.0
_TIME_CELLS = 2
_ADVICE = "let the post-processor write latitude and longitude (lat/lon/height), in UTC or GPS time, or log NMEA"


def read_pos(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    """The fixes of a solution file; their epochs are UTC, for it has no receive times.

    Raises:
        DataError: unreadable file, no header of a known form, or no row.
    """
    lines = bytes_of(path).decode(errors="replace").splitlines()
    head = next((found for line in lines if (found := _HEAD.match(line))), None)
    if head is None:
        raise DataError(f"{path}: no header line like '%  GPST  latitude(deg) longitude(deg) height(m) Q …': {_ADVICE}")
    names = [name.partition("(")[0].lower() for name in re.split(r"[\s,;]+", head["names"].strip())]
    apart = "'" in head["names"]
    rows, first_odd, odd = [], 0, 0
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("%"):
            continue
        row = _row(re.split(r"[\s,;]+", line.strip()), len(names), apart)
        if row is None:
            odd, first_odd = odd + 1, first_odd or number
        else:
            rows.append(row)
    if not rows:
        raise DataError(f"{path}: none of {odd} rows can be read, the first at line {first_odd}: {_ADVICE}")
    table = np.array(rows)
    shift_s = {"GPST": -LEAP_SECONDS, "UTC": 0.0, "JST": -_JAPAN_S}[head["clock"].upper()]
    columns = {name: table[:, 1 + k] for k, name in enumerate(names)}
    notices = [Notice(path.name, "rows of a solution file read as fixes, Q as RTKLIB's", len(rows))]
    if odd:
        notices.append(Notice(path.name, "rows that cannot be read dropped", odd, f"line {first_odd}"))
    return _fixes(np.round(table[:, 0] + shift_s, 4), columns), tuple(notices)


def _row(cells: list[str], wanted: int, apart: bool) -> list[float] | None:
    """Time (s since 1970, in the file's own clock) and the columns of a row; None where it cannot be read."""
    try:
        time_s = _time_s(*cells[:_TIME_CELLS])
        values = [float(cell) for cell in cells[_TIME_CELLS:]]
    except (ValueError, TypeError):
        return None
    if apart and len(values) > 6:
        south, west = (cells[_TIME_CELLS + k].startswith("-") for k in (0, 3))
        lat, lon = _degrees(values[0], values[1], values[2], south), _degrees(values[3], values[4], values[5], west)
        values = [lat, lon, *values[6:]]
    if len(values) < wanted or not np.isfinite([time_s, *values]).all():
        return None
    return [time_s, *values[:wanted]]


def _time_s(day: str, clock: str) -> float:
    if "/" not in day:
        return _GPS_EPOCH_S + int(day) * _WEEK_S + float(clock)
    year, month, date = (int(part) for part in day.split("/"))
    hours, minutes, seconds = clock.split(":")
    begins = datetime(year, month, date, tzinfo=UTC).timestamp()
    return begins + 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)


def _degrees(degrees: float, minutes: float, seconds: float, negative: bool) -> float:
    size = abs(degrees) + minutes / 60.0 + seconds / 3600.0
    return -size if negative else size


def _fixes(utc_s: Floats, columns: dict[str, Floats]) -> FixStream:
    order = np.argsort(utc_s, kind="stable")
    none = np.full(utc_s.size, np.nan)

    def column(name: str) -> Floats:
        return columns.get(name, none)[order]

    def sigma_m(name: str) -> Floats:
        given = column(name)
        return np.where(given > 0.0, np.minimum(given, SIGMA_LIMIT_M), np.nan)

    root = column("sdne")
    quality = mapped(column("q"), RTKLIB)
    extras: dict[str, Floats] = {name: column(name) for name in ("ns", "age", "ratio") if name in columns}
    return FixStream(
        host_t_s=none,
        utc_s=utc_s[order],
        utc_has_date=True,
        lat_deg=column("latitude"),
        lon_deg=column("longitude"),
        alt_m=column("height"),
        quality=np.where(np.isfinite(quality), quality, -1.0).astype(np.int64),
        sigma_east_m=sigma_m("sde"),
        sigma_north_m=sigma_m("sdn"),
        cov_en_m2=np.nan_to_num(np.sign(root) * root**2),
        extras=extras,
    )
