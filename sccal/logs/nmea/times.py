"""When an NMEA sentence was true: time of day, date, and the epoch of the sentences that state neither.

GGA, GNS, GST, PASHR and PTNL,AVR state a time of day; RMC, ZDA, PTNL,GGK and KSXT a date too. HDT, THS and VTG state
nothing: they belong to the epoch of the sentences among which they stand.

A receiver counts GPS time and learns from the satellites, within 12.5 minutes, how many leap seconds UTC is behind.
Until then it writes GPS time (18 s ahead of UTC since 2017) or trusts a number that its firmware was built with (some
seconds ahead): its UTC then steps back in the middle of the log. It counts weeks modulo 1024: a receiver that is too
old, or does not know the year, writes dates 7168 days early. Sources: IS-GPS-200, 20.3.3.5.2.4 and 20.3.3.3.1.1;
u-blox integration manuals, "Leap seconds" and "GPS week number rollover"; NovAtel OEM7 documentation, NMEA logs ("UTC
time calculated with default parameters").
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.bursts import spread_bursts
from sccal.logs.decimals import Decimals
from sccal.logs.nmea.kinds import LAYOUTS, READ, READ_FOR_DATES, READ_FOR_POSITIONS, Date, Kind
from sccal.logs.nmea.sentences import Sentences, kinds_in
from sccal.logs.streams import ClockStep, Notice

DAY_S = 86400.0
ROLLOVER_DAYS = 1024 * 7
LEAP_SECONDS = 18.0
"""GPS time minus UTC since 2017 (IERS Bulletin C 52 and later: none since), for messages in GPS time."""
UNIX_FROM_S = 1e9
"""Receive times from here on (2001) are Unix time; smaller ones count from an arbitrary zero."""

_LONG_AGO_DAY = 14610  # 2010-01-01
_GPS_DAY = 3657.0  # 1980-01-06
_MOST_WEEKS = 10_000
_TEN_TO = 10 ** np.arange(19, dtype=np.int64)
_MOST_PLACES = 9
_LARGEST_STEP_S = 20
_WHOLE_WITHIN_S = 0.2
_LEAST_STEP_S = 0.75
_FEWEST_ROWS = 5
_FEWEST_IN_SECONDS = 3
_SIDE_ROWS = 200
_MOST_STEPS = 20
_STAMPED = [kind for kind, layout in LAYOUTS.items() if layout.date is not None and layout.date.form == "stamp"]
_BURST_SHARE = 0.75
"""Of the time between epochs: sentences that lie further apart than this do not belong together."""


@dataclass(frozen=True)
class Dated:
    """The sentences that can be relied on, with the epoch that each belongs to; arrays of length n, in file order."""

    sentences: Sentences
    running_s: Floats
    """Time of day, counted on past midnight; the same number for all of one epoch; NaN where none is stated."""
    midnight_s: Floats
    """What to add for Unix time; 0 where there is no date."""
    has_date: bool
    clock_steps: tuple[ClockStep, ...] = ()
    """Of the receive times (see set_clock)."""

    @property
    def step_s(self) -> float:
        """Usual time between epochs; NaN with fewer than two of them."""
        steps_s = np.diff(self.running_s[np.isfinite(self.running_s)])
        steps_s = steps_s[steps_s > 0]
        return float(np.median(steps_s)) if steps_s.size else float("nan")


def date_sentences(sentences: Sentences, source: str, notices: list[Notice]) -> Dated:
    """Give every sentence its epoch; what had to be mended for it is told."""
    tod_s = times_of_day(sentences, READ)
    timed = np.flatnonzero(np.isfinite(tod_s))
    running_s = np.full(tod_s.size, np.nan)
    running_s[timed] = unwrapped(tod_s[timed])
    _mend_steps(sentences, running_s, timed, source, notices)
    _give_fractions(sentences, running_s, source, notices)
    midnight_s, has_date = _midnights(sentences, tod_s, running_s, timed, source, notices)
    if has_date:
        midnight_s += _rollover_s(sentences, running_s + midnight_s, source, notices)
    return Dated(sentences, running_s, midnight_s, has_date)


def _give_fractions(sentences: Sentences, running_s: Floats, source: str, notices: list[Notice]) -> None:
    """Spread the epochs of several fixes in one second whose times have lost their fractions; in place.

    Two receivers that give one fix a second each look alike, so it takes three in a second, of one talker.
    """
    there = np.bincount(sentences.kind, minlength=256)
    for kind in READ_FOR_POSITIONS:
        if not there[kind]:
            continue
        rows = np.flatnonzero(sentences.kind == kind)
        begin_s = running_s[rows[:_FEWEST_ROWS]]
        if (begin_s != np.floor(begin_s))[np.isfinite(begin_s)].any():
            continue
        rows = rows[np.isfinite(running_s[rows])]
        t_s = running_s[rows]
        if rows.size < _FEWEST_IN_SECONDS * _FEWEST_ROWS or not (t_s == np.floor(t_s)).all():
            continue
        _, sizes = np.unique(t_s, return_counts=True)
        if np.median(sizes) < _FEWEST_IN_SECONDS or np.unique(sentences.talker[rows]).size > 1:
            continue
        own, position = sentences.take(rows), LAYOUTS[kind].position
        assert position is not None
        places = [own.number(field) for field in (position.latitude, position.longitude)]
        running_s[rows] = spread_bursts(t_s, places, own.line, source, notices)


def epoch_key(running_s: Floats) -> Ints:
    """Epochs as whole milliseconds, to compare them; −1 where there is none."""
    return np.where(np.isfinite(running_s), np.round(running_s * 1000), -1).astype(np.int64)


def epochs_of_untimed(dated: Dated, rows: Ints) -> Floats:
    """Epochs (m,) of the untimed sentences at ``rows`` (m,), all of one kind and talker; NaN where there is none.

    Between two sentences of one epoch it is that epoch. At the border of two, the receiver's habit decides: it writes
    the sentence after the others of its epoch, or before them. The receive times tell which (the pause lies between the
    bursts); without them it is after. An epoch that gets several keeps the one that stands nearest to it.
    """
    sentences, running_s = dated.sentences, dated.running_s
    timed = np.flatnonzero(np.isfinite(running_s))
    if timed.size == 0 or rows.size == 0:
        return np.full(rows.size, np.nan)
    after = np.searchsorted(timed, rows)
    previous, following = timed[np.maximum(after - 1, 0)], timed[np.minimum(after, timed.size - 1)]
    has_previous, has_following = after > 0, after < timed.size
    host_s = sentences.host_t_s
    since_s = np.where(has_previous, host_s[rows] - host_s[previous], np.inf)
    until_s = np.where(has_following, host_s[following] - host_s[rows], np.inf)
    inside = has_previous & has_following & (np.abs(running_s[previous] - running_s[following]) < 1e-4)
    known = ~inside & np.isfinite(since_s) & np.isfinite(until_s)
    leads = bool(known.any()) and float(np.median(since_s[known])) > float(np.median(until_s[known]))
    own = np.where(inside, previous, following if leads else previous)
    belongs = inside | (has_following if leads else has_previous)
    away_s = np.where(inside, np.minimum(since_s, until_s), until_s if leads else since_s)
    belongs &= ~(away_s > _BURST_SHARE * dated.step_s)
    epoch_s = np.where(belongs, running_s[own], np.nan)
    order = np.flatnonzero(belongs)[:: -1 if leads else 1]
    _, first = np.unique(epoch_key(epoch_s[order]), return_index=True)
    nearest = np.zeros(rows.size, dtype=np.bool_)
    nearest[order[first]] = True
    return np.where(nearest, epoch_s, np.nan)


def times_of_day(sentences: Sentences, kinds: Iterable[Kind]) -> Floats:
    """(n) seconds since midnight by sentences of some kinds; NaN where no time is stated or the field is none."""
    tod_s = np.full(sentences.start.size, np.nan)
    there = np.bincount(sentences.kind, minlength=256)
    kinds = [kind for kind in kinds if there[kind] and LAYOUTS[kind].time is not None]
    for field, clock in {(LAYOUTS[kind].time, LAYOUTS[kind].clock) for kind in kinds}:
        assert field is not None
        alike = [kind for kind in kinds if (LAYOUTS[kind].time, LAYOUTS[kind].clock) == (field, clock)]
        rows = np.flatnonzero(kinds_in(sentences.kind, alike))
        if rows.size and clock != "utc":
            of_week = sentences.take(rows).number(field) / (1000.0 if clock == "week_ms" else 1.0)
            tod_s[rows] = np.round((of_week - LEAP_SECONDS) % DAY_S, 3)
        elif rows.size:
            stamps = kinds_in(sentences.kind[rows], _STAMPED)
            tod_s[rows] = _seconds_of_day(sentences.take(rows).decimals(field), stamps)
    return tod_s


def _seconds_of_day(stated: Decimals, stamps: Bools) -> Floats:
    """Out of ``hhmmss.ss`` (n,), with the date before it in stamps."""
    whole = np.where(stated.good & (stated.places <= _MOST_PLACES), stated.mantissa, -1)
    unit = _TEN_TO[np.minimum(stated.places, _MOST_PLACES)]
    if stamps.any():
        whole = np.where(stamps, np.where(whole >= 0, whole % (10**6 * unit), -1), whole)
    minutes, seconds = np.divmod(whole, 100 * unit)
    seconds_s = seconds / unit
    hours, minutes = np.divmod(minutes, 100)
    plausible = (whole >= 0) & (hours < 24) & (minutes < 60) & (seconds_s < 61)
    return np.where(plausible, hours * 3600 + minutes * 60 + seconds_s, np.nan)


def unwrapped(tod_s: Floats) -> Floats:
    """Times of day counted on past midnight."""
    days = np.round(np.diff(tod_s) / DAY_S)
    if not days.any():
        return tod_s
    return tod_s - DAY_S * np.concatenate(([0.0], np.cumsum(days)))


def _mend_steps(sentences: Sentences, running_s: Floats, timed: Ints, source: str, notices: list[Notice]) -> None:
    """Move the times before a step of whole seconds, so that they continue into those after it; in place."""
    if timed.size < 2 * _FEWEST_ROWS:
        return
    step_s = np.diff(running_s[timed])
    host_s = sentences.host_t_s[timed]
    host_step_s = np.diff(host_s)
    with_host = bool(np.isfinite(host_s).mean() > 0.5)
    odd = (np.abs(host_step_s - step_s) >= _LEAST_STEP_S) if with_host else (step_s <= -_LEAST_STEP_S)
    borders = np.flatnonzero(odd) + 1
    if not 0 < borders.size <= _MOST_STEPS:
        return
    forward = step_s[step_s > 0]
    usual_s = float(np.median(forward)) if forward.size else 0.0
    edges = np.concatenate(([0], borders, [timed.size]))
    seen = np.isfinite(host_s) if with_host else np.ones(timed.size, dtype=np.bool_)
    for i, border in enumerate(borders.tolist()):
        before = slice(max(edges[i], border - _SIDE_ROWS), border)
        after = slice(border, min(edges[i + 2], border + _SIDE_ROWS))
        if min(seen[before].sum(), seen[after].sum()) < _FEWEST_ROWS:
            continue
        step, host_step = float(step_s[border - 1]), float(host_step_s[border - 1])
        if with_host:
            delay_s = host_s - running_s[timed]
            lost_s = float(np.nanmedian(delay_s[after]) - np.nanmedian(delay_s[before]))
            ours = step < 0 or abs(step - usual_s) > abs(host_step - usual_s) or min(step, lost_s) > 3 * usual_s
        else:
            lost_s, ours = usual_s - step, True
        whole = round(lost_s)
        if not ours or not 1 <= abs(whole) <= _LARGEST_STEP_S or abs(lost_s - whole) > _WHOLE_WITHIN_S:
            continue
        running_s[timed[:border]] -= whole
        line = sentences.line[timed[border]]
        what = (
            f"times before a step of the receiver's UTC by {-whole:+d} s moved by as much: it learnt the leap seconds "
            "only then"
        )
        doubt = "" if with_host else f"{source}: UTC steps by {-whole:+d} s, and no receive times show since when"
        notices.append(Notice(source, what, border, f"line {line}", "warning", doubt))


def _midnights(
    sentences: Sentences, tod_s: Floats, running_s: Floats, timed: Ints, source: str, notices: list[Notice]
) -> tuple[Floats, bool]:
    """(n) what to add to the running time of day to get Unix time, and whether a date was found.

    The dates of a run in one go all give the same midnight; a date that holds for a few sentences only is nonsense.
    """
    none = np.zeros(tod_s.size)
    rows, day = _dates(sentences, timed)
    if rows.size == 0:
        return none, False
    offset_s = np.round((day * DAY_S + tod_s[rows] - running_s[rows]) / DAY_S) * DAY_S
    if (offset_s == offset_s[0]).all():
        return none + offset_s[0], True
    _, which, counts = np.unique(offset_s, return_inverse=True, return_counts=True)
    rare = (counts < max(3.0, 0.05 * rows.size)) & (counts < counts.max())
    lost = rare[which]
    if lost.any():
        first = rows[lost][0]
        wrong_date = np.datetime64(int(day[lost][0]), "D")
        what = f"dates that the others contradict ignored ({wrong_date})"
        notices.append(Notice(source, what, int(lost.sum()), f"line {sentences.line[first]}", "warning"))
        rows, offset_s = rows[~lost], offset_s[~lost]
    nearest = np.searchsorted(rows, np.arange(tod_s.size), side="right") - 1
    return offset_s[np.maximum(nearest, 0)], True


def _dates(sentences: Sentences, timed: Ints) -> tuple[Ints, Floats]:
    """Rows that state a date (m,), of the best source that there is, and their days since 1970-01-01 (m,)."""
    kind = sentences.kind[timed]
    void: tuple[Ints, Floats] | None = None
    for source in READ_FOR_DATES:
        rows = timed[kind == source]
        if rows.size == 0:
            continue
        own, date = sentences.take(rows), LAYOUTS[source].date
        assert date is not None
        day = days_stated(own, date)
        good = np.isfinite(day)
        if source == Kind.RMC:
            void = rows[good], day[good]
            good &= own.letter(2) == ord("A")
        if good.any():
            return rows[good], day[good]
    return void if void is not None else (timed[:0], np.empty(0))


def days_stated(own: Sentences, date: Date) -> Floats:
    """(n) days since 1970-01-01 stated by sentences of one kind, NaN for impossible dates."""
    if date.form == "dd,mm,yyyy":
        day, month, year = (own.decimals(field) for field in date.fields)
        good = day.good & month.good & year.good & (day.places + month.places + year.places == 0)
        return _days(day.mantissa, month.mantissa, year.mantissa, good)
    if date.form in ("week,s", "week,ms"):
        return _days_of_weeks(own, date)
    stated = own.decimals(date.fields[0])
    good = stated.good & (stated.mantissa >= 0)
    if date.form == "stamp":
        packed = stated.mantissa // (10**6 * _TEN_TO[np.minimum(stated.places, _MOST_PLACES)])
        return _days(packed % 100, packed // 100 % 100, packed // 10000, good & (packed >= 19800106))
    first, second, short = stated.mantissa // 10000, stated.mantissa // 100 % 100, stated.mantissa % 100
    years = short + np.where(short >= 80, 1900, 2000)
    good &= stated.places == 0
    if date.form == "ddmmyy":
        return _days(first, second, years, good)
    american = _days(second, first, years, good)
    return american if np.isfinite(american).any() else _days(first, second, years, good)


def _days_of_weeks(own: Sentences, date: Date) -> Floats:
    """The same of GPS weeks and what has passed of them; week 0 is that of a receiver that knows no time yet."""
    week, of_week = own.number(date.fields[0]), own.number(date.fields[0] + 1)
    utc_s = np.round(of_week / (1000.0 if date.form == "week,ms" else 1.0) - LEAP_SECONDS, 3)
    good = (week > 0) & (week < _MOST_WEEKS) & (of_week >= 0)
    return np.where(good, _GPS_DAY + 7.0 * np.floor(week) + np.floor(utc_s / DAY_S), np.nan)


def _days(day: Ints, month: Ints, year: Ints, good: Bools) -> Floats:
    good = good & (day >= 1) & (month >= 1) & (month <= 12) & (year >= 1970) & (year < 2200)
    packed = np.where(good, ((year - 1970) * 12 + month - 1) * 32 + day, 0)
    starts = np.flatnonzero(np.concatenate(([True], np.diff(packed) != 0))[: packed.size])
    months, days = packed[starts] // 32, packed[starts] % 32
    first = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    length = (months + 1).astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) - first
    since = np.where((days >= 1) & (days <= length), (first + days - 1).astype(float), np.nan)
    return np.repeat(since, np.diff(np.append(starts, packed.size)))


def _rollover_s(sentences: Sentences, utc_s: Floats, source: str, notices: list[Notice]) -> float:
    """Seconds to add to all dates because the receiver's week count rolled over; told, and 0 where it did not."""
    ahead_s = sentences.host_t_s - utc_s
    both = np.isfinite(ahead_s) & (sentences.host_t_s >= UNIX_FROM_S)
    dated = np.flatnonzero(np.isfinite(utc_s))
    if dated.size == 0:
        return 0.0
    stated = np.datetime64(int(utc_s[dated[0]] // DAY_S), "D")
    where = f"line {sentences.line[dated[0]]}"
    if both.any():
        behind_days = float(np.median(ahead_s[both])) / DAY_S
        turns = round(behind_days / ROLLOVER_DAYS)
        if turns == 0 or abs(behind_days - turns * ROLLOVER_DAYS) > 2.0:
            return 0.0
        what = (
            f"sentences with dates {abs(turns)} x 1024 weeks from the receive times' (the first says {stated}) moved "
            "there: the receiver's week count rolled over"
        )
        notices.append(Notice(source, what, int(dated.size), where, "warning"))
        return turns * ROLLOVER_DAYS * DAY_S
    if utc_s[dated[0]] < _LONG_AGO_DAY * DAY_S:
        what = (
            f"sentences are dated {stated}; if the drive is younger, the receiver's week count rolled over (1024 "
            "weeks), and only receive times before the lines can mend that"
        )
        notices.append(Notice(source, what, int(dated.size), where))
    return 0.0
