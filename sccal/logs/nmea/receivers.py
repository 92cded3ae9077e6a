"""One receiver's fixes out of a log in which several talkers, or several receivers, state a position.

A receiver that knows satellites of several systems may write the same epoch as GPGGA and GNGGA, or change its talker
with what it sees; two receivers may also write into one log. Where the fixes of two talkers share their epochs, one is
chosen for the whole log: two solutions that differ by decimetres are not one track.
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.logs.nmea.kinds import LAYOUTS
from sccal.logs.nmea.positions import Positions
from sccal.logs.nmea.sentences import talker_name
from sccal.logs.nmea.times import Dated, epoch_key
from sccal.logs.streams import Notice

_BEST_FIRST = (4, 5, 2, 9, 3, 1, -1, 8, 6, 7)
_LEAST_SHARE = 0.1
_SAME_PLACE_M = 0.05
_METRES_PER_DEG = 111_320.0


def one_receiver(dated: Dated, positions: Positions, source: str, notices: list[Notice]) -> Positions:
    """Only the fixes of one receiver: the talker with the best, and others where they speak in its pauses."""
    talker = dated.sentences.talker[positions.rows]
    if (talker == talker[0]).all():
        return _one_of_two(dated, positions, source, notices)
    name = LAYOUTS[positions.kind].name

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


def _beside(dated: Dated, best: Positions, other: Positions) -> tuple[Bools, float]:
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


def _one_of_two(dated: Dated, positions: Positions, source: str, notices: list[Notice]) -> Positions:
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
        f"{LAYOUTS[positions.kind].name} fixes dropped: two for each epoch, {apart_m:.2f} m apart, look like two "
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
