"""One piece of an NMEA log, whole lines, with its sentences rewritten: new positions and claims, or no fix.

What a sentence without a fix holds is what receivers write: quality 0 (status V, mode N), no position, height, speed
or course, 00 satellites, HDOP 99.99; the number of fields, the time and the date stay.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.degrade.edits import Bytes, Edits, constant
from sccal.degrade.epochs import Epochs, Holders
from sccal.degrade.faults import FaultedFixes, Faults
from sccal.degrade.places import moved
from sccal.degrade.quality import written_hdop
from sccal.logs.decimals import read_digits, write_decimals
from sccal.logs.nmea.kinds import GST_SIGMAS, LAYOUTS, Kind, Position
from sccal.logs.nmea.positions import position_of
from sccal.logs.nmea.sentences import LONG_CHECKSUM_DIGITS, Sentences, crc_32
from sccal.logs.nmea.times import times_of_day

_MOST_PLACES = {False: 11, True: 13}
"""Places up to which a float holds minutes and degrees; further ones are written as zeros."""
_FAR_DEG = 0.01
_LARGEST = 9e17
"""What the digits of a field can hold."""
_UPPER = np.frombuffer(b"0123456789ABCDEF", dtype=np.uint8)
_LOWER = np.frombuffer(b"0123456789abcdef", dtype=np.uint8)


@dataclass(frozen=True)
class Plan:
    """What to do to a log: its epochs, and what becomes of them."""

    faults: Faults
    epochs: Epochs
    fixes: FaultedFixes
    small_hex: bool
    """Checksums without a letter get small ones."""


class _Piece:
    """A piece of log, its sentences that hold positions, and the edits so far."""

    def __init__(self, found: Sentences, size: int, plan: Plan) -> None:
        self.found = found
        self.plan = plan
        self.edits = Edits(found.data, size)
        self.change = np.zeros(found.start.size, dtype=np.uint8)
        self.touched = np.zeros(found.start.size, dtype=np.bool_)
        self.size = size

    def has(self, rows: Ints, field: int) -> Bools:
        """Which sentences have that field, empty or not."""
        there: Bools = self.found.fields[rows] >= field
        return there

    def put(self, rows: Ints, begin: Ints, end: Ints, text: Bytes) -> None:
        """New text for a span of each of the sentences ``rows`` (k,)."""
        self.change[rows] ^= self.edits.put(begin, end, text)
        self.touched[rows] = True

    def put_field(self, rows: Ints, field: int, text: bytes) -> None:
        """The same text for a field of each of the sentences ``rows`` that has it with another text."""
        rows = rows[self.has(rows, field)]
        begin, end = self.found.span(field, rows)
        other = end - begin != len(text)
        for place, mark in enumerate(text):
            other |= self.found.data[np.minimum(begin + place, self.found.data.size - 1)] != mark
        self.put(rows[other], begin[other], end[other], constant(text, int(other.sum())))


def rewritten_piece(
    found: Sentences, size: int, holders: Holders, epoch_of: Ints, plan: Plan
) -> tuple[bytes, Counter[str]]:
    """A piece of ``size`` bytes after the plan, and how many sentences of each kind were changed.

    ``epoch_of`` (k,) is the epoch of each of the ``holders``; -1 where a sentence has none.
    """
    piece = _Piece(found, size, plan)
    dropped: list[Ints] = []
    for kind in np.unique(holders.kind).tolist():
        rows = np.flatnonzero((holders.kind == kind) & (epoch_of >= 0))
        fields = position_of(Kind(kind))
        lost = plan.fixes.lost[epoch_of[rows]] & _filled(piece, holders.row[rows], fields)
        if plan.faults.drop:
            dropped.append(rows[lost])
        else:
            _lose(piece, holders.row[rows[lost]], fields)
        alive = rows[~plan.fixes.lost[epoch_of[rows]]]
        _move(piece, holders, alive, epoch_of[alive], fields)
        _claim(piece, holders.row[alive], holders.quality[alive], epoch_of[alive], fields)
    if plan.faults.gst and plan.faults.noise_m:
        _widen_gst(piece)
    _close(piece, holders)
    counts = _counts(holders, piece.touched[holders.row])
    if plan.faults.gst:
        gst = int(np.count_nonzero(piece.touched & (found.kind == Kind.GST)))
        counts.update({"GST": gst} if gst else {})
    for rows in dropped:
        _leave_out(piece, holders.row[rows], holders.with_crc[rows])
        counts.update(_counts(holders, np.isin(np.arange(holders.row.size), rows)))
    return piece.edits.applied(), counts


def _counts(holders: Holders, chosen: Bools) -> Counter[str]:
    kinds, counts = np.unique(holders.kind[chosen], return_counts=True)
    return Counter(
        {LAYOUTS[Kind(kind)].name: int(count) for kind, count in zip(kinds.tolist(), counts.tolist(), strict=True)}
    )


def _filled(piece: _Piece, rows: Ints, fields: Position) -> Bools:
    """Which sentences have anything where the position stands."""
    filled = np.zeros(rows.size, dtype=np.bool_)
    for field in (fields.latitude, fields.longitude):
        begin, end = piece.found.span(field, rows)
        filled |= end > begin
    return filled


def _lose(piece: _Piece, rows: Ints, fields: Position) -> None:
    sides = () if fields.in_degrees else (fields.latitude + 1, fields.longitude + 1)
    for field in (fields.latitude, fields.longitude, *sides, *fields.emptied):
        piece.put_field(rows, field, b"")
    for field, text in fields.lost:
        piece.put_field(rows, field, text.encode())
    if fields.claim.form == "letters":
        _put_modes(piece, rows, fields.quality, np.full(rows.size, ord("N"), dtype=np.uint8), over_none=True)


def _move(piece: _Piece, holders: Holders, at: Ints, epoch: Ints, fields: Position) -> None:
    fixes, epochs = piece.plan.fixes, piece.plan.epochs
    going = fixes.displaced[epoch] & np.isfinite(holders.lat_deg[at])
    at, epoch = at[going], epoch[going]
    rows = holders.row[at]
    old_lat, old_lon = holders.lat_deg[at], holders.lon_deg[at]
    lat_step, lon_step = old_lat - epochs.lat_deg[epoch], _turned(old_lon - epochs.lon_deg[epoch])
    lat = _as_epoch(lat_step, holders.lat_digits[at], fields) + fixes.lat_deg[epoch]
    lon = _turned(_as_epoch(lon_step, holders.lon_digits[at], fields) + fixes.lon_deg[epoch])
    far = (np.abs(lat_step) > _FAR_DEG) | (np.abs(lon_step) > _FAR_DEG) | (np.abs(lat) > 90)
    if far.any():
        lat[far], lon[far] = moved(old_lat[far], old_lon[far], fixes.east_m[epoch[far]], fixes.north_m[epoch[far]])
    _put_angle(piece, rows, fields, fields.latitude, lat, holders.lat_digits[at], b"NS")
    _put_angle(piece, rows, fields, fields.longitude, lon, holders.lon_digits[at], b"EW")
    if fields.from_base_m is not None:
        east, north = fields.from_base_m
        _put_values(piece, rows, east, lambda east_m, good: east_m + fixes.east_m[epoch[good]])
        _put_values(piece, rows, north, lambda north_m, good: north_m + fixes.north_m[epoch[good]])


def _as_epoch(step_deg: Floats, digits: Ints, fields: Position) -> Floats:
    """Steps from the epoch's position, 0 where they are only the rounding of a field with fewer digits."""
    unit_deg = 10.0 ** -(np.abs(digits) % 100) / (1.0 if fields.in_degrees else 60.0)
    return np.where(np.abs(step_deg) <= 1.001 * unit_deg, 0.0, step_deg)


def _turned(lon_deg: Floats) -> Floats:
    return np.where(np.abs(lon_deg) > 180, (lon_deg + 180) % 360 - 180, lon_deg)


def _put_angle(
    piece: _Piece, rows: Ints, fields: Position, field: int, angle_deg: Floats, digits: Ints, sides: bytes
) -> None:
    """Write angles with the digits that their fields have, and the hemisphere after them."""
    places = np.abs(digits) % 100
    exact = np.minimum(places, _MOST_PLACES[fields.in_degrees])
    unit = 10**exact
    if fields.in_degrees:
        mantissa = np.round(np.abs(angle_deg) * unit).astype(np.int64)
    else:
        units = np.round(np.abs(angle_deg) * 60 * unit).astype(np.int64)
        mantissa = units // (60 * unit) * (100 * unit) + units % (60 * unit)
    mantissa *= 10 ** (places - exact)
    minus = (angle_deg < 0) & fields.in_degrees
    begin, end = piece.found.span(field, rows)
    piece.put(rows, begin, end, write_decimals(mantissa, minus, np.abs(digits) // 100, places, digits > 0))
    if fields.in_degrees:
        return
    begin, _ = piece.found.span(field + 1, rows)
    old = piece.found.data[begin] & 0xDF
    new = np.where(angle_deg < 0, sides[1], sides[0]).astype(np.uint8)
    turned = np.flatnonzero((old != new) & (mantissa > 0))
    piece.put(rows[turned], begin[turned], begin[turned] + 1, new[turned][:, None])


def _put_values(piece: _Piece, rows: Ints, field: int, new: Callable[[Floats, Bools], Floats]) -> None:
    """New values for a number's field, with as many places as it has.

    ``new`` is given the old values (m,) and which of ``rows`` (k,) they are of.
    """
    begin, end = piece.found.span(field, rows)
    old = read_digits(piece.found.data, begin, end)
    good = old.good & (old.places <= _MOST_PLACES[True])
    values = new(old.values[good], good)
    mantissa = np.round(np.minimum(np.abs(values) * 10.0 ** old.places[good], _LARGEST)).astype(np.int64)
    whole = np.where(old.whole > 1, np.minimum(old.whole, 2), old.whole)[good]
    text = write_decimals(mantissa, values < 0, whole, old.places[good], old.dotted[good])
    piece.put(rows[good], begin[good], end[good], text)


def _claim(piece: _Piece, rows: Ints, own_quality: Ints, epoch: Ints, fields: Position) -> None:
    """What the sentences say about how good their fix is."""
    plan = piece.plan
    noisy = plan.fixes.noisy[epoch] & (own_quality != 0)
    rows, own_quality, epoch = rows[noisy], own_quality[noisy], epoch[noisy]
    old, new = plan.epochs.quality[epoch], plan.fixes.quality[epoch]
    for quality in np.unique(new[(new != old) & (old > 0)]).tolist():
        with_it = (new == quality) & (new != old) & (old > 0)
        text = fields.claim.written[quality]
        stated = rows[with_it & (own_quality > 0)]
        if fields.claim.form == "letters":
            _put_modes(piece, stated, fields.quality, np.full(stated.size, ord(text), dtype=np.uint8), over_none=False)
        else:
            piece.put_field(stated, fields.quality, text.encode())
        if quality == 0 and fields.status is not None:
            piece.put_field(rows[with_it], fields.status, dict(fields.lost)[fields.status].encode())
    noise_m = plan.faults.noise_m
    if not noise_m:
        return
    if fields.hdop is not None:
        _put_values(piece, rows, fields.hdop, lambda hdop, good: written_hdop(hdop, noise_m, new[good]))
    for field in fields.sigmas_m or ():
        _put_values(piece, rows, field, lambda sigma_m, _: np.hypot(sigma_m, noise_m))
    if fields.accuracy_m is not None:
        _put_values(piece, rows, fields.accuracy_m, lambda accuracy_m, _: np.hypot(accuracy_m, math.sqrt(2) * noise_m))


def _put_modes(piece: _Piece, rows: Ints, field: int, letter: Bytes, over_none: bool) -> None:
    """GNS: a letter for each constellation; N, no fix, stays N unless ``over_none``."""
    begin, end = piece.found.span(field, rows)
    length = end - begin
    text = np.zeros((rows.size, int(length.max(initial=0))), dtype=np.uint8)
    for place in range(text.shape[1]):
        inside = place < length
        old = piece.found.data[np.where(inside, begin + place, 0)]
        new = letter if over_none else np.where(old == ord("N"), old, letter)
        text[:, place] = np.where(inside, new, 0)
    piece.put(rows, begin, end, text)


def _widen_gst(piece: _Piece) -> None:
    """The noise put into the error fields of GST."""
    found, plan = piece.found, piece.plan
    rows = np.flatnonzero((found.kind == Kind.GST) & (found.right_checksum | (~found.has_checksum & found.complete)))
    part = found.take(rows)
    epoch = plan.epochs.at(times_of_day(part, (Kind.GST,)))
    rows = rows[(epoch >= 0) & plan.fixes.noisy[epoch] & ~plan.fixes.lost[epoch]]
    for field in GST_SIGMAS:
        _put_values(piece, rows, field, lambda sigma_m, _: np.hypot(sigma_m, plan.faults.noise_m))


def _close(piece: _Piece, holders: Holders) -> None:
    """Right checksums after what was touched."""
    found, data = piece.found, piece.found.data
    with_crc = np.zeros(found.start.size, dtype=np.bool_)
    with_crc[holders.row[holders.with_crc]] = True
    rows = np.flatnonzero(piece.touched & found.has_checksum & ~with_crc)
    star = found.stop[rows]
    digits = np.stack([data[star + 1], data[star + 2]])
    value = np.where(digits >= ord("A"), (digits & 0xDF) - ord("A") + 10, digits - ord("0"))
    value = (value[0] * 16 + value[1]).astype(np.uint8) ^ piece.change[rows]
    small = (digits >= ord("a")).any(axis=0)
    large = ((digits >= ord("A")) & (digits <= ord("F"))).any(axis=0)
    small |= ~large & piece.plan.small_hex
    text = np.column_stack([np.where(small, _LOWER[half], _UPPER[half]) for half in (value >> 4, value & 15)])
    piece.edits.put(star + 1, star + 3, text)
    for row in np.flatnonzero(piece.touched & with_crc).tolist():
        stop = int(found.stop[row])
        crc = f"{crc_32(piece.edits.within(int(found.start[row]) + 1, stop)):08X}"
        old = data[stop + 1 : stop + 1 + LONG_CHECKSUM_DIGITS].tobytes()
        new = (crc.lower() if old != old.upper() else crc).encode()
        piece.edits.put(np.array([stop + 1]), np.array([stop + 1 + LONG_CHECKSUM_DIGITS]), constant(new, 1))


def _leave_out(piece: _Piece, rows: Ints, with_crc: Bools) -> None:
    """Cut sentences out: the whole line where it holds nothing else but a receive time, else the sentence alone."""
    found, size = piece.found, piece.size
    body = found.data[:size]
    breaks = np.append(np.flatnonzero((body == ord("\n")) | (body == ord("\r"))), size)
    start = found.start[rows]
    stop = found.stop[rows] + np.where(with_crc, 1 + LONG_CHECKSUM_DIGITS, np.where(found.has_checksum[rows], 3, 0))
    line_at = np.searchsorted(breaks, start)
    line_start = np.where(line_at > 0, breaks[line_at - 1] + 1, 0)
    line_stop = breaks[np.searchsorted(breaks, stop)]
    before = np.where(rows > 0, found.start[rows - 1], -1)
    alone = (line_stop == stop) & (before < line_start)
    alone &= (start == line_start) | np.isfinite(found.host_t_s[rows])
    last = found.data[np.minimum(line_stop, size)]
    after = line_stop + (line_stop < size)
    after += (last == ord("\r")) & (after < size) & (found.data[np.minimum(after, size)] == ord("\n"))
    nothing = np.zeros((rows.size, 0), dtype=np.uint8)
    piece.edits.put(np.where(alone, line_start, start), np.where(alone, after, stop), nothing)
