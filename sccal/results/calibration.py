"""What a calibration found, with everything that a report needs: reports compute nothing.

Angles are in radians here and become degrees only where they are written or printed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.inputs import InputFile
from sccal.logs.streams import Notice, Vehicle
from sccal.results.clock import Clock
from sccal.results.noise import Noise
from sccal.results.numbers import radians_of, wrapped_deg
from sccal.results.verdict import Verdict

Status = Literal["estimated", "unobserved", "at_bound", "held"]
PARAMETERS = ("radius_right_m", "radius_left_m", "track_m", "heading_offset_deg")
"""Names of the constants in files."""
OFFSET_KEY = PARAMETERS[3]
CALIBRATION_SCHEMA = "sccal.calibration/1"
VEHICLE_RUN = "(vehicle)"
"""The ``run`` of a vehicle's file; no folder of results can have that name on its own."""
FilterName = Literal["sc_ekf", "sc_ekf_offset"]
FILTERS: tuple[FilterName, FilterName] = ("sc_ekf", "sc_ekf_offset")
"""The filters of the paper, without and with the heading offset as a state."""
UNJUDGED = Verdict("doubtful", ("not judged yet",))


@dataclass(frozen=True)
class Estimate:
    """One parameter: its value, its standard deviation (both in the parameter's unit), and whether to believe it."""

    value: float
    sigma: float
    status: Status
    reason: str = ""
    """Why it should not be believed and what to do about it; empty where it should."""
    nominal: float | None = None
    """The declared prior value; None where there is none (the heading offset)."""
    prior_sigma: float | None = None

    WRITTEN: ClassVar[str] = "value! sigma! status reason nominal prior_sigma"

    @property
    def in_degrees(self) -> Estimate:
        """An angle in radians: its values wrapped into (−180, 180], its spreads only converted."""
        return Estimate(
            wrapped_deg(self.value),
            math.degrees(self.sigma),
            self.status,
            self.reason,
            None if self.nominal is None else wrapped_deg(self.nominal),
            None if self.prior_sigma is None else math.degrees(self.prior_sigma),
        )

    @property
    def in_radians(self) -> Estimate:
        """An angle in degrees, as it stands in a file."""
        return Estimate(
            radians_of(self.value),
            radians_of(self.sigma),
            self.status,
            self.reason,
            None if self.nominal is None else radians_of(self.nominal),
            None if self.prior_sigma is None else radians_of(self.prior_sigma),
        )


@dataclass(frozen=True)
class Parameters:
    """The calibrated constants of the paper's state: R_r, R_l, L and Ofs."""

    radius_right_m: Estimate
    radius_left_m: Estimate
    track_m: Estimate
    heading_offset_rad: Estimate
    """What the AHRS reads, turned into enu, minus the robot's heading; in (−π, π]."""

    WRITTEN: ClassVar[str] = "radius_right_m! radius_left_m! track_m! heading_offset_rad!"

    @property
    def by_key(self) -> dict[str, Estimate]:
        """By their names in files, which are PARAMETERS: the heading offset in degrees."""
        right, left, track = self.radius_right_m, self.radius_left_m, self.track_m
        return dict(zip(PARAMETERS, (right, left, track, self.heading_offset_rad.in_degrees), strict=True))


@dataclass(frozen=True)
class Fit:
    """How well the filter's predictions met the measurements (innovations of the accepted ones)."""

    gnss_innovation_rms_m: float
    """Root mean square of the innovation's length (east and north together)."""
    heading_innovation_rms_rad: float
    nis_gnss: float
    """Mean normalised innovation squared per degree of freedom; 1 is consistent."""
    nis_heading: float
    fixes_used: int
    fixes_rejected: int
    headings_used: int
    headings_rejected: int
    recoveries: int
    """How often the filter had locked itself out and was opened again."""


@dataclass(frozen=True)
class OutageWindow:
    """One stretch with the fixes withheld, judged antenna against antenna."""

    start_s: float
    end_s: float
    distance_m: float
    rms_drift_m: float
    end_drift_m: float
    t_s: Floats
    """Times of the withheld fixes."""
    drift_m: Floats
    """Distance between the predicted and the withheld fix at those times."""

    WRITTEN: ClassVar[str] = "start_s end_s distance_m rms_m=rms_drift_m end_m=end_drift_m"


@dataclass(frozen=True)
class Outage:
    """Drift over windows without fixes, dead-reckoned by what the filter had learnt before each window."""

    window_s: float
    windows: tuple[OutageWindow, ...]
    rms_m: float | None
    """Over all withheld fixes; None where no window fits into the run."""
    end_rms_m: float | None
    percent_of_distance: float | None
    """Sum of the end drifts over the sum of the distances driven in the windows, in percent."""
    how: str
    """Which data taught the filter and which judged it, in words."""

    WRITTEN: ClassVar[str] = "window_s windows=count rms_m end_rms_m percent_of_distance how each=windows"

    @property
    def count(self) -> int:
        """How many windows there are."""
        return len(self.windows)


@dataclass(frozen=True)
class AgainstReference:
    """The forward filter judged by fixes that it never saw: withheld ones, or those from before a log was degraded."""

    losses: Outage | None
    """One window for each stretch whose fixes are lost; None where none is."""
    displaced_rms_m: float | None
    """Root mean square distance of the predicted from the undisplaced fixes; None where none was displaced."""
    displaced: int
    """How many fixes that is."""

    WRITTEN: ClassVar[str] = "losses displaced displaced_rms_m"


@dataclass(frozen=True)
class Unseen:
    """A parameter beyond the model that these data could not show at any size worth looking for."""

    effect: str
    title: str
    parameter: str
    unit: str
    sigma: float
    """What its standard deviation would be, were it estimated."""
    smallest: float
    """Smallest size that would stand out."""

    WRITTEN: ClassVar[str] = "effect parameter unit sigma smallest"


@dataclass(frozen=True)
class Missing:
    """An effect that the model lacks, as a quick look sees it: a diagnosis would name it."""

    effect: str
    title: str
    evidence_nats: float
    """Logarithm of the odds for it."""
    size: float
    """Largest parameter in units of the smallest size that matters."""


@dataclass(frozen=True)
class HeldOut:
    """Drift without fixes on data that fitted neither constants nor effects."""

    outage_rms_m: float | None
    outage_end_rms_m: float | None
    how: str
    """Which data judged, and which fitted, in words."""


@dataclass(frozen=True)
class Trajectory:
    """The middle between the wheels, in the tangent plane."""

    t_s: Floats
    east_m: Floats
    north_m: Floats
    yaw_rad: Floats
    sigma_east_m: Floats
    sigma_north_m: Floats
    sigma_yaw_rad: Floats


@dataclass(frozen=True)
class History:
    """The parameters as the forward filter learnt them, starting from the nominal values (m, m, m, rad)."""

    t_s: Floats
    radius_right_m: Floats
    radius_left_m: Floats
    track_m: Floats
    heading_offset_rad: Floats
    sigma_radius_right_m: Floats
    sigma_radius_left_m: Floats
    sigma_track_m: Floats
    sigma_heading_offset_rad: Floats


@dataclass(frozen=True)
class Residuals:
    """Innovations ν = z − h(x) at every measurement of the last pass."""

    heading_t_s: Floats
    heading_rad: Floats
    heading_sigma_rad: Floats
    heading_accepted: Bools
    fix_t_s: Floats
    fix_east_m: Floats
    fix_north_m: Floats
    fix_sigma_east_m: Floats
    fix_sigma_north_m: Floats
    fix_accepted: Bools


@dataclass(frozen=True)
class Fixes:
    """The fixes as they were used, in the tangent plane and on the logging computer's clock."""

    t_s: Floats
    east_m: Floats
    north_m: Floats
    quality: Ints
    """As in GGA; -1 where not given."""


@dataclass(frozen=True)
class Drive:
    """What the run did: the part of a verdict that a driver can change."""

    duration_s: float
    distance_m: float
    reversed_m: float
    """Part of the distance driven backwards."""
    standing_s: float
    max_speed_mps: float
    turned_left_rad: float
    """Sum of the turning to the left (counter-clockwise)."""
    turned_right_rad: float


@dataclass(frozen=True)
class Manoeuvre:
    """One kind of driving, by the wheels: how much of it the run has."""

    kind: Literal["straight", "straight_back", "arc_left", "arc_right", "spin_left", "spin_right", "standing"]
    duration_s: float
    distance_m: float
    turned_rad: float
    """To the side that the kind says, or without regard to sides; not negative."""
    speed_mps: tuple[float, float]
    """Between these was nine tenths of the time; a spin's are those of a wheel's rim."""


@dataclass(frozen=True)
class Cause:
    """Accepted residuals of one kind against a quantity that may cause them, from where the start has settled."""

    residual: Literal["heading", "along", "across"]
    """Of the heading (rad), or of the fixes in the robot's direction and to its left (m)."""
    quantity: Literal["yaw", "turn_rate", "speed", "roll", "pitch"]
    x: Floats
    """(n,) the quantity at the measurements: rad in (−π, π], rad/s to the left, m/s, rad left side up, rad nose up."""
    residuals: Floats
    """(n,)"""
    bin_x: Floats
    """(k,) middles of stretches of x that hold enough measurements."""
    bin_mean: Floats
    bin_sigma: Floats
    """Standard errors of the means."""
    chance: float
    """Probability that means would lie as far from zero by chance alone; nan without means."""


@dataclass(frozen=True)
class Consistency:
    """Normalised innovations squared per degree of freedom, in stretches of time; 1 is expected."""

    measured: Literal["fixes", "headings"]
    t_s: Floats
    """(k,) middles of the stretches."""
    nis: Floats
    """(k,) means over the accepted measurements."""
    low: Floats
    """(k,) 95 of 100 means lie between low and high if the stated noise is right."""
    high: Floats
    inside: float
    """Share of single measurements within their own 95 % region."""


@dataclass(frozen=True)
class Provenance:
    """What a result was made from, and with what: the same provenance gives the same result."""

    inputs: tuple[InputFile, ...]
    options: Mapping[str, str]
    """Every option by its name, as it was in force."""
    versions: Mapping[str, str]
    """Of sccal and of the libraries that compute."""


@dataclass(frozen=True)
class Origin:
    """Where the tangent plane touches the earth, WGS 84; NaN where a file does not tell it."""

    lat_deg: float
    lon_deg: float
    alt_m: float = 0.0


@dataclass(frozen=True)
class Calibration:
    """One run, calibrated: what its file holds, and beside it what grows with the run's length."""

    run: str
    vehicle: Vehicle
    with_offset: bool
    """False for the paper's SC EKF without the offset state."""
    parameters: Parameters
    origin: Origin
    fit: Fit
    outage: Outage
    noise: Noise
    drive: Drive
    clock: Clock
    trajectory: Trajectory
    history: History
    residuals: Residuals
    fixes: Fixes
    notices: tuple[Notice, ...]
    """Everything that readers, alignment and filter had to repair, drop or doubt."""
    effects: Mapping[str, Mapping[str, Estimate]] = field(default_factory=dict)
    on_the_way: Trajectory | None = None
    """Where the forward filter believed the robot to be at the time, before it knew what came later."""
    against_reference: AgainstReference | None = None
    """None where all fixes teach and were never displaced."""
    unseen: tuple[Unseen, ...] = ()
    started: str | None = None
    """When the wheels' log begins, ISO 8601 in UTC; None where the log has no date."""
    provenance: Provenance | None = None
    """None where the run does not come from files."""
    causes: tuple[Cause, ...] = ()
    consistency: tuple[Consistency, ...] = ()
    manoeuvres: tuple[Manoeuvre, ...] = ()
    missing: tuple[Missing, ...] = ()
    """What the model seems to lack, the strongest first."""
    held_out: HeldOut | None = None
    """By stretches of the run; None where it is too short to leave any out."""
    verdict: Verdict = UNJUDGED

    SCHEMA: ClassVar[str] = CALIBRATION_SCHEMA
    WRITTEN: ClassVar[str] = (
        "run! vehicle started variant verdict parameters! effects origin fit outage held_out missing "
        "reference=against_reference unseen noise drive clock notices provenance"
    )

    @property
    def variant(self) -> FilterName:
        """The filter of the paper that it was."""
        return FILTERS[self.with_offset]

    @property
    def of_vehicle(self) -> bool:
        """Whether it is several runs as one problem."""
        return False

    @staticmethod
    def further(document: Mapping[str, Any], _: Any) -> dict[str, Any]:
        """What a document tells in other words."""
        return {"with_offset": document.get("variant") != FILTERS[False]}


@dataclass(frozen=True)
class VehicleCalibration:
    """Several runs of one vehicle as one problem: shared radii and track, own poses and offsets."""

    vehicle: Vehicle
    with_offset: bool
    runs: tuple[Calibration, ...]
    parameters: Parameters
    fit: Fit
    """Pooled over the runs."""
    outage: Outage
    """All runs' windows together."""
    consistency_chi2_per_dof: float | None
    """Disagreement of the runs about the shared parameters, over what their sigmas allow; None for one run."""
    notices: tuple[Notice, ...] = ()
    effects: Mapping[str, Mapping[str, Estimate]] = field(default_factory=dict)
    held_out: HeldOut | None = None
    """The same quantity as before and after of a diagnosis; None where no run is long enough to leave stretches out."""
    missing: tuple[Missing, ...] = ()
    """What the model seems to lack in some run, the strongest first."""
    verdict: Verdict = UNJUDGED

    SCHEMA: ClassVar[str] = CALIBRATION_SCHEMA
    WRITTEN: ClassVar[str] = (
        "run vehicle variant verdict parameters! effects consistency_chi2_per_dof fit outage held_out missing "
        "runs=runs(run verdict parameters) notices"
    )

    @property
    def run(self) -> str:
        """What a vehicle's file has in place of a run's name."""
        return VEHICLE_RUN

    @property
    def variant(self) -> FilterName:
        """The filter of the paper that it was."""
        return FILTERS[self.with_offset]

    @property
    def of_vehicle(self) -> bool:
        """Whether it is several runs as one problem."""
        return True

    @property
    def started(self) -> None:
        """Several runs have no one beginning."""
        return

    @property
    def provenance(self) -> None:
        """The runs have their own."""
        return

    @staticmethod
    def further(document: Mapping[str, Any], _: Any) -> dict[str, Any]:
        """What a document tells in other words."""
        return {"with_offset": document.get("variant") != FILTERS[False]}


Calibrated = Calibration | VehicleCalibration


def named_estimates(calibrated: Calibrated) -> dict[str, Estimate]:
    """Every estimate by its dotted name in the file: ``parameters.track_m``, ``effects.lever_arm.left_m``."""
    return {f"parameters.{key}": estimate for key, estimate in calibrated.parameters.by_key.items()} | {
        f"effects.{effect}.{name}": estimate
        for effect, named in calibrated.effects.items()
        for name, estimate in named.items()
    }
