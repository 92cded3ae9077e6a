"""Position fixes out of NMEA sentences, one for each epoch, with what other sentences say about that epoch.

GST gives sigmas, never widened by the HDOP, unless the sentence states its own; RMC, KSXT, VTG and BESTVELA give the
speed over ground.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.limits import HEIGHT_LIMIT_M, SIGMA_LIMIT_M, SPEED_LIMIT_MPS
from sccal.logs.nmea.kinds import GST_BEARING, GST_SIGMAS, LAYOUTS, READ_FOR_SPEEDS, UNTIMED, Kind
from sccal.logs.nmea.positions import altitude, best_kind, extras, own_sigmas
from sccal.logs.nmea.quality import worded
from sccal.logs.nmea.receivers import one_receiver
from sccal.logs.nmea.sentences import Sentences
from sccal.logs.nmea.times import Dated, epoch_key, epochs_of_untimed
from sccal.logs.streams import FixStream, Notice
from sccal.logs.timeline import order_in_time

_KNOT_MPS = 1852.0 / 3600.0


def read_fixes(dated: Dated, source: str, notices: list[Notice]) -> FixStream | None:
    """The fixes in order of time; None where there is not one. What was met is told."""
    positions = best_kind(dated, source, notices)
    if positions is None:
        return None
    positions = one_receiver(dated, positions, source, notices)
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
    if (own := own_sigmas(fixes, positions.kind)) is not None:
        (sigma_east_m, sigma_north_m), cov_en_m2 = own, np.zeros(rows.size)
    _tell_missing_host_times(fixes, source, notices)
    return FixStream(
        host_t_s=fixes.host_t_s,
        utc_s=utc_s,
        utc_has_date=dated.has_date,
        lat_deg=positions.lat_deg,
        lon_deg=positions.lon_deg,
        alt_m=_possible_heights(altitude(fixes, positions.kind), fixes, source, notices),
        quality=positions.quality,
        sigma_east_m=sigma_east_m,
        sigma_north_m=sigma_north_m,
        cov_en_m2=cov_en_m2,
        extras=extras(fixes, positions.kind),
        speed_mps=_speeds(dated, running_s),
        clock_steps=dated.clock_steps,
    )


def _possible_heights(alt_m: Floats, fixes: Sentences, source: str, notices: list[Notice]) -> Floats:
    high = np.abs(alt_m) > HEIGHT_LIMIT_M
    if not high.any():
        return alt_m
    what = f"heights beyond {HEIGHT_LIMIT_M:g} m taken as empty"
    notices.append(Notice(source, what, int(high.sum()), f"line {fixes.line[high][0]}", "warning"))
    return np.where(high, np.nan, alt_m)


def _speeds(dated: Dated, running_s: Floats) -> Floats | None:
    """Speed over ground (m/s) at the epochs ``running_s``, from the first of READ_FOR_SPEEDS that has it, or None."""
    wanted = epoch_key(running_s)
    speed_mps = np.full(wanted.size, np.nan)
    for kind in READ_FOR_SPEEDS:
        rows = np.flatnonzero(dated.sentences.kind == kind)
        missing = np.flatnonzero(np.isnan(speed_mps))
        if rows.size == 0 or missing.size == 0:
            continue
        value = _speed_mps(dated.sentences.take(rows), kind)
        usable = np.flatnonzero((value >= 0) & (value <= SPEED_LIMIT_MPS))
        if usable.size == 0:
            continue
        rows, value = rows[usable], value[usable]
        key = epoch_key(_epochs_by_talker(dated, rows) if kind in UNTIMED else dated.running_s[rows])
        at, hit = _matched(key, wanted[missing])
        speed_mps[missing[hit]] = value[at[hit]]
    return speed_mps if np.isfinite(speed_mps).any() else None


def _speed_mps(own: Sentences, kind: Kind) -> Floats:
    """Speeds (n,) of sentences of one kind; NaN where they have none, or say that it does not hold."""
    fields = LAYOUTS[kind].speed
    assert fields is not None
    value = np.full(own.start.size, np.nan) if fields.kmph is None else own.number(fields.kmph) / 3.6
    if fields.mps is not None:
        value = own.number(fields.mps)
    if fields.knots is not None:
        value = np.where(np.isfinite(value), value, own.number(fields.knots) * _KNOT_MPS)
    if fields.told_by is None:
        return value
    if fields.holds:
        return np.where(worded(own, fields.told_by, {fields.holds: 1}) == 1, value, np.nan)
    return np.where(own.letter(fields.told_by) != ord(fields.holds_not), value, np.nan)


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
    major, minor, gst_north, gst_east = (gst.number(field) for field in GST_SIGMAS)
    bearing = np.radians(gst.number(GST_BEARING))
    var_north = (major * np.cos(bearing)) ** 2 + (minor * np.sin(bearing)) ** 2
    var_east = (major * np.sin(bearing)) ** 2 + (minor * np.cos(bearing)) ** 2
    ellipse_cov = (major**2 - minor**2) * np.sin(bearing) * np.cos(bearing)
    with np.errstate(invalid="ignore", divide="ignore"):
        stated = (gst_north > 0) & (gst_east > 0)
        agrees = stated & _near(np.sqrt(var_north), gst_north) & _near(np.sqrt(var_east), gst_east)
        gst_cov = ellipse_cov / np.sqrt(var_north * var_east) * gst_north * gst_east
    gst_cov = np.where(agrees & np.isfinite(gst_cov), gst_cov, 0.0)
    hit &= stated[at]
    wide = (gst_north > SIGMA_LIMIT_M) | (gst_east > SIGMA_LIMIT_M)
    gst_cov = np.where(wide, 0.0, gst_cov)
    gst_north, gst_east = np.minimum(gst_north, SIGMA_LIMIT_M), np.minimum(gst_east, SIGMA_LIMIT_M)
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
