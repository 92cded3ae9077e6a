"""A log of messages as tables: the tables it was made of where sccal converted it, else the streams that it gives."""

from __future__ import annotations

import re

import numpy as np

from sccal.arrays import Floats
from sccal.convert.from_folder import nmea_lines
from sccal.convert.tables import LogTable, RunTables
from sccal.logs.ahrs import AHRS_COLUMNS
from sccal.logs.encoder import TRAVEL_UNKNOWN
from sccal.logs.messages.converted import TableNote
from sccal.logs.messages.heading import in_convention
from sccal.logs.messages.read import read_tables
from sccal.logs.options import ReadOptions
from sccal.logs.run import RunSource, read_run, vehicle_of
from sccal.logs.streams import FixStream, HeadingStream, Run, WheelStream
from sccal.logs.table import Table

_ENCODER_COLUMNS = ("t", "left_ticks", "right_ticks", "left_rad", "right_rad", TRAVEL_UNKNOWN)


def tables_of_messages(source: RunSource, options: ReadOptions) -> RunTables:
    """An .mcap, .db3 or .bag file, or a rosbag2 folder, which must be one that can be calibrated.

    Raises:
        DataError: the log cannot be read, or lacks a stream.
    """
    run = read_run(source, options)
    whole = read_tables(source.path, run.vehicle, options)
    notices = [notice for notice in run.notices if notice.doubt or notice in whole.note.notices]
    encoder, ahrs, gnss = (
        _plain(table, whole.note.tables.get(kind))
        for kind, table in (("encoder", whole.encoder), ("ahrs", whole.ahrs), ("gnss", whole.gnss))
    )
    encoder = _wheels(run.wheels) if encoder is None else _table(encoder, run.wheels)
    nmea = nmea_lines(whole.nmea, encoder.t_s, run.path, notices) if whole.nmea else None
    return RunTables(
        name=source.name,
        path=source.path,
        vehicle=run.vehicle,
        vehicle_text=vehicle_of(source).read_bytes(),
        encoder=encoder,
        ahrs=None if nmea and run.heading.utc_s is not None else ahrs or _heading(run),
        gnss=None if nmea else gnss or _fixes(run.fixes),
        nmea=nmea,
        notices=tuple(notices),
    )


def _plain(table: Table | None, note: TableNote | None) -> LogTable | None:
    if table is None:
        return None
    written = {} if note is None else {"t": note.time_places, **note.columns}
    return LogTable(
        table.columns["t"],
        {name: column for name, column in table.columns.items() if name != "t"},
        {name: places for name, places in written.items() if places is not None},
    )


def _table(own: LogTable, wheels: WheelStream) -> LogTable:
    """A converted log's own table, with the columns that other topics have added since."""
    at = np.searchsorted(own.t_s, wheels.t_s)
    added = {}
    for name, column in wheels.extras.items():
        if name not in own.columns:
            added[_free(name)] = whole = np.full(own.t_s.size, np.nan)
            whole[at] = column
    return LogTable(own.t_s, {**own.columns, **added}, own.written)


def _wheels(wheels: WheelStream) -> LogTable:
    columns = {"left_rad": wheels.left_rad, "right_rad": wheels.right_rad}
    if wheels.loose.any():
        columns[TRAVEL_UNKNOWN] = wheels.loose.astype(np.float64)
    return LogTable(wheels.t_s, {**columns, **{_free(name): column for name, column in wheels.extras.items()}})


def _free(name: str) -> str:
    """A further column's name as CSV can hold it and no reader mistakes it."""
    name = re.sub(r'[,;\t\r\n"]+', "_", name).strip() or "_"
    return f"{name}_" if name in (*_ENCODER_COLUMNS, *AHRS_COLUMNS) else name


def _heading(run: Run) -> LogTable:
    heading: HeadingStream = run.heading
    written = heading.convention or run.vehicle.convention
    columns: dict[str, Floats] = {"yaw_rad": in_convention(heading.yaw_rad, written, run.vehicle.convention)}
    further = (
        ("pitch_rad", heading.pitch_rad),
        ("roll_rad", heading.roll_rad),
        ("yaw_sigma_rad", heading.yaw_sigma_rad),
        ("gyro_z_radps", heading.gyro_z_radps),
    )
    columns |= {name: values for name, values in further if values is not None}
    return LogTable(heading.t_s, {**columns, **{_free(name): column for name, column in heading.extras.items()}})


def _fixes(fixes: FixStream) -> LogTable:
    columns: dict[str, Floats] = {"lat_deg": fixes.lat_deg, "lon_deg": fixes.lon_deg}
    if np.isfinite(fixes.alt_m).any():
        columns["alt_m"] = fixes.alt_m
    if (fixes.quality >= 0).any():
        columns["fix_quality"] = np.where(fixes.quality >= 0, fixes.quality, np.nan)
    if np.isfinite(fixes.sigma_east_m).any():
        same = (fixes.sigma_east_m == fixes.sigma_north_m) | np.isnan(fixes.sigma_east_m)
        if same.all() and not fixes.cov_en_m2.any():
            columns["sigma_m"] = fixes.sigma_east_m
        else:
            columns["sigma_east_m"], columns["sigma_north_m"] = fixes.sigma_east_m, fixes.sigma_north_m
            columns["cov_en_m2"] = fixes.cov_en_m2
    return LogTable(fixes.host_t_s, {**columns, **{_free(name): column for name, column in fixes.extras.items()}})
