"""The epochs of an NMEA log: which sentences belong to which, where the antenna was, and when.

A sentence counts if its checksum is right, or if it has none and is whole. Sentences of one UTC time of day are one
epoch; those without a time belong to the epoch before them.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.degrade.layouts import (
    LAYOUTS,
    NOT_A_POSITION,
    READ_AS,
    SECOND_ANTENNA,
    Layout,
    layout_of,
)
from sccal.logs.decimals import Digits, read_digits
from sccal.logs.nmea.positions import stated_quality
from sccal.logs.nmea.sentences import Kind, Sentences

_DAY_S = 86400.0
_KEYS_PER_S = 1000
_NOT_STATED = -1
_RMC = next(code for code, layout in enumerate(LAYOUTS) if layout.name == "RMC")
CRC_DIGITS = 8


@dataclass(frozen=True)
class Holders:
    """The sentences of a piece of log that may hold a position, in file order; arrays (k,)."""

    row: Ints
    """Among all sentences of the piece."""
    code: Ints
    """Of its layout."""
    time_of_day_s: Floats
    lat_deg: Floats
    """NaN where there is no position."""
    lon_deg: Floats
    lat_digits: Ints
    """Digits of the field: 100 × before the dot + after it, negative without a dot."""
    lon_digits: Ints
    quality: Ints
    host_t_s: Floats
    with_crc: Bools
    """Ends with a CRC of 8 digits."""
    day: Floats
    """Days since 1970-01-01 by RMC; NaN elsewhere."""


@dataclass(frozen=True)
class Epochs:
    """The epochs of a log in the order of time; arrays (m,)."""

    epoch_s: Floats
    """Running time of day, UTC."""
    utc_s: Floats
    """Unix time; NaN where the log has no date."""
    host_t_s: Floats
    """Receive time; NaN where the log has none."""
    lat_deg: Floats
    """By the best sentence of the epoch; NaN where none has a position."""
    lon_deg: Floats
    quality: Ints
    """As in GGA; -1 where not stated."""
    read: Bools
    """Where the position comes from the kind of sentence that a reader would take in this log."""

    def at(self, time_of_day_s: Floats) -> Ints:
        """The epoch (k,) of each time of day; -1 where there is none."""
        keys = np.round(self.epoch_s % _DAY_S * _KEYS_PER_S).astype(np.int64)
        order = np.argsort(keys, kind="stable")
        wanted = np.round(np.nan_to_num(time_of_day_s, nan=-1.0) * _KEYS_PER_S).astype(np.int64)
        at = order[np.minimum(np.searchsorted(keys[order], wanted), keys.size - 1)]
        return np.where(keys[at] == wanted, at, -1)


def span(found: Sentences, rows: Ints, field: int) -> tuple[Ints, Ints]:
    """Where field ``field`` (from 1) of the sentences ``rows`` (k,) begins and ends; empty where there is none."""
    mark, stop = found.first_mark[rows] + (field - 1), found.stop[rows]
    short = found.fields[rows] < field
    mark = np.where(short, 0, mark)
    return np.where(short, stop, found.marks[mark] + 1), np.where(short, stop, found.marks[mark + 1])


def find_holders(found: Sentences, codes: Ints) -> Holders:
    """The sentences of a piece that count and may hold a position; ``codes`` (n,) are those of ``find_layouts``."""
    rows = np.flatnonzero((codes != NOT_A_POSITION) & (found.right_checksum | found.complete))
    codes = codes[rows]
    own = found.take(rows)
    with_crc = _with_right_crc(own, codes)
    fewest = np.array([layout.fewest for layout in LAYOUTS])[codes % SECOND_ANTENNA]
    whole = ~own.has_checksum & (own.fields >= fewest)
    use = np.flatnonzero(own.right_checksum | with_crc | whole)
    rows, codes, own, with_crc = rows[use], codes[use], own.take(use), with_crc[use]
    n = rows.size
    lat, lon, time_of_day, day = (np.full(n, np.nan) for _ in range(4))
    lat_digits, lon_digits = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    quality = np.full(n, _NOT_STATED, dtype=np.int64)
    for code in np.unique(codes).tolist():
        at = np.flatnonzero(codes == code)
        layout, part = layout_of(code), own if at.size == n else own.take(at)
        time_of_day[at] = time_of_day_s(part, layout.time)
        lat[at], lat_digits[at] = _angle(part, layout, layout.latitude, b"NS", 90.0)
        lon[at], lon_digits[at] = _angle(part, layout, layout.longitude, b"EW", 180.0)
        quality[at] = _quality(part, layout)
        if code == _RMC:
            packed = _field(part, 9).values
            year = packed % 100
            day[at] = days(packed // 10000, packed // 100 % 100, year + np.where(year >= 80, 1900, 2000))
    placed = np.isfinite(lat) & np.isfinite(lon)
    return Holders(
        row=rows,
        code=codes,
        time_of_day_s=time_of_day,
        lat_deg=np.where(placed, lat, np.nan),
        lon_deg=np.where(placed, lon, np.nan),
        lat_digits=lat_digits,
        lon_digits=lon_digits,
        quality=quality,
        host_t_s=own.host_t_s,
        with_crc=with_crc,
        day=day,
    )


def zda_days(found: Sentences) -> tuple[Floats, Floats]:
    """Times of day (k,) of the ZDA sentences of a piece, and the days since 1970-01-01 that they state."""
    zda = found.take(np.flatnonzero((found.kind == Kind.ZDA) & found.right_checksum))
    return time_of_day_s(zda, 1), days(_field(zda, 2).values, _field(zda, 3).values, _field(zda, 4).values)


def time_of_day_s(part: Sentences, field: int) -> Floats:
    """Seconds since midnight (k,) out of ``[yyyymmdd]hhmmss.ss``; NaN where the field is no time."""
    time = _field(part, field)
    unit = 10**time.places
    packed = time.mantissa % (1_000_000 * unit)
    hours, rest = packed // (10_000 * unit), packed % (10_000 * unit)
    minutes, seconds = rest // (100 * unit), (rest % (100 * unit)) / unit
    good = time.good & (time.mantissa >= 0) & (hours < 24) & (minutes < 60) & (seconds < 61) & (time.places <= 9)
    return np.where(good & ~time.negative, hours * 3600 + minutes * 60 + seconds, np.nan)


def days(day: Floats, month: Floats, year: Floats) -> Floats:
    """Days since 1970-01-01 (k,); NaN for dates that do not exist."""
    good = (day >= 1) & (day <= 31) & (month >= 1) & (month <= 12) & (year >= 1970) & (year < 2200)
    months = np.where(good, (np.nan_to_num(year) - 1970) * 12 + np.nan_to_num(month) - 1, 0).astype(np.int64)
    first = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    length = (months + 1).astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) - first
    return np.where(good & (day <= length), first + day - 1, np.nan)


def gathered(pieces: Sequence[Holders], zda: Sequence[tuple[Floats, Floats]]) -> tuple[Epochs, Ints]:
    """All epochs of a log, and the epoch of each holder of each piece, one after the other; -1 where it has none."""

    def all_of(name: str) -> Floats:
        return np.concatenate([np.empty(0), *(getattr(piece, name) for piece in pieces)])

    time_of_day, code = all_of("time_of_day_s"), all_of("code").astype(np.int64)
    lat, lon, quality, host = (all_of(name) for name in ("lat_deg", "lon_deg", "quality", "host_t_s"))
    timed = np.isfinite(time_of_day)
    running = np.unwrap(time_of_day[timed], period=_DAY_S)
    keys, which = np.unique(np.round(running * _KEYS_PER_S).astype(np.int64), return_inverse=True)
    epoch_of = np.full(time_of_day.size, -1, dtype=np.int64)
    epoch_of[timed] = which
    latest = np.maximum.accumulate(np.where(timed, np.arange(time_of_day.size), -1))
    epoch_of = np.where(latest >= 0, epoch_of[np.maximum(latest, 0)], which[0] if which.size else -1)

    usable = timed & np.isfinite(lat) & (code < SECOND_ANTENNA)
    with_fix = usable & (quality != 0)
    worth = np.where(with_fix, code, np.where(usable, code + 20, np.where(code < SECOND_ANTENNA, code + 40, 60)))
    rows = np.flatnonzero(timed)
    order = rows[np.lexsort((rows, worth[rows], epoch_of[rows]))]
    best = order[np.flatnonzero(np.diff(epoch_of[order], prepend=-1))]
    read_code = int(code[with_fix].min(initial=SECOND_ANTENNA))
    epoch_s = np.empty(keys.size)
    epoch_s[which] = running
    midnight_s = _midnight(
        np.concatenate([time_of_day, *(times for times, _ in zda)]),
        np.concatenate([all_of("day"), *(stated for _, stated in zda)]),
        running[0] if running.size else 0.0,
    )
    placed = usable[best]
    epochs = Epochs(
        epoch_s=epoch_s,
        utc_s=epoch_s + midnight_s,
        host_t_s=host[best],
        lat_deg=np.where(placed, lat[best], np.nan),
        lon_deg=np.where(placed, lon[best], np.nan),
        quality=quality[best].astype(np.int64),
        read=with_fix[best] & (code[best] == read_code),
    )
    return epochs, epoch_of


def _midnight(time_of_day: Floats, stated: Floats, start_s: float) -> float:
    """What to add to running times of day that begin at ``start_s``: the midnight that most dates agree with."""
    known = np.isfinite(stated) & np.isfinite(time_of_day)
    if not known.any():
        return np.nan
    since = (time_of_day[known] - start_s) % _DAY_S
    early = since > 0.75 * _DAY_S
    first_day = np.round((stated[known] * _DAY_S + time_of_day[known] - (start_s + since - early * _DAY_S)) / _DAY_S)
    values, counts = np.unique(first_day, return_counts=True)
    return float(values[counts.argmax()]) * _DAY_S


def _field(part: Sentences, field: int) -> Digits:
    return read_digits(part.data, *part.span(field))


def _angle(part: Sentences, layout: Layout, field: int, sides: bytes, limit_deg: float) -> tuple[Floats, Ints]:
    """Angles in degrees (k,), NaN where there is none, and the digits of their fields."""
    packed = _field(part, field)
    if layout.in_degrees:
        value = packed.values
        padded = (packed.whole > 1) & (packed.mantissa < 10 ** np.maximum(packed.whole + packed.places - 1, 0))
        whole = np.where(padded, packed.whole, 1)
    else:
        unit = 10**packed.places
        minutes = (packed.mantissa % (100 * unit)) / unit
        value = packed.mantissa // (100 * unit) + minutes / 60.0
        side = part.letter(field + 1)
        right = packed.good & ~packed.negative & (minutes < 60) & ((side == sides[0]) | (side == sides[1]))
        value = np.where(right, np.where(side == sides[1], -value, value), np.nan)
        whole = packed.whole
    digits = 100 * whole + packed.places
    return np.where(np.abs(value) <= limit_deg, value, np.nan), np.where(
        packed.dotted | (packed.places > 0), digits, -digits
    )


def _quality(part: Sentences, layout: Layout) -> Ints:
    """The GGA quality (k,) that the sentences state; -1 where they state none."""
    if layout.read_as is not None:
        return stated_quality(part, layout.read_as)
    begin, end = part.span(layout.quality)
    quality = np.full(begin.size, _NOT_STATED, dtype=np.int64)
    first = part.data[begin]
    first = np.where((first >= ord("a")) & (first <= ord("z")), first - 32, first)
    second = part.data[np.minimum(begin + 1, part.data.size - 1)] & 0xDF if layout.claim == "pubx" else first
    length = 2 if layout.claim == "pubx" else 1
    for text, code in READ_AS[layout.claim].items():
        same = (end - begin == length) & (first == ord(text[0]))
        if length == 2:
            same &= second & 0xDF == ord(text[1]) & 0xDF
        quality[same] = code
    if layout.status is not None:
        quality[part.letter(layout.status) != ord("A")] = 0
    return quality


def _with_right_crc(own: Sentences, codes: Ints) -> Bools:
    """Which sentences end with a right CRC-32 of 8 digits, as Unicore's receivers write after ``$KSXT``."""
    right = np.zeros(codes.size, dtype=np.bool_)
    ksxt = np.flatnonzero(np.array([layout.name == "KSXT" for layout in LAYOUTS])[codes % SECOND_ANTENNA])
    for row in ksxt[own.has_checksum[ksxt]].tolist():
        stop = int(own.stop[row])
        digits = own.data[stop + 1 : stop + 1 + CRC_DIGITS].tobytes()
        try:
            stated = int(digits, 16)
        except ValueError:
            continue
        right[row] = stated == crc_32(own.data[int(own.start[row]) + 1 : stop].tobytes())
    return right


def crc_32(text: bytes) -> int:
    """The CRC that starts from zero and is not inverted at its end (NovAtel, Unicore)."""
    return zlib.crc32(text, 0xFFFFFFFF) ^ 0xFFFFFFFF
