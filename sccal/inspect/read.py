"""The streams of a log, each read on its own: what cannot be read is told, and the rest is still there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from sccal.align.signs import slope_through_origin
from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.inspect.place import legs, placed_fixes
from sccal.logs.folder import RunFolder
from sccal.logs.messages.read import LooseStreams, read_loose_streams
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.one_clock import on_one_clock
from sccal.logs.options import ReadOptions
from sccal.logs.rates import unit_of, with_angles
from sccal.logs.run import RunSource, read_run, vehicle_of
from sccal.logs.streams import FixStream, HeadingStream, Notice, Run, Vehicle, WheelStream
from sccal.logs.vehicle import read_vehicle
from sccal.results.inspection import Unread

FEWEST_LEGS = 5
STAND_IN_TRACK_M = 1.0

Read = TypeVar("Read")


@dataclass(frozen=True)
class LogStreams:
    """What could be read of one run; None for what could not."""

    source: RunSource
    vehicle: Vehicle | None
    """Where vehicle.toml is missing or unusable: a stand-in whose sizes come from the fixes and the heading."""
    declared: bool
    track_known: bool
    wheels: WheelStream | None
    heading: HeadingStream | None
    fixes: FixStream | None
    fix_source: str
    unread: tuple[Unread, ...]
    notices: tuple[Notice, ...]

    @property
    def run(self) -> Run | None:
        """The run as a calibration would take it; None where anything is missing."""
        if self.unread or not (self.vehicle and self.wheels and self.heading and self.fixes):
            return None
        return Run(
            self.source.name, self.source.path, self.vehicle, self.wheels, self.heading, self.fixes, self.notices
        )

    @property
    def nothing(self) -> bool:
        """Whether no stream could be read."""
        return self.wheels is None and self.heading is None and self.fixes is None


def read_streams(source: RunSource, options: ReadOptions | None = None) -> LogStreams:
    """Read whatever can be read of a run: bad data are told in ``unread``.

    Raises DataError where the run is neither a folder nor a file.
    """
    folder = source.folder
    return _of_messages(source, options) if folder is None else _FolderReading(source, folder).streams()


def _of_messages(source: RunSource, options: ReadOptions | None) -> LogStreams:
    """A log of messages read whole, and where that fails stream by stream."""
    try:
        run = read_run(source, options)
    except DataError as error:
        return _loose_messages(source, options or ReadOptions(), str(error))
    name = source.path.name
    return LogStreams(source, run.vehicle, True, True, run.wheels, run.heading, run.fixes, name, (), run.notices)


def _loose_messages(source: RunSource, options: ReadOptions, why: str) -> LogStreams:
    """Whatever streams a log of messages holds; its wheels by a stand-in where nobody declares the vehicle."""
    name = source.path.name
    unread: list[Unread] = []
    try:
        vehicle, notices = read_vehicle(vehicle_of(source))
    except DataError as error:
        unread.append(Unread("vehicle", str(error)))
        vehicle, notices = None, ()
    used = vehicle or Vehicle(source.path.resolve().stem, source.path.parent / VEHICLE_FILE, 1.0, STAND_IN_TRACK_M, 1.0)
    try:
        found = read_loose_streams(source.path, used, options)
    except DataError:
        return LogStreams(source, None, False, False, None, None, None, "", (Unread("run", why),), ())
    track_known = vehicle is not None
    if vehicle is None and found.wheels is not None:
        sized = _sized_by_the_rest(used, found)
        if sized is None:
            unread.append(Unread("wheels", f"{name}: neither {VEHICLE_FILE} nor the fixes say how far a turn goes"))
            found = replace(found, wheels=None)
        else:
            used, track_known = sized
            found = read_loose_streams(source.path, used, options)
    unread += [Unread(what, text) for what, text in found.unread.items()]
    if not unread:
        unread.append(Unread("run", why))
    return LogStreams(
        source=source,
        vehicle=used if found.wheels is not None or vehicle is not None else None,
        declared=vehicle is not None,
        track_known=track_known,
        wheels=found.wheels,
        heading=found.heading,
        fixes=found.fixes,
        fix_source=name,
        unread=tuple(unread),
        notices=(*notices, *found.notices),
    )


def _sized_by_the_rest(made: Vehicle, found: LooseStreams) -> tuple[Vehicle, bool] | None:
    """A vehicle whose wheels go as far as the fixes and turn as far as the heading, and whether its track is known."""
    wheels, fixes = found.wheels, found.fixes
    if wheels is None or fixes is None:
        return None
    radius_m = metres_per_count(wheels.t_s, wheels.left_rad, wheels.right_rad, fixes)
    if radius_m is None:
        return None
    t_s, left, right, heading = wheels.t_s, wheels.left_rad, wheels.right_rad, found.heading
    track_m = None if heading is None else track_by_turning_m(t_s, left, right, heading, radius_m)
    return replace(made, wheel_radius_m=radius_m, track_m=track_m or STAND_IN_TRACK_M), track_m is not None


@dataclass
class _FolderReading:
    """A folder read stream by stream, and what went wrong."""

    source: RunSource
    folder: RunFolder
    unread: list[Unread] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)

    def streams(self) -> LogStreams:
        fixes = self._tried("fixes", self.folder.fixes)
        heading = self._tried("heading", self.folder.heading)
        vehicle = self._tried("vehicle", lambda: read_vehicle(vehicle_of(self.source)))
        wheels, used, track_known = self._wheels(vehicle, fixes, heading)
        if wheels is not None and heading is not None and fixes is not None:
            heading, fixes, moved = on_one_clock(wheels, heading, fixes)
            self.notices += moved
        order = ("vehicle", "wheels", "heading", "fixes")
        return LogStreams(
            source=self.source,
            vehicle=used,
            declared=vehicle is not None and used is vehicle,
            track_known=track_known,
            wheels=wheels,
            heading=heading,
            fixes=fixes,
            fix_source=self.folder.fix_file,
            unread=tuple(sorted(self.unread, key=lambda one: order.index(one.what))),
            notices=tuple(self.notices),
        )

    def _tried(self, what: str, read: Callable[[], tuple[Read, tuple[Notice, ...]]]) -> Read | None:
        try:
            found, notices = read()
        except DataError as error:
            self.unread.append(Unread(what, str(error)))
            return None
        self.notices += notices
        return found

    def _wheels(
        self, vehicle: Vehicle | None, fixes: FixStream | None, heading: HeadingStream | None
    ) -> tuple[WheelStream | None, Vehicle | None, bool]:
        """The wheels, the vehicle that they were read with, and whether its track means anything."""
        if vehicle is not None:
            wheels = self._tried("wheels", lambda: self.folder.wheels(vehicle))
            if wheels is not None or vehicle.ticks_per_rev is not None:
                return wheels, vehicle, True
        try:
            made, track_known = _stand_in(self.folder, vehicle, fixes, heading)
            wheels, notices = self.folder.wheels(made)
        except DataError as error:
            if vehicle is None:
                self.unread.append(Unread("wheels", str(error)))
            return None, vehicle, vehicle is not None
        self.notices += notices
        return wheels, made, track_known


def _stand_in(
    folder: RunFolder, vehicle: Vehicle | None, fixes: FixStream | None, heading: HeadingStream | None
) -> tuple[Vehicle, bool]:
    """A vehicle whose wheels travel as far as the fixes, and turn as far as the heading.

    Raises DataError where there are no wheels, or no fixes to scale them by.
    """
    table = folder.wheel_table()
    if unit_of(table):
        plain = vehicle or Vehicle("", folder.path / VEHICLE_FILE, 1.0, STAND_IN_TRACK_M)
        table = with_angles(table, plain, table.source)
    in_ticks = "left_ticks" in table.columns and "right_ticks" in table.columns
    unit = "ticks" if in_ticks else "rad"
    t_s, left, right = (table.columns[name] for name in ("t", f"left_{unit}", f"right_{unit}"))
    m_per_count = None if fixes is None else metres_per_count(t_s, left, right, fixes)
    if m_per_count is None:
        raise DataError(
            f"{table.source}: {table.rows_seen} rows, {t_s[0]:.3f} … {t_s[-1]:.3f} s, cannot be scaled: neither "
            f"{VEHICLE_FILE} nor the fixes say how far a count goes"
        )
    track_m = None if heading is None else track_by_turning_m(t_s, left, right, heading, m_per_count)
    radius_m = m_per_count / (2 * np.pi) if in_ticks else m_per_count
    made = Vehicle(
        name=folder.path.resolve().name if vehicle is None else vehicle.name,
        path=folder.path / VEHICLE_FILE if vehicle is None else vehicle.path,
        wheel_radius_m=radius_m,
        track_m=track_m or STAND_IN_TRACK_M,
        ticks_per_rev=1.0 if in_ticks else None,
    )
    if vehicle is not None:
        # The radius is declared and only the counts per turn are not.
        counts = 2 * np.pi * vehicle.wheel_radius_m / m_per_count
        return replace(vehicle, ticks_per_rev=counts if in_ticks else None), True
    return made, track_m is not None


def metres_per_count(t_s: Floats, left: Floats, right: Floats, fixes: FixStream) -> float | None:
    """Median over legs of the fixes' displacement per mean count of both wheels; None where the two do not meet."""
    placed = placed_fixes(fixes, (float(t_s[0]), float(t_s[-1])))
    inside = (placed.t_s >= t_s[0]) & (placed.t_s <= t_s[-1])
    at = legs(placed.east_m[inside], placed.north_m[inside], placed.leg_m)
    if at.size < FEWEST_LEGS + 1:
        return None
    where = (placed.east_m + 1j * placed.north_m)[inside][at]
    counts = np.interp(placed.t_s[inside][at], t_s, 0.5 * (left + right))
    driven = np.abs(np.diff(counts))
    moved = driven > 0
    if moved.sum() < FEWEST_LEGS:
        return None
    return float(np.median(np.abs(np.diff(where))[moved] / driven[moved]))


def track_by_turning_m(
    t_s: Floats, left: Floats, right: Floats, heading: HeadingStream, m_per_count: float
) -> float | None:
    """The track on which the wheels turn as far as the yaw does; None where that is not clear."""
    grid = np.arange(max(t_s[0], heading.t_s[0]), min(t_s[-1], heading.t_s[-1]))
    if grid.size < 3:
        return None
    apart_m = m_per_count * np.diff(np.interp(grid, t_s, right - left))
    yaw = np.diff(np.interp(grid, heading.t_s, np.unwrap(heading.yaw_rad)))
    slope = slope_through_origin(apart_m, yaw)
    return 1.0 / abs(slope.value) if slope.clear else None
