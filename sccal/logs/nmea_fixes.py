"""Position fixes out of NMEA sentences, one for each epoch.

Positions come from GGA; where a log has none that can be used, from GNS, PTNL,GGK, KSXT or RMC, in this order: by how
much they say about their quality. GST gives sigmas, never widened by the HDOP.

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
from sccal.logs.decimals import parse_decimals
from sccal.logs.nmea_times import Dated, epoch_key, epochs_of_untimed
from sccal.logs.sentences import Kind, Sentences, talker_name
from sccal.logs.streams import FixStream, Notice
from sccal.logs.timeline import order_in_time

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
_BEST_FIRST = (4, 5, 2, 9, 3, 1, -1, 8, 6, 7)
_KNOT_MPS = 1852.0 / 3600.0
_LEAST_SHARE = 0.1
_SAME_PLACE_M = 0.05
_METRES_PER_DEG = 111_320.0


@dataclass(frozen=True)
class _Positions:
    """Usable positions of one kind; arrays of length m."""

    kind: Kind
    rows: Ints
    """Of the sentences."""
    lat_deg: Floats
    lon_deg: Floats
    quality: Ints

    def take(self, keep: Bools | Ints) -> _Positions:
        return _Positions(self.kind, self.rows[keep], self.lat_deg[keep], self.lon_deg[keep], self.quality[keep])


def read_fixes(dated: Dated, source: str, notices: list[Notice]) -> FixStream | None:
    """The fixes in order of time; None where there is not one. What was met is told."""
    positions = _best_kind(dated, source, notices)
    if positions is None:
        return None
    positions = _one_receiver(dated, positions, source, notices)
    rows = positions.rows
    utc_s = dated.running_s[rows] + dated.midnight_s[rows]
    order, order_notices = order_in_time(utc_s, dated.sentences.line[rows], source)
    notices += order_notices
    positions, utc_s = positions.take(order), utc_s[order]
    rows = positions.rows
    fixes = dated.sentences.take(rows)
    running_s = dated.running_s[rows]
    talker = int(fixes.talker[0])
    sigma_east_m, sigma_north_m, cov_en_m2 = _stated_sigmas(dated, running_s, talker)
    _tell_missing_host_times(fixes, source, notices)
    return FixStream(
        host_t_s=fixes.host_t_s,
        utc_s=utc_s,
        utc_has_date=dated.has_date,
        lat_deg=positions.lat_deg,
        lon_deg=positions.lon_deg,
        alt_m=_altitude(fixes, positions.kind),
        quality=positions.quality,
        sigma_east_m=sigma_east_m,
        sigma_north_m=sigma_north_m,
        cov_en_m2=cov_en_m2,
        extras=_extras(fixes, positions.kind),
        speed_mps=_speeds(dated, running_s),
    )


def _best_kind(dated: Dated, source: str, notices: list[Notice]) -> _Positions | None:
    """The first kind with usable positions, unless another one has ten times as many."""
    kind = dated.sentences.kind
    timed = np.isfinite(dated.running_s)
    rows_of = {one: np.flatnonzero((kind == one) & timed) for one in POSITION_KINDS}
    found: list[tuple[_Positions, list[Notice]]] = []
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


def _usable(sentences: Sentences, kind: Kind, rows: Ints, source: str, notices: list[Notice]) -> _Positions:
    fixes = sentences.take(rows)
    quality = _QUALITIES[kind](fixes)
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
    positions = _Positions(kind, rows, lat_deg, lon_deg, quality)
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


def _rank_of(letters: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> Ints:
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


def _one_receiver(dated: Dated, positions: _Positions, source: str, notices: list[Notice]) -> _Positions:
    """Only the fixes of one receiver: the talker with the best, and others where they speak in its pauses."""
    talker = dated.sentences.talker[positions.rows]
    if (talker == talker[0]).all():
        return _one_of_two(dated, positions, source, notices)
    name = KIND_NAMES[positions.kind]

    def merit(one: int) -> tuple[int, ...]:
        own = positions.quality[talker == one]
        return (*(int((own == code).sum()) for code in _BEST_FIRST), int(talker_name(one) == "GN"))

    first, *others = sorted(np.unique(talker).tolist(), key=merit, reverse=True)
    keep = talker == first
    best = positions.take(keep)
    best = best.take(np.argsort(dated.running_s[best.rows], kind="stable"))
    for one in others:
        own = np.flatnonzero(talker == one)
        other = positions.take(own)
        beside, apart_m = _beside(dated, best, other)
        where = f"line {dated.sentences.line[other.rows[0]]}"
        names = talker_name(one), talker_name(first)
        if beside.mean() < _LEAST_SHARE:
            what = f"{name} fixes of talker {names[0]} in the pauses of {names[1]} read as one receiver's"
            notices.append(Notice(source, what, int((~beside).sum()), where))
            keep[own[~beside]] = True
            continue
        what = f"{name} fixes of talker {names[0]} dropped: their epochs were seen before, from {names[1]}"
        if apart_m <= _SAME_PLACE_M:
            again = np.isin(epoch_key(dated.running_s[other.rows]), epoch_key(dated.running_s[best.rows]))
            if again.any():
                notices.append(Notice(source, what, int(again.sum()), where))
            keep[own[~again]] = True
        else:
            what += f", {apart_m:.2f} m away: two receivers, or two solutions of one"
            notices.append(Notice(source, what, own.size, where, "warning"))
    return _one_of_two(dated, positions.take(keep), source, notices)


def _beside(dated: Dated, best: _Positions, other: _Positions) -> tuple[Bools, float]:
    """Which fixes have fixes of the best talker close before and after (or at once), and how far away they are (m)."""
    t_s, of_s = dated.running_s[best.rows], dated.running_s[other.rows]
    after = np.clip(np.searchsorted(t_s, of_s), 0, t_s.size - 1)
    before = np.maximum(np.searchsorted(t_s, of_s + 1e-3) - 1, 0)
    usual_s = float(np.median(np.diff(t_s))) if t_s.size > 1 else 0.0
    close = (t_s[after] >= of_s - 1e-3) & (t_s[before] <= of_s + 1e-3)
    beside = close & (t_s[after] - t_s[before] <= 1.5 * usual_s + 1e-3)
    if not beside.any():
        return beside, 0.0
    rows = np.argsort(t_s, kind="stable")
    lat_deg = np.interp(of_s[beside], t_s[rows], best.lat_deg[rows])
    lon_deg = np.interp(of_s[beside], t_s[rows], best.lon_deg[rows])
    apart_m = _distance_m(lat_deg, lon_deg, other.lat_deg[beside], other.lon_deg[beside])
    return beside, float(np.median(apart_m))


def _one_of_two(dated: Dated, positions: _Positions, source: str, notices: list[Notice]) -> _Positions:
    """Two receivers that use the same name: epochs with two different places. One of them is followed through the log.

    The line between the two antennas turns slowly, so that a sudden turn by more than a right angle means that the two
    were written in the other order.
    """
    key = epoch_key(dated.running_s[positions.rows])
    if (np.diff(key) > 0).all():
        return positions
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(np.diff(key[order]) == 0)
    if again.size < max(2.0, _LEAST_SHARE * key.size):
        return positions
    fresh = np.concatenate(([True], np.diff(again) > 1))
    first, second = order[again[fresh]], order[again[fresh] + 1]
    lat_deg, lon_deg = positions.lat_deg, positions.lon_deg
    apart_m = float(np.median(_distance_m(lat_deg[first], lon_deg[first], lat_deg[second], lon_deg[second])))
    if apart_m <= _SAME_PLACE_M:
        return positions
    shrink = np.cos(np.radians(lat_deg[first]))
    line = (lon_deg[second] - lon_deg[first]) * shrink + 1j * (lat_deg[second] - lat_deg[first])
    turned = np.real(line[1:] * np.conj(line[:-1])) < 0
    swapped = np.concatenate(([False], np.cumsum(turned) % 2 == 1))
    one, two = np.where(swapped, second, first), np.where(swapped, first, second)
    merits = [tuple(int((positions.quality[track] == code).sum()) for code in _BEST_FIRST) for track in (one, two)]
    kept = one if merits[0] >= merits[1] else two
    what = (
        f"{KIND_NAMES[positions.kind]} fixes dropped: two for each epoch, {apart_m:.2f} m apart, look like two "
        "receivers in one log, and only one of them is followed"
    )
    doubt = f"{source} holds the fixes of two receivers under one name; log each to a file of its own"
    where = f"line {dated.sentences.line[positions.rows[second[0]]]}"
    notices.append(Notice(source, what, int(key.size - kept.size), where, "warning", doubt))
    return positions.take(np.sort(kept))


def _distance_m(lat_deg: Floats, lon_deg: Floats, other_lat_deg: Floats, other_lon_deg: Floats) -> Floats:
    """Short distances, to a percent."""
    east = (other_lon_deg - lon_deg) * np.cos(np.radians(lat_deg))
    return np.asarray(_METRES_PER_DEG * np.hypot(east, other_lat_deg - lat_deg))


def _altitude(fixes: Sentences, kind: Kind) -> Floats:
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


def _extras(fixes: Sentences, kind: Kind) -> dict[str, Floats]:
    extras = {name: fixes.number(field) for name, field in _EXTRAS[kind].items()}
    return {name: column for name, column in extras.items() if np.isfinite(column).any()}


def _speeds(dated: Dated, running_s: Floats) -> Floats | None:
    """Speed over ground (m/s) at the epochs ``running_s``, from RMC, else KSXT, else VTG; None where there is none."""
    wanted = epoch_key(running_s)
    speed_mps = np.full(wanted.size, np.nan)
    for kind in (Kind.RMC, Kind.KSXT, Kind.VTG):
        rows = np.flatnonzero(dated.sentences.kind == kind)
        missing = np.flatnonzero(np.isnan(speed_mps))
        if rows.size == 0 or missing.size == 0:
            continue
        own = dated.sentences.take(rows)
        if kind == Kind.RMC:
            value = np.where(own.letter(2) == ord("A"), own.number(7) * _KNOT_MPS, np.nan)
        elif kind == Kind.KSXT:
            value = own.number(8) / 3.6
        else:
            knots, kmph = own.number(5), own.number(7)
            value = np.where(np.isfinite(kmph), kmph / 3.6, knots * _KNOT_MPS)
            value = np.where(own.letter(9) == ord("N"), np.nan, value)
        usable = np.flatnonzero(np.isfinite(value) & (value >= 0))
        if usable.size == 0:
            continue
        rows, value = rows[usable], value[usable]
        key = epoch_key(_epochs_by_talker(dated, rows) if kind == Kind.VTG else dated.running_s[rows])
        at, hit = _matched(key, wanted[missing])
        speed_mps[missing[hit]] = value[at[hit]]
    return speed_mps if np.isfinite(speed_mps).any() else None


def _epochs_by_talker(dated: Dated, rows: Ints) -> Floats:
    talker = dated.sentences.talker[rows]
    epoch_s = np.full(rows.size, np.nan)
    for one in np.unique(talker).tolist():
        own = talker == one
        epoch_s[own] = epochs_of_untimed(dated, rows[own])
    return epoch_s


def _matched(key: Ints, wanted: Ints) -> tuple[Ints, Bools]:
    """For each wanted epoch the index of its first key, and whether there is one."""
    keys, first = (key, np.arange(key.size)) if (np.diff(key) > 0).all() else np.unique(key, return_index=True)
    at = np.minimum(np.searchsorted(keys, wanted), keys.size - 1)
    return first[at], keys[at] == wanted


def _stated_sigmas(dated: Dated, fix_running_s: Floats, talker: int) -> tuple[Floats, Floats, Floats]:
    """East and north sigmas and their covariance for each fix, from the GST of the same epoch; own talker first."""
    n = fix_running_s.size
    east, north, cov = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n)
    rows = np.flatnonzero((dated.sentences.kind == Kind.GST) & np.isfinite(dated.running_s))
    if rows.size == 0:
        return east, north, cov
    other = dated.sentences.talker[rows] != talker
    if other.any() and not other.all():
        rows = rows[np.argsort(other, kind="stable")]
    gst = dated.sentences.take(rows)
    at, hit = _matched(epoch_key(dated.running_s[rows]), epoch_key(fix_running_s))
    gst_north, gst_east = gst.number(6), gst.number(7)
    major, minor, bearing = gst.number(3), gst.number(4), np.radians(gst.number(5))
    var_north = (major * np.cos(bearing)) ** 2 + (minor * np.sin(bearing)) ** 2
    var_east = (major * np.sin(bearing)) ** 2 + (minor * np.cos(bearing)) ** 2
    ellipse_cov = (major**2 - minor**2) * np.sin(bearing) * np.cos(bearing)
    with np.errstate(invalid="ignore", divide="ignore"):
        stated = (gst_north > 0) & (gst_east > 0)
        agrees = stated & _near(np.sqrt(var_north), gst_north) & _near(np.sqrt(var_east), gst_east)
        gst_cov = ellipse_cov / np.sqrt(var_north * var_east) * gst_north * gst_east
    gst_cov = np.where(agrees & np.isfinite(gst_cov), gst_cov, 0.0)
    hit &= stated[at]
    east[hit], north[hit], cov[hit] = gst_east[at[hit]], gst_north[at[hit]], gst_cov[at[hit]]
    return east, north, cov


def _near(a: Floats, b: Floats) -> Bools:
    near: Bools = np.abs(a - b) <= 0.2 * np.maximum(a, b)
    return near


def _tell_missing_host_times(fixes: Sentences, source: str, notices: list[Notice]) -> None:
    missing = ~np.isfinite(fixes.host_t_s)
    if missing.any() and not missing.all():
        where = f"line {fixes.line[missing][0]}"
        notices.append(Notice(source, "fixes without a receive time among others with one", int(missing.sum()), where))
