"""The streams of one run, as arrays: what every reader gives and the alignment takes.

Every array of a stream has the same length n and is sorted by its own time, strictly increasing. Further numeric
columns of a file ride along in ``extras`` (name to float array of length n, NaN where a cell is empty).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

from sccal.arrays import Bools, Floats, Ints
from sccal.errors import one_line
from sccal.logs.names import AHRS_FILE, ENCODER_FILE

Convention = Literal["enu", "ned"]
_NO_ARRAYS = ("utc_has_date", "extras", "clock_steps")


@dataclass(frozen=True)
class Notice:
    """Something that a reader met and dealt with, counted: "12 rows could not be read, first at line 40"."""

    source: str
    """Which file, as the user would name it (``encoder.csv``)."""
    what: str
    """What was met and what was done about it, in words after the count ("rows with text cells dropped")."""
    count: int
    where: str = ""
    """Place of the first one: ``line 40`` or ``t = 12.3 s``."""
    severity: Literal["info", "warning"] = "info"
    doubt: str = ""
    """Why results may be wrong because of it, for the verdict; empty where it was dealt with for good."""

    def __str__(self) -> str:
        place = f" (first at {self.where})" if self.where else ""
        return one_line(f"{self.source}: {self.count} {self.what}{place}")


@dataclass(frozen=True)
class Vehicle:
    """What ``vehicle.toml`` declares. Nominal values are the prior, not the answer."""

    name: str
    path: Path
    wheel_radius_m: float
    track_m: float
    ticks_per_rev: float | None = None
    """Counts per turn of the wheel, after gearing; None where the encoder file holds angles."""
    counter_bits: int | None = None
    convention: Convention = "enu"
    """Of the AHRS yaw: enu, counter-clockwise from east; ned, clockwise from north."""


@dataclass(frozen=True)
class ClockStep:
    """Where a clock moved by an amount that only the stream itself shows."""

    at_s: float
    """The first time after it."""
    size_s: float
    """By how much the times before were moved."""


@dataclass(frozen=True)
class WheelStream:
    """Cumulative angles of the two wheels, forward positive, counters unwrapped and repaired."""

    t_s: Floats
    left_rad: Floats
    right_rad: Floats
    loose: Bools
    """True where the travel since the previous sample is not known well: a counter reset, or a gap."""
    extras: Mapping[str, Floats] = field(default_factory=dict)
    clock_steps: tuple[ClockStep, ...] = ()
    """Steps of its clock whose size only its own rows show (see set_clock)."""
    source: str = ENCODER_FILE
    """Where the counts come from, as the user would name it."""


@dataclass(frozen=True)
class HeadingStream:
    """A heading in its source's own convention, in radians, not unwrapped."""

    t_s: Floats
    """On the logging computer's clock; where utc_s is given, to within the jitter of the receive times, or UTC."""
    yaw_rad: Floats
    yaw_sigma_rad: Floats | None = None
    pitch_rad: Floats | None = None
    """Nose up positive."""
    roll_rad: Floats | None = None
    """Left side up positive."""
    gyro_z_radps: Floats | None = None
    extras: Mapping[str, Floats] = field(default_factory=dict)
    utc_s: Floats | None = None
    """The receiver's epochs, where it gives heading and fixes: both are put on the logging clock alike."""
    convention: Convention | None = None
    """Of yaw_rad; None for the vehicle's (see Vehicle.convention)."""
    source: str = AHRS_FILE
    """Where the readings come from, as the user would name it."""
    clock_steps: tuple[ClockStep, ...] = ()
    """Steps of its clock whose size only its own rows show (see set_clock)."""


@dataclass(frozen=True)
class FixStream:
    """Position fixes with both of their clocks: which one to trust is for the alignment to decide."""

    host_t_s: Floats
    """Time on the logging computer's clock (receive time); NaN where the log has none."""
    utc_s: Floats
    """The receiver's epoch as Unix time; NaN where the log has none (gnss.csv)."""
    utc_has_date: bool
    """False where the log gave times of day only: utc_s then counts from an arbitrary midnight."""
    lat_deg: Floats
    lon_deg: Floats
    alt_m: Floats
    """Height above the ellipsoid where known, else above sea level, else NaN."""
    quality: Ints
    """As in GGA: 0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float; -1 where not given."""
    sigma_east_m: Floats
    """Stated by the log (GST, sigma_m); NaN where not stated."""
    sigma_north_m: Floats
    cov_en_m2: Floats
    """East-north covariance stated by the log; 0 where not stated."""
    extras: Mapping[str, Floats] = field(default_factory=dict)
    speed_mps: Floats | None = None
    """The receiver's own speed over ground (unsigned) at the fixes' epochs; NaN where there is none at that epoch."""
    clock_steps: tuple[ClockStep, ...] = ()
    """Steps of its clock whose size only its own rows show (see set_clock)."""

    def take(self, rows: Ints) -> FixStream:
        """Only the fixes at the indices ``rows``."""
        cut: dict[str, Any] = {
            one.name: array[rows]
            for one in fields(self)
            if one.name not in _NO_ARRAYS and (array := getattr(self, one.name)) is not None
        }
        return replace(self, **cut, extras={name: column[rows] for name, column in self.extras.items()})


@dataclass(frozen=True)
class Reference:
    """Fixes of a degraded log as they were before: they judge what the filter says and never teach it."""

    fixes: FixStream
    lost: Bools
    """(n,) True where the degraded log has no fix any more; False where it has one that was displaced, or the same."""


@dataclass(frozen=True)
class Run:
    """One run, read and repaired but not yet aligned."""

    name: str
    """Unique within one call; names the folder of its results. May hold '/'."""
    path: Path
    vehicle: Vehicle
    wheels: WheelStream
    heading: HeadingStream
    fixes: FixStream
    notices: tuple[Notice, ...] = ()
    reference: Reference | None = None
    """Of a log that `sccal degrade` made; None of every other."""
