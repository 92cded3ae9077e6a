"""The tables of a run's folder, each with its column of times, which is found by its numbers and then by its name."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.logs.csv_header import LINE_LIMIT_BYTES
from sccal.logs.formats import may_be_table
from sccal.logs.mapping import ISO, TIME_UNITS
from sccal.logs.names import NMEA_FILE
from sccal.logs.table import columns_of
from sccal.logs.text import as_utf8
from sccal.propose import words

FEWEST_ROWS = 20
"""Fewer rows than two seconds of a slow sensor show nothing."""
_EPOCHS = (("s", 9e8, 5e9), ("ms", 9e11, 5e12), ("us", 9e14, 5e15), ("ns", 9e17, 5e18))
"""Between 1998 and 2128, counted since 1970 in each unit: no counter of a log reaches so far by chance."""
_SLOWEST_S, _FASTEST_S = 2.0, 2e-3
"""From row to row: wheel encoders, headings and fixes come between 0.5 and 500 times a second. The usual step alone
tells the unit, as these three decades are what one unit of time is of the next."""
_NAMED_FASTEST_S, _NAMED_SLOWEST_S = 1e-4, 20.0
"""The same where the name says the unit: what is rare, and still possible."""
_MOSTLY = 0.99
_EVEN = 0.5
"""Of the usual step: a clock's steps scatter less than that in half of all rows, a wheel's counts more as it stops."""
_NMEA_LINES = 5


@dataclass(frozen=True)
class Clock:
    """A column of times."""

    column: str
    unit: str
    why: str
    doubt: str = ""


@dataclass(frozen=True)
class Logged:
    """One table; rows without a time, or behind one of their own time, are left out."""

    path: Path
    clock: Clock
    t_s: Floats
    """(n) strictly increasing."""
    numbers: dict[str, Floats]
    """(n) each, NaN where a cell holds no number; the times are not among them."""
    texts: dict[str, list[str]] = field(default_factory=dict)
    """First cells of columns that hold no numbers."""

    @property
    def name(self) -> str:
        """The file's name."""
        return self.path.name

    def pair(self, *names: str) -> tuple[Floats, ...]:
        """Times and columns (m) of the rows in which all of these columns hold numbers."""
        columns = [self.numbers[name] for name in names]
        there = np.logical_and.reduce([np.isfinite(column) for column in columns])
        return (self.t_s[there], *(column[there] for column in columns))


@dataclass(frozen=True)
class Folder:
    """What lies in one run's folder."""

    path: Path
    tables: tuple[Logged, ...]
    sentences: tuple[Path, ...]
    """Files of NMEA sentences."""
    odd: tuple[str, ...]
    """Files that are no tables, and why."""


def looked_into(folder: Path) -> Folder:
    """Every file of a folder that may be a table or hold sentences."""
    tables, sentences, odd = [], [], []
    for path in sorted(one for one in folder.iterdir() if one.is_file()):
        if path.name.lower() == NMEA_FILE or path.suffix.lower() in (".nmea", ".ubx") or may_be_table(path.name):
            if _holds_sentences(path):
                sentences.append(path)
            elif may_be_table(path.name):
                try:
                    tables.append(_logged(path))
                except DataError as error:
                    odd.append(str(error))
    return Folder(folder, tuple(tables), tuple(sentences), tuple(odd))


def _holds_sentences(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            begin = as_utf8(file.read(LINE_LIMIT_BYTES))
    except OSError:
        return False
    return sum(begin.count(mark) for mark in (b"GGA,", b"RMC,", b"GNS,", b"GGK,", b"KSXT,")) >= _NMEA_LINES


def _logged(path: Path) -> Logged:
    """A table and its times. Raises DataError where it has none, or too few rows."""
    header, numbers, texts = columns_of(path)
    rows = max((column.size for column in numbers.values()), default=0)
    if rows < FEWEST_ROWS:
        raise DataError(f"{path.name}: {rows} rows of numbers, at least {FEWEST_ROWS} are needed to know what they are")
    clock = _clock_of(numbers, texts)
    if clock is None:
        names = ", ".join(words.called(name) for name in header.names[:12])
        raise DataError(f"{path.name}: none of its columns ({names}) rises evenly as times do")
    scale = 1.0 if clock.unit == ISO else TIME_UNITS[clock.unit]
    t_s = scale * numbers[clock.column]
    rows_of = np.flatnonzero(np.isfinite(t_s))
    rows_of = rows_of[np.argsort(t_s[rows_of], kind="stable")]
    rows_of = rows_of[np.diff(t_s[rows_of], prepend=-np.inf) > 0]
    kept = {name: column[rows_of] for name, column in numbers.items() if name != clock.column}
    return Logged(path, clock, t_s[rows_of], kept, texts)


def _clock_of(numbers: dict[str, Floats], texts: dict[str, list[str]]) -> Clock | None:
    """The column of times: dates first, then numbers since 1970, then what its name calls a time, then what is even."""
    risen = [name for name in numbers if _rises(numbers[name])]
    dated = [name for name in risen if name in texts]
    if dated:
        return Clock(dated[0], ISO, "holds dates and times that rise from row to row")
    of_epoch = [(name, unit) for name in risen for unit in [_since_1970(numbers[name])] if unit]
    found = [(name, unit, "since 1970") for name, unit in of_epoch]
    if not found:
        named = [name for name in risen if _is_called_time(name)]
        even = [name for name in risen if _is_even(numbers[name]) and _step(numbers[name]) != 1.0]
        found = [(name, _unit_of(name, numbers[name]), "") for name in named or even]
    if not found:
        return None
    name, unit, since = next((one for one in found if _is_called_time(one[0])), found[0])
    others = [other for other, _, _ in found if other != name]
    step = _step(numbers[name])
    rate = f"({1.0 / (step * TIME_UNITS[unit]):.3g} rows a second)"
    why = f"only rises, by {step:.6g} at a time: {unit} {since or rate}"
    doubt = f"{words.called(', '.join(others))} may be times too" if others else ""
    if _unit_named(name) not in ("", unit):
        doubt = f"its name says {_unit_named(name)}, and its numbers {unit}"
    return Clock(name, unit, why, doubt)


def _is_called_time(name: str) -> bool:
    return words.has(name, words.TIME) or "".join(words.parts(name)) in words.TIME_UNITS


def _unit_named(name: str) -> str:
    found = [words.TIME_UNITS[part] for part in words.parts(name) if part in words.TIME_UNITS]
    return found[-1] if found else ""


def _rises(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    return known.size >= FEWEST_ROWS and float((steps >= 0).mean()) >= _MOSTLY and float((steps > 0).mean()) > 0.1


def _step(values: Floats) -> float:
    steps = np.diff(values[np.isfinite(values)])
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0


def _is_even(values: Floats) -> bool:
    steps = np.diff(values[np.isfinite(values)])
    usual = float(np.median(steps))
    return usual > 0 and float(np.quantile(np.abs(steps - usual), 0.9)) < _EVEN * usual


def _since_1970(values: Floats) -> str:
    middle = float(np.nanmedian(values))
    return next((unit for unit, low, high in _EPOCHS if low <= middle < high), "")


def _unit_of(name: str, values: Floats) -> str:
    """By the name where its rate is possible, else by the step."""
    step, named = _step(values), _unit_named(name)
    if named and _NAMED_FASTEST_S <= step * TIME_UNITS[named] <= _NAMED_SLOWEST_S:
        return named
    for unit in ("s", "ms", "us", "ns"):
        if step * TIME_UNITS[unit] >= _FASTEST_S and step * TIME_UNITS[unit] < _SLOWEST_S:
            return unit
    return named or ("s" if step < 1.0 else "ns")
