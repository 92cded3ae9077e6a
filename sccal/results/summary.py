"""What a summary holds: reports compute nothing. Angles in degrees, as in the files that it is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from sccal.arrays import Bools, Floats
from sccal.results.saved import SavedEstimate

Shape = Literal["drift", "onset", "step"]


@dataclass(frozen=True)
class ThinPath:
    """The corners of a run's path, in its tangent plane, each (k,); nothing where there is no trajectory."""

    east_m: Floats
    north_m: Floats


@dataclass(frozen=True)
class Outage:
    """Drift without fixes, as the run's file tells it; None where no window fits into the run."""

    window_s: float | None
    windows: int
    rms_m: float | None
    end_rms_m: float | None
    percent_of_distance: float | None


@dataclass(frozen=True)
class RunLine:
    """One run that gave a result."""

    run: str
    """Its name, and its folder below the folder of results."""
    vehicle: str
    """As in VehicleSummary.label."""
    started: str | None
    """ISO 8601; None where the log has no date."""
    level: str
    """``good``, ``partial`` or ``doubtful``."""
    verdict: str
    """The level, a colon and why."""
    duration_s: float | None
    distance_m: float | None
    parameters: Mapping[str, SavedEstimate]
    effects: Mapping[str, Mapping[str, SavedEstimate]]
    fit: Mapping[str, Any]
    """Numbers by name, as in calibration.json."""
    outage: Outage
    warnings: tuple[str, ...]
    inputs: tuple[tuple[str, str], ...]
    """Name and SHA-256 of each file that the run was read from."""
    versions: Mapping[str, str]
    """Of sccal and of the libraries that computed the run."""
    path: ThinPath


@dataclass(frozen=True)
class FailedRun:
    """A run, or a path on the command line, that gave no result."""

    run: str
    reason: str
    exit_code: int


@dataclass(frozen=True)
class Trend:
    """A change of one parameter over the runs that chance does not explain."""

    shape: Shape
    """``drift``: along all runs. ``onset``: steady, and drifting from run ``since`` on. ``step``: once."""
    change: float
    """Over the whole drift, or across the step, in the parameter's unit."""
    sigma: float
    """Of ``change``; holds the scatter between the runs."""
    p_value: float
    """Chance of so clear a change in this one chart where nothing changes, for the search over shapes and places."""
    before: int
    """Step: index of the last run before it. Otherwise the run with which the drift begins."""
    after: int
    """Step: index of the first run after it. Otherwise the last run."""
    days: float | None
    """Between the two runs; None for a chart by order."""
    fitted: Floats
    """(n,) of the chart's runs."""


@dataclass(frozen=True)
class Chart:
    """One parameter of a vehicle over its runs: an individuals chart with limits. Arrays are (n,), in order of time."""

    key: str
    """``track_m``, or an effect, a dot and its parameter's name."""
    runs: tuple[str, ...]
    started: tuple[str | None, ...]
    by_date: bool
    """False where too few runs have a date, or all the same: then in the order of the names."""
    at: Floats
    """Days since the first run, or 0, 1, 2 …"""
    value: Floats
    """Directions stand on one turn, so they may leave (−180, 180]."""
    sigma: Floats
    centre: float
    """Weighted median."""
    scatter: float
    """Standard deviation between the runs beyond their own sigmas."""
    lower: Floats
    upper: Floats
    """centre ± 3 √(scatter² + sigma²)"""
    outside: Bools
    """Beyond the limits."""
    set_aside: Bools
    """So far from the runs around them that they do not take part in centre and trend."""
    left_out: int
    """Runs that did not estimate the parameter, or have no date in a chart by date."""
    tested: bool
    """Whether a change was looked for: enough runs, at different times."""
    trend: Trend | None
    """None where nothing changes beyond chance."""


@dataclass(frozen=True)
class NoChart:
    """A parameter without a chart, and why."""

    key: str
    reason: str


@dataclass(frozen=True)
class VehicleSummary:
    """One vehicle."""

    label: str
    """Its name; with a number behind where several vehicles of different settings share it."""
    file: str | None
    """Name of its JSON file in the folder of results; None where it has none."""
    verdict: str
    parameters: Mapping[str, SavedEstimate]
    """Of all runs as one problem; empty without a file."""
    runs: int
    charts: tuple[Chart, ...]
    no_charts: tuple[NoChart, ...]


@dataclass(frozen=True)
class Totals:
    """How many runs came out how."""

    runs: int
    """With those that failed."""
    good: int
    partial: int
    doubtful: int
    failed: int
    duration_s: float
    distance_m: float


@dataclass(frozen=True)
class Summary:
    """A batch."""

    runs: tuple[RunLine, ...]
    failures: tuple[FailedRun, ...]
    vehicles: tuple[VehicleSummary, ...]
    totals: Totals
