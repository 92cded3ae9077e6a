"""The beginning of a CSV file: whether there is a header, and which columns it names. Light: no table is read."""

from __future__ import annotations

import re
from pathlib import Path

from sccal.errors import DataError
from sccal.logs.compressed import PIECE_BYTES, pieces_of
from sccal.logs.text import as_utf8

LINE_LIMIT_BYTES = 64 * 1024
COLUMN_LIMIT = 1000
_NAMES_SHOWN, _NAME_SHOWN = 12, 40
_SEPARATOR_LINE = re.compile(r"(?i:sep)=.?")
"""What spreadsheets write first: the separator of all that follows."""
BLANKS = " "
"""The separator of a header whose names stand apart by any number of blanks."""
_APART = re.compile(r"\w +\w")
_BLANKS = b"\0 \t\r\n"


def split_header(data: bytes, path: Path) -> tuple[list[str], str, int, int]:
    """Column names, separator, the header's line number from 1, and where the bytes below it begin.

    Raises:
        DataError: no header, or one that no log has.
    """
    start = line = 0
    told = ""
    while start < len(data):
        end = data.find(b"\n", start)
        end = len(data) if end < 0 else end
        line += 1
        if end - start > LINE_LIMIT_BYTES:
            raise DataError(
                f"{path}: line {line} has more than {LINE_LIMIT_BYTES // 1024} kB without a line end; "
                "this is not a CSV file"
            )
        text = data[start:end].decode("utf-8", errors="replace").strip()
        if _SEPARATOR_LINE.fullmatch(text):
            told = text[4:] or "\t"
        elif text and not text.startswith("#"):
            break
        start = end + 1
    else:
        raise DataError(
            f"{path}: no header line in {len(data)} bytes; the first line names the columns, such as t,yaw_deg"
        )
    separator = told if told and told in text else max(",;\t", key=text.count)
    if separator not in text and _APART.search(text):
        separator = BLANKS
    cells = text.split() if separator == BLANKS else text.split(separator)
    names = [name.strip().strip('"').strip() for name in cells]
    if len(names) > COLUMN_LIMIT:
        raise DataError(f"{path}: line {line} names {len(names)} columns, more than {COLUMN_LIMIT}; this is not a log")
    return names, separator, line, end + 1


def header_in_words(path: Path) -> str:
    """What columns the beginning of a file names, in a few words for a message: no more of it is quoted."""
    try:
        with path.open("rb") as file:
            begin = as_utf8(file.read(LINE_LIMIT_BYTES))
        names, _, line, _ = split_header(begin.replace(b"\r", b"\n"), path)
    except (OSError, DataError):
        return "has no header that can be read"
    plain = ["".join(mark if mark.isprintable() else "?" for mark in name)[:_NAME_SHOWN] for name in names]
    more = f" and {len(plain) - _NAMES_SHOWN} more" if len(plain) > _NAMES_SHOWN else ""
    return f"has in line {line} the columns {', '.join(plain[:_NAMES_SHOWN])}{more}"


def blank_file(path: Path, size_bytes: int) -> DataError:
    """The error of a file without content."""
    what = "is empty (0 bytes)" if not size_bytes else f"holds nothing but blanks ({size_bytes} bytes)"
    return DataError(f"{path}: {what}; log it again or remove the run")


def is_blank(data: bytes) -> bool:
    """Whether there is nothing but spaces, line ends and zero bytes."""
    return not data.strip(_BLANKS)


def require_csv(path: Path) -> None:
    """Look at the file's first megabyte.

    Raises:
        DataError: it cannot be read, is empty, or has no header that a log may have.
    """
    pieces = pieces_of(path)
    begin = next(pieces, b"")
    if is_blank(begin):
        size = len(begin)
        for piece in pieces:
            if not is_blank(piece):
                return
            size += len(piece)
        raise blank_file(path, size)
    if as_utf8(begin) is not begin or (b"\n" not in begin and b"\r" in begin):
        return  # for the reader of tables to say, or to take
    if len(begin) == PIECE_BYTES:
        begin += b"\nt"  # where all of it is comments, the header comes later
    split_header(begin, path)
