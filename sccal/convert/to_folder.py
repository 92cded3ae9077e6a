"""Tables as a run's folder: encoder.csv, ahrs.csv, and gnss.nmea or gnss.csv, with the decimals that they had."""

from __future__ import annotations

from pathlib import Path

from sccal.convert.tables import MOST_PLACES, LogTable, NmeaLines, RunTables, time_places
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, GNSS_FILE, NMEA_FILE
from sccal.logs.write import write_bytes, write_table


def write_folder_of(tables: RunTables, folder: Path) -> None:
    """Write a run's files into a folder that is there."""
    _write(tables.encoder, folder / ENCODER_FILE)
    if tables.ahrs is not None:
        _write(tables.ahrs, folder / AHRS_FILE)
    if tables.gnss is not None:
        _write(tables.gnss, folder / GNSS_FILE)
    if tables.nmea is not None:
        write_bytes(folder / NMEA_FILE, nmea_text(tables.nmea))


def nmea_text(nmea: NmeaLines) -> bytes:
    """The lines, each after its receive time where it has one."""
    places = time_places(nmea.host_t_s[nmea.stamped])
    digits = MOST_PLACES if places is None else places
    rows = zip(nmea.host_t_s.tolist(), nmea.stamped.tolist(), nmea.texts, strict=True)
    return b"".join(b"%s%s\n" % (b"%.*f " % (digits, t) if stamped else b"", text) for t, stamped, text in rows)


def _write(table: LogTable, path: Path) -> None:
    places = {"t": table.time_places, **table.places}
    formats = {name: "%r" if count is None else f"%.{count}f" for name, count in places.items()}
    write_table(path, {"t": table.t_s, **table.columns}, formats)
