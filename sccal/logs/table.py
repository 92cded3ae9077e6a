"""One CSV file of numeric columns: bytes to float arrays, each row with its line in the file.

A row whose required cells cannot be read is dropped and counted, never guessed. Text in a further column is an empty
cell; a further column without any number is left out. What was met is told in notices.
"""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import DataError
from sccal.logs.bursts import spread_bursts
from sccal.logs.column_names import Named, contract_names
from sccal.logs.compressed import bytes_of
from sccal.logs.csv_header import BLANKS, COLUMN_LIMIT, LINE_LIMIT_BYTES, blank_file, is_blank, split_header
from sccal.logs.dialect import declared_seconds, filled_pairs, in_seconds, qualities_of_text, times_of_text, with_points
from sccal.logs.set_clock import carried_on
from sccal.logs.streams import ClockStep, Notice
from sccal.logs.text import as_utf8
from sccal.logs.timeline import order_in_time

_LONG_NUMBER = 64
_TURN_RAD = 6.3
_TEXT_CELLS = 200

Choice = Callable[[list[str], int], tuple[Named, Sequence[str]]]
"""What a header's names (and its line) mean, and which columns every row must hold; they hold ``t``."""


@dataclass(frozen=True)
class Table:
    """Numeric columns of one file, all of length n, with strictly increasing ``t``."""

    source: str
    columns: dict[str, Floats]
    line: Ints
    """Line in the file of each row, from 1."""
    rows_seen: int
    """Rows with any content, before rows were dropped."""
    notices: tuple[Notice, ...]
    clock_steps: tuple[ClockStep, ...] = ()
    """Steps of its clock whose size only these rows show."""

    def keep(self, rows: Bools, notices: Sequence[Notice] = ()) -> Table:
        """The same table with only the rows where ``rows`` (n) is True, and further notices."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        return Table(self.source, columns, self.line[rows], self.rows_seen, (*self.notices, *notices), self.clock_steps)

    def extras(self, used: Sequence[str]) -> dict[str, Floats]:
        """The columns that are not in ``used``."""
        return {name: column for name, column in self.columns.items() if name not in used}


def read_table(path: Path, alternatives: Sequence[Sequence[str]]) -> Table:
    """Read a CSV whose header holds at least one of the ``alternatives`` in full; each holds ``t``.

    The first alternative found is required of every row. Whole numbers from 2^63 up (unsigned 64-bit counters below
    zero) are read as their two's complement.

    Raises:
        DataError: unreadable or empty file, a header without the required columns, or no usable row.
    """

    def chosen(logged: list[str], line: int) -> tuple[Named, Sequence[str]]:
        named = contract_names(logged, alternatives)
        return named, _required(named.names, alternatives, path, line)

    return read_chosen(path, chosen)


def read_chosen(path: Path, choose: Choice) -> Table:
    """Read a CSV, the meaning of whose columns is chosen when its header is seen.

    Raises:
        DataError: as read_table, and whatever the choice raises.
    """
    source = path.name
    header, body = split_table(path)
    separator, header_line = header.separator, header.line
    named, required = choose(header.names, header.line)
    names = named.names
    notices: list[Notice] = []
    if named.taken:
        shown = ", ".join(f"{theirs} as {ours}" for ours, theirs in named.taken.items())
        notices.append(
            Notice(source, f"columns taken by other names: {shown}", len(named.taken), f"line {header_line}")
        )
    body = _without_endless_lines(body, header_line, source, notices)
    body = _without_cut_line(body, separator, len(names), header_line, source, notices)
    body = with_points(body, separator, source, notices)
    frame = _parse(body, names, separator, header_line, path, notices)
    columns, content = _numeric_columns(frame, names, required, header_line, source, notices)
    line = np.arange(len(frame), dtype=np.int64) + header_line + 1
    columns["t"] = _times_s(frame[names.index("t")], columns["t"], named, source, notices)
    filled_pairs(columns, required, content, source, line, notices)
    if named.plain_yaw:
        _tell_unit_of_yaw(columns, source, notices)

    readable = content.copy()
    for name in required:
        readable &= np.isfinite(columns[name])
    unreadable = content & ~readable
    if unreadable.any():
        what = f"rows with unreadable or empty {', '.join(required)} dropped"
        notices.append(Notice(source, what, int(unreadable.sum()), f"line {line[unreadable][0]}"))
    rows_seen = int(content.sum())
    if not readable.any():
        why = "; ".join(str(notice) for notice in notices) or "nothing below the header"
        raise DataError(
            f"{path}: no usable row of {rows_seen} below line {header_line}, "
            f"{', '.join(required)} must be numbers in every row: {why}"
        )
    columns = {name: column[readable] for name, column in columns.items()}
    line = line[readable]
    columns["t"], steps = carried_on(columns["t"], line, source, notices)
    columns["t"] = spread_bursts(columns["t"], [columns[name] for name in required[1:]], line, source, notices)
    order, order_notices = order_in_time(columns["t"], line, source)
    columns = {name: column[order] for name, column in columns.items()}
    return Table(source, columns, line[order], rows_seen, (*notices, *order_notices), steps)


@dataclass(frozen=True)
class Header:
    """The line that names the columns."""

    names: list[str]
    """``1``, ``2``, … where no line names any."""
    separator: str
    line: int
    """From 1; 0 where there is none."""


def split_table(path: Path) -> tuple[Header, bytes]:
    """The header of a table, and what stands below it; runs of blanks between cells have become one tab each.

    Raises:
        DataError: unreadable or empty file, or one without a header.
    """
    data = _load(path)
    names, separator, line, below = split_header(data, path)
    body = data[below:]
    if all(_is_number(name) for name in names):
        body = data[data.rfind(b"\n", 0, max(below - 1, 0)) + 1 :]
        names, line = [str(place + 1) for place in range(len(names))], line - 1
    if separator == BLANKS:
        body, separator = _between_tabs(body), "\t"
    return Header(names, separator, line), body


def columns_of(path: Path) -> tuple[Header, dict[str, Floats], dict[str, list[str]]]:
    """Header, every column of numbers (n, NaN where a cell holds none), and the first cells of columns of text.

    Whole lines that cannot be read are rows without numbers. The times of a column of dates are in seconds.

    Raises:
        DataError: as split_table.
    """
    header, body = split_table(path)
    lost: list[Notice] = []
    body = _without_endless_lines(body, header.line, path.name, lost)
    body = with_points(body, header.separator, path.name, lost)
    frame = _parse(body, header.names, header.separator, header.line, path, lost)
    numbers: dict[str, Floats] = {}
    texts: dict[str, list[str]] = {}
    for position, name in enumerate(header.names):
        if not name or name in numbers or name in texts:
            continue
        series = frame[position]
        values = _floats(series)
        values[~np.isfinite(values)] = np.nan
        if np.isfinite(values).any():
            numbers[name] = values
            continue
        dates = times_of_text(series, values, path.name, lost) if _is_text(series) else values
        if np.isfinite(dates).any():
            numbers[name] = dates
        texts[name] = [str(cell).strip().strip('"') for cell in series.dropna().iloc[:_TEXT_CELLS]]
    return header, numbers, texts


def _between_tabs(body: bytes) -> bytes:
    """Rows whose cells stood apart by blanks; a date and its time of day stay one cell."""
    whole = re.sub(rb"(\d{4}-\d\d-\d\d) +(\d\d:\d\d)", rb"\1T\2", body)
    return re.sub(rb"[ \t]+", b"\t", re.sub(rb"(?m)^[ \t]+|[ \t\r]+$", b"", whole))


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", ".") or "x")
    except ValueError:
        return False
    return True


def _times_s(cells: pd.Series[Any], t: Floats, named: Named, source: str, notices: list[Notice]) -> Floats:
    """A column of times in seconds: of dates, or of numbers in the unit that is declared or that name and size say."""
    if _is_text(cells):
        dated = times_of_text(cells, t, source, notices)
        if dated is not t:
            return dated
    return (
        declared_seconds(t, named.time_unit_s, source)
        if named.declared
        else (in_seconds(t, named.time_unit_s, source, notices))
    )


def _load(path: Path) -> bytes:
    data = bytes_of(path)
    if is_blank(data):
        raise blank_file(path, len(data))
    data = as_utf8(data)
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    return data.replace(b"\0", b"?") if b"\0" in data else data


def _required(names: list[str], alternatives: Sequence[Sequence[str]], path: Path, line: int) -> Sequence[str]:
    for alternative in alternatives:
        if set(alternative) <= set(names):
            return alternative
    needed = " or ".join(",".join(alternative) for alternative in alternatives)
    shown = ",".join(names[:20])
    there = "".join(mark if mark.isprintable() else "?" for mark in shown)[:200]
    raise DataError(f"{path}: the header (line {line}) needs {needed}; it has {there}")


def _without_endless_lines(body: bytes, header_line: int, source: str, notices: list[Notice]) -> bytes:
    """Blank the lines that are too long to be a row of anything."""
    breaks = np.flatnonzero(np.frombuffer(body, dtype=np.uint8) == ord("\n"))
    lengths = np.diff(np.concatenate(([-1], breaks, [len(body)])))
    endless = np.flatnonzero(lengths > LINE_LIMIT_BYTES)
    if endless.size == 0:
        return body
    lines = body.split(b"\n")
    for row in endless:
        lines[row] = b""
    what = f"lines of more than {LINE_LIMIT_BYTES // 1024} kB dropped"
    notices.append(Notice(source, what, int(endless.size), f"line {header_line + 1 + endless[0]}", "warning"))
    return b"\n".join(lines)


def _without_cut_line(
    body: bytes, separator: str, width: int, header_line: int, source: str, notices: list[Notice]
) -> bytes:
    """Leave out a last line that ends without a line end and is shorter than the line before: a cut file."""
    if not body or body.endswith(b"\n"):
        return body
    start = body.rfind(b"\n") + 1
    before = body[body.rfind(b"\n", 0, max(start - 1, 0)) + 1 : max(start - 1, 0)]
    mark = separator.encode()
    last_cells, before_cells = body[start:].split(mark), before.strip().split(mark)
    whole = len(last_cells) >= width
    if whole and len(before_cells) >= width:
        last, previous = last_cells[width - 1].strip(), before_cells[width - 1].strip()
        decimals, previous_decimals = len(last.partition(b".")[2]), len(previous.partition(b".")[2])
        whole = decimals >= previous_decimals and (b"." in last or len(last) >= len(previous))
    if whole:
        return body
    line = header_line + 1 + body.count(b"\n")
    notices.append(Notice(source, "last line cut in the middle and dropped", 1, f"line {line}"))
    return body[:start]


def _parse(
    body: bytes, names: list[str], separator: str, header_line: int, path: Path, notices: list[Notice]
) -> pd.DataFrame:
    """A frame with one row per line of ``body``, blank lines included, and one column per name, by position."""
    try:
        return _pandas_frame(body, len(names), separator)
    except (pd.errors.ParserError, pd.errors.ParserWarning):
        pass
    body, width = _without_long_rows(body, len(names), separator, header_line, path, notices)
    try:
        frame = _pandas_frame(body, width, separator)
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        raise DataError(f"{path}: cannot be read as CSV ({' '.join(str(error).split())})") from error
    for position in range(len(names), width):
        if frame[position].notna().any():
            raise DataError(
                f"{path}: the header (line {header_line}) names {len(names)} columns, "
                f"but the rows have {width}; name them all"
            )
    return frame


def _pandas_frame(body: bytes, width: int, separator: str) -> pd.DataFrame:
    if not body:
        return pd.DataFrame({position: np.empty(0) for position in range(width)})
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)
        return pd.read_csv(
            io.BytesIO(body),
            sep=separator,
            header=None,
            names=list(range(width)),
            index_col=False,
            engine="c",
            quoting=3,
            skipinitialspace=True,
            skip_blank_lines=False,
            low_memory=False,
            encoding="utf-8",
            encoding_errors="replace",
        )


def _without_long_rows(
    body: bytes, width: int, separator: str, header_line: int, path: Path, notices: list[Notice]
) -> tuple[bytes, int]:
    """Blank the lines with too many cells; where nearly every line has more cells than names, widen instead."""
    lines = body.replace(b"\r\n", b"\n").replace(b"\r", b" ").split(b"\n")
    mark = separator.encode()
    cells = np.array([line.count(mark) + 1 for line in lines])
    usual = int(np.median(cells[cells > 1])) if (cells > 1).any() else width
    if usual > COLUMN_LIMIT:
        raise DataError(f"{path}: rows have {usual} cells, more than {COLUMN_LIMIT}; this is not a log")
    width = max(width, usual)
    long = np.flatnonzero(cells > width)
    for row in long:
        lines[row] = b"?"
    if long.size:
        what = f"rows with more than {width} cells dropped"
        notices.append(Notice(path.name, what, int(long.size), f"line {header_line + 1 + long[0]}"))
    return b"\n".join(lines), width


def _numeric_columns(
    frame: pd.DataFrame, names: list[str], required: Sequence[str], header_line: int, source: str, notices: list[Notice]
) -> tuple[dict[str, Floats], Bools]:
    """The columns as floats, NaN where a cell holds no finite number, and which lines hold a row at all."""
    columns: dict[str, Floats] = {}
    content = np.zeros(len(frame), dtype=np.bool_)
    comment = np.zeros(len(frame), dtype=np.bool_)
    text_cells, text_row, text_columns, repeated = 0, math.inf, [], []
    for position, name in enumerate(names):
        series = frame[position]
        filled = series.notna().to_numpy()
        content |= filled
        if position == 0 and _is_text(series):
            comment = series.astype(str).str.startswith("#").to_numpy(dtype=np.bool_) & filled
        if not name or name in columns:
            repeated += [name] if name else []
            continue
        values = _floats(series)
        values[~np.isfinite(values)] = np.nan
        if name == "fix_quality" and _is_text(series):
            values = qualities_of_text(series, values, source, notices)
        if name not in required:
            lost = filled & np.isnan(values) & ~comment
            if lost.any() and not np.isfinite(values).any():
                text_columns.append(name)
                continue
            if lost.any():
                text_cells += int(lost.sum())
                text_row = min(text_row, int(np.flatnonzero(lost)[0]))
        columns[name] = values
    if text_cells:
        where = f"line {header_line + 1 + int(text_row)}"
        notices.append(Notice(source, "cells of further columns are not numbers and taken as empty", text_cells, where))
    if text_columns:
        shown = ", ".join(text_columns[:8])
        notices.append(Notice(source, f"columns without numbers left out: {shown}", len(text_columns)))
    if repeated:
        shown = ", ".join(repeated[:8])
        notices.append(
            Notice(source, f"columns named twice, the first taken: {shown}", len(repeated), severity="warning")
        )
    return columns, content & ~comment


def _tell_unit_of_yaw(columns: dict[str, Floats], source: str, notices: list[Notice]) -> None:
    """Name a heading without a unit by its size: beyond a turn in radians it is in degrees. In place."""
    yaw = columns["yaw_deg"]
    most = float(np.nanmax(np.abs(yaw))) if np.isfinite(yaw).any() else 0.0
    if most <= _TURN_RAD:
        columns["yaw_deg"] = np.degrees(yaw)
    unit = "radians" if most <= _TURN_RAD else "degrees"
    what = f"headings without a unit in their name taken as {unit}: they reach {most:.4g}"
    notices.append(Notice(source, what, int(np.isfinite(yaw).sum()), "", "warning"))


def _is_text(series: pd.Series[Any]) -> bool:
    return not (pd.api.types.is_numeric_dtype(series.dtype) or pd.api.types.is_bool_dtype(series.dtype))


def _floats(series: pd.Series[Any]) -> Floats:
    if _is_text(series):
        series = pd.to_numeric(series.astype(object).map(_unquoted), errors="coerce")
    values = series.to_numpy()
    if values.dtype == np.uint64:
        values = values.view(np.int64)
    return values.astype(np.float64)


def _unquoted(cell: object) -> object:
    """A cell for pandas, which fails at whole numbers beyond the range of a float."""
    if isinstance(cell, int):
        return cell if abs(cell) < 1 << 64 else _beyond(cell)
    if not isinstance(cell, str):
        return cell
    text = cell.strip().strip('"').strip()
    if len(text) < _LONG_NUMBER:
        return text
    try:
        return float(text)
    except ValueError:
        return math.nan


def _beyond(number: int) -> float:
    try:
        return float(number)
    except OverflowError:
        return math.inf
