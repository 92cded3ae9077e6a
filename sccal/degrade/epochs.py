"""The epochs of an NMEA log: which sentences belong to which, where the antenna was, and when.

A sentence counts if its checksum is right, or if it has none and is whole. Sentences of one UTC time of day are one
epoch; those without a time belong to the epoch before them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.decimals import read_digits
from sccal.logs.nmea.kinds import LAYOUTS, LONG, NO_FIX, NOT_STATED, PLACED, READ_FOR_POSITIONS, Kind, Position
from sccal.logs.nmea.positions import position_of
from sccal.logs.nmea.quality import stated_quality
from sccal.logs.nmea.sentences import Sentences, kinds_in
from sccal.logs.nmea.times import DAY_S, days_stated, epoch_key, times_of_day, unwrapped

_BEST_FIRST = (*READ_FOR_POSITIONS, Kind.GLL, Kind.PUBX, Kind.PASHR_POS)
"""Where an epoch has several, the first of these says where the fix was, and how good: that of the reader."""
_RANK = np.full(len(Kind), len(_BEST_FIRST), dtype=np.int64)
_RANK[list(_BEST_FIRST)] = np.arange(len(_BEST_FIRST))


@dataclass(frozen=True)
class Holders:
    """The sentences of a piece of log that may hold a position, in file order; arrays (k,)."""

    row: Ints
    """Among all sentences of the piece."""
    kind: Ints
    """Of Kind."""
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
    """Days since 1970-01-01 by RMC and long messages; NaN elsewhere."""


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
        keys = epoch_key(self.epoch_s % DAY_S)
        order = np.argsort(keys, kind="stable")
        wanted = epoch_key(time_of_day_s)
        at = order[np.minimum(np.searchsorted(keys[order], wanted), keys.size - 1)]
        return np.where(keys[at] == wanted, at, -1)


def find_holders(found: Sentences) -> Holders:
    """The sentences of a piece that count and may hold a position."""
    fewest = np.zeros(len(Kind), dtype=np.int64)
    fewest[list(LAYOUTS)] = [layout.fewest for layout in LAYOUTS.values()]
    whole = ~found.has_checksum & found.complete & (found.fields >= fewest[found.kind])
    rows = np.flatnonzero(kinds_in(found.kind, PLACED) & (found.right_checksum | whole))
    own = found.take(rows)
    n = rows.size
    lat, lon, day = (np.full(n, np.nan) for _ in range(3))
    lat_digits, lon_digits = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    quality = np.full(n, NOT_STATED, dtype=np.int64)
    for kind in (Kind(one) for one in np.unique(own.kind).tolist()):
        at = np.flatnonzero(own.kind == kind)
        fields, part = position_of(kind), own if at.size == n else own.take(at)
        lat[at], lat_digits[at] = _angle(part, fields, fields.latitude, b"NS", 90.0)
        lon[at], lon_digits[at] = _angle(part, fields, fields.longitude, b"EW", 180.0)
        quality[at] = stated_quality(part, fields)
        if kind in (Kind.RMC, *LONG):
            day[at] = _days(part, kind)
    placed = np.isfinite(lat) & np.isfinite(lon)
    return Holders(
        row=rows,
        kind=own.kind.astype(np.int64),
        time_of_day_s=times_of_day(own, PLACED),
        lat_deg=np.where(placed, lat, np.nan),
        lon_deg=np.where(placed, lon, np.nan),
        lat_digits=lat_digits,
        lon_digits=lon_digits,
        quality=quality,
        host_t_s=own.host_t_s,
        with_crc=own.long_checksum,
        day=day,
    )


def zda_days(found: Sentences) -> tuple[Floats, Floats]:
    """Times of day (k,) of the ZDA sentences of a piece, and the days since 1970-01-01 that they state."""
    zda = found.take(np.flatnonzero((found.kind == Kind.ZDA) & found.right_checksum))
    return times_of_day(zda, (Kind.ZDA,)), _days(zda, Kind.ZDA)


def _days(own: Sentences, kind: Kind) -> Floats:
    date = LAYOUTS[kind].date
    assert date is not None
    return days_stated(own, date)


def gathered(pieces: Sequence[Holders], zda: Sequence[tuple[Floats, Floats]]) -> tuple[Epochs, Ints]:
    """All epochs of a log, and the epoch of each holder of each piece, one after the other; -1 where it has none."""

    def all_of(name: str) -> Floats:
        return np.concatenate([np.empty(0), *(getattr(piece, name) for piece in pieces)])

    time_of_day, kind = all_of("time_of_day_s"), all_of("kind").astype(np.int64)
    lat, lon, quality, host = (all_of(name) for name in ("lat_deg", "lon_deg", "quality", "host_t_s"))
    timed = np.isfinite(time_of_day)
    running = unwrapped(time_of_day[timed])
    keys, which = np.unique(epoch_key(running), return_inverse=True)
    epoch_of = np.full(time_of_day.size, -1, dtype=np.int64)
    epoch_of[timed] = which
    latest = np.maximum.accumulate(np.where(timed, np.arange(time_of_day.size), -1))
    epoch_of = np.where(latest >= 0, epoch_of[np.maximum(latest, 0)], which[0] if which.size else -1)

    rank = _RANK[kind]
    first_antenna = rank < len(_BEST_FIRST)
    usable = timed & np.isfinite(lat) & first_antenna
    with_fix = usable & (quality != NO_FIX)
    worth = np.where(with_fix, rank, np.where(usable, rank + 20, np.where(first_antenna, rank + 40, 60)))
    rows = np.flatnonzero(timed)
    order = rows[np.lexsort((rows, worth[rows], epoch_of[rows]))]
    best = order[np.flatnonzero(np.diff(epoch_of[order], prepend=-1))]
    read_rank = int(rank[with_fix].min(initial=len(_BEST_FIRST)))
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
        read=with_fix[best] & (rank[best] == read_rank),
    )
    return epochs, epoch_of


def _midnight(time_of_day: Floats, stated: Floats, start_s: float) -> float:
    """What to add to running times of day that begin at ``start_s``: the midnight that most dates agree with."""
    known = np.isfinite(stated) & np.isfinite(time_of_day)
    if not known.any():
        return np.nan
    since = (time_of_day[known] - start_s) % DAY_S
    early = since > 0.75 * DAY_S
    first_day = np.round((stated[known] * DAY_S + time_of_day[known] - (start_s + since - early * DAY_S)) / DAY_S)
    values, counts = np.unique(first_day, return_counts=True)
    return float(values[counts.argmax()]) * DAY_S


def _angle(part: Sentences, fields: Position, field: int, sides: bytes, limit_deg: float) -> tuple[Floats, Ints]:
    """Angles in degrees (k,), NaN where there is none, and the digits of their fields."""
    packed = read_digits(part.data, *part.span(field))
    if fields.in_degrees:
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
