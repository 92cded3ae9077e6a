"""How plain text is laid out: paragraphs with a label, tables, notices, and names that are too long."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence

from sccal.logs.streams import Notice
from sccal.report.sentences import notice_text
from sccal.results.numbers import one_line

NOTICES_SHOWN = 5
_LABEL = 9
NUMBER_AND_UNIT = re.compile(r"(\d) (?=(?:m|m/s|s|ms|deg|ppm|%|min|h|windows?|runs?)(?:\W|$))")
_SIGN_AND_NUMBER = re.compile(r"(?<=[±σ=]) (?=[=\d])")


def in_columns(table: Sequence[Sequence[str]], alignment: str) -> list[str]:
    """Cells padded to their column, two blanks between columns; ``<`` left, ``>`` right."""
    widths = [max(len(row[i]) for row in table) for i in range(len(alignment))]
    return [
        "  ".join(
            cell.ljust(size) if side == "<" else cell.rjust(size)
            for cell, size, side in zip(row, widths, alignment, strict=True)
        ).rstrip()
        for row in table
    ]


def labelled(label: str, texts: Iterable[str], width: int) -> list[str]:
    """A paragraph for each text that is not empty, the label in the margin of the first."""
    lines = [line for text in texts if text for line in wrapped(text, width, " " * _LABEL)]
    if lines:
        lines[0] = label.ljust(_LABEL) + lines[0][_LABEL:]
    return lines


def wrapped(text: str, width: int, indent: str = "") -> list[str]:
    """Broken between words, but never between a number and its unit."""
    glued = NUMBER_AND_UNIT.sub("\\1\u00a0", one_line(text))
    lines = textwrap.wrap(
        glued,
        width,
        initial_indent=indent,
        subsequent_indent=indent + "  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace("\u00a0", " ") for line in lines]


def sentence(text: str, stop: bool = True) -> str:
    """With a capital at the beginning and a full stop at the end; names of effects keep their small letters."""
    text = one_line(text)
    first = text.partition(" ")[0]
    if text and "_" not in first and "~" not in first:
        text = text[0].upper() + text[1:]
    text = _SIGN_AND_NUMBER.sub("\u00a0", NUMBER_AND_UNIT.sub("\\1\u00a0", text))
    return text if not stop or not text or text[-1] in ".!?…" else f"{text}."


def shortened(name: str, room: int) -> str:
    """Cut in the middle: runs in one folder differ at the end, folders at the beginning."""
    if len(name) <= room:
        return name
    head = (room - 1) // 3 if room >= 16 else 0
    return f"{name[:head]}…{name[len(name) - (room - 1 - head) :]}"


def notice_lines(notices: Iterable[tuple[str, Notice]], rest_in: str) -> list[str]:
    """One line each, of (run or empty, notice); warnings first, the surplus by its number and where it stands."""
    ordered = sorted(notices, key=lambda pair: pair[1].severity != "warning")
    lines = [
        ("warning: " if notice.severity == "warning" else "")
        + (f"{shortened(one_line(run), 40)}: " if run else "")
        + notice_text(notice)
        for run, notice in ordered
    ]
    shown = lines[:NOTICES_SHOWN]
    if len(lines) > NOTICES_SHOWN:
        shown.append(f"… and {len(lines) - NOTICES_SHOWN} more in {rest_in}")
    return shown
