"""Receive times in any form: what terminals, loggers and other programs write before, after or above a sentence.

Plain seconds before the ``$`` are read with the sentences. This is for all other logs, line by line: ISO dates, times
of day, whole numbers of milli-, micro- and nanoseconds, several numbers of which one is the time, and the stamps that
ROS prints above a message. The receiver's own epochs tell the unit of a number, and which of several goes with them: it
must go on as they do. Times of day are local or UTC, and dates without a zone too: where the sentences have dates, they
are put to the quarter of an hour that the epochs show.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.logs.nmea.sentences import Sentences
from sccal.logs.nmea.times import DAY_S, date_sentences, unwrapped
from sccal.logs.streams import Notice

ZONE_STEP_S = 900.0
"""Zones of the world are whole quarters of an hour from UTC."""
_SAMPLE = 200
_LOOKED_AT = 200
"""Sentences from which it is told whether there is anything to read at all."""
_MOST_BEFORE = 400
"""Bytes before a sentence in which its time is looked for."""
_MOST_AFTER = 80
_LEAST_SHARE = 0.5
_SAME_RATE = 0.02
_UNITS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}
_MOST_NUMBERS = 6
_LAGS = 50

_ECHO = re.compile(rb"\bsecs?: *(\d{1,12})\s+n(?:ano)?secs?: *(\d{1,9})\b")
_DATE = re.compile(
    rb"(\d{4})[-/.](\d\d)[-/.](\d\d)[T _](\d\d):(\d\d):(\d\d)(?:[.,](\d{1,9}))?\s*(Z|[+-]\d\d:?\d\d(?![.:\d]))?"
)
_TIME_OF_DAY = re.compile(rb"(?<![\d:])(\d\d?):(\d\d):(\d\d)(?:[.,:](\d{1,9}))?(?![\d:])")
_NUMBER = re.compile(rb"(?<![\w.+-])-?\d{1,20}(?:\.\d+)?(?![\w.:])")


@dataclass(frozen=True)
class _Form:
    """A way in which times are written."""

    name: str
    read: Callable[[bytes], float]
    """Seconds; NaN where the text does not hold one."""
    local: bool = False
    """Whether it may be of any zone."""
    daily: bool = False
    """Whether it begins again at midnight."""


def with_receive_times(found: Sentences, source: str, notices: list[Notice]) -> Sentences:
    """The same sentences with receive times in whatever form they stand; told where it is not plain seconds."""
    if found.start.size == 0:
        return found
    begin = found.take(np.arange(min(found.start.size, _LOOKED_AT)))
    if np.isfinite(found.host_t_s).mean() > _LEAST_SHARE:
        return _in_seconds(found, begin, source, notices)
    first = np.flatnonzero(np.diff(found.line, prepend=0) > 0)
    looked = int(found.start[first[min(first.size, _LOOKED_AT) - 1]]) + _MOST_BEFORE
    if _texts_beside(begin, found.data[:looked].tobytes(), first[first < begin.start.size]) is None:
        return found
    raw = found.data.tobytes()
    texts = _texts_beside(found, raw, first)
    if texts is None:
        return found
    utc_s, dated = _epochs(found)
    form, unit_s = _form_of(texts, utc_s[first])
    if form is None:
        return found
    host = np.array([form.read(text) for text in texts]) * unit_s
    if form.daily:
        known = np.flatnonzero(np.isfinite(host))
        host[known] = unwrapped(host[known])
    zone = ""
    if form.local and dated:
        moved_s = _zone_s(host, utc_s[first])
        host = host + moved_s
        zone = f", taken as those of UTC{_hours_ahead(moved_s):+g} h"
    unit = "" if unit_s == 1.0 else f" in {_unit_name(unit_s)}"
    what = f"lines with receive times read as {form.name}{unit}{zone}"
    where = f"line {found.line[first[np.isfinite(host)][0]]}" if np.isfinite(host).any() else ""
    notices.append(Notice(source, what, int(np.isfinite(host).sum()), where))
    of_line = np.cumsum(np.diff(found.line, prepend=0) > 0) - 1
    return replace(found, host_t_s=host[of_line], odd_prefix=np.zeros(found.start.size, dtype=np.bool_))


def _unit_name(unit_s: float) -> str:
    return next(name for name, size in _UNITS.items() if size == unit_s)


def _epochs(found: Sentences) -> tuple[Floats, bool]:
    """The epoch of each sentence (n,), that of the one before where it states none, and whether it has a date."""
    good = np.flatnonzero(found.right_checksum | ~found.has_checksum)
    plain = replace(found.take(good), host_t_s=np.full(good.size, np.nan))
    dated = date_sentences(plain, "", [])
    utc_s = np.full(found.start.size, np.nan)
    utc_s[good] = dated.running_s + dated.midnight_s
    known = np.isfinite(utc_s)
    latest = np.maximum.accumulate(np.where(known, np.arange(utc_s.size), -1))
    return np.where(latest >= 0, utc_s[np.maximum(latest, 0)], np.nan), dated.has_date


def _in_seconds(found: Sentences, begin: Sentences, source: str, notices: list[Notice]) -> Sentences:
    """Plain numbers that are seconds, or go by another unit than the epochs of the first sentences say."""
    unit_s = _unit_of(begin.host_t_s, _epochs(begin)[0])
    if unit_s is None or unit_s == 1.0:
        return found
    what = f"receive times read as {_unit_name(unit_s)}: they count {1.0 / unit_s:,.0f} in a second of the receiver"
    notices.append(Notice(source, what, int(np.isfinite(found.host_t_s).sum()), f"line {found.line[0]}"))
    return replace(found, host_t_s=found.host_t_s * unit_s)


def _unit_of(numbers: Floats, utc_s: Floats) -> float | None:
    """The unit in which numbers (n,) go on as epochs (n,) do; None where they go on otherwise."""
    both = np.flatnonzero(np.isfinite(numbers) & np.isfinite(utc_s))
    lag = max(1, min(_LAGS, both.size // 4))
    if both.size < 2 * lag + 1:
        return None
    went, passed_s = numbers[both[lag:]] - numbers[both[:-lag]], utc_s[both[lag:]] - utc_s[both[:-lag]]
    moving = passed_s > 0
    if not moving.any():
        return None
    rate = float(np.median(went[moving] / passed_s[moving]))
    return next((unit for unit in _UNITS.values() if abs(rate * unit - 1.0) < _SAME_RATE), None)


def _texts_beside(found: Sentences, raw: bytes, first: Ints) -> list[bytes] | None:
    """Of each line what stands before its first sentence, else after its last one, else on the lines above."""
    start = found.start[first].tolist()
    ended = _ends(found, np.append(first[1:], found.start.size) - 1).tolist()
    above = [raw[max(a, b - _MOST_BEFORE) : b] for a, b in zip([0, *ended[:-1]], start, strict=True)]
    before = [text[max(text.rfind(b"\n"), text.rfind(b"\r")) + 1 :] for text in above]
    if _share(before) > _LEAST_SHARE:
        return before
    after = [_first_line(raw[a : min(b, a + _MOST_AFTER)]) for a, b in zip(ended, [*start[1:], len(raw)], strict=True)]
    return next((texts for texts in (after, above) if _share(texts) > _LEAST_SHARE), None)


def _first_line(text: bytes) -> bytes:
    return (text.splitlines() or [b""])[0]


def _ends(found: Sentences, rows: Ints) -> Ints:
    """Where sentences end, their checksum included."""
    stop = found.stop[rows]
    digits = np.where(found.has_checksum[rows], 3 + 6 * found.long_checksum[rows], 0)
    return np.asarray(stop + digits)


def _share(texts: Sequence[bytes]) -> float:
    """How many of some texts hold a digit."""
    sample = texts[:: max(1, len(texts) // _SAMPLE)]
    return sum(any(48 <= letter < 58 for letter in text) for text in sample) / len(sample)


def _form_of(texts: Sequence[bytes], utc_s: Floats) -> tuple[_Form | None, float]:
    """The form that most of a sample has, and the unit of its numbers."""
    rows = np.arange(0, len(texts), max(1, len(texts) // _SAMPLE))
    for form in (_Form("the stamps that ROS prints", _echoed), *_CLOCKS):
        if np.isfinite([form.read(texts[row]) for row in rows.tolist()]).mean() > _LEAST_SHARE:
            return form, 1.0
    near = np.arange(min(len(texts), 4 * _SAMPLE))
    for place in range(_MOST_NUMBERS):
        form = _Form(f"the {_ORDINALS[place]} number", lambda text, place=place: _number(text, place))  # type: ignore[misc]
        numbers = np.array([form.read(texts[row]) for row in near.tolist()])
        if np.isfinite(numbers).mean() > _LEAST_SHARE:
            unit = _unit_of(numbers, utc_s[near])
            if unit is not None:
                return form, unit
    return None, 1.0


_ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth")


def _echoed(text: bytes) -> float:
    matches = _ECHO.findall(text)
    return int(matches[-1][0]) + 1e-9 * int(matches[-1][1]) if matches else np.nan


def _fraction(digits: bytes) -> float:
    return float(b"0." + digits) if digits else 0.0


def _date_and_time(text: bytes, zoned: bool) -> float:
    match = _DATE.search(text)
    if match is None or (match[8] is not None) != zoned:
        return np.nan
    try:
        year, month, day, hour, minute, second = (int(match[number]) for number in range(1, 7))
        whole = dt.datetime(year, month, day, hour, minute, second, tzinfo=dt.UTC)
    except ValueError:
        return np.nan
    return whole.timestamp() + _fraction(match[7]) - (_offset_s(match[8]) if zoned else 0.0)


def _offset_s(zone: bytes) -> float:
    """Seconds that a zone such as +02:00 is ahead of UTC."""
    if zone == b"Z":
        return 0.0
    sign = -1.0 if zone[:1] == b"-" else 1.0
    return sign * (3600.0 * int(zone[1:3]) + 60.0 * int(zone[-2:]))


def _of_day(text: bytes) -> float:
    match = _TIME_OF_DAY.search(text)
    if match is None or int(match[1]) > 23:
        return np.nan
    return 3600.0 * int(match[1]) + 60.0 * int(match[2]) + int(match[3]) + _fraction(match[4])


def _number(text: bytes, place: int) -> float:
    numbers = _NUMBER.findall(text)
    return float(numbers[place]) if place < len(numbers) else np.nan


_CLOCKS = (
    _Form("dates and times with their zone", lambda text: _date_and_time(text, True)),
    _Form("dates and times", lambda text: _date_and_time(text, False), local=True),
    _Form("times of day", _of_day, local=True, daily=True),
)


def _hours_ahead(moved_s: float) -> float:
    """Of the zone of times that had to be moved so far to be UTC's, whatever their day."""
    return ((0.5 * DAY_S - moved_s) % DAY_S - 0.5 * DAY_S) / 3600.0


def _zone_s(host_s: Floats, utc_s: Floats) -> float:
    """What to add to times of some zone, and perhaps without a date, to get those of UTC."""
    away = (utc_s - host_s)[np.isfinite(utc_s - host_s)]
    return round(float(np.median(away)) / ZONE_STEP_S) * ZONE_STEP_S if away.size else 0.0
