"""``gnss.nmea``, from a file or from bytes, as fixes or as headings.

Only sentences whose checksum is right are used, or which have none and are otherwise whole.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from sccal.arrays import Bools
from sccal.errors import DataError
from sccal.logs.compressed import bytes_of
from sccal.logs.decimals import words_of
from sccal.logs.nmea.fixes import read_fixes
from sccal.logs.nmea.headings import HEADING_NAMES, read_heading
from sccal.logs.nmea.kinds import COURSES, LAYOUTS, READ, READ_FOR_POSITIONS
from sccal.logs.nmea.received import with_receive_times
from sccal.logs.nmea.sentences import Sentences, all_lower, find_sentences, kinds_in, names_of
from sccal.logs.nmea.times import Dated, date_sentences
from sccal.logs.set_clock import carried_on
from sccal.logs.streams import FixStream, HeadingStream, Notice
from sccal.logs.text import as_utf8

POSITION_NAMES = ", ".join(LAYOUTS[kind].name for kind in READ_FOR_POSITIONS)
_MOST_NAMES = 12
_SHOWN_FROM, _SHOWN = 4096, 60
_LONG_MESSAGE = re.compile(rb"#[A-Z][A-Z0-9]{3,}")
_RARE = 0.2
"""Sentences without checksum that are shorter than usual are cut where they are no larger a share of their kind."""


def read_nmea(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    """Read the fixes of an NMEA log, each line optionally after the host's receive time.

    Raises:
        DataError: unreadable file, no sentence, or no fix.
    """
    return parse_nmea(bytes_of(path), path.name, path)


def read_nmea_heading(path: Path) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """Read the headings of an NMEA log (see parse_nmea_heading).

    Raises:
        DataError: unreadable file, no sentence, or no heading.
    """
    return parse_nmea_heading(bytes_of(path), path.name, path)


def parse_nmea(raw: bytes, source: str, path: Path | str | None = None) -> tuple[FixStream, tuple[Notice, ...]]:
    """The fixes in the bytes of an NMEA log; notices name it ``source``, errors ``path`` where there is one.

    Raises:
        DataError: no sentence, or no fix.
    """
    where = str(path or source)
    dated, count, notices = _dated(raw, source, where)
    fixes = read_fixes(dated, source, notices)
    if fixes is None:
        why = "; ".join(str(notice) for notice in notices) or f"no {POSITION_NAMES} with a time"
        raise DataError(f"{where}: no position fix in {count} sentences ({len(raw)} bytes): {why}")
    return fixes, tuple(notices)


def parse_nmea_heading(
    raw: bytes, source: str, path: Path | str | None = None
) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """The headings in the bytes of an NMEA log, of the kind that says most about its quality.

    Notices that the fixes of the same bytes give too are left out.

    Raises:
        DataError: no sentence, or no heading.
    """
    where = str(path or source)
    dated, count, told = _dated(raw, source, where)
    notices: list[Notice] = []
    heading = read_heading(dated, source, notices)
    if heading is None:
        met = [str(notice) for notice in notices] or [f"no {HEADING_NAMES}"]
        courses = int(kinds_in(dated.sentences.kind, COURSES).sum())
        if courses:
            met.append(f"{courses} RMC, KSXT or VTG state a course over ground, which is no heading")
        met += [str(notice) for notice in told if "passed over" in notice.what]
        why = "; ".join(met)
        raise DataError(f"{where}: no heading in {count} sentences ({len(raw)} bytes): {why}")
    return heading, tuple(notices)


def _dated(raw: bytes, source: str, where: str) -> tuple[Dated, int, list[Notice]]:
    """The sentences that can be relied on with their epochs, and how many sentences there were."""
    if not raw:
        raise DataError(f"{where}: is empty (0 bytes); log it again or remove the run")
    found = find_sentences(as_utf8(raw))
    if found.start.size == 0:
        raise DataError(
            f"{where}: no NMEA sentence in {len(raw)} bytes; lines should hold $GNGGA,… sentences, and the first is "
            f"{_shown(raw)}"
        )
    notices: list[Notice] = []
    found = with_receive_times(found, source, notices)
    host_t_s, steps = carried_on(found.host_t_s, found.line, source, notices)
    found = replace(found, host_t_s=host_t_s)
    dated = date_sentences(_whole_sentences(found, source, notices), source, notices)
    dated = replace(dated, clock_steps=steps)
    return dated, int(found.start.size), notices


def _shown(raw: bytes) -> str:
    """The beginning of the first line with anything in it, for messages."""
    named = _LONG_MESSAGE.search(raw[:_SHOWN_FROM])
    if named is not None:
        return (
            f"{named[0].decode()}, a long message that is not read for positions; log GGA, KSXT or BESTPOSA beside it"
        )
    lines = raw[:_SHOWN_FROM].split()
    text = lines[0][:_SHOWN].decode("ascii", errors="replace") if lines else ""
    shown = "".join(letter if letter.isprintable() else "?" for letter in text) or "blank"
    return shown + (" (JSON: gpsd's reports are not read, `gpspipe -r` logs its sentences)" if text[:1] == "{" else "")


def _whole_sentences(found: Sentences, source: str, notices: list[Notice]) -> Sentences:
    """The sentences of known kinds that can be relied on."""
    needed = np.zeros(256, dtype=np.int64)
    needed[list(LAYOUTS)] = [layout.fewest for layout in LAYOUTS.values()]
    ours = kinds_in(found.kind, READ)
    wrong = found.has_checksum & ~found.right_checksum
    cut = ~found.has_checksum & ~found.complete
    lower = (found.data[found.start + 1] > ord("Z")) & ~all_lower(words_of(found.data), found.start)
    short = ours & ~wrong & ~cut & ((found.fields < needed[found.kind]) | (~found.has_checksum & lower))
    cut |= ours & ~wrong & ~short & _without_their_end(found)
    use: Bools = ours & ~wrong & ~cut & ~short
    bare = use & ~found.has_checksum
    other = ~ours & ~wrong & ~cut
    for rows, what, severity in (
        (wrong, "sentences with a wrong checksum dropped", "warning"),
        (cut, "sentences cut in the middle dropped", "info"),
        (short, "sentences with missing fields dropped", "info"),
        (bare, "sentences without checksum read", "info"),
        (other, f"other sentences passed over ({_listed(found, other)})", "info"),
        (_odd_prefixes(found), "lines begin with something that is no time: no receive time read", "warning"),
    ):
        count = int(rows.sum())
        if count:
            where = f"line {found.line[rows][0]}"
            serious = severity == "warning" and count > 0.001 * found.start.size
            notices.append(Notice(source, what, count, where, "warning" if serious else "info"))
    return found if use.all() else found.take(np.flatnonzero(use))


def _listed(found: Sentences, rows: Bools) -> str:
    """The names of sentences, and how many there are of each."""
    named = names_of(found, rows) if rows.any() else []
    more = f", {len(named) - _MOST_NAMES} more names" if len(named) > _MOST_NAMES else ""
    return ", ".join(f"{name} {count}" for name, count in named[:_MOST_NAMES]) + more


def _without_their_end(found: Sentences) -> Bools:
    """True where a sentence has no checksum though most of its kind do, or rarely few fields where none has one."""
    bare = ~found.has_checksum
    lost = np.zeros(bare.size, dtype=np.bool_)
    if not bare.any():
        return lost
    for kind in np.unique(found.kind[bare]).tolist():
        rows = np.flatnonzero(bare & (found.kind == kind))
        with_one = int(((found.kind == kind) & ~bare).sum())
        if with_one > rows.size:
            lost[rows] = True
            continue
        counts, which, many = np.unique(found.fields[rows], return_inverse=True, return_counts=True)
        few = (counts < counts[np.argmax(many)]) & (many < _RARE * rows.size)
        lost[rows] = few[which]
    return lost


def _odd_prefixes(found: Sentences) -> Bools:
    """Where text stands before the sentence, if that is the rule: single ones are what binary messages leave."""
    odd = found.odd_prefix
    return odd if odd.sum() > 0.5 * found.start.size else np.zeros(odd.size, dtype=np.bool_)
