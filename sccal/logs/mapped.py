"""A user's own files read as ``[files]`` of ``vehicle.toml`` maps them: tables with the contract's columns.

From there on a mapped file is read as the contract's own are, so that everything that these forgive is forgiven here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sccal.arrays import Bools, Floats
from sccal.errors import DataError
from sccal.logs.ahrs import heading_of_table, usable_yaws
from sccal.logs.column_names import Named
from sccal.logs.encoder import repaired_wheels
from sccal.logs.gnss_csv import fixes_of_table
from sccal.logs.grids import is_of_metres, lat_lon_of_grid, lat_lon_of_plane
from sccal.logs.mapping import LOCAL, NMEA_FORMAT, RATE_UNITS, FileMapping, Section, StreamKey, Use, listed, near, shown
from sccal.logs.messages.heading import euler
from sccal.logs.rates import integrated
from sccal.logs.streams import FixStream, HeadingStream, Notice, Vehicle, WheelStream
from sccal.logs.table import Table, read_chosen

_PLACES = ("lat_deg", "lon_deg")
_QUATERNION = ("quaternion_x", "quaternion_y", "quaternion_z", "quaternion_w")
_GRID = ("grid_east", "grid_north")
_FURTHER: Mapping[StreamKey, Mapping[str, str]] = {
    "encoder": {},
    "ahrs": {"pitch": "pitch_rad", "roll": "roll_rad", "sigma": "yaw_sigma_rad", "turn_rate": "gyro_z_radps"},
    "gnss": {
        **{"height": "alt_m", "quality": "fix_quality", "sigma": "sigma_m"},
        **{"sigma_east": "sigma_east_m", "sigma_north": "sigma_north_m"},
    },
}
"""The contract's names of what a section may name beside what it must."""
_OWN_NAMES = {
    "encoder": ("t", "left_ticks", "right_ticks", "left_rad", "right_rad"),
    "ahrs": ("t", "yaw_deg", "yaw_rad", *_QUATERNION),
    "gnss": ("t", *_PLACES, *_GRID),
}
"""What only a mapped column is called: another one of that name has ``_as_logged`` behind it."""
_SMALLEST_NORM = 0.5
"""Of a quaternion, which has 1: all zeros stand for none."""


@dataclass(frozen=True)
class MappedFile:
    """One file of a run's folder, and the section that says what it holds."""

    path: Path
    mapping: FileMapping
    stream: StreamKey

    @property
    def section(self) -> Section:
        """What vehicle.toml says of it."""
        return self.mapping.sections[self.stream]

    def wheels(self, vehicle: Vehicle) -> tuple[WheelStream, tuple[Notice, ...]]:
        """The wheels, repaired by what the vehicle declares."""
        stream, notices = repaired_wheels(self.wheel_table(vehicle.wheel_radius_m), str(self.path), vehicle)
        left, right = (self.section.uses[side].reversed for side in ("left", "right"))
        return replace(
            stream,
            left_rad=-stream.left_rad if left else stream.left_rad,
            right_rad=-stream.right_rad if right else stream.right_rad,
            source=self.path.name,
        ), notices

    def wheel_table(self, radius_m: float) -> Table:
        """Counts or angles before any repair; travel in metres is turned into that of wheels of the radius."""
        unit = self.section.uses["left"].unit
        kind = "ticks" if unit in ("ticks", "ticks/s") else "rad"
        table = self._table({"left": f"left_{kind}", "right": f"right_{kind}"})
        scale = {"rpm": 2.0 * np.pi / 60.0, "m": 1.0 / radius_m, "m/s": 1.0 / radius_m}.get(unit, 1.0)
        columns = dict(table.columns)
        for name in (f"left_{kind}", f"right_{kind}"):
            turned = scale * columns[name]
            columns[name] = integrated(columns["t"], turned) if unit in RATE_UNITS else turned
        told = Notice(table.source, f"rows of wheel rates in {unit} summed to angles", table.line.size)
        notices = (*table.notices, told) if unit in RATE_UNITS else table.notices
        return replace(table, columns=columns, notices=notices)

    def heading(self) -> tuple[HeadingStream, tuple[Notice, ...]]:
        """The heading, in the convention that the vehicle declares."""
        stream, notices = heading_of_table(self.heading_table())
        return replace(stream, source=self.path.name), notices

    def heading_table(self) -> Table:
        """The heading's readings with the columns of the contract."""
        if "quaternion" in self.section.uses:
            return self._with_yaw(self._table({"quaternion": _QUATERNION}))
        in_radians = self.section.uses["heading"].unit in ("rad", "mrad")
        name = "yaw_rad" if in_radians else "yaw_deg"
        table = self._table({"heading": name})
        radians = self.section.unit("heading") * table.columns[name]
        yaw = radians if in_radians else np.degrees(radians)
        return usable_yaws(replace(table, columns={**table.columns, name: yaw}), self.path)

    def _with_yaw(self, table: Table) -> Table:
        columns = dict(table.columns)
        x, y, z, w = (columns.pop(name) for name in _QUATERNION)
        there: Bools = np.sqrt(x * x + y * y + z * z + w * w) > _SMALLEST_NORM
        if not there.any():
            raise DataError(f"{self.path}: none of {table.line.size} rows holds a quaternion: all have a norm near 0")
        columns["yaw_rad"], _, _ = euler(x, y, z, w)
        told = Notice(table.source, "rows without a quaternion (near zero) dropped", int((~there).sum()))
        return replace(table, columns=columns).keep(there, () if there.all() else [told])

    def fixes(self) -> tuple[FixStream, tuple[Notice, ...]]:
        """The fixes, by latitude and longitude, of whatever grid they are written in."""
        if self.section.format == NMEA_FORMAT:
            from sccal.logs.nmea import read_nmea

            return read_nmea(self.path)
        return fixes_of_table(self.fix_table(), str(self.path))

    def fix_table(self) -> Table:
        """The fixes with the columns of the contract, those without a position too."""
        in_grid = "east" in self.section.uses
        first, second = ("east", "north") if in_grid else ("latitude", "longitude")
        names = dict(zip((first, second), _GRID if in_grid else _PLACES, strict=True))
        table = _without_repeats(self._table(names), tuple(names.values()))
        columns = dict(table.columns)
        for key, name in names.items():
            columns[name] = self.section.unit(key) * columns[name]
        table = replace(table, columns=columns)
        return self._on_the_globe(table) if in_grid else table

    def _on_the_globe(self, table: Table) -> Table:
        columns = dict(table.columns)
        east_m, north_m = (columns.pop(name) for name in _GRID)
        crs = self.section.crs
        if crs == LOCAL:
            columns["lat_deg"], columns["lon_deg"] = lat_lon_of_plane(east_m, north_m)
            columns.pop("alt_m", None)  # lengths in this plane are those on the ground, whatever its height
            return replace(table, columns=columns)
        columns["lat_deg"], columns["lon_deg"] = self._of_crs(east_m, north_m)
        there: Bools = np.isfinite(columns["lat_deg"]) & np.isfinite(columns["lon_deg"])
        there &= (east_m != 0.0) | (north_m != 0.0)
        if not there.any():
            raise DataError(
                f"{self.path}: no place of the grid {crs} is like {east_m[0]:.10g}, {north_m[0]:.10g}; check crs and "
                f"which column is east, in {self.mapping.path}, line {self.section.line}"
            )
        told = Notice(table.source, f"rows dropped whose place does not lie in {crs}", int((~there).sum()))
        return replace(table, columns=columns).keep(there, () if there.all() else [told])

    def _of_crs(self, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        crs = self.section.crs
        place = f"{self.mapping.path}, line {self.section.line}: [files.{self.stream}] crs"
        try:
            if not is_of_metres(crs):
                raise DataError(f'{place} = "{crs}" is no projected grid: name latitude and longitude instead')
        except ValueError as error:
            raise DataError(f"{place}: {error}") from error
        return lat_lon_of_grid(east_m, north_m, crs)

    def _table(self, needed: Mapping[str, str | tuple[str, ...]]) -> Table:
        """The rows that can be read, with their columns under the contract's names.

        ``needed`` says those of the keys that every row must hold, beside the time.
        """
        if self.section.format == NMEA_FORMAT:
            raise DataError(f"{self.path}: holds NMEA sentences, and no table")
        wanted: dict[str, tuple[str, ...]] = {"time": ("t",)}
        wanted |= {key: (names,) if isinstance(names, str) else names for key, names in needed.items()}
        required = [name for names in wanted.values() for name in names]
        wanted |= {key: (_FURTHER[self.stream][key],) for key in self.section.uses if key not in wanted}

        def chosen(logged: list[str], line: int) -> tuple[Named, Sequence[str]]:
            names = self._contract_names(logged, line, wanted)
            return Named(names, {}, self.section.unit("time"), declared=True), required

        return self._in_si(read_chosen(self.path, chosen))

    def _contract_names(self, logged: list[str], line: int, wanted: dict[str, tuple[str, ...]]) -> list[str]:
        """The header with the contract's names for what is mapped, and none for what goes with another stream."""
        file = self.path.name
        keeps = self.mapping.takes_further_columns(self.stream, file)
        elsewhere = self.mapping.used_elsewhere(self.stream, file)
        taken = {*_OWN_NAMES[self.stream], *(name for names in wanted.values() for name in names)}
        names = [f"{name}_as_logged" if name in taken else name for name in logged]
        names = [name if keeps and logged[at] not in elsewhere else "" for at, name in enumerate(names)]
        for key, ours in wanted.items():
            use = self.section.uses[key]
            for column, name in zip(use.columns, ours, strict=True):
                names[self._place(column, logged, line, use)] = name
        return names

    def _place(self, column: str, logged: list[str], line: int, use: Use) -> int:
        """Which of the header's columns is meant: by its name, whatever its capitals, or by its number from 1."""
        if column in logged:
            return logged.index(column)
        alike = [at for at, name in enumerate(logged) if name.lower() == column.strip().lower()]
        if len(alike) == 1:
            return alike[0]
        if column.isdecimal() and 0 < int(column[:9]) <= len(logged):
            return int(column) - 1
        where = f"the header (line {line})" if line else "the first row, for no line names the columns,"
        raise DataError(
            f'{self.path}: {where} has no column "{shown(column)}", which {self.mapping.path}, line {use.line} '
            f"asks for; it has {listed(logged)}{near(column, logged)}"
        )

    def _in_si(self, table: Table) -> Table:
        """The columns that need not be there in the contract's units."""
        columns = dict(table.columns)
        for key, name in _FURTHER[self.stream].items():
            if key in self.section.uses and name in columns:
                columns[name] = self.section.unit(key) * columns[name]
        return replace(table, columns=columns)


def _without_repeats(table: Table, names: Sequence[str]) -> Table:
    """The table without rows that only repeat the place before, where most rows do: a table of faster streams."""
    repeats: Bools = np.concatenate(
        ([False], np.logical_and.reduce([np.diff(table.columns[name]) == 0.0 for name in names]))
    )
    if repeats.mean() < _MOSTLY:
        return table
    what = "rows that only repeat the place of the row before left out: the fixes are slower than the rows"
    return table.keep(~repeats, [Notice(table.source, what, int(repeats.sum()), f"line {table.line[repeats][0]}")])


_MOSTLY = 0.6
"""A robot that stands repeats its place too, to the last digit, where the digits are coarse; a table that goes twice
as fast as its fixes repeats half of the rows, and what is old in those the alignment finds."""
