"""``gnss.csv``: position fixes on the logging computer's clock, for logs without NMEA."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.limits import HEIGHT_LIMIT_M, SIGMA_LIMIT_M
from sccal.logs.place_units import in_ten_millionths, notation_of
from sccal.logs.quality import quality_of
from sccal.logs.quality_words import RTKLIB, mapped, of_novatel
from sccal.logs.streams import FixStream, Notice
from sccal.logs.table import Table, read_table

GNSS_COLUMNS = (
    *("t", "lat_deg", "lon_deg", "alt_m", "fix_quality", "sigma_m"),
    *("sigma_east_m", "sigma_north_m", "cov_en_m2"),
)
"""The columns with a meaning; all others are further ones."""


def read_gnss_csv(path: Path) -> tuple[FixStream, tuple[Notice, ...]]:
    """Read fixes: ``t,lat_deg,lon_deg`` and optionally ``alt_m,fix_quality,sigma_m`` (horizontal, per axis).

    Where axes differ, ``sigma_east_m,sigma_north_m,cov_en_m2`` say so and come before ``sigma_m``.

    Raises:
        DataError: unreadable file, missing columns, or no position in range.
    """
    return fixes_of_table(gnss_table(path), str(path))


def gnss_table(path: Path) -> Table:
    """The rows of a file of fixes that can be read, in order of time, those without a fix too.

    Raises:
        DataError: unreadable file or missing columns.
    """
    return read_table(path, (("t", "lat_deg", "lon_deg"),))


def fixes_of_table(table: Table, path: str) -> tuple[FixStream, tuple[Notice, ...]]:
    """The fixes in a table with the columns of gnss.csv; ``path`` is for messages.

    Raises:
        DataError: no position in range.
    """
    table = _with_quality(_in_degrees(table))
    lat, lon = table.columns["lat_deg"], table.columns["lon_deg"]
    quality = table.columns.get("fix_quality", np.full(lat.size, np.nan))
    beyond: Bools = (np.abs(lat) > 90) | (np.abs(lon) > 360)
    origin: Bools = (lat == 0) & (lon == 0)
    none: Bools = (quality == 0) & ~beyond & ~origin
    notices = []
    for rows, what in (
        (beyond, "rows with a latitude beyond 90 or a longitude beyond 360 degrees dropped"),
        (origin, "rows at latitude 0, longitude 0 dropped"),
        (none, "rows without a fix (fix_quality 0) dropped"),
    ):
        if rows.any():
            notices.append(Notice(table.source, what, int(rows.sum()), f"line {table.line[rows][0]}"))
    keep = ~(beyond | origin | none)
    if not keep.any():
        why = "; ".join(str(notice) for notice in notices)
        why += f"; {notation_of(lat[beyond], lon[beyond])}" if beyond.any() else ""
        raise DataError(f"{path}: none of {lat.size} rows holds a usable position: {why}")
    table = table.keep(keep, notices)
    n = table.line.size
    absent = np.full(n, np.nan)
    given = table.columns.get("fix_quality", absent)
    codes = np.where(np.isfinite(given) & (given >= 0) & (given <= 9), given, -1)
    sigma_m = table.columns.get("sigma_m", absent)
    sigma_m = np.where(sigma_m > 0, np.minimum(sigma_m, SIGMA_LIMIT_M), np.nan)
    sigma_east_m, sigma_north_m = (_positive(table, f"sigma_{axis}_m", sigma_m) for axis in ("east", "north"))
    lon = table.columns["lon_deg"]
    alt_m = table.columns.get("alt_m", absent)
    high: Bools = np.abs(alt_m) > HEIGHT_LIMIT_M
    if high.any():
        alt_m = np.where(high, np.nan, alt_m)
        what = f"heights beyond {HEIGHT_LIMIT_M:g} m taken as empty"
        notice = Notice(table.source, what, int(high.sum()), f"line {table.line[high][0]}", "warning")
        table = table.keep(np.ones(n, dtype=np.bool_), [notice])
    stream = FixStream(
        host_t_s=table.columns["t"],
        utc_s=absent,
        utc_has_date=False,
        lat_deg=table.columns["lat_deg"],
        lon_deg=np.where(np.abs(lon) > 180, (lon + 180) % 360 - 180, lon),
        alt_m=alt_m,
        quality=np.round(codes).astype(np.int64),
        sigma_east_m=sigma_east_m,
        sigma_north_m=sigma_north_m,
        cov_en_m2=np.nan_to_num(table.columns.get("cov_en_m2", np.zeros(n))),
        extras=table.extras(GNSS_COLUMNS),
        clock_steps=table.clock_steps,
    )
    return stream, table.notices


def _with_quality(table: Table) -> Table:
    """The table with GGA's qualities where it has a maker's numbers that cannot be taken for GGA's."""
    codes, told = table.columns.get("fix_quality"), ""
    if codes is None:
        column = next((name for name in ("Q", "q") if name in table.columns), None)
        if column is None:
            return _with_status(table)
        codes, told = mapped(table.columns[column], RTKLIB), f"column {column} read as RTKLIB's quality codes"
    elif (novatel := of_novatel(codes)) is not None:
        codes, told = (
            novatel,
            "fix_quality read as NovAtel's position types, for its numbers are no quality codes of GGA",
        )
    if not told:
        return table
    every = np.ones(table.line.size, dtype=np.bool_)
    table = table.keep(every, [Notice(table.source, told, table.line.size, f"line {table.line[0]}", "warning")])
    return replace(table, columns={**table.columns, "fix_quality": codes})


def _with_status(table: Table) -> Table:
    """The table with GGA's qualities where a column status can only be that of NavSatFix: −1, 0, 1 and 2, and fixes."""
    status = table.columns.get("status")
    if status is None or not np.isin(status[np.isfinite(status)], (-1, 0, 1, 2)).all() or np.ptp(status) == 0.0:
        return table
    sigma_m = table.columns.get("sigma_m", np.full(status.size, np.nan))
    told = Notice(table.source, "rows whose status is read as that of NavSatFix (2 RTK, 1 SBAS, 0 a fix)", status.size)
    table = table.keep(np.ones(status.size, dtype=np.bool_), [told])
    return replace(table, columns={**table.columns, "fix_quality": quality_of(status, sigma_m).astype(np.float64)})


def _in_degrees(table: Table) -> Table:
    """The table with its places in degrees where they are whole ten-millionths of one."""
    lat, lon = table.columns["lat_deg"], table.columns["lon_deg"]
    known = (lat != 0) & (lon != 0)
    if not known.any() or not in_ten_millionths(lat[known], lon[known]):
        return table
    what = "rows with places in whole numbers read as ten-millionths of a degree"
    every = np.ones(lat.size, dtype=np.bool_)
    table = table.keep(every, [Notice(table.source, what, int(known.sum()), f"line {table.line[0]}", "warning")])
    return replace(table, columns={**table.columns, "lat_deg": 1e-7 * lat, "lon_deg": 1e-7 * lon})


def _positive(table: Table, name: str, instead: Floats) -> Floats:
    given = table.columns.get(name, instead)
    return np.where(given > 0, np.minimum(given, SIGMA_LIMIT_M), instead)
