"""``gnss.nmea``: fixes from GGA, dated by RMC or ZDA, with the sigmas of GST.

Only sentences whose checksum is right are used, or which have none and are otherwise whole. GGA gives position,
quality and time of day; RMC and ZDA give the date; GST gives sigmas, never widened by the HDOP. Where a log has no GGA
the positions of RMC stand in.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import DataError
from sccal.logs.sentences import Sentences, find_sentences, kinds_in
from sccal.logs.streams import FixStream, Notice
from sccal.logs.timeline import order_in_time

_DAY_S = 86400.0
_FIELDS_NEEDED = {b"GGA": 13, b"RMC": 9, b"GST": 8, b"ZDA": 4}
_MODE_QUALITY = {ord("R"): 4, ord("F"): 5, ord("D"): 2, ord("A"): 1, ord("E"): 6, ord("N"): 0}


def read_nmea(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    """Read the fixes of an NMEA log, each line optionally after the host's receive time.

    Raises:
        DataError: unreadable file, no sentence, or no fix.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    if not raw:
        raise DataError(f"{path}: is empty (0 bytes); log it again or remove the run")
    return parse_nmea(raw, str(path), path.name)


def parse_nmea(raw: bytes, path: str, source: str) -> tuple[FixStream, tuple[Notice, ...]]:
    """The fixes in the bytes of an NMEA log; ``path`` names it in errors, ``source`` in notices.

    Raises:
        DataError: no sentence, or no fix.
    """
    notices: list[Notice] = []
    found = find_sentences(raw)
    if found.start.size == 0:
        raise DataError(f"{path}: no NMEA sentence in {len(raw)} bytes; lines should hold $GNGGA,… sentences")
    timed = _whole_sentences(found, source, notices)
    tod_s = _time_of_day(timed)
    timed_rows = np.flatnonzero(np.isfinite(tod_s))
    timed, tod_s = timed.take(timed_rows), tod_s[timed_rows]
    running_s = np.unwrap(tod_s, period=_DAY_S)
    midnight_s, has_date = _midnights(timed, tod_s, running_s, source, notices)

    gga = timed.kind == b"GGA"
    use = np.flatnonzero(gga if gga.any() else timed.kind == b"RMC")
    fixes = timed.take(use)
    utc_s = running_s[use] + midnight_s[use]
    if gga.any():
        quality = _gga_quality(fixes)
        latitude_field = 2
    else:
        quality = _rmc_quality(fixes)
        latitude_field = 3
    lat_deg, lon_deg, garbled = _position(fixes, latitude_field)
    chosen = _usable(fixes, quality, lat_deg, garbled, source, notices)
    if not chosen.any():
        why = "; ".join(str(notice) for notice in notices) or "no GGA or RMC with a time"
        raise DataError(f"{path}: no position fix in {found.start.size} sentences: {why}")
    rows = np.flatnonzero(chosen)
    if not gga.any():
        what = "RMC sentences read for their positions because there is no GGA"
        notices.append(Notice(source, what, int(rows.size), severity="warning"))
    order, order_notices = order_in_time(utc_s[rows], fixes.line[rows], source)
    notices += order_notices
    rows = rows[order]
    fixes, utc_s = fixes.take(rows), utc_s[rows]
    sigma_east_m, sigma_north_m, cov_en_m2 = _stated_sigmas(timed, running_s, running_s[use[rows]])
    _tell_missing_host_times(fixes, source, notices)
    stream = FixStream(
        host_t_s=fixes.host_t_s,
        utc_s=utc_s,
        utc_has_date=has_date,
        lat_deg=lat_deg[rows],
        lon_deg=lon_deg[rows],
        alt_m=_altitude(fixes) if gga.any() else np.full(rows.size, np.nan),
        quality=quality[rows],
        sigma_east_m=sigma_east_m,
        sigma_north_m=sigma_north_m,
        cov_en_m2=cov_en_m2,
        extras=_gga_extras(fixes) if gga.any() else {},
    )
    return stream, tuple(notices)


def _whole_sentences(found: Sentences, source: str, notices: list[Notice]) -> Sentences:
    """The GGA, RMC, GST and ZDA that can be relied on."""
    ours = kinds_in(found.kind, list(_FIELDS_NEEDED))
    wrong = found.has_checksum & ~found.right_checksum
    cut = ~found.has_checksum & ~found.complete
    needed = np.zeros(found.start.size, dtype=np.int64)
    for kind, count in _FIELDS_NEEDED.items():
        needed[found.kind == kind] = count
    lower = found.data[found.start + 1] > ord("Z")
    short = ours & ~wrong & ~cut & ((found.field_count() < needed) | (~found.has_checksum & lower))
    use: Bools = ours & ~wrong & ~cut & ~short
    bare = use & ~found.has_checksum
    other = ~ours & ~wrong & ~cut
    for rows, what, severity in (
        (wrong, "sentences with a wrong checksum dropped", "warning"),
        (cut, "sentences cut in the middle dropped", "info"),
        (short, "sentences with missing fields dropped", "info"),
        (bare, "sentences without checksum read", "info"),
        (other, "other sentences passed over", "info"),
    ):
        count = int(rows.sum())
        if count:
            where = f"line {found.line[rows][0]}"
            serious = severity == "warning" and count > 0.001 * found.start.size
            notices.append(Notice(source, what, count, where, "warning" if serious else "info"))
    return found.take(np.flatnonzero(use))


def _time_of_day(timed: Sentences) -> Floats:
    """(n) seconds since midnight, NaN where the field is no time."""
    value = timed.number(1)
    value = np.where((value >= 0) & (value < 240000), value, np.nan)
    hours = np.floor(value / 10000)
    minutes = np.floor((value - hours * 10000) / 100)
    seconds = np.round(value - hours * 10000 - minutes * 100, 6)
    plausible = (minutes < 60) & (seconds < 61)
    return np.where(plausible, hours * 3600 + minutes * 60 + seconds, np.nan)


def _midnights(
    timed: Sentences, tod_s: Floats, running_s: Floats, source: str, notices: list[Notice]
) -> tuple[Floats, bool]:
    """(n) what to add to the running time of day to get Unix time, and whether a date was found.

    The dates of a run in one go all give the same midnight; a date that holds for a few sentences only is nonsense.
    """
    rows = np.flatnonzero(kinds_in(timed.kind, (b"RMC", b"ZDA")))
    dating = timed.take(rows)
    day = _days(dating)
    dated = np.isfinite(day)
    valid_rmc = dated & (dating.kind == b"RMC") & (dating.letter(2) == ord("A"))
    zda = dated & (dating.kind == b"ZDA")
    preferred = valid_rmc if valid_rmc.any() else zda if zda.any() else dated
    rows, day = rows[preferred], day[preferred]
    if rows.size == 0:
        return np.zeros(tod_s.size), False
    offset_s = np.round((day * _DAY_S + tod_s[rows] - running_s[rows]) / _DAY_S) * _DAY_S
    values, which, counts = np.unique(offset_s, return_inverse=True, return_counts=True)
    if values.size > 1:
        rare = (counts < max(3.0, 0.05 * rows.size)) & (counts < counts.max())
        lost = rare[which]
        if lost.any():
            first = rows[lost][0]
            wrong_date = np.datetime64(int(day[lost][0]), "D")
            what = f"dates that the others contradict ignored ({wrong_date})"
            notices.append(Notice(source, what, int(lost.sum()), f"line {timed.line[first]}", "warning"))
            rows, offset_s = rows[~lost], offset_s[~lost]
    nearest = np.searchsorted(rows, np.arange(tod_s.size), side="right") - 1
    return offset_s[np.maximum(nearest, 0)], True


def _days(dating: Sentences) -> Floats:
    """(n) days since 1970-01-01 stated by RMC and ZDA, NaN for impossible dates."""
    rmc = dating.kind == b"RMC"
    packed = dating.number(9)
    two_digits = packed % 100
    day = np.where(rmc, np.floor(packed / 10000), dating.number(2))
    month = np.where(rmc, np.floor(packed / 100) % 100, dating.number(3))
    year = np.where(rmc, two_digits + np.where(two_digits >= 80, 1900, 2000), dating.number(4))
    whole = (day == np.floor(day)) & (month == np.floor(month)) & (year == np.floor(year))
    good = whole & (day >= 1) & (month >= 1) & (month <= 12) & (year >= 1970) & (year < 2200)
    months = np.where(good, (year - 1970) * 12 + month - 1, 0).astype(np.int64)
    first = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    length = (months + 1).astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) - first
    good &= day <= length
    return np.where(good, first + day - 1, np.nan)


def _gga_quality(fixes: Sentences) -> Ints:
    code = fixes.number(6)
    return np.where((code >= 0) & (code <= 9), code, 0).astype(np.int64)


def _rmc_quality(fixes: Sentences) -> Ints:
    quality = np.full(fixes.start.size, -1, dtype=np.int64)
    mode = fixes.letter(12)
    for letter, code in _MODE_QUALITY.items():
        quality[mode == letter] = code
    quality[fixes.letter(2) != ord("A")] = 0
    return quality


def _position(fixes: Sentences, field: int) -> tuple[Floats, Floats, Bools]:
    """Latitude and longitude in degrees, and where the four fields are filled but make no position."""
    lat_deg, lat_empty = _angle(fixes, field, ord("N"), ord("S"), 90.0)
    lon_deg, lon_empty = _angle(fixes, field + 2, ord("E"), ord("W"), 180.0)
    empty = lat_empty | lon_empty
    missing = np.isnan(lat_deg) | np.isnan(lon_deg)
    lat_deg = np.where(missing, np.nan, lat_deg)
    return lat_deg, lon_deg, missing & ~empty


def _angle(fixes: Sentences, field: int, positive: int, negative: int, limit_deg: float) -> tuple[Floats, Bools]:
    packed = fixes.number(field)
    side = fixes.letter(field + 1)
    degrees = np.floor(packed / 100)
    minutes = packed - degrees * 100
    value = degrees + minutes / 60
    good = (minutes < 60) & (value <= limit_deg) & (packed >= 0) & ((side == positive) | (side == negative))
    begin, end = fixes.span(field)
    return np.where(good, np.where(side == negative, -value, value), np.nan), begin == end


def _usable(
    fixes: Sentences, quality: Ints, lat_deg: Floats, garbled: Bools, source: str, notices: list[Notice]
) -> Bools:
    none = quality == 0
    lost = ~none & np.isnan(lat_deg)
    for rows, what in (
        (none, "sentences without a fix passed over"),
        (lost & ~garbled, "sentences with a fix but an empty position dropped"),
        (lost & garbled, "sentences with an impossible position dropped"),
    ):
        if rows.any():
            notices.append(Notice(source, what, int(rows.sum()), f"line {fixes.line[rows][0]}"))
    usable: Bools = ~none & ~lost
    return usable


def _altitude(fixes: Sentences) -> Floats:
    """Above the ellipsoid where the geoid separation is given, else above sea level."""
    above_sea_m, separation_m = fixes.number(9), fixes.number(11)
    return np.where(np.isfinite(separation_m), above_sea_m + separation_m, above_sea_m)


def _gga_extras(fixes: Sentences) -> dict[str, Floats]:
    extras = {"hdop": fixes.number(8), "satellites": fixes.number(7), "age_s": fixes.number(13)}
    return {name: column for name, column in extras.items() if np.isfinite(column).any()}


def _stated_sigmas(timed: Sentences, running_s: Floats, fix_running_s: Floats) -> tuple[Floats, Floats, Floats]:
    """East and north sigmas and their covariance for each fix, from the GST of the same time of day."""
    n = fix_running_s.size
    east, north, cov = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n)
    rows = np.flatnonzero(timed.kind == b"GST")
    if rows.size == 0:
        return east, north, cov
    gst = timed.take(rows)
    key, first = np.unique(np.round(running_s[rows] * 1000).astype(np.int64), return_index=True)
    gst = gst.take(first)
    wanted = np.round(fix_running_s * 1000).astype(np.int64)
    at = np.minimum(np.searchsorted(key, wanted), key.size - 1)
    hit = key[at] == wanted
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
