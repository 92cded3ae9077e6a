"""The streams of a log, each read on its own: what cannot be read is told, and the rest is still there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sccal.align.signs import slope_through_origin
from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.inspect.place import legs, placed_fixes
from sccal.inspect.result import Unread
from sccal.logs.ahrs import read_ahrs
from sccal.logs.encoder import read_encoder
from sccal.logs.gnss_csv import read_gnss_csv
from sccal.logs.nmea import read_nmea, read_nmea_heading
from sccal.logs.options import ReadOptions
from sccal.logs.run import RunSource, read_run
from sccal.logs.streams import FixStream, HeadingStream, Notice, Run, Vehicle, WheelStream
from sccal.logs.table import read_table
from sccal.logs.vehicle import MINIMAL_VEHICLE, read_vehicle

FEWEST_ROWS = 2
FEWEST_LEGS = 5
STAND_IN_TRACK_M = 1.0


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
    """Read whatever can be read of a run. Raises nothing for bad data: it is told in ``unread``."""
    return _of_messages(source, options) if source.folder is None else _Folder(source).read()


def _of_messages(source: RunSource, options: ReadOptions | None) -> LogStreams:
    """A log of messages is read whole or not at all."""
    try:
        run = read_run(source, options)
    except DataError as error:
        return LogStreams(source, None, False, False, None, None, None, "", (Unread("run", str(error)),), ())
    name = source.path.name
    return LogStreams(source, run.vehicle, True, True, run.wheels, run.heading, run.fixes, name, (), run.notices)


class _Folder:
    """Reads a folder file by file and collects what goes wrong."""

    def __init__(self, source: RunSource) -> None:
        self.source, self.folder = source, source.path
        self.unread: list[Unread] = []
        self.notices: list[Notice] = []

    def read(self) -> LogStreams:
        fixes, fix_source = self._fixes()
        heading = self._heading()
        vehicle = self._vehicle()
        wheels, used, track_known = self._wheels(vehicle, fixes, heading)
        order = {"vehicle": 0, "wheels": 1, "heading": 2, "fixes": 3}
        return LogStreams(
            source=self.source,
            vehicle=used,
            declared=vehicle is not None and used is vehicle,
            track_known=track_known,
            wheels=wheels,
            heading=heading,
            fixes=fixes,
            fix_source=fix_source,
            unread=tuple(sorted(self.unread, key=lambda one: order[one.what])),
            notices=tuple(self.notices),
        )

    def _lost(self, what: str, why: object) -> None:
        self.unread.append(Unread(what, str(why)))

    def _there(self, name: str) -> bool:
        return (self.folder / name).is_file()

    def _vehicle(self) -> Vehicle | None:
        toml = self.source.vehicle_toml
        if toml is None:
            self._lost(
                "vehicle",
                f"{self.folder}: no vehicle.toml here or above, up to {self.source.searched_up_to or self.folder}; "
                f"add one with {MINIMAL_VEHICLE}",
            )
            return None
        try:
            vehicle, notices = read_vehicle(toml)
        except DataError as error:
            self._lost("vehicle", error)
            return None
        self.notices += notices
        return vehicle

    def _heading(self) -> HeadingStream | None:
        own = self._there("ahrs.csv")
        if not own and not self._there("gnss.nmea"):
            self._lost("heading", f"{self.folder}: lacks ahrs.csv")
            return None
        try:
            reader, name = (read_ahrs, "ahrs.csv") if own else (read_nmea_heading, "gnss.nmea")
            heading, notices = reader(self.folder / name)
            _require_rows(heading.source, heading.t_s.size)
        except DataError as error:
            self._lost("heading", error if own else f"{self.folder}: lacks ahrs.csv, and {error}")
            return None
        self.notices += notices
        return heading

    def _fixes(self) -> tuple[FixStream | None, str]:
        name = next((name for name in ("gnss.nmea", "gnss.csv") if self._there(name)), "")
        if not name:
            self._lost("fixes", f"{self.folder}: lacks gnss.nmea (or gnss.csv)")
            return None, ""
        try:
            fixes, notices = (read_nmea if name == "gnss.nmea" else read_gnss_csv)(self.folder / name)
            _require_rows(name, fixes.lat_deg.size)
        except DataError as error:
            self._lost("fixes", error)
            return None, name
        self.notices += notices
        if name == "gnss.nmea" and self._there("gnss.csv"):
            self.notices.append(Notice("gnss.csv", "file not read because gnss.nmea is there too", 1))
        return fixes, name

    def _wheels(
        self, vehicle: Vehicle | None, fixes: FixStream | None, heading: HeadingStream | None
    ) -> tuple[WheelStream | None, Vehicle | None, bool]:
        """The wheels, the vehicle that they were read with, and whether its track means anything."""
        if not self._there("encoder.csv"):
            self._lost("wheels", f"{self.folder}: lacks encoder.csv")
            return None, vehicle, vehicle is not None
        path = self.folder / "encoder.csv"
        if vehicle is not None:
            try:
                wheels, notices = read_encoder(path, vehicle)
                _require_rows("encoder.csv", wheels.t_s.size)
            except DataError as error:
                self._lost("wheels", error)
                if vehicle.ticks_per_rev is not None:
                    return None, vehicle, True
            else:
                self.notices += notices
                return wheels, vehicle, True
        try:
            made, track_known = self._stand_in(vehicle, fixes, heading)
            wheels, notices = read_encoder(path, made)
            _require_rows("encoder.csv", wheels.t_s.size)
        except DataError as error:
            if vehicle is None:
                self._lost("wheels", error)
            return None, vehicle, vehicle is not None
        self.notices += notices
        return wheels, made, track_known

    def _stand_in(
        self, vehicle: Vehicle | None, fixes: FixStream | None, heading: HeadingStream | None
    ) -> tuple[Vehicle, bool]:
        """A vehicle whose wheels travel as far as the fixes, and turn as far as the heading.

        Raises DataError where there are no fixes to scale by.
        """
        table = read_table(
            self.folder / "encoder.csv", (("t", "left_ticks", "right_ticks"), ("t", "left_rad", "right_rad"))
        )
        in_ticks = "left_ticks" in table.columns and "right_ticks" in table.columns
        unit = "ticks" if in_ticks else "rad"
        t_s, left, right = (table.columns[name] for name in ("t", f"left_{unit}", f"right_{unit}"))
        m_per_count = None if fixes is None else _metres_per_count(t_s, left, right, fixes)
        if m_per_count is None:
            raise DataError(
                f"{table.source}: {table.rows_seen} rows, {t_s[0]:.3f} … {t_s[-1]:.3f} s, cannot be scaled: neither "
                "vehicle.toml nor the fixes say how far a count goes"
            )
        track_m = None if heading is None else _track_m(t_s, left, right, heading, m_per_count)
        radius_m = m_per_count / (2 * np.pi) if in_ticks else m_per_count
        made = Vehicle(
            name=self.folder.resolve().name if vehicle is None else vehicle.name,
            path=self.folder / "vehicle.toml" if vehicle is None else vehicle.path,
            wheel_radius_m=radius_m,
            track_m=track_m or STAND_IN_TRACK_M,
            ticks_per_rev=1.0 if in_ticks else None,
        )
        if vehicle is not None:
            # The radius is declared and only the counts per turn are not.
            counts = 2 * np.pi * vehicle.wheel_radius_m / m_per_count
            return replace(vehicle, ticks_per_rev=counts if in_ticks else None), True
        return made, track_m is not None


def _require_rows(source: str, usable: int) -> None:
    if usable < FEWEST_ROWS:
        raise DataError(f"{source}: {usable} usable rows, at least {FEWEST_ROWS} are needed")


def _metres_per_count(t_s: Floats, left: Floats, right: Floats, fixes: FixStream) -> float | None:
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


def _track_m(t_s: Floats, left: Floats, right: Floats, heading: HeadingStream, m_per_count: float) -> float | None:
    """The track on which the wheels turn as far as the yaw does; None where that is not clear."""
    grid = np.arange(max(t_s[0], heading.t_s[0]), min(t_s[-1], heading.t_s[-1]))
    if grid.size < 3:
        return None
    apart_m = m_per_count * np.diff(np.interp(grid, t_s, right - left))
    yaw = np.diff(np.interp(grid, heading.t_s, np.unwrap(heading.yaw_rad)))
    slope = slope_through_origin(apart_m, yaw)
    return 1.0 / abs(slope.value) if slope.clear else None
