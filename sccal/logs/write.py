"""Writing what the readers read: vehicle.toml, CSV tables and NMEA sentences. Used by the simulator and by tests."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.logs.streams import Vehicle

_ROWS_AT_ONCE = 20_000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_UNITS_PER_MINUTE = 10**8


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text so that a reader sees either the old file or the whole new one."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: Path, content: bytes) -> None:
    """Write bytes so that a reader sees either the old file or the whole new one."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_vehicle(path: Path, vehicle: Vehicle) -> None:
    """Write ``vehicle.toml``; ``vehicle.path`` is not used."""
    lines = [f"name = {json.dumps(vehicle.name, ensure_ascii=False)}"]
    if vehicle.ticks_per_rev is not None or vehicle.counter_bits is not None:
        lines.append("[encoder]")
    if vehicle.ticks_per_rev is not None:
        lines.append(f"ticks_per_rev = {_toml_number(vehicle.ticks_per_rev)}")
    if vehicle.counter_bits is not None:
        lines.append(f"counter_bits = {vehicle.counter_bits}")
    lines += [
        "[nominal]",
        f"wheel_radius_m = {_toml_number(vehicle.wheel_radius_m)}",
        f"track_m = {_toml_number(vehicle.track_m)}",
        "[ahrs]",
        f'convention = "{vehicle.convention}"',
    ]
    write_text(path, "\n".join(lines) + "\n")


def _toml_number(value: float) -> str:
    return str(int(value)) if value == int(value) and abs(value) < 2**53 else repr(float(value))


def write_table(path: Path, columns: Mapping[str, Floats | Ints], formats: Mapping[str, str]) -> None:
    """Write columns of equal length as CSV, each by its printf-like format ('%.4f', '%d'); NaN as an empty cell."""
    cells: list[list[object]] = []
    row_formats = []
    for name, column in columns.items():
        values = np.asarray(column)
        if values.dtype.kind == "f" and np.isnan(values).any():
            cells.append(["" if math.isnan(value) else formats[name] % value for value in values.tolist()])
            row_formats.append("%s")
        else:
            cells.append(values.tolist())
            row_formats.append(formats[name])
    row = ",".join(row_formats) + "\n"
    rows = list(zip(*cells, strict=True))
    parts = [",".join(columns) + "\n"]
    for start in range(0, len(rows), _ROWS_AT_ONCE):
        chunk = rows[start : start + _ROWS_AT_ONCE]
        parts.append((row * len(chunk)) % tuple(cell for cells_of_row in chunk for cell in cells_of_row))
    write_text(path, "".join(parts))


def checksum(body: str) -> str:
    """Two hex digits for the text between ``$`` and ``*``."""
    total = 0
    for byte in body.encode("ascii"):
        total ^= byte
    return f"{total:02X}"


def gga(
    utc_s: float,
    lat_deg: float,
    lon_deg: float,
    alt_m: float,
    quality: int,
    satellites: int,
    hdop: float,
    age_s: float | None = None,
) -> str:
    """A GGA sentence; ``alt_m`` above the ellipsoid (geoid separation 0); no position where ``quality`` is 0."""
    if quality == 0:
        return _sentence(f"GNGGA,{_clock(utc_s)},,,,,0,{satellites:02d},,,,,,,")
    age = "" if age_s is None or math.isnan(age_s) else f"{age_s:.1f}"
    where = f"{_latitude(lat_deg)},{_longitude(lon_deg)}"
    return _sentence(
        f"GNGGA,{_clock(utc_s)},{where},{quality},{satellites:02d},{hdop:.2f},{alt_m:.3f},M,0.000,M,{age},"
    )


def rmc(utc_s: float, lat_deg: float, lon_deg: float, speed_mps: float, course_deg: float, mode: str = "A") -> str:
    """An RMC sentence; ``course_deg`` clockwise from north; ``mode`` R, F, D, A, E or N."""
    status = "V" if mode == "N" else "A"
    date = _moment(utc_s).strftime("%d%m%y")
    where = f"{_latitude(lat_deg)},{_longitude(lon_deg)}"
    knots = speed_mps / 0.514444444444
    return _sentence(f"GNRMC,{_clock(utc_s)},{status},{where},{knots:.3f},{course_deg % 360:.2f},{date},,,{mode}")


def gst(utc_s: float, sigma_east_m: float, sigma_north_m: float) -> str:
    """A GST sentence with an error ellipse along north and east."""
    bearing = 0.0 if sigma_north_m >= sigma_east_m else 90.0
    major, minor = max(sigma_east_m, sigma_north_m), min(sigma_east_m, sigma_north_m)
    return _sentence(
        f"GNGST,{_clock(utc_s)},,{major:.4f},{minor:.4f},{bearing:.1f},{sigma_north_m:.4f},{sigma_east_m:.4f},"
    )


def zda(utc_s: float) -> str:
    """A ZDA sentence: time and date."""
    return _sentence(f"GNZDA,{_clock(utc_s)},{_moment(utc_s).strftime('%d,%m,%Y')},00,00")


def _sentence(body: str) -> str:
    return f"${body}*{checksum(body)}"


def _moment(utc_s: float) -> datetime:
    return _EPOCH + timedelta(milliseconds=10 * round(utc_s * 100))


def _clock(utc_s: float) -> str:
    hundredths = round(utc_s * 100) % 8_640_000
    seconds, hundredths = divmod(hundredths, 100)
    minutes, seconds = divmod(seconds, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours:02d}{minutes:02d}{seconds:02d}.{hundredths:02d}"


def _latitude(lat_deg: float) -> str:
    return f"{_packed(lat_deg, 2)},{'S' if lat_deg < 0 else 'N'}"


def _longitude(lon_deg: float) -> str:
    lon_deg = (lon_deg + 180) % 360 - 180 if abs(lon_deg) > 180 else lon_deg
    return f"{_packed(lon_deg, 3)},{'W' if lon_deg < 0 else 'E'}"


def _packed(angle_deg: float, digits: int) -> str:
    degrees, units = divmod(round(abs(angle_deg) * 60 * _UNITS_PER_MINUTE), 60 * _UNITS_PER_MINUTE)
    minutes, fraction = divmod(units, _UNITS_PER_MINUTE)
    return f"{degrees:0{digits}d}{minutes:02d}.{fraction:08d}"
