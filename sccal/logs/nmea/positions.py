"""Positions out of the sentences that state one: which kind is read, its qualities, heights and further columns.

Positions come from GGA; where a log has none that can be used, from GNS, PTNL,GGK, KSXT or RMC, in this order: by how
much they say about their quality.

All qualities are told in the numbers of GGA. Sources: NMEA 0183 version 4.10 (mode letters: A autonomous, D
differential, E estimated, F float RTK, M manual, N no fix, P precise, R real-time kinematic, S simulator; GNS has one
letter for each constellation, N where it is not used: the position is as good as the best that took part, and this is
what receivers then state in GGA); Trimble receiver help, "PTNL,GGK", and Spectra Geospatial, "GGKx" (own numbers, date
mmddyy, height above the ellipsoid after EHT); Unicore N4 commands reference, KSXT (longitude first, degrees, date and
time in one field, 0 none, 1 single, 2 float, 3 fixed, speeds in km/h).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.decimals import Bytes, parse_decimals
from sccal.logs.nmea.sentences import Kind, Sentences
from sccal.logs.nmea.times import Dated
from sccal.logs.streams import Notice

POSITION_KINDS = (Kind.GGA, Kind.GNS, Kind.GGK, Kind.KSXT, Kind.RMC)
KIND_NAMES = {Kind.AVR: "PTNL,AVR", Kind.GGK: "PTNL,GGK"} | {
    kind: kind.name for kind in Kind if kind not in (Kind.AVR, Kind.GGK)
}
"""As users write them."""

_MODES = b"NSMEAPDFR"
"""Mode letters, the better ones later."""
_MODE_QUALITY = np.array([0, 8, 7, 6, 1, 3, 2, 5, 4])
_GGK_QUALITY = np.array([0, 1, 5, 4, 2, 2, 5, 4, 5, 4, 5, 2, 5, 2, 5])
"""By Trimble's number: 0 none, 1 autonomous, 2 RTK float, 3 RTK fixed, 4 DGPS, 5 SBAS, 6/8 network RTK float, 7/9
network RTK fixed, 10 OmniSTAR HP, 11 OmniSTAR VBS, 12 location RTK, 13 beacon DGPS, 14 RTK global."""
_KSXT_QUALITY = np.array([0, 1, 5, 4])
_LEAST_SHARE = 0.1


@dataclass(frozen=True)
class Positions:
    """Usable positions of one kind; arrays of length m."""

    kind: Kind
    rows: Ints
    """Of the sentences."""
    lat_deg: Floats
    lon_deg: Floats
    quality: Ints

    def take(self, keep: Bools | Ints) -> Positions:
        """Only those that are kept."""
        return Positions(self.kind, self.rows[keep], self.lat_deg[keep], self.lon_deg[keep], self.quality[keep])


def best_kind(dated: Dated, source: str, notices: list[Notice]) -> Positions | None:
    """The first kind with usable positions, unless another one has ten times as many."""
    kind = dated.sentences.kind
    timed = np.isfinite(dated.running_s)
    rows_of = {one: np.flatnonzero((kind == one) & timed) for one in POSITION_KINDS}
    found: list[tuple[Positions, list[Notice]]] = []
    for i, one in enumerate(POSITION_KINDS):
        if rows_of[one].size == 0:
            continue
        own: list[Notice] = []
        found.append((_usable(dated.sentences, one, rows_of[one], source, own), own))
        others = max((rows_of[other].size for other in POSITION_KINDS[i + 1 :]), default=0)
        if found[-1][0].rows.size >= max(1.0, _LEAST_SHARE * others):
            break
    if not found:
        return None
    most = max(positions.rows.size for positions, _ in found)
    if most == 0:
        for _, own in found:
            notices += own
        return None
    best, own = next(one for one in found if one[0].rows.size >= max(1.0, _LEAST_SHARE * most))
    notices += own
    if best.kind != Kind.GGA:
        few = rows_of[Kind.GGA].size > 0
        why = f"only {found[0][0].rows.size} GGA can be used" if few else "there is no GGA"
        what = f"{KIND_NAMES[best.kind]} sentences read for their positions because {why}"
        serious = best.kind == Kind.RMC or few
        notices.append(Notice(source, what, int(best.rows.size), severity="warning" if serious else "info"))
    return best


def stated_quality(fixes: Sentences, kind: Kind) -> Ints:
    """The GGA quality (n,) that sentences of one of the POSITION_KINDS state; 0 no fix, -1 not stated."""
    return _QUALITIES[kind](fixes)


def _usable(sentences: Sentences, kind: Kind, rows: Ints, source: str, notices: list[Notice]) -> Positions:
    fixes = sentences.take(rows)
    quality = stated_quality(fixes, kind)
    if kind == Kind.KSXT:
        lat_deg, lon_deg, garbled = _plain_position(fixes)
    else:
        lat_deg, lon_deg, garbled = _position(fixes, 3 if kind in (Kind.RMC, Kind.GGK) else 2)
    none = quality == 0
    lost = ~none & np.isnan(lat_deg)
    for chosen, what in (
        (none, "sentences without a fix passed over"),
        (lost & ~garbled, "sentences with a fix but an empty position dropped"),
        (lost & garbled, "sentences with an impossible position dropped"),
    ):
        if chosen.any():
            notices.append(Notice(source, what, int(chosen.sum()), f"line {fixes.line[chosen][0]}"))
    positions = Positions(kind, rows, lat_deg, lon_deg, quality)
    return positions if not (none | lost).any() else positions.take(~none & ~lost)


def _gga_quality(fixes: Sentences) -> Ints:
    code = fixes.number(6)
    return np.where((code >= 0) & (code <= 9), code, 0).astype(np.int64)


def _gns_quality(fixes: Sentences) -> Ints:
    best = np.max(_rank_of(fixes.letters(6, 8)), axis=1)
    return np.where(best < 0, -1, _MODE_QUALITY[best])


def _rmc_quality(fixes: Sentences) -> Ints:
    rank = _rank_of(fixes.letter(12))
    return np.where(fixes.letter(2) != ord("A"), 0, np.where(rank < 0, -1, _MODE_QUALITY[rank]))


def _rank_of(letters: Bytes) -> Ints:
    """Place in _MODES; −1 for other bytes."""
    table = np.full(256, -1, dtype=np.int64)
    table[list(_MODES)] = np.arange(len(_MODES))
    return np.asarray(table[letters])


def _numbered(field: int, quality: Ints) -> Callable[[Sentences], Ints]:
    def read(fixes: Sentences) -> Ints:
        code = fixes.number(field)
        known = (code >= 0) & (code < quality.size) & (code == np.floor(code))
        return np.where(known, quality[np.where(known, code, 0).astype(np.int64)], np.where(code > 0, -1, 0))

    return read


_QUALITIES: dict[Kind, Callable[[Sentences], Ints]] = {
    Kind.GGA: _gga_quality,
    Kind.GNS: _gns_quality,
    Kind.GGK: _numbered(7, _GGK_QUALITY),
    Kind.KSXT: _numbered(10, _KSXT_QUALITY),
    Kind.RMC: _rmc_quality,
}


def _position(fixes: Sentences, field: int) -> tuple[Floats, Floats, Bools]:
    """Latitude and longitude in degrees, and where the four fields are filled but make no position."""
    lat_deg, lat_empty = _angle(fixes, field, ord("N"), ord("S"), 90.0)
    lon_deg, lon_empty = _angle(fixes, field + 2, ord("E"), ord("W"), 180.0)
    missing = np.isnan(lat_deg) | np.isnan(lon_deg)
    return np.where(missing, np.nan, lat_deg), lon_deg, missing & ~(lat_empty | lon_empty)


def _angle(fixes: Sentences, field: int, positive: int, negative: int, limit_deg: float) -> tuple[Floats, Bools]:
    """Degrees of a packed ``dddmm.mmmm``, to 1e-14; and where the field is empty."""
    begin, end = fixes.span(field)
    packed = parse_decimals(fixes.data, begin, end)
    side = fixes.letter(field + 1)
    degrees = np.floor(packed / 100)
    minutes = packed - degrees * 100
    value = degrees + minutes / 60
    good = (minutes < 60) & (value <= limit_deg) & (packed >= 0) & ((side == positive) | (side == negative))
    return np.where(good, np.where(side == negative, -value, value), np.nan), begin == end


def _plain_position(fixes: Sentences) -> tuple[Floats, Floats, Bools]:
    """KSXT: longitude and latitude in signed degrees."""
    lon_deg, lat_deg = fixes.number(2), fixes.number(3)
    good = (np.abs(lat_deg) <= 90) & (np.abs(lon_deg) <= 180)
    (lon_begin, lon_end), (lat_begin, lat_end) = fixes.span(2), fixes.span(3)
    filled = (lon_end > lon_begin) & (lat_end > lat_begin)
    return np.where(good, lat_deg, np.nan), lon_deg, ~good & filled


def altitude(fixes: Sentences, kind: Kind) -> Floats:
    """Above the ellipsoid where the geoid separation is given, else above sea level."""
    if kind == Kind.RMC:
        return np.full(fixes.start.size, np.nan)
    if kind == Kind.KSXT:
        return fixes.number(4)
    if kind == Kind.GGK:
        begin, end = fixes.span(10)
        named = (fixes.data[begin] & 0xDF) == ord("E")
        return parse_decimals(fixes.data, np.minimum(begin + 3 * named, end), end)
    field = 9
    above_sea_m, separation_m = fixes.number(field), fixes.number(field + (2 if kind == Kind.GGA else 1))
    return np.where(np.isfinite(separation_m), above_sea_m + separation_m, above_sea_m)


_EXTRAS: dict[Kind, dict[str, int]] = {
    Kind.GGA: {"hdop": 8, "satellites": 7, "age_s": 13},
    Kind.GNS: {"hdop": 8, "satellites": 7, "age_s": 11},
    Kind.GGK: {"dop": 9, "satellites": 8},
    Kind.KSXT: {"satellites": 13, "age_s": 20},
    Kind.RMC: {},
}
"""Fields of further columns."""


def extras(fixes: Sentences, kind: Kind) -> dict[str, Floats]:
    """Further columns (m,) by name, those that hold any number."""
    extras = {name: fixes.number(field) for name, field in _EXTRAS[kind].items()}
    return {name: column for name, column in extras.items() if np.isfinite(column).any()}
