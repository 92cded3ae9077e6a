"""A run's folder as tables: the rows that can be read, and the lines that hold a sentence."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sccal.arrays import Floats
from sccal.convert.tables import MOST_PLACES, NOTE_FILE, LogTable, NmeaLines, RunTables
from sccal.errors import DataError
from sccal.logs.ahrs import ahrs_table
from sccal.logs.compressed import bytes_of, head_of
from sccal.logs.encoder import encoder_table
from sccal.logs.gnss_csv import gnss_table
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, GNSS_FILE, NMEA_FILE
from sccal.logs.nmea.received import with_receive_times
from sccal.logs.nmea.sentences import find_sentences
from sccal.logs.nmea.times import date_sentences
from sccal.logs.rates import unit_of
from sccal.logs.run import RunSource, read_run, vehicle_of
from sccal.logs.streams import Notice
from sccal.logs.table import Table
from sccal.logs.text import as_utf8
from sccal.logs.wheel_units import UNITS

_DAY_S = 86400.0
_LOOK_BYTES, _LOOK_ROWS = 1 << 16, 200
_CHECKED = re.compile(rb"[\x20-\x7e]*\*[0-9A-Fa-f]{2}")
_PLAIN = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?")


def tables_of_folder(source: RunSource) -> RunTables:
    """A run's folder, which must be one that can be calibrated.

    Raises:
        DataError: a file is missing or cannot be used.
    """
    run, listed, folder = read_run(source), source.folder, source.path
    assert listed is not None
    listed.require_contract("converted")
    notices = earlier_notices(folder)
    encoder = _log_table(_counts_or_angles, listed.file(ENCODER_FILE), notices)
    ahrs = gnss = nmea = None
    if AHRS_FILE in listed.there:
        ahrs = _log_table(ahrs_table, listed.file(AHRS_FILE), notices)
    if listed.fix_file == NMEA_FILE:
        nmea = nmea_lines(bytes_of(listed.file(NMEA_FILE)), encoder.t_s, listed.file(NMEA_FILE), notices)
    elif listed.foreign:
        raise DataError(
            f"{folder / listed.foreign}: fixes of another program are calibrated as they are, and not converted: write "
            f"{GNSS_FILE} instead"
        )
    else:
        gnss = _log_table(gnss_table, listed.file(GNSS_FILE), notices)
    return RunTables(
        name=source.name,
        path=folder,
        vehicle=run.vehicle,
        vehicle_text=vehicle_of(source).read_bytes(),
        encoder=encoder,
        ahrs=ahrs,
        gnss=gnss,
        nmea=nmea,
        notices=tuple(notices),
    )


def _counts_or_angles(path: Path) -> Table:
    """The encoder's rows. Raises DataError where they hold speeds or metres."""
    table = encoder_table(path)
    if name := unit_of(table):
        raise DataError(
            f"{path}: wheels as {UNITS[name].words} (left_{name}, right_{name}) are calibrated as they are, and not "
            "converted: write left_rad,right_rad instead"
        )
    return table


def earlier_notices(folder: Path) -> list[Notice]:
    """What was told when a folder was made from another log, which its own files do not show any more."""
    try:
        entries = json.loads((folder / NOTE_FILE).read_text(encoding="utf-8"))["notices"]
        return [Notice(**one) for one in entries]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _log_table(read: Callable[[Path], Table], path: Path, notices: list[Notice]) -> LogTable:
    table = read(path)
    notices += [notice for notice in table.notices if notice.severity == "warning" or notice.doubt]
    columns = {name: column for name, column in table.columns.items() if name != "t"}
    for better, other in (("yaw_deg", "yaw_rad"), ("left_ticks", "left_rad"), ("right_ticks", "right_rad")):
        if better in columns:
            columns.pop(other, None)
    return LogTable(table.columns["t"], columns, _written_places(path))


def _written_places(path: Path) -> dict[str, int]:
    """Decimals of each column in the first rows of a plain CSV, where they all have as many."""
    lines = head_of(path, _LOOK_BYTES).decode("utf-8", "replace").splitlines()[:_LOOK_ROWS]
    rows = [[cell.strip() for cell in line.split(",")] for line in lines if line and not line.startswith("#")]
    places = {}
    for name, *cells in zip(*(row for row in rows if len(row) == len(rows[0])), strict=True) if rows else ():
        counts = {len(cell.partition(".")[2]) for cell in cells if cell}
        if len(counts) == 1 and all(_PLAIN.fullmatch(cell) for cell in cells if cell):
            places[name] = min(counts.pop(), MOST_PLACES)
    return places


def nmea_lines(raw: bytes, run_t_s: Floats, path: Path, notices: list[Notice]) -> NmeaLines:
    """The lines of an NMEA log; of those without a receive time, when the receiver says they were true.

    A log without dates is put on the day of the run, whose times are ``run_t_s``.
    """
    raw = as_utf8(raw)
    found = with_receive_times(find_sentences(raw), path.name, [])
    mark = b"\n" if b"\n" in raw else b"\r"
    texts = [line[line.find(b"$") :].strip(b" \t\r\n\0") if b"$" in line else b"" for line in raw.split(mark)]
    broken = [at for at, text in enumerate(texts) if text and not _is_text(text)]
    for at in broken:
        texts[at] = b"".join(_readable(part) for part in texts[at].split(b"$"))
    cut = not raw.endswith((b"\n", b"\r")) and b"*" not in texts[-1][-3:]
    if cut:
        texts[-1] = b""
    first = np.flatnonzero(np.diff(found.line, prepend=0) > 0)
    line, host = found.line[first] - 1, found.host_t_s[first]
    dated = date_sentences(found, path.name, [])
    utc = dated.running_s + dated.midnight_s
    if not dated.has_date and np.isfinite(utc).any():
        middle = 0.5 * float(np.nanmin(utc) + np.nanmax(utc))
        utc = utc + round((0.5 * float(run_t_s[0] + run_t_s[-1]) - middle) / _DAY_S) * _DAY_S
    shown = _filled(np.where(np.isfinite(found.host_t_s), found.host_t_s, utc))[first]
    whole = [bool(texts[at]) for at in line.tolist()]
    if broken:
        what = "lines with bytes that are no text, of which the sentences are kept"
        notices.append(Notice(path.name, what, len(broken), f"line {broken[0] + 1}"))
    if not any(whole):
        raise DataError(f"{path}: no line with an NMEA sentence")
    rows = np.array(whole, dtype=np.bool_)
    return NmeaLines(
        texts=tuple(texts[at] for at in line[rows].tolist()), host_t_s=host[rows], shown_s=_filled(shown[rows])
    )


def _readable(part: bytes) -> bytes:
    """What follows a ``$``, with it, up to its checksum where other bytes come after it; nothing of other bytes."""
    if part and not _is_text(part):
        found = _CHECKED.match(part)
        part = found[0] if found else b""
    return b"$" + part if part else b""


def _is_text(line: bytes) -> bool:
    try:
        line.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return b"\0" not in line


def _filled(times_s: Floats) -> Floats:
    """Times (n) with gaps filled from before, else from behind, none of them far off the others, never running back."""
    known = np.isfinite(times_s)
    if not known.any():
        return np.zeros(times_s.size)
    known &= np.abs(times_s - np.median(times_s[known])) <= _DAY_S
    first = int(np.argmax(known))
    at = np.maximum.accumulate(np.where(known, np.arange(times_s.size), first))
    return np.maximum.accumulate(times_s[at])
