"""``ahrs.csv``: the AHRS readings in the file's own convention, in radians."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.limits import ANGLE_LIMIT_RAD, SIGMA_LIMIT_RAD, TURN_LIMIT_RAD, TURN_RATE_LIMIT_RADPS
from sccal.logs.streams import HeadingStream, Notice
from sccal.logs.table import Table, read_table
from sccal.logs.yaw_values import TURNS, stands_for_none, turn_of

_YAW = ("yaw_deg", "yaw_rad")
_FURTHER = {
    "pitch": ("pitch_deg", "pitch_rad"),
    "roll": ("roll_deg", "roll_rad"),
    "yaw_sigma": ("yaw_sigma_deg", "yaw_sigma_rad"),
    "gyro_z": ("gyro_z_dps", "gyro_z_radps"),
}
AHRS_COLUMNS = ("t", *_YAW, *(name for pair in _FURTHER.values() for name in pair))
"""The columns with a meaning; all others are further ones."""
_LIMITS = {
    "pitch": TURN_LIMIT_RAD,
    "roll": TURN_LIMIT_RAD,
    "yaw_sigma": SIGMA_LIMIT_RAD,
    "gyro_z": TURN_RATE_LIMIT_RADPS,
}
_DEGREE_LIKE_RAD = 50.0


def read_ahrs(path: Path) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """Read an AHRS file: ``t`` and ``yaw_deg`` or ``yaw_rad``; where both are there, degrees are read.

    Raises:
        DataError: unreadable file or missing columns.
    """
    return heading_of_table(ahrs_table(path))


def ahrs_table(path: Path) -> Table:
    """The rows of an AHRS file that can be read, in order of time.

    Raises:
        DataError: unreadable file or missing columns.
    """
    return usable_yaws(read_table(path, (("t", "yaw_deg"), ("t", "yaw_rad"))), path)


def usable_yaws(table: Table, path: Path) -> Table:
    """The table with its yaw in the unit of its name, and without what no AHRS gives; told in notices.

    Raises DataError where nothing is left.
    """
    return _of_known_unit(_without_impossible_yaws(table, path))


def heading_of_table(table: Table) -> tuple[HeadingStream, tuple[Notice, ...]]:
    """The heading in a table with the columns of ahrs.csv."""
    notices = list(table.notices)
    yaw_rad = _radians(table.columns, *_YAW)
    assert yaw_rad is not None
    if "yaw_deg" not in table.columns:
        odd = np.abs(table.columns["yaw_rad"]) > _DEGREE_LIKE_RAD
        if odd.any():
            what = f"yaw_rad values beyond {_DEGREE_LIKE_RAD:.0f} look like degrees; if so, name the column yaw_deg"
            notices.append(Notice(table.source, what, int(odd.sum()), f"line {table.line[odd][0]}", "warning"))
    further = {name: _radians(table.columns, *pair) for name, pair in _FURTHER.items()}
    for name, limit in _LIMITS.items():
        angle = further[name]
        if angle is not None and (beyond := np.abs(angle) > limit).any():
            further[name] = np.where(beyond, np.nan, angle)
            what = f"impossible values of {name} taken as empty"
            notices.append(Notice(table.source, what, int(beyond.sum()), f"line {table.line[beyond][0]}", "warning"))
    sigma_rad = further["yaw_sigma"]
    if sigma_rad is not None:
        unusable = sigma_rad <= 0
        if unusable.any():
            sigma_rad = np.where(unusable, np.nan, sigma_rad)
            what = "yaw sigmas of zero or less taken as not stated"
            notices.append(Notice(table.source, what, int(unusable.sum()), f"line {table.line[unusable][0]}"))
    stream = HeadingStream(
        t_s=table.columns["t"],
        yaw_rad=yaw_rad,
        yaw_sigma_rad=sigma_rad,
        pitch_rad=further["pitch"],
        roll_rad=further["roll"],
        gyro_z_radps=further["gyro_z"],
        extras=table.extras(AHRS_COLUMNS),
        clock_steps=table.clock_steps,
    )
    return stream, tuple(notices)


def _without_impossible_yaws(table: Table, path: Path) -> Table:
    name = next(name for name in _YAW if name in table.columns)
    beyond: Bools = np.abs(table.columns[name]) > ANGLE_LIMIT_RAD
    if not beyond.any():
        return table
    what = f"rows with {name} beyond {ANGLE_LIMIT_RAD:g} dropped"
    notice = Notice(table.source, what, int(beyond.sum()), f"line {table.line[beyond][0]}", "warning")
    if beyond.all():
        raise DataError(f"{path}: {notice}; no row is left")
    return table.keep(~beyond, [notice])


def _of_known_unit(table: Table) -> Table:
    """The table with its yaw in the unit of its name, and without numbers that stand for no yaw; both told."""
    name = next(name for name in _YAW if name in table.columns)
    own_turn = 360.0 if name == "yaw_deg" else 2.0 * np.pi
    none, number = stands_for_none(table.columns[name], own_turn)
    if none.any():
        what = f"rows with a {name} of exactly {number:g}, which jumps from there and back, dropped: it stands for none"
        where = f"line {table.line[none][0]}"
        table = table.keep(~none, [Notice(table.source, what, int(none.sum()), where, "warning")])
    turn = turn_of(table.columns[name])
    if turn is None or turn == own_turn:
        return table
    what = f"{name} begins again after {turn:.6g}: read as {TURNS[turn]}"
    every = np.ones(table.line.size, dtype=np.bool_)
    table = table.keep(every, [Notice(table.source, what, table.line.size, f"line {table.line[0]}", "warning")])
    columns = {**table.columns, name: table.columns[name] * (own_turn / turn)}
    return replace(table, columns=columns)


def _radians(columns: dict[str, Floats], in_degrees: str, in_radians: str) -> Floats | None:
    if in_degrees in columns:
        return np.radians(columns[in_degrees])
    return columns.get(in_radians)
