"""Dialects of tables: decimal commas, dates and times of day, times in other units, rows of one wheel, bursts.

What a table means in the contract's words is decided here, and each decision is told. A table that keeps the contract
stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import DataError
from sccal.logs.limits import TIME_LIMIT_S
from sccal.logs.quality_words import qualities_of_words
from sccal.logs.streams import Notice

_LOOK_BYTES = 8192
_MOST_WORDS = 40
_SAMPLE_ROWS = 1000
_COMMA = re.compile(rb"(?<![\d.,:])[-+]?\d*,\d+(?![\d.,])")
_POINT = re.compile(rb"(?<![\d.,:])[-+]?\d*\.\d+(?![\d.,])")
_QUOTED = re.compile(rb'"([-+]?\d*),(\d+)"')
_DAY_S = 86400.0
_HALF = 0.5
_NEVER_BOTH = 0.1
_LEAST_OWN = 0.25
_JUMP = 1000.0
_UNITS = ((1e17, 1e-9, "nanoseconds"), (1e14, 1e-6, "microseconds"), (TIME_LIMIT_S, 1e-3, "milliseconds"))
"""Numbers from here on are no seconds of any year, but so many parts of one since 1970."""


def has_decimal_commas(body: bytes, separator: str) -> bool:
    """Whether the first rows below a header hold decimal commas and no decimal points."""
    begin = body[:_LOOK_BYTES]
    if separator == ",":
        return _QUOTED.search(begin) is not None
    return _COMMA.search(begin) is not None and _POINT.search(begin) is None


def with_points(body: bytes, separator: str, source: str, notices: list[Notice]) -> bytes:
    """The rows with decimal points where they had decimal commas."""
    if not has_decimal_commas(body, separator):
        return body
    if separator == ",":
        body, count = _QUOTED.subn(rb"\1.\2", body)
    else:
        count = body.count(b",")
        body = body.replace(b",", b".")
    notices.append(Notice(source, "decimal commas read as points", count))
    return body


def times_of_text(cells: pd.Series[Any], numbers: Floats, source: str, notices: list[Notice]) -> Floats:
    """Seconds (n) where a column of times holds text: dates and times, or times of day, counted on past midnight."""
    text = cells.notna().to_numpy() & np.isnan(numbers)
    if text.sum() <= _HALF * len(cells):
        return numbers
    plain = cells.astype(str).str.strip().str.strip('"').str.replace(",", ".", regex=False)
    first = plain[text].iloc[0]
    if re.match(r"\d\d?:\d\d:\d\d", first):
        found = np.array(pd.to_timedelta(plain.where(text), errors="coerce").dt.total_seconds(), dtype=np.float64)
        known = np.flatnonzero(np.isfinite(found))
        days = np.round(np.diff(found[known]) / _DAY_S)
        found[known] -= _DAY_S * np.concatenate(([0.0], np.cumsum(days)))[: known.size]
        what = "times of day read as seconds since midnight"
    else:
        found = _dates(plain.where(text), first)
        zoned = re.search(r"(Z|[+-]\d\d:?\d\d)$", first)
        what = "dates and times read as seconds since 1970" + ("" if zoned else ", as those of UTC")
    got = np.isfinite(found)
    if got.sum() <= _HALF * text.sum():
        return numbers
    notices.append(Notice(source, what, int(got.sum())))
    return np.where(got, found, numbers)


def _dates(text: pd.Series[Any], first: str) -> Floats:
    if re.match(r"\d\d?\.\d\d?\.\d{4}", first):
        when = pd.to_datetime(text, format="%d.%m.%Y %H:%M:%S.%f", utc=True, errors="coerce")
    else:
        whole = text.str.replace(r"^(\d{4})[/.](\d\d)[/.](\d\d)", r"\1-\2-\3", regex=True)
        when = pd.to_datetime(whole, format="ISO8601", utc=True, errors="coerce")
    ns = when.to_numpy(dtype="datetime64[ns]")
    return np.where(np.isnat(ns), np.nan, ns.astype(np.int64) * 1e-9)


def in_seconds(t: Floats, unit_s: float, source: str, notices: list[Notice]) -> Floats:
    """Times (n) in seconds, of the unit that the column's name says, or that their size leaves no doubt of."""
    if unit_s != 1.0:
        notices.append(Notice(source, f"times read in units of {unit_s:g} s, as their column is named", t.size))
        return t * unit_s
    some = t[:: max(1, t.size // _SAMPLE_ROWS)]
    known = np.abs(some[np.isfinite(some)])
    usual = float(np.median(known)) if known.size else 0.0
    for least, size_s, name in _UNITS:
        if usual >= least:
            notices.append(Notice(source, f"times read as {name} since 1970", t.size, "", "warning"))
            return t * size_s
    return t


def declared_seconds(t: Floats, unit_s: float, source: str) -> Floats:
    """Times (n) in seconds, of the unit that vehicle.toml declares.

    Raises DataError where the numbers can be no times of that unit.
    """
    if np.isnan(unit_s):
        raise DataError(f'{source}: the times are numbers, and no dates as unit = "iso" says: s, ms, us or ns')
    known = np.abs(t[np.isfinite(t)]) * unit_s
    usual_s = float(np.median(known)) if known.size else 0.0
    if usual_s >= TIME_LIMIT_S:
        fits = next((name for least, _, name in _UNITS if usual_s / unit_s >= least), "seconds")
        raise DataError(f"{source}: times of {usual_s:.4g} s lie in no year: they look like {fits} since 1970")
    return t * unit_s


def qualities_of_text(cells: pd.Series[Any], numbers: Floats, source: str, notices: list[Notice]) -> Floats:
    """GGA's qualities (n) where a column of them holds words that are known; the numbers as they are otherwise."""
    text = cells.notna().to_numpy() & np.isnan(numbers)
    plain = cells.astype(str).str.strip().str.strip('"').str.strip()
    words = sorted(set(plain[text]))
    if not 0 < len(words) <= _MOST_WORDS:
        return numbers
    meaning = qualities_of_words(words)
    shown = ", ".join(words[:8])
    if meaning is None:
        notices.append(
            Notice(source, f"fix_quality in words that are not known: {shown}", int(text.sum()), "", "warning")
        )
        return numbers
    read = ", ".join(f"{word} as {'not stated' if code < 0 else code}" for word, code in meaning.items())
    notices.append(Notice(source, f"fix_quality in words, read in GGA's codes: {read}", int(text.sum())))
    return np.where(text, plain.map(meaning).astype(np.float64).to_numpy(), numbers)


def filled_pairs(
    columns: dict[str, Floats], required: Sequence[str], content: Bools, source: str, line: Ints, notices: list[Notice]
) -> None:
    """Where rows hold one of two columns each, put the second one's value at the first one's times; in place."""
    if len(required) != 3:
        return
    t, first, second = (columns[name] for name in required)
    one, other = np.isfinite(t) & np.isfinite(first), np.isfinite(t) & np.isfinite(second)
    rows = int(content.sum())
    if (one & other).sum() > _NEVER_BOTH * rows or min(one.sum(), other.sum()) < max(2.0, _LEAST_OWN * rows):
        return
    at, known = np.flatnonzero(one), np.flatnonzero(other)
    known = known[np.argsort(t[known], kind="stable")]
    after = np.clip(np.searchsorted(t[known], t[at]), 1, known.size - 1)
    low, high = known[after - 1], known[after]
    step = second[high] - second[low]
    usual = float(np.median(np.abs(step[step != 0]))) if (step != 0).any() else 0.0
    passed_s = t[high] - t[low]
    share = np.where(passed_s > 0, np.clip((t[at] - t[low]) / np.where(passed_s > 0, passed_s, 1.0), 0.0, 1.0), 0.0)
    columns[required[2]] = second.copy()
    columns[required[2]][at] = second[low] + np.where(np.abs(step) <= _JUMP * usual, share * step, 0.0)
    content &= ~(other & ~one)
    what = f"rows hold {required[1]} or {required[2]} alone: {required[2]} interpolated to the times of {required[1]}"
    notices.append(Notice(source, what, int(at.size), f"line {line[at[0]]}", "warning"))
