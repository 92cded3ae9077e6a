"""What an inspection finds: facts about streams, fixes, clock and drive, and what they mean for a calibration.

Times are on the logging clock. What cannot be told, because a stream is missing or too short, is None or NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

from sccal.arrays import Floats, Ints
from sccal.logs.streams import Notice, Vehicle
from sccal.results.calibration import UNJUDGED
from sccal.results.clock import Clock
from sccal.results.verdict import Verdict

StreamName = Literal["wheels", "heading", "fixes"]
Shown = Literal["yes", "weak", "no"]
Weight = Literal["refused", "warning", "note"]
SPANS_TOLD = 500
"""Stretches of one quality in a file, at most."""


@dataclass(frozen=True)
class Unread:
    """Something of the run that could not be read, with the reader's error."""

    what: str
    """wheels, heading, fixes, vehicle, or run."""
    why: str

    WRITTEN: ClassVar[str] = "what error=why"


@dataclass(frozen=True)
class Gap:
    """A pause in a stream."""

    start_s: float
    length_s: float


@dataclass(frozen=True)
class StreamFacts:
    """One stream, as it was read."""

    name: StreamName
    source: str
    """File name."""
    rows: int
    first_s: float
    last_s: float
    rate_hz: float
    """One over the median step."""
    jitter_s: float
    """Half the width of the middle two thirds of what the steps between stamps differ from whole usual steps."""
    missing: float
    """Share of the rows that an even rate would have and that are not there, gaps left out."""
    longest_step_s: float
    gaps: tuple[Gap, ...]
    """The longest ones first."""
    gap_count: int
    gap_total_s: float
    covered: float
    """Share of the run's time in which the stream is there."""
    resolution: float
    """Smallest step of the values that occurs, in ``resolution_unit``; NaN where all are the same."""
    resolution_unit: str
    repaired: int
    """Rows that the reader dropped or put in order; the notices say which."""
    shares_time: bool
    """False where no moment of it lies within the run's reference stream."""

    WRITTEN: ClassVar[str] = (
        "source rows first_s last_s rate_hz jitter_s missing longest_step_s gaps gap_count gap_total_s covered "
        "resolution resolution_unit repaired shares_time"
    )


@dataclass(frozen=True)
class QualityShare:
    """Fixes of one quality."""

    code: int
    """As in GGA; -1 where not stated."""
    name: str
    count: int
    seconds: float


@dataclass(frozen=True)
class QualitySpan:
    """A stretch of fixes of one quality; code is None where there is none."""

    start_s: float
    end_s: float
    code: int | None


@dataclass(frozen=True)
class Range:
    """Lowest, median and highest value."""

    low: float
    median: float
    high: float


@dataclass(frozen=True)
class FixFacts:
    """What the receiver says about its fixes."""

    qualities: tuple[QualityShare, ...]
    """Most frequent first."""
    spans: tuple[QualitySpan, ...]
    strip: tuple[int | None, ...]
    """The most frequent quality in each of STRIP_CELLS equal parts of the run; None where there is no fix."""
    fine_strip: tuple[int | None, ...]
    """The same in FINE_CELLS parts, for pictures."""
    stated_sigma_m: Range | None
    stated_share: float
    satellites: Range | None
    hdop: Range | None
    age_s: Range | None
    white_m: float
    """Scatter from fix to fix, m per axis: what remains of their second differences."""

    WRITTEN: ClassVar[str] = (
        "qualities spans=spans_told strip stated_sigma_m stated_share satellites hdop age_s white_m spans_left_out"
    )

    @property
    def spans_told(self) -> tuple[QualitySpan, ...]:
        """As many stretches as a file tells."""
        return self.spans[:SPANS_TOLD]

    @property
    def spans_left_out(self) -> int:
        """How many more there are."""
        return max(len(self.spans) - SPANS_TOLD, 0)


@dataclass(frozen=True)
class DriveFacts:
    """What the robot did."""

    duration_s: float
    distance_wheels_m: float | None
    distance_fixes_m: float | None
    reversed_m: float | None
    standing_s: float
    standstills: int
    speed_median_mps: float
    """While it moves."""
    speed_max_mps: float
    acceleration_max_mps2: float
    braking_max_mps2: float
    turned_left_rad: float
    turned_right_rad: float
    turn_rate_median_radps: float
    """While it turns."""
    turn_rate_max_radps: float
    headings: int
    """Of twelve sectors, those that the robot moved in."""
    straights: int
    arcs: int
    pivots: int
    by: str
    """What this rests on: wheels, or fixes where there are no wheels."""


@dataclass(frozen=True)
class StandstillFacts:
    """What the sensors read while the robot stands: their noise, without any model."""

    stops: int
    seconds: float
    fixes_m: float | None
    """Scatter about the mean of each stop, m per axis."""
    yaw_rad: float | None
    gyro_radps: float | None
    gyro_bias_radps: float | None


@dataclass(frozen=True)
class Witness:
    """Two streams compared: the slope of the second on the first, through the origin."""

    what: str
    slope: float
    correlation: float
    windows: int
    clear: bool
    """False where the drive does not tell."""
    meaning: str = ""
    """What would make the two agree."""


@dataclass(frozen=True)
class CourseFacts:
    """Yaw minus course of the fixes, on straight legs."""

    legs: int
    offset_rad: float
    """In (−π, π]: the heading offset, as far as it is one."""
    spread_rad: float
    """One standard deviation, robust."""
    expected_rad: float
    """What the scatter of the fixes alone makes of it."""


@dataclass(frozen=True)
class ColumnFacts:
    """A further column of a file: a candidate cause."""

    source: str
    name: str
    values: Range
    varies: bool
    missing: float
    """Share of the rows without a value."""

    WRITTEN: ClassVar[str] = "source name *values varies missing"


@dataclass(frozen=True)
class Excited:
    """Whether this drive shows something."""

    name: str
    title: str
    shown: Shown
    advice: str
    """What to drive where it is not shown well."""
    sigmas: Mapping[str, float]
    """Expected standard deviations by parameter, at typical noise; empty where only geometry was asked."""
    units: Mapping[str, str]
    same_as: tuple[str, ...] = ()
    """Effects that look the same on this drive."""

    WRITTEN: ClassVar[str] = "effect=name title shown advice expected_sigma=sigmas units same_as"


@dataclass(frozen=True)
class Finding:
    """Something to act on."""

    weight: Weight
    """refused: a calibration is impossible; warning: it may be wrong; note: it could be better."""
    text: str


@dataclass(frozen=True)
class Series:
    """What the timeline shows: rates on a common grid (n,), NaN where unknown."""

    t_s: Floats
    speed_wheels_mps: Floats
    speed_fixes_mps: Floats
    """With the sign of the wheels' speed, where they are there."""
    turn_wheels_radps: Floats
    turn_yaw_radps: Floats
    standing_s: Floats
    """(k, 2) start and end of each standstill."""
    fix_east_m: Floats
    """(f,) the fixes in a tangent plane of their own."""
    fix_north_m: Floats
    fix_quality: Ints


@dataclass(frozen=True)
class VehicleFacts:
    """The vehicle, as its file or a guess has it."""

    name: str
    declared: bool
    """False where it is a guess."""
    wheel_radius_m: float
    track_m: float
    ticks_per_rev: float | None
    convention: str


@dataclass(frozen=True)
class StandstillTold:
    """What the sensors read while the robot stands, and when it does."""

    facts: StandstillFacts
    spans_s: Floats
    """(k, 2)"""

    WRITTEN: ClassVar[str] = "*facts spans_s"


@dataclass(frozen=True)
class Inspection:
    """One log, inspected."""

    run: str
    path: Path
    vehicle: Vehicle | None
    declared: bool
    """False where there is no usable vehicle.toml, and the wheels were scaled by the fixes."""
    unread: tuple[Unread, ...]
    span_s: tuple[float, float]
    streams: tuple[StreamFacts, ...]
    fixes: FixFacts | None
    clock: Clock | None
    drive: DriveFacts | None
    standstill: StandstillFacts | None
    witnesses: tuple[Witness, ...]
    course: CourseFacts | None
    columns: tuple[ColumnFacts, ...]
    excited: tuple[Excited, ...]
    excited_how: str
    findings: tuple[Finding, ...]
    notices: tuple[Notice, ...]
    series: Series
    verdict: Verdict = UNJUDGED

    WRITTEN: ClassVar[str] = (
        "run path vehicle=vehicle_facts verdict calibratable unread "
        "span=(start_s end_s) streams=streams_by_name fixes clock drive "
        "standstill=standstill_told witnesses yaw_minus_course=course columns "
        "excited=(how=shown_by effects=excited) findings notices"
    )

    @property
    def refused(self) -> bool:
        """Whether a calibration of this log is impossible."""
        return any(finding.weight == "refused" for finding in self.findings)

    @property
    def calibratable(self) -> bool:
        """Whether a calibration may begin."""
        return not self.refused

    @property
    def vehicle_facts(self) -> VehicleFacts | None:
        """The vehicle's sizes; None where nothing is known of it."""
        v = self.vehicle
        if v is None:
            return None
        return VehicleFacts(v.name, self.declared, v.wheel_radius_m, v.track_m, v.ticks_per_rev, v.convention)

    @property
    def start_s(self) -> float:
        """When the run begins."""
        return self.span_s[0]

    @property
    def end_s(self) -> float:
        """When it ends."""
        return self.span_s[1]

    @property
    def shown_by(self) -> str | None:
        """How it was asked what the drive shows; None where nothing could be."""
        return self.excited_how if self.excited else None

    @property
    def streams_by_name(self) -> Mapping[str, StreamFacts]:
        """The streams by what they are."""
        return {stream.name: stream for stream in self.streams}

    @property
    def standstill_told(self) -> StandstillTold | None:
        """The standstills with their times."""
        return None if self.standstill is None else StandstillTold(self.standstill, self.series.standing_s)


@dataclass(frozen=True)
class InspectFailure:
    """A run that could not be inspected."""

    name: str
    error: str


@dataclass(frozen=True)
class Inspections:
    """Every run of a call, and what could not be inspected."""

    runs: tuple[Inspection, ...]
    failures: tuple[InspectFailure, ...] = ()

    SCHEMA: ClassVar[str] = "sccal.inspect/1"
