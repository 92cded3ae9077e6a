"""Positions out of the sentences that state one: which kind is read, its qualities, heights and further columns.

Positions come from GGA; where a log has none that can be used, from the others of READ_FOR_POSITIONS in their order: by
how much they say about their quality.

Where each kind holds them is told in ``kinds``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.decimals import parse_decimals
from sccal.logs.limits import SIGMA_LIMIT_M
from sccal.logs.nmea.kinds import INERTIAL, LAYOUTS, READ_FOR_POSITIONS, Kind, Position
from sccal.logs.nmea.quality import stated_quality
from sccal.logs.nmea.sentences import Sentences
from sccal.logs.nmea.times import Dated
from sccal.logs.streams import Notice

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
    rows_of = {one: np.flatnonzero((kind == one) & timed) for one in READ_FOR_POSITIONS}
    found: list[tuple[Positions, list[Notice]]] = []
    for i, one in enumerate(READ_FOR_POSITIONS):
        if rows_of[one].size == 0:
            continue
        own: list[Notice] = []
        found.append((_usable(dated.sentences, one, rows_of[one], source, own), own))
        others = max((rows_of[other].size for other in READ_FOR_POSITIONS[i + 1 :]), default=0)
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
        what = f"{LAYOUTS[best.kind].name} sentences read for their positions because {why}"
        serious = best.kind == Kind.RMC or few
        notices.append(Notice(source, what, int(best.rows.size), severity="warning" if serious else "info"))
    if best.kind in INERTIAL:
        what = "positions of an inertial solution, which its filter has smoothed; BESTGNSSPOSA would have none of that"
        notices.append(Notice(source, what, int(best.rows.size), severity="warning"))
    return best


def _usable(sentences: Sentences, kind: Kind, rows: Ints, source: str, notices: list[Notice]) -> Positions:
    fixes, position = sentences.take(rows), position_of(kind)
    quality = stated_quality(fixes, position)
    lat_deg, lon_deg, garbled = (_plain_position if position.in_degrees else _position)(fixes, position)
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


def position_of(kind: Kind) -> Position:
    """The fields of a kind that holds a position."""
    position = LAYOUTS[kind].position
    assert position is not None
    return position


def _position(fixes: Sentences, fields: Position) -> tuple[Floats, Floats, Bools]:
    """Latitude and longitude in degrees, and where the four fields are filled but make no position."""
    lat_deg, lat_empty = _angle(fixes, fields.latitude, ord("N"), ord("S"), 90.0)
    lon_deg, lon_empty = _angle(fixes, fields.longitude, ord("E"), ord("W"), 180.0)
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


def _plain_position(fixes: Sentences, fields: Position) -> tuple[Floats, Floats, Bools]:
    """The same out of signed degrees."""
    lat_deg, lon_deg = fixes.number(fields.latitude), fixes.number(fields.longitude)
    good = (np.abs(lat_deg) <= 90) & (np.abs(lon_deg) <= 180)
    (lat_begin, lat_end), (lon_begin, lon_end) = fixes.span(fields.latitude), fixes.span(fields.longitude)
    filled = (lon_end > lon_begin) & (lat_end > lat_begin)
    return np.where(good, lat_deg, np.nan), lon_deg, ~good & filled


def altitude(fixes: Sentences, kind: Kind) -> Floats:
    """Above the ellipsoid where the geoid separation is given, else above sea level; EHT before it is passed over."""
    fields = position_of(kind)
    if fields.altitude_m is None:
        return np.full(fixes.start.size, np.nan)
    begin, end = fixes.span(fields.altitude_m)
    named = (end > begin) & ((fixes.data[begin] & 0xDF) == ord("E"))
    altitude_m = parse_decimals(fixes.data, np.minimum(begin + 3 * named, end), end)
    if fields.separation_m is None:
        return altitude_m
    separation_m = fixes.number(fields.separation_m)
    return np.where(np.isfinite(separation_m), altitude_m + separation_m, altitude_m)


def own_sigmas(fixes: Sentences, kind: Kind) -> tuple[Floats, Floats] | None:
    """East and north sigmas (m,) that the sentences state, NaN where they state none; None for kinds without."""
    fields = position_of(kind).sigmas_m
    if fields is None:
        return None
    east, north = (fixes.number(field) for field in fields)
    stated = (east > 0) & (north > 0)
    return tuple(np.where(stated, np.minimum(sigma, SIGMA_LIMIT_M), np.nan) for sigma in (east, north))  # type: ignore[return-value]


def extras(fixes: Sentences, kind: Kind) -> dict[str, Floats]:
    """Further columns (m,) by name, those that hold any number."""
    extras = {name: fixes.number(field) for name, field in position_of(kind).extras.items()}
    return {name: column for name, column in extras.items() if np.isfinite(column).any()}
