"""Headings out of NMEA sentences, for logs whose heading comes from two antennas or from a receiver with gyros.

All are clockwise from north ("ned"), a compass's from magnetic north: the heading offset then holds the declination
too. Their fields stand in ``kinds``, with what tells how good they are; what those mean that have a reader here:

* THS is a measurement with mode A, autonomous (and D, P, R, F as in RMC, or nothing); E estimated, M manual,
  S simulator and V void are none.
* PASHR: quality 0 is none everywhere, the other numbers differ. Roll is positive to starboard, the left side up, and
  pitch bow up (OxTS NMEA description; QPS driver manual, "Applanix PASHR": roll positive heeling to starboard, pitch
  positive bow up): the signs of ahrs.csv.
* PTNL,AVR: quality 3 RTK fixed, 2 RTK float. Tilt is the baseline's inclination; the receiver writes Roll instead where
  it is told that the antennas stand side by side.
* KSXT: quality of the heading 3 fixed, 2 float.

The inclination of a baseline is pitch where the second antenna stands in front of the first. A baseline across the
robot adds 90° to the heading: the heading offset absorbs that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.limits import SIGMA_LIMIT_RAD
from sccal.logs.nmea.kinds import INERTIAL, LAYOUTS, READ_FOR_HEADINGS, UNTIMED, Heading, Kind
from sccal.logs.nmea.quality import worded
from sccal.logs.nmea.sentences import Sentences, talker_name
from sccal.logs.nmea.times import Dated, epoch_key, epochs_of_untimed
from sccal.logs.streams import HeadingStream, Notice
from sccal.logs.timeline import order_in_time
from sccal.logs.yaw_values import stands_for_none

_USUAL = (Kind.HDT, Kind.THS, Kind.KSXT, Kind.AVR, Kind.PASHR)
HEADING_NAMES = ", ".join(LAYOUTS[kind].name for kind in dict.fromkeys((*_USUAL, *READ_FOR_HEADINGS)))

_FIXED, _LOOSE = 3, 2
_LEAST_SHARE = 0.1
_LEAST_OF_RICHEST = 0.5
_BASELINE_SHARE = 0.1
_OFTENER = 1.5
_AVR_LABELS = ((3, "Y"), (5, "T"), (7, "R"))
"""Yaw, Tilt and Roll, each in the field after its value."""
_THS_MEASURES = np.frombuffer(b"ADPRF\0", dtype=np.uint8)


@dataclass(frozen=True)
class _Readings:
    """Usable headings of one kind; arrays of length m."""

    kind: Kind
    rows: Ints
    yaw_deg: Floats
    pitch_deg: Floats | None = None
    roll_deg: Floats | None = None
    sigma_deg: Floats | None = None

    def take(self, keep: Bools | Ints) -> _Readings:
        pitch, roll, sigma = (
            None if column is None else column[keep] for column in (self.pitch_deg, self.roll_deg, self.sigma_deg)
        )
        return _Readings(self.kind, self.rows[keep], self.yaw_deg[keep], pitch, roll, sigma)


def read_heading(dated: Dated, source: str, notices: list[Notice]) -> HeadingStream | None:
    """The best kind's headings in order of time; None where there is not one. What was met is told."""
    readings = _best_kind(dated, source, notices)
    if readings is None:
        return None
    name = f"{source} ({LAYOUTS[readings.kind].name})"
    readings = _one_talker(dated, readings, name, notices)
    epoch_s, host_s = _epochs(dated, readings, name, notices)
    t_s = host_s if epoch_s is None else epoch_s
    timed = np.flatnonzero(np.isfinite(t_s))
    if timed.size < t_s.size:
        first = dated.sentences.line[readings.rows[~np.isfinite(t_s)][0]]
        what = "headings without an epoch of their own dropped"
        notices.append(Notice(name, what, int(t_s.size - timed.size), f"line {first}"))
    if timed.size == 0:
        return None
    order, order_notices = order_in_time(t_s[timed], dated.sentences.line[readings.rows[timed]], name)
    notices += order_notices
    chosen = timed[order]
    readings = readings.take(chosen)
    none, number = stands_for_none(readings.yaw_deg, 360.0)
    if none.any():
        where = f"line {dated.sentences.line[readings.rows[none][0]]}"
        what = f"headings of exactly {number:g}, which jump from there and back, dropped: they stand for none"
        notices.append(Notice(name, what, int(none.sum()), where, "warning"))
        chosen, readings = chosen[~none], readings.take(~none)
    what = f"headings read, clockwise from {_fields_of(readings.kind).north} north"
    if readings.kind not in (Kind.PASHR, Kind.PSXN, *INERTIAL) and readings.pitch_deg is not None:
        what += "; their pitch is the inclination of the baseline between the antennas"
    notices.append(Notice(name, what, int(chosen.size)))
    return HeadingStream(
        t_s=host_s[chosen],
        yaw_rad=np.radians(readings.yaw_deg),
        yaw_sigma_rad=_stated(readings.sigma_deg),
        pitch_rad=_filled(readings.pitch_deg, t_s[chosen]),
        roll_rad=_filled(readings.roll_deg, t_s[chosen]),
        utc_s=None if epoch_s is None else epoch_s[chosen],
        convention="ned",
        source=name,
        clock_steps=dated.clock_steps,
    )


def _best_kind(dated: Dated, source: str, notices: list[Notice]) -> _Readings | None:
    """The first kind that has at least half as many usable readings as the richest."""
    found: list[tuple[_Readings, list[Notice]]] = []
    there = np.bincount(dated.sentences.kind, minlength=256)
    for kind in READ_FOR_HEADINGS:
        if not there[kind]:
            continue
        usable = dated.sentences.kind == kind
        if kind not in UNTIMED:
            usable &= np.isfinite(dated.running_s)
        rows = np.flatnonzero(usable)
        if rows.size:
            own: list[Notice] = []
            name = f"{source} ({LAYOUTS[kind].name})"
            found.append(
                (_READERS.get(kind, partial(_claimed, kind))(dated.sentences.take(rows), rows, name, own), own)
            )
    richest = max((readings.rows.size for readings, _ in found), default=0)
    if richest == 0:
        for _, own in found:
            notices += own
        return None
    chosen, own = next(one for one in found if one[0].rows.size >= _LEAST_OF_RICHEST * richest)
    notices += own
    for readings, _ in found:
        if readings is not chosen and readings.rows.size:
            what = f"headings not used because {LAYOUTS[chosen.kind].name} gives them too"
            notices.append(Notice(f"{source} ({LAYOUTS[readings.kind].name})", what, readings.rows.size))
    return chosen


def _fields_of(kind: Kind) -> Heading:
    heading = LAYOUTS[kind].heading
    assert heading is not None
    return heading


def _read(own: Sentences, rows: Ints, kind: Kind) -> _Readings:
    """All that sentences of one kind say, usable or not."""
    fields = _fields_of(kind)
    pitch, roll, sigma = (
        None if field is None else own.number(field) for field in (fields.pitch, fields.roll, fields.sigma)
    )
    return _Readings(kind, rows, own.number(fields.yaw), pitch, roll, sigma)


def _claimed(kind: Kind, own: Sentences, rows: Ints, name: str, notices: list[Notice]) -> _Readings:
    """Headings of a kind whose row in the table tells all that is to know."""
    fields = _fields_of(kind)
    readings = _read(own, rows, kind)
    pitch, roll = (None if angle is None else _or_none(angle) for angle in (readings.pitch_deg, readings.roll_deg))
    readings = replace(readings, pitch_deg=pitch, roll_deg=roll)
    if fields.state is None:
        return _plausible(own, readings, np.ones(rows.size, dtype=np.bool_), name, notices)
    states = dict.fromkeys(fields.loose, _LOOSE) | dict.fromkeys(fields.fixed, _FIXED)
    measured = _best_quality(worded(own, fields.state, states).astype(np.float64), name, own, notices)
    return _plausible(own, readings, measured, name, notices)


def _hdt(own: Sentences, rows: Ints, name: str, notices: list[Notice]) -> _Readings:
    begin, end = own.span(2)
    reference = own.letter(2)
    readings = _read(own, rows, Kind.HDT)
    return _plausible(own, readings, (reference == ord("T")) | (begin == end), name, notices)


def _ths(own: Sentences, rows: Ints, name: str, notices: list[Notice]) -> _Readings:
    return _plausible(own, _read(own, rows, Kind.THS), np.isin(own.letter(2), _THS_MEASURES), name, notices)


def _pashr(own: Sentences, rows: Ints, name: str, notices: list[Notice]) -> _Readings:
    measured = (own.letter(3) == ord("T")) & (own.number(10) != 0)
    return _plausible(own, _read(own, rows, Kind.PASHR), measured, name, notices)


def _avr(own: Sentences, rows: Ints, name: str, notices: list[Notice]) -> _Readings:
    labelled, tilted, rolled = (own.letters(field, 1)[:, 0] == ord(mark) for field, mark in _AVR_LABELS)
    readings = _read(own, rows, Kind.AVR)
    assert readings.pitch_deg is not None
    assert readings.roll_deg is not None
    tilt, roll = np.where(tilted, readings.pitch_deg, np.nan), np.where(rolled, readings.roll_deg, np.nan)
    readings = replace(readings, pitch_deg=_or_none(tilt), roll_deg=_or_none(roll))
    length_m = own.number(8)
    measured = labelled & _best_quality(own.number(9), name, own, notices)
    if measured.any() and np.isfinite(length_m[measured]).any():
        usual_m = float(np.nanmedian(length_m[measured]))
        odd = measured & (np.abs(length_m - usual_m) > _BASELINE_SHARE * usual_m)
        if odd.any():
            what = f"headings dropped whose baseline is not the usual {usual_m:.2f} m long"
            notices.append(Notice(name, what, int(odd.sum()), f"line {own.line[odd][0]}"))
            own, rows, measured = own.take(np.flatnonzero(~odd)), rows[~odd], measured[~odd]
            readings = readings.take(~odd)
    return _plausible(own, readings, measured, name, notices)


def _ksxt(own: Sentences, rows: Ints, name: str, notices: list[Notice]) -> _Readings:
    readings = _read(own, rows, Kind.KSXT)
    assert readings.pitch_deg is not None
    assert readings.roll_deg is not None
    readings = replace(readings, pitch_deg=_or_none(readings.pitch_deg), roll_deg=_or_none(readings.roll_deg))
    measured = _best_quality(own.number(11), name, own, notices)
    return _plausible(own, readings, measured, name, notices)


_READERS: dict[Kind, Callable[[Sentences, Ints, str, list[Notice]], _Readings]] = {
    Kind.HDT: _hdt,
    Kind.THS: _ths,
    Kind.PASHR: _pashr,
    Kind.AVR: _avr,
    Kind.KSXT: _ksxt,
}


def _best_quality(quality: Floats, name: str, own: Sentences, notices: list[Notice]) -> Bools:
    """The fixed headings, where at least a tenth are; else all that there are, told."""
    some: Bools = quality > 0
    fixed: Bools = quality == _FIXED
    rest = some & ~fixed
    if fixed.sum() >= _LEAST_SHARE * some.sum():
        if rest.any():
            what = "headings without fixed ambiguities dropped"
            notices.append(Notice(name, what, int(rest.sum()), f"line {own.line[rest][0]}"))
        return fixed
    what = "headings without fixed ambiguities read because there are hardly others"
    doubt = f"{name}: nearly all headings come without fixed ambiguities and may be degrees off"
    notices.append(Notice(name, what, int(rest.sum()), f"line {own.line[rest][0]}", "warning", doubt))
    return some


def _plausible(own: Sentences, readings: _Readings, measured: Bools, name: str, notices: list[Notice]) -> _Readings:
    """The readings that are headings and measured; the others are told."""
    begin, end = own.span(_fields_of(readings.kind).yaw)
    empty = begin == end
    possible = np.abs(readings.yaw_deg) <= 360.0
    for lost, what in (
        (empty | ~measured & possible, "sentences without a heading passed over"),
        (~empty & ~possible, "sentences with an impossible heading dropped"),
    ):
        if lost.any():
            notices.append(Notice(name, what, int(lost.sum()), f"line {own.line[lost][0]}"))
    keep = measured & possible & ~empty
    return readings if keep.all() else readings.take(keep)


def _or_none(column: Floats) -> Floats | None:
    return column if np.isfinite(column).any() else None


def _one_talker(dated: Dated, readings: _Readings, name: str, notices: list[Notice]) -> _Readings:
    """The headings of the talker that says most, and of others that speak in its pauses only."""
    talker = dated.sentences.talker[readings.rows]
    if (talker == talker[0]).all():
        return readings
    talkers, counts = np.unique(talker, return_counts=True)
    first = int(talkers[np.argmax(counts)])
    epoch_s = dated.running_s[readings.rows]
    for one in talkers.tolist():
        own = np.flatnonzero(talker == one)
        if np.isnan(epoch_s[own]).all():
            epoch_s[own] = epochs_of_untimed(dated, readings.rows[own])
    key = epoch_key(epoch_s)
    keep = talker == first
    for one in talkers[talkers != first].tolist():
        own = talker == one
        names = talker_name(one), talker_name(first)
        where = f"line {dated.sentences.line[readings.rows[own][0]]}"
        if np.isin(key[own], key[talker == first]).mean() < _LEAST_SHARE:
            keep |= own
            what = f"headings of talker {names[0]} in the pauses of {names[1]} read as one receiver's"
            notices.append(Notice(name, what, int(own.sum()), where))
        else:
            what = f"headings of talker {names[0]} dropped beside those of {names[1]}, which are more"
            notices.append(Notice(name, what, int(own.sum()), where, "warning"))
    return readings.take(keep)


def _epochs(dated: Dated, readings: _Readings, name: str, notices: list[Notice]) -> tuple[Floats | None, Floats]:
    """UTC of the readings' epochs (m,), None where they come by a clock of their own, and their receive times (m,).

    The receive times follow the epochs' own spacing, so that they increase; where the log has none they are UTC.
    Untimed headings that come much oftener than epochs are another instrument's: they are true when they arrive.
    """
    sentences, rows = dated.sentences, readings.rows
    host_s = sentences.host_t_s[rows]
    epoch_s = dated.running_s[rows]
    if readings.kind in UNTIMED:
        epochs = np.unique(epoch_key(dated.running_s[np.isfinite(dated.running_s)])).size
        if rows.size > _OFTENER * epochs and np.isfinite(host_s).all():
            what = "headings come oftener than fixes: taken as true when they were received"
            notices.append(Notice(name, what, rows.size, f"line {sentences.line[rows[0]]}"))
            return None, host_s
        epoch_s = np.full(rows.size, np.nan)
        for one in np.unique(sentences.talker[rows]).tolist():
            own = sentences.talker[rows] == one
            epoch_s[own] = epochs_of_untimed(dated, rows[own])
    utc_s = epoch_s + dated.midnight_s[rows]
    late_s = host_s - utc_s
    known = np.isfinite(late_s)
    return utc_s, utc_s + float(np.median(late_s[known])) if known.any() else utc_s


def _stated(sigma_deg: Floats | None) -> Floats | None:
    if sigma_deg is None or not (sigma_deg > 0).any():
        return None
    return np.minimum(np.radians(np.where(sigma_deg > 0, sigma_deg, np.nan)), SIGMA_LIMIT_RAD)


def _filled(angle_deg: Floats | None, t_s: Floats) -> Floats | None:
    """In radians, gaps filled in between their neighbours; None where half of it or more is missing."""
    if angle_deg is None:
        return None
    known = np.abs(angle_deg) <= 360.0
    if known.mean() <= 0.5:
        return None
    return np.radians(angle_deg if known.all() else np.interp(t_s, t_s[known], angle_deg[known]))
