"""``encoder.csv``: the two wheels' cumulative counts or angles, repaired into one WheelStream."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import DataError
from sccal.logs.counter import SPEED_LIMIT_MPS, Repair, Scale, detect_width, repair
from sccal.logs.limits import ANGLE_LIMIT_RAD, TICKS_LIMIT
from sccal.logs.rates import unit_of, with_angles
from sccal.logs.saturation import saturated
from sccal.logs.streams import Notice, Vehicle, WheelStream
from sccal.logs.table import Table, read_table
from sccal.logs.wheel_units import RATE_COLUMNS, UNITS

_TICKS = ("t", "left_ticks", "right_ticks")
_ANGLES = ("t", "left_rad", "right_rad")
TRAVEL_UNKNOWN = "travel_unknown"
"""A further column: 1 where the travel since the row before is not known well, as a log before repair showed."""
_EXACT_LIMIT = 2.0**53
_ANGLE_QUANTUM_RAD = 1e-3
GAP_S = 0.5
"""A pause between rows longer than this, and than five usual steps, is a gap."""


def read_encoder(path: Path, vehicle: Vehicle) -> tuple[WheelStream, tuple[Notice, ...]]:
    """Read and repair an encoder file; angles in radians, travel across resets and gaps marked loose.

    Raises:
        DataError: unreadable file, ticks without ``ticks_per_rev``, or counts that no motion explains.
    """
    return repaired_wheels(encoder_table(path), str(path), vehicle)


def encoder_table(path: Path) -> Table:
    """The rows of an encoder file that can be read, in order of time, before any repair.

    Raises:
        DataError: unreadable file or missing columns.
    """
    return read_table(path, (_TICKS, _ANGLES, *RATE_COLUMNS))


def repaired_wheels(
    table: Table, path: str, vehicle: Vehicle, of_rates: bool = False
) -> tuple[WheelStream, tuple[Notice, ...]]:
    """Unwrap and repair a table with ``left_ticks,right_ticks``, ``left_rad,right_rad`` or columns of another unit.

    ``path`` is for messages. ``of_rates`` says that angles are integrated speeds: no gap's travel is known then.

    Raises:
        DataError: ticks without ``ticks_per_rev``, or counts that no motion explains.
    """
    in_ticks = set(_TICKS) <= table.columns.keys()
    if not in_ticks and not set(_ANGLES) <= table.columns.keys():
        of_rates = UNITS[unit_of(table)].rate
        table = with_angles(table, vehicle, path)
    names, limit = (_TICKS, TICKS_LIMIT) if in_ticks else (_ANGLES, ANGLE_LIMIT_RAD)
    table = _without_impossible(table, names, path, limit)
    if in_ticks and vehicle.ticks_per_rev is None:
        raise DataError(
            f"{path}: left_ticks,right_ticks need ticks_per_rev in {vehicle.path}; "
            "add a line such as ticks_per_rev = 32768 below [encoder], or log left_rad,right_rad"
        )
    counts_per_turn = vehicle.ticks_per_rev if in_ticks and vehicle.ticks_per_rev else 2 * np.pi
    counts_per_m = counts_per_turn / (2 * np.pi * vehicle.wheel_radius_m)
    scale = Scale(counts_per_m, 1.0 if in_ticks else _ANGLE_QUANTUM_RAD)
    t_s = table.columns["t"]
    counts = np.column_stack((table.columns[names[1]], table.columns[names[2]]))
    if in_ticks:
        _require_room(t_s, counts, table, scale, vehicle, path)
    notices = list(table.notices)
    bits = _width(t_s, counts, table.line, scale, vehicle, table.source, notices) if in_ticks else None
    try:
        repaired = repair(t_s, counts, scale, bits)
    except ValueError as error:
        raise DataError(
            f"{path}: {error} imply travel that no speed up to {SPEED_LIMIT_MPS:.0f} m/s explains; "
            f"check {names[1]},{names[2]} and ticks_per_rev, counter_bits and wheel_radius_m in {vehicle.path}"
        ) from error
    kept = table.keep(repaired.keep)
    loose = _loose(kept, repaired, scale, of_rates, notices)
    if TRAVEL_UNKNOWN in table.columns:
        told = np.cumsum(np.nan_to_num(table.columns[TRAVEL_UNKNOWN]) > 0)[repaired.keep]
        loose |= np.diff(told, prepend=0) > 0
    _tell(table, kept, repaired, bits, vehicle, notices)
    rad_per_count = 2 * np.pi / counts_per_turn
    stream = WheelStream(
        t_s=kept.columns["t"],
        left_rad=repaired.counts[:, 0] * rad_per_count,
        right_rad=repaired.counts[:, 1] * rad_per_count,
        loose=loose,
        extras=kept.extras((*names, TRAVEL_UNKNOWN)),
        clock_steps=table.clock_steps,
    )
    return stream, tuple(notices)


def _require_room(t_s: Floats, counts: Floats, table: Table, scale: Scale, vehicle: Vehicle, path: str) -> None:
    """Raise DataError where a counter is full and stays so while the robot drives on."""
    full = saturated(t_s, counts, 1.0 / scale.counts_per_m, vehicle.counter_bits)
    if full is None:
        return
    which = ("left", "right")[full.side]
    meanwhile = "and the other one is full as well" if full.both else "while the other wheel drives on"
    raise DataError(
        f"{path}: line {table.line[full.row]}, t = {t_s[full.row]:.3f} s: the {which} counter saturates: it stays at "
        f"{full.count}, the end of a {full.bits}-bit counter, for {full.stays_s:.1f} s, {meanwhile}. It does not "
        "wrap, so all travel from there on is lost: cut the log there, or use a counter that is wider or wraps"
    )


def _without_impossible(table: Table, names: tuple[str, ...], path: str, limit: float) -> Table:
    """The table without rows whose counts no counter can hold."""
    beyond: Bools = np.maximum(*(np.abs(table.columns[name]) for name in names[1:])) > limit
    if not beyond.any():
        return table
    where = f"line {table.line[beyond][0]}"
    what = f"rows with {' or '.join(names[1:])} beyond {limit:.4g} dropped"
    notice = Notice(table.source, what, int(beyond.sum()), where, "warning")
    if beyond.all():
        raise DataError(f"{path}: {notice}; no row is left")
    return table.keep(~beyond, [notice])


def _width(
    t_s: Floats, counts: Floats, line: Ints, scale: Scale, vehicle: Vehicle, source: str, notices: list[Notice]
) -> int | None:
    """The width to unwrap at: as declared where the values agree with it, else as detected."""
    beyond = (np.abs(counts) >= _EXACT_LIMIT).any(axis=1)
    if beyond.any():
        what = "rows with counts beyond 2^53, which are read to some ticks only"
        notices.append(Notice(source, what, int(beyond.sum()), f"line {line[beyond][0]}", "warning"))
    bits = vehicle.counter_bits
    if bits is not None:
        outside = ((counts < -(2.0 ** (bits - 1))) | (counts >= 2.0**bits)).any(axis=1)
        if outside.mean() <= 0.01:
            return bits
        what = f"rows with counts beyond {bits} bits: counter_bits = {bits} not used; correct it in {vehicle.path.name}"
        notices.append(Notice(source, what, int(outside.sum()), f"line {line[outside][0]}", "warning"))
    return detect_width(t_s, counts, scale)


def _loose(kept: Table, repaired: Repair, scale: Scale, of_rates: bool, notices: list[Notice]) -> Bools:
    """(m) True at samples whose travel since the one before is not known well; tells the gaps."""
    t_s = kept.columns["t"]
    dt_s = np.diff(t_s, prepend=t_s[:1])
    loose = np.zeros(t_s.size, dtype=np.bool_)
    usual_dt_s = float(np.median(dt_s[1:])) if t_s.size > 1 else 0.0
    gap = dt_s > max(5 * usual_dt_s, GAP_S)
    if gap.any():
        travel = np.abs(np.diff(repaired.counts, axis=0, prepend=repaired.counts[:1])).max(axis=1)
        loose |= gap & (of_rates | (travel > 2 * scale.quantum))
        what = f"gaps, {dt_s[gap].sum():.1f} s in all, the longest {dt_s.max():.1f} s"
        where = f"t = {t_s[gap][0]:.3f} s"
        notices.append(Notice(kept.source, what, int(gap.sum()), where, "warning" if loose.any() else "info"))
    loose[repaired.reset] = True
    loose[repaired.unlikely] = True
    return loose


def _tell(
    table: Table, kept: Table, repaired: Repair, bits: int | None, vehicle: Vehicle, notices: list[Notice]
) -> None:
    source = table.source
    dropped = ~repaired.keep
    if repaired.stale.size:
        dropped[repaired.stale] = False
        what = "rows dropped whose counts lagged and then caught up in one step"
        where = f"line {table.line[repaired.stale].min()}"
        notices.append(Notice(source, what, int(repaired.stale.size), where, "warning"))
    if dropped.any():
        what = "rows with bogus counts, which jump away and come back, dropped"
        many = dropped.sum() > 0.01 * dropped.size
        where = f"line {table.line[dropped][0]}"
        notices.append(Notice(source, what, int(dropped.sum()), where, "warning" if many else "info"))
    if repaired.wraps:
        how = "as declared" if bits == vehicle.counter_bits else f"detected; declare counter_bits = {bits}"
        notices.append(Notice(source, f"counter wraps at {bits} bits unwrapped ({how})", repaired.wraps))
    if repaired.aliased:
        what = f"bits are too few: steps come near half the counter's range, so travel is uncertain by 2^{bits} counts"
        notices.append(Notice(source, what, bits or 0, severity="warning"))
    for rows, what in (
        (repaired.reset, "counter resets bridged with the speed around them"),
        (repaired.unlikely, "steps that do not fit the speed around them, kept but not relied on"),
    ):
        if rows.size:
            where = f"line {kept.line[rows[0]]}"
            notices.append(Notice(source, what, int(rows.size), where, "warning"))
