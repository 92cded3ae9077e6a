"""Fixes out of messages: NavSatFix, GPSFix, LocationFix, NMEA sentences, or latitude and longitude at any path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.limits import HEIGHT_LIMIT_M, SIGMA_LIMIT_M
from sccal.logs.messages.topics import STAMPED, Messages
from sccal.logs.messages.wheels import of_messages
from sccal.logs.nmea import parse_nmea, parse_nmea_heading
from sccal.logs.nmea.kinds import LAYOUTS, READ_FOR_POSITIONS
from sccal.logs.place_units import in_ten_millionths
from sccal.logs.quality import RTK_FIXED_M, quality_of
from sccal.logs.streams import FixStream, HeadingStream, Notice
from sccal.logs.timeline import order_in_time

_SMALL_S = 1e8
_ONE_LINE = bytes.maketrans(b"\r\n", b"  ")


def fixes_of_positions(messages: Messages, path: str, source: str) -> tuple[FixStream, tuple[Notice, ...]]:
    """Fixes of a topic with latitude and longitude in degrees.

    Raises:
        DataError: no message holds a usable position.
    """
    scaled: list[Notice] = []
    messages = _in_degrees(_of_nav_pvt(messages), source, scaled)
    lat, lon = messages.column("latitude"), messages.column("longitude")
    none = messages.column("status") < 0
    unset = ~none & ~(np.isfinite(lat) & np.isfinite(lon))
    beyond = ~none & ~unset & ((np.abs(lat) > 90) | (np.abs(lon) > 360))
    origin = ~none & (lat == 0) & (lon == 0)
    notices = scaled
    for rows, what in (
        (none, "messages without a fix (status −1) dropped"),
        (unset, "messages without a position dropped"),
        (beyond, "messages with a latitude beyond 90 or a longitude beyond 360 degrees dropped"),
        (origin, "messages at latitude 0, longitude 0 dropped"),
    ):
        if rows.any():
            notices.append(Notice(source, what, int(rows.sum()), f"message {messages.number[rows][0]}"))
    keep: Bools = ~(none | unset | beyond | origin)
    if not keep.any():
        why = "; ".join(str(notice) for notice in notices)
        raise DataError(f"{path}: none of {lat.size} messages holds a usable position: {why}")
    messages = messages.keep(keep)
    order, order_notices = order_in_time(messages.t_s, messages.number, source)
    messages = messages.take(order)
    n = messages.t_s.size
    var_east, var_north = messages.column("cov_ee"), messages.column("cov_nn")
    stated = (var_east > 0) & (var_north > 0) & (messages.column("cov_type") != 0)
    sigma_east, sigma_north = (np.sqrt(np.where(stated, v, np.nan)) for v in (var_east, var_north))
    sigma_east, sigma_north = np.minimum(sigma_east, SIGMA_LIMIT_M), np.minimum(sigma_north, SIGMA_LIMIT_M)
    limit = sigma_east * sigma_north
    alt_m = messages.column("altitude")
    high = np.abs(alt_m) > HEIGHT_LIMIT_M
    if high.any():
        what = f"heights beyond {HEIGHT_LIMIT_M:g} m taken as empty"
        notices.append(Notice(source, what, int(high.sum()), f"message {messages.number[high][0]}", "warning"))
    stream = FixStream(
        host_t_s=messages.t_s,
        utc_s=np.full(n, np.nan),
        utc_has_date=False,
        lat_deg=messages.column("latitude"),
        lon_deg=_wrapped_longitude(messages.column("longitude")),
        alt_m=np.where(high | np.isinf(alt_m), np.nan, alt_m),
        quality=quality_of(messages.column("status"), np.maximum(sigma_east, sigma_north)),
        sigma_east_m=sigma_east,
        sigma_north_m=sigma_north,
        cov_en_m2=np.where(stated, np.clip(np.nan_to_num(messages.column("cov_en")), -limit, limit), 0.0),
    )
    return stream, of_messages((*notices, *order_notices))


def _of_nav_pvt(messages: Messages) -> Messages:
    """A u-blox NavPVT as a NavSatFix: heights and errors in mm, fix type 2, 3 or 4 with a valid flag, carrier in flags.

    Of its flags, bit 0 says that the fix holds, and bits 6 and 7 are 1 for float and 2 for fixed ambiguities (u-blox
    ZED-F9P interface description, UBX-NAV-PVT). Its error is a radius; 1/sqrt(2) of it is that of one axis.
    """
    if messages.kind != "NavPVT" or "accuracy" not in messages.values:
        return messages
    flags = np.nan_to_num(messages.column("flags")).astype(np.int64)
    kind = messages.column("fix_type")
    holds = (kind >= 2) & (kind <= 4) & ((flags & 1) == 1)
    carrier = (flags >> 6) & 3
    status = np.where(holds, np.where(carrier > 0, 2, np.where(flags & 2, 1, 0)), -1)
    variance = 0.5 * (1e-3 * messages.column("accuracy")) ** 2
    least = RTK_FIXED_M * 1.01
    variance = np.where(carrier == 1, np.maximum(variance, least**2), variance)
    values = {
        "latitude": messages.column("latitude"),
        "longitude": messages.column("longitude"),
        "altitude": 1e-3 * messages.column("altitude"),
        "status": status.astype(np.float64),
        **dict.fromkeys(("cov_ee", "cov_nn"), variance),
        "cov_type": np.full(status.size, 1.0),
    }
    return replace(messages, values=values)


def _in_degrees(messages: Messages, source: str, notices: list[Notice]) -> Messages:
    """Positions in ten-millionths of a degree, as u-blox and MAVLink have them, in degrees."""
    lat, lon = messages.column("latitude"), messages.column("longitude")
    known = np.isfinite(lat) & np.isfinite(lon) & (lat != 0)
    if not known.any() or not in_ten_millionths(lat[known], lon[known]):
        return messages
    what = "positions in whole numbers read as ten-millionths of a degree"
    notices.append(Notice(source, what, int(known.sum()), f"message {messages.number[0]}", "warning"))
    return replace(messages, values={**messages.values, "latitude": 1e-7 * lat, "longitude": 1e-7 * lon})


def lines_of_sentences(messages: Messages, places: int | None = None) -> bytes:
    """Sentences as lines of a gnss.nmea, each after its message's time to ``places`` decimals (None: enough of them).

    Of a log that sccal converted (``places`` given), sentences without a stamp had no receive time and get none.
    """
    stamped = messages.column(STAMPED) != 0 if places is not None else np.ones(messages.t_s.size, dtype=np.bool_)
    digits = 7 if places is None else places
    if places is None and messages.t_s.size and np.abs(messages.t_s).max() < _SMALL_S:
        digits = 9
    lines = (
        b"%s%s\n" % (b"%.*f " % (digits, t) if with_time else b"", text.strip().translate(_ONE_LINE))
        for t, with_time, text in zip(messages.t_s.tolist(), stamped.tolist(), messages.texts, strict=True)
    )
    return b"".join(lines)


def fixes_of_sentences(
    messages: Messages, path: str, source: str, places: int | None = None
) -> tuple[FixStream, tuple[Notice, ...]]:
    """Fixes of a topic of NMEA sentences; the messages' times are the receive times (see lines_of_sentences).

    Raises:
        DataError: no sentence, or no fix.
    """
    stream, notices = parse_nmea(lines_of_sentences(messages, places), source, path)
    return stream, of_messages(notices)


def heading_of_sentences(
    messages: Messages, path: str, source: str, places: int | None = None
) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """Headings of a topic of NMEA sentences.

    Raises:
        DataError: no sentence, or no heading.
    """
    stream, notices = parse_nmea_heading(lines_of_sentences(messages, places), source, path)
    return stream, of_messages(notices)


_POSITIONS = tuple(LAYOUTS[kind].name.rpartition(",")[2].encode() + b"," for kind in READ_FOR_POSITIONS)


_HEADINGS = tuple(
    f"{layout.name},".encode()
    for layout in LAYOUTS.values()
    if layout.heading is not None and layout.name != "HEADINGA"
)


def has_headings(messages: Messages) -> bool:
    """Whether a topic of sentences holds any that give a heading."""
    return any(name in text for text in messages.texts for name in _HEADINGS)


def has_positions(messages: Messages) -> bool:
    """Whether a topic of sentences holds any that give a position."""
    return any(name in text for text in messages.texts for name in _POSITIONS)


def _wrapped_longitude(lon_deg: Floats) -> Floats:
    return np.where(np.abs(lon_deg) > 180, (lon_deg + 180) % 360 - 180, lon_deg)
