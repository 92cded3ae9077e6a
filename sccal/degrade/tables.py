"""gnss.csv, ahrs.csv and encoder.csv with a fault: only the cells and rows that it concerns change.

Rows that cannot be read stay as they are. A lost fix keeps its row with fix_quality 0 and no position where there is
that column, else its row goes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.degrade.faults import FaultedFixes, Faults, drift_deg, dropped_rows, fault_fixes
from sccal.degrade.sheet import Cells, Sheet
from sccal.errors import DataError
from sccal.logs.names import AHRS_FILE, ENCODER_FILE, GNSS_FILE
from sccal.logs.streams import Convention

_POSITION_PLACES = 10
"""Of a degree: 0.01 mm."""
_SIGMA_PLACES = 3
_YAW_PLACES = {"yaw_deg": 4, "yaw_rad": 6}


@dataclass(frozen=True)
class DegradedFixTable:
    """A rewritten gnss.csv, and its usable rows before and after; arrays (n,) in file order."""

    raw: bytes
    t_s: Floats
    lat_deg: Floats
    lon_deg: Floats
    quality: Ints
    read: Bools
    """False for rows without a fix."""
    fixes: FaultedFixes
    rows_dropped: int


def degrade_gnss_csv(
    raw: bytes, faults: Faults, span_s: tuple[float, float] | None, stream_name: str
) -> DegradedFixTable:
    """Rewrite ``gnss.csv``; ``span_s`` is the run's on the same clock, None to take that of the fixes.

    Raises:
        DataError: columns are missing, or no row has a position.
        UsageError: a window outside the run.
    """
    sheet = Sheet(raw, GNSS_FILE)
    sheet.require(("t", "lat_deg", "lon_deg"))
    time, lat, lon = (_present(sheet.column(name)) for name in ("t", "lat_deg", "lon_deg"))
    claimed, sigma, alt = (sheet.column(name) for name in ("fix_quality", "sigma_m", "alt_m"))
    with np.errstate(invalid="ignore"):
        placed = (np.abs(lat.values) <= 90) & (np.abs(lon.values) <= 360) & np.isfinite(time.values)
    placed &= (lat.values != 0) | (lon.values != 0)
    rows = np.flatnonzero(placed)
    if rows.size == 0:
        raise DataError(f"none of {placed.size} rows holds a position: nothing to degrade")
    t_s, lat_deg, lon_read = time.values[rows], lat.values[rows], lon.values[rows]
    lon_deg = _turned(lon_read)
    quality = np.full(rows.size, -1, dtype=np.int64)
    if claimed is not None:
        given = claimed.values[rows]
        known = np.isfinite(given) & (given >= 0) & (given <= 9)
        quality[known] = np.round(given[known]).astype(np.int64)
    read = quality != 0
    if span_s is None:
        span_s = float(t_s.min()), float(t_s.max())
    fixes = fault_fixes(t_s, lat_deg, lon_deg, quality, faults, span_s, stream_name, read=read)

    going = np.flatnonzero(fixes.displaced)
    moved_lon = _as_before(lon_read + _turned(fixes.lon_deg - lon_deg), lon_read)
    sheet.put(lat, rows[going], fixes.lat_deg[going], _POSITION_PLACES)
    sheet.put(lon, rows[going], moved_lon[going], _POSITION_PLACES)
    if claimed is not None:
        renamed = np.flatnonzero(~fixes.lost & (fixes.quality != quality) & (quality > 0))
        sheet.put(claimed, rows[renamed], fixes.quality[renamed].astype(np.float64), 0)
    if sigma is not None and faults.noise_m:
        wider = np.flatnonzero(~fixes.lost & fixes.noisy & (sigma.values[rows] > 0))
        sheet.put(sigma, rows[wider], np.hypot(sigma.values[rows[wider]], faults.noise_m), _SIGMA_PLACES)
    lost = np.flatnonzero(fixes.lost)
    kept_empty = claimed is not None and not faults.drop
    if kept_empty and claimed is not None:
        for cells in (lat, lon, alt, sigma):
            sheet.clear(cells, rows[lost])
        sheet.put(claimed, rows[lost], np.zeros(lost.size), 0)
    else:
        sheet.leave_out(rows[lost])
    dropped = 0 if kept_empty else lost.size
    return DegradedFixTable(sheet.edits.applied(), t_s, lat_deg, lon_deg, quality, read, fixes, dropped)


def degrade_ahrs_csv(raw: bytes, faults: Faults, convention: Convention) -> tuple[bytes, int]:
    """Rewrite the yaw of ``ahrs.csv`` with a heading that drifts; gives the bytes and how many rows changed.

    Angles stay in the range in which the file writes them: 0 to 360, −180 to 180, or any.

    Raises:
        DataError: columns are missing, or no row can be read.
    """
    sheet = Sheet(raw, AHRS_FILE)
    sheet.require(("t", "yaw_deg"), ("t", "yaw_rad"))
    time = _present(sheet.column("t"))
    changed = 0
    for name, turn in (("yaw_deg", 360.0), ("yaw_rad", 2 * np.pi)):
        yaw = sheet.column(name)
        if yaw is None:
            continue
        rows = np.flatnonzero(np.isfinite(time.values) & np.isfinite(yaw.values))
        if rows.size == 0:
            raise DataError(f"none of {time.values.size} rows can be read: nothing to degrade")
        drift = drift_deg(time.values[rows], faults.heading_drift_deg_per_hour, convention) * (turn / 360.0)
        rows, drift = rows[drift != 0], drift[drift != 0]
        places = np.maximum(yaw.decimals.places[rows], _YAW_PLACES[name])
        new = np.round(_in_range(yaw.values[rows] + drift, yaw.values, turn) * 10.0**places) / 10.0**places
        sheet.put(yaw, rows, _in_range(new, yaw.values, turn), _YAW_PLACES[name])
        changed = max(changed, rows.size)
    return sheet.edits.applied(), changed


def _in_range(new: Floats, file: Floats, turn: float) -> Floats:
    seen = file[np.isfinite(file)]
    low, high = float(seen.min()), float(seen.max())
    slack = 1e-3 * turn / 360.0
    if low >= -slack and turn / 2 + slack < high <= turn + slack:
        return new % turn
    if low >= -turn / 2 - slack and high <= turn / 2 + slack:
        return turn / 2 - (turn / 2 - new) % turn
    return new


def degrade_encoder_csv(raw: bytes, faults: Faults, stream_name: str) -> tuple[bytes, int]:
    """Rewrite ``encoder.csv`` without the rows that a stalled logger lost; gives the bytes and how many rows went.

    Raises:
        DataError: columns are missing.
    """
    sheet = Sheet(raw, ENCODER_FILE)
    names = sheet.require(("t", "left_ticks", "right_ticks"), ("t", "left_rad", "right_rad"))
    readable = np.ones(sheet.line_begin.size, dtype=np.bool_)
    for name in names:
        readable &= np.isfinite(_present(sheet.column(name)).values)
    rows = np.flatnonzero(readable)
    t_s = _present(sheet.column("t")).values[rows]
    gone = rows[dropped_rows(t_s, faults.encoder_dropout, faults.seed, stream_name)]
    sheet.leave_out(gone)
    return sheet.edits.applied(), int(gone.size)


def _present(cells: Cells | None) -> Cells:
    assert cells is not None
    return cells


def _turned(lon_deg: Floats) -> Floats:
    return np.where(np.abs(lon_deg) > 180, (lon_deg + 180) % 360 - 180, lon_deg)


def _as_before(lon_deg: Floats, before_deg: Floats) -> Floats:
    """Longitudes in the range in which each was written: up to 180 either way, or 0 to 360."""
    return np.where(before_deg > 180, lon_deg % 360, np.where(before_deg < -180, lon_deg, _turned(lon_deg)))
