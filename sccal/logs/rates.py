"""Wheels logged as speeds, or as travel in metres: from what each column says to angles of the wheel.

Metres become angles by the nominal radius: the radii found then say how far the logger's metres are off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.counter import SPEED_LIMIT_MPS
from sccal.logs.streams import Notice, Vehicle
from sccal.logs.table import Table
from sccal.logs.wheel_units import UNITS, WheelUnit


def integrated(t_s: Floats, rate: Floats) -> Floats:
    """The trapezoidal integral (n,) from 0 of rates (n,) at times (n,)."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t_s))))


def unit_of(table: Table) -> str:
    """The name of the unit in which a table holds both wheels; empty where it holds counts or angles, or neither."""
    return next((name for name in UNITS if {f"left_{name}", f"right_{name}"} <= table.columns.keys()), "")


def with_angles(table: Table, vehicle: Vehicle, path: str) -> Table:
    """A table whose wheels are rates or lengths with ``left_rad,right_rad`` instead.

    Raises:
        DataError: no row whose speed a robot can have.
    """
    name = unit_of(table)
    unit = UNITS[name]
    rad = unit.rad or unit.m / vehicle.wheel_radius_m
    sides = (f"left_{name}", f"right_{name}")
    if unit.rate:
        table = _without_impossible(table, sides, rad * vehicle.wheel_radius_m, path)
    angles = [rad * table.columns[side] for side in sides]
    if unit.rate:
        angles = [integrated(table.columns["t"], angle) for angle in angles]
    kept = {column: values for column, values in table.columns.items() if column not in sides}
    told = Notice(table.source, _words(unit, sides, vehicle), table.line.size, f"line {table.line[0]}")
    notices = (*table.notices, told)
    return replace(table, columns={**kept, "left_rad": angles[0], "right_rad": angles[1]}, notices=notices)


def _words(unit: WheelUnit, sides: tuple[str, str], vehicle: Vehicle) -> str:
    what = f"rows of {', '.join(sides)} ({unit.words}) "
    what += "integrated over time to wheel angles" if unit.rate else "turned into wheel angles"
    if not unit.m:
        return what
    return (
        f"{what} with the nominal radius {vehicle.wheel_radius_m:g} m ({vehicle.path.name}): it must be the one that "
        "the logger used, else radii and track are those of its metres"
    )


def _without_impossible(table: Table, sides: tuple[str, str], metres: float, path: str) -> Table:
    """The table without rows in which a rim is faster than any robot's; ``metres`` are in one of the unit."""
    fastest = np.maximum(*(np.abs(table.columns[side]) for side in sides)) * metres
    beyond: Bools = fastest > SPEED_LIMIT_MPS
    if not beyond.any():
        return table
    where = f"line {table.line[beyond][0]}"
    what = (
        f"rows of {', '.join(sides)} in which a wheel's rim goes faster than {SPEED_LIMIT_MPS:.0f} m/s (up to "
        f"{fastest.max():.4g} m/s) dropped"
    )
    notice = Notice(table.source, what, int(beyond.sum()), where, "warning")
    if beyond.all():
        raise DataError(f"{path}: {notice}; no row is left: check the unit of the columns")
    return table.keep(~beyond, [notice])
