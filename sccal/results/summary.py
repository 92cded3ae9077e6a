"""What a summary holds: reports compute nothing. Angles in degrees, as in the files that it is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from sccal.arrays import Bools, Floats
from sccal.logs.inputs import InputFile
from sccal.results.calibration import Estimate, Fit, Outage
from sccal.results.gates import GateResult
from sccal.results.verdict import Verdict

SUMMARY_SCHEMA = "sccal.summary/1"
Shape = Literal["drift", "onset", "step"]


@dataclass(frozen=True)
class ThinPath:
    """The corners of a run's path, in its tangent plane, each (k,); nothing where there is no trajectory."""

    east_m: Floats
    north_m: Floats


@dataclass(frozen=True)
class RunLine:
    """One run that gave a result."""

    run: str
    """Its name, and its folder below the folder of results."""
    vehicle: str
    """As in VehicleSummary.label."""
    started: str | None
    """ISO 8601; None where the log has no date."""
    verdict: Verdict
    duration_s: float
    distance_m: float
    parameters: Mapping[str, Estimate]
    effects: Mapping[str, Mapping[str, Estimate]]
    fit: Fit
    outage: Outage
    warnings: tuple[str, ...]
    inputs: tuple[InputFile, ...]
    versions: Mapping[str, str]
    """Of sccal and of the libraries that computed the run."""
    path: ThinPath

    WRITTEN: ClassVar[str] = (
        "run vehicle started verdict duration_s distance_m parameters=parameters(value sigma status) "
        "effects=effects(value sigma status) fit "
        "outage=outage(window_s windows=count rms_m end_rms_m percent_of_distance) warnings results=run "
        "inputs=inputs(name sha256)"
    )


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
    sentence: str = ""
    """The change in words, where a report has put them."""


@dataclass(frozen=True)
class Change:
    """A trend by the names of its runs."""

    shape: Shape
    value: float
    sigma: float
    days: float | None
    from_run: str
    to_run: str
    from_date: str | None
    to_date: str | None
    p_value: float
    sentence: str

    WRITTEN: ClassVar[str] = "shape value sigma days from_run to_run from=from_date to=to_date p_value sentence"


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

    WRITTEN: ClassVar[str] = (
        "parameter=key by runs centre scatter lower upper outside=runs_outside set_aside=runs_set_aside left_out "
        "tested change"
    )

    @property
    def by(self) -> Literal["date", "order"]:
        """What the runs stand by."""
        return "date" if self.by_date else "order"

    @property
    def runs_outside(self) -> tuple[str, ...]:
        """Names of those beyond the limits."""
        return tuple(run for run, outside in zip(self.runs, self.outside, strict=True) if outside)

    @property
    def runs_set_aside(self) -> tuple[str, ...]:
        """Names of those that do not take part."""
        return tuple(run for run, aside in zip(self.runs, self.set_aside, strict=True) if aside)

    @property
    def change(self) -> Change | None:
        """What changes, by the names of the runs."""
        t = self.trend
        if t is None:
            return None
        begun = self.started if self.by_date else (None,) * len(self.runs)
        between = self.runs[t.before], self.runs[t.after]
        dates = begun[t.before], begun[t.after]
        return Change(t.shape, t.change, t.sigma, t.days, *between, *dates, t.p_value, t.sentence)


@dataclass(frozen=True)
class NoChart:
    """A parameter without a chart, and why."""

    key: str
    reason: str

    WRITTEN: ClassVar[str] = "parameter=key no_chart=reason"


@dataclass(frozen=True)
class VehicleSummary:
    """One vehicle."""

    label: str
    """Its name; with a number behind where several vehicles of different settings share it."""
    file: str | None
    """Name of its JSON file in the folder of results; None where it has none."""
    verdict: Verdict | None
    parameters: Mapping[str, Estimate]
    """Of all runs as one problem; empty without a file."""
    runs: int
    charts: tuple[Chart, ...]
    no_charts: tuple[NoChart, ...]

    WRITTEN: ClassVar[str] = (
        "vehicle=label file verdict=verdict_text runs parameters=parameters(value sigma status) trends"
    )

    @property
    def verdict_text(self) -> str:
        """Empty without a file."""
        return str(self.verdict or "")

    @property
    def trends(self) -> tuple[Chart | NoChart, ...]:
        """Every parameter with its chart, then those without one."""
        return (*self.charts, *self.no_charts)


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
    gates: tuple[GateResult, ...] = ()

    SCHEMA: ClassVar[str] = SUMMARY_SCHEMA
    WRITTEN: ClassVar[str] = "totals runs failures vehicles gates"
