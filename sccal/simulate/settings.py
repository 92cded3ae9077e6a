"""Everything that can be chosen about a simulated run; the defaults are the paper's tracked robot.

Defaults: wheels of nominally 0.08 m, 0.70 m apart, encoders of 1024 counts on the motor axis behind a 1/32 gear, on a
drive at 0.6 m/s. The true values differ from the nominal ones, or there would be nothing to calibrate.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from sccal.errors import UsageError
from sccal.logs.streams import Convention

PathName = Literal["rectangle", "circle", "general", "straight", "figure8", "rows", "calibration"]
PATH_NAMES: tuple[PathName, ...] = get_args(PathName)
Rounds = Literal["counterclockwise", "clockwise", "alternate"]
Corners = Literal["pivot", "arc"]


def _positive(owner: object, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        if not value > 0:
            raise UsageError(f"simulation: {name} = {value:g} must be above zero")


def _not_negative(owner: object, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        if not value >= 0:
            raise UsageError(f"simulation: {name} = {value:g} must not be negative")


@dataclass(frozen=True)
class DriveSettings:
    """The drive: which path, for how long, how fast, how gently."""

    path: PathName = "rectangle"
    duration_s: float = 600.0
    """Whole drive with what comes first. A rectangle finishes the round under way, so it may last longer."""
    speed_mps: float = 0.6
    """Cruising speed; ``general`` draws its own between ``slowest_mps`` and ``fastest_mps``."""
    slowest_mps: float = 0.3
    fastest_mps: float = 1.2
    acceleration_mps2: float = 0.5
    turn_rate_radps: float = 0.5
    """Of pivots and spins in place."""
    turn_acceleration_radps2: float = 0.8
    stand_first_s: float = 0.0
    reverse_first_m: float = 0.0
    """Begins by driving backwards this far, after standing."""
    start_yaw_deg: float | None = None
    """Counter-clockwise from east; None is the path's own: north for ``rows``, else east."""
    rounds: Rounds = "counterclockwise"
    """Direction of ``rectangle`` (alternate: every other round), ``circle`` and the first loop of ``figure8``."""
    corners: Corners = "pivot"
    """Of the rectangle: stop and pivot in place, or arcs of ``corner_radius_m`` without stopping."""
    corner_radius_m: float = 1.0
    rectangle_length_m: float = 20.0
    rectangle_width_m: float = 12.0
    circle_radius_m: float = 8.0
    """Also of the loops of ``figure8``."""
    lead_in_m: float = 10.0
    """Straight before the circle."""
    row_length_m: float = 30.0
    row_spacing_m: float = 1.0
    reverse_leg_m: float = 10.0
    """Of ``general``, driven backwards again and again."""
    grid_hz: float = 200.0
    """Of the truth; at least 100."""

    def __post_init__(self) -> None:
        if self.path not in PATH_NAMES:
            raise UsageError(f"simulation: no path {self.path!r}; there are {', '.join(PATH_NAMES)}")
        if self.path == "circle" and self.rounds == "alternate":
            raise UsageError("simulation: a circle goes one way; take rounds clockwise or counterclockwise, or figure8")
        _positive(
            self, "duration_s", "speed_mps", "slowest_mps", "acceleration_mps2", "turn_rate_radps", "corner_radius_m"
        )
        _positive(self, "turn_acceleration_radps2", "rectangle_length_m", "rectangle_width_m", "circle_radius_m")
        _positive(self, "row_length_m", "row_spacing_m", "reverse_leg_m")
        _not_negative(self, "stand_first_s", "reverse_first_m", "lead_in_m")
        if self.fastest_mps < self.slowest_mps:
            raise UsageError(f"simulation: fastest_mps = {self.fastest_mps:g} is below slowest_mps")
        if self.grid_hz < 100:
            raise UsageError(f"simulation: grid_hz = {self.grid_hz:g} must be at least 100")


@dataclass(frozen=True)
class VehicleSettings:
    """The vehicle as it is, and as its vehicle.toml declares it."""

    name: str = "tracked-demo"
    radius_right_m: float = 0.0808
    radius_left_m: float = 0.0796
    track_m: float = 0.728
    nominal_radius_m: float = 0.08
    nominal_track_m: float = 0.70
    slip_m_per_sqrt_m: float = 0.003
    """Each wheel's travel over ground wanders by this per root of a metre driven."""

    def __post_init__(self) -> None:
        _positive(self, "radius_right_m", "radius_left_m", "track_m", "nominal_radius_m", "nominal_track_m")
        _not_negative(self, "slip_m_per_sqrt_m")


@dataclass(frozen=True)
class EncoderSettings:
    """Two counters, read together."""

    rate_hz: float = 100.0
    ticks_per_rev: int = 32768
    """1024 counts on the motor axis, 32 turns of it per turn of the wheel."""
    counter_bits: int | None = None
    """Width at which the counters wrap; None where they never do."""
    counter_signed: bool = True
    """Two's complement: −2^(bits−1) … 2^(bits−1)−1; else 0 … 2^bits−1."""
    start_left_ticks: int = 0
    start_right_ticks: int = 0
    arrival_jitter_s: float = 0.0
    """Mean of the exponential delay of each time stamp."""

    def __post_init__(self) -> None:
        _positive(self, "rate_hz", "ticks_per_rev")
        _not_negative(self, "arrival_jitter_s")
        if self.counter_bits is not None and not 8 <= self.counter_bits <= 62:
            raise UsageError(f"simulation: counter_bits = {self.counter_bits} must be 8 to 62")


@dataclass(frozen=True)
class AhrsSettings:
    """The heading reference; its error has a part that lasts and a part that does not."""

    rate_hz: float = 50.0
    convention: Convention = "enu"
    heading_offset_deg: float = 12.5
    """What the AHRS reads, turned into enu, minus the robot's heading: mounting, declination and any zero."""
    drift_sigma_deg: float = 0.4
    drift_time_s: float = 15.0
    """Correlation time of the lasting part (first-order Gauss-Markov)."""
    white_sigma_deg: float = 0.15
    resolution_deg: float = 0.01
    tilt_sigma_deg: float = 0.3
    """Of pitch and roll about zero, correlated over 5 s."""
    arrival_jitter_s: float = 0.0

    def __post_init__(self) -> None:
        _positive(self, "rate_hz", "drift_time_s", "resolution_deg")
        _not_negative(self, "drift_sigma_deg", "white_sigma_deg", "tilt_sigma_deg", "arrival_jitter_s")


@dataclass(frozen=True)
class GnssSettings:
    """The receiver: epochs on whole fractions of UTC seconds, lines a little later on the logging computer."""

    rate_hz: float = 5.0
    origin_lat_deg: float = 37.5256
    """Of the place where the drive begins."""
    origin_lon_deg: float = 15.0744
    alt_m: float = 110.0
    antenna_forward_m: float = 0.0
    antenna_left_m: float = 0.0
    white_sigma_m: float = 0.01
    """Per axis, as are all sigmas here."""
    drift_sigma_m: float = 0.01
    drift_time_s: float = 60.0
    speed_sigma_mps: float = 0.02
    """Of the Doppler velocity in RMC."""
    outlier_fraction: float = 0.0
    outlier_smallest_m: float = 1.0
    outlier_largest_m: float = 5.0
    quality: int = 4
    """As in GGA, and the outliers claim it too."""
    satellites: int = 14
    hdop: float = 0.8
    correction_age_s: float = 1.0
    receive_delay_s: float = 0.02
    """Mean from the epoch to the receive time; gamma-distributed."""
    receive_jitter_s: float = 0.005
    """Standard deviation of that delay."""
    with_gst: bool = False
    """Write GST, the receiver's own sigmas, with each fix."""
    with_host_time: bool = True
    """Put the receive time before each line."""

    def __post_init__(self) -> None:
        _positive(self, "rate_hz", "drift_time_s")
        _not_negative(self, "white_sigma_m", "drift_sigma_m", "speed_sigma_mps", "outlier_fraction")
        _not_negative(self, "outlier_smallest_m", "receive_delay_s", "receive_jitter_s")
        if self.outlier_largest_m < self.outlier_smallest_m or self.outlier_fraction > 1:
            raise UsageError("simulation: outliers need a fraction of at most 1 and largest not below smallest")
        if self.receive_jitter_s > 0 and self.receive_delay_s == 0:
            raise UsageError("simulation: receive_jitter_s needs a receive_delay_s: no line arrives before its epoch")


@dataclass(frozen=True)
class ClockSettings:
    """When the drive begins, and what the logging computer's clock says then."""

    start_utc_s: float = 1717243200.0
    """Unix time; 2024-06-01 12:00:00."""
    host_epoch_offset_s: float = 0.0
    """The logging clock is UTC minus this: 0 logs Unix time, ``start_utc_s`` logs seconds from zero."""


@dataclass(frozen=True)
class SimulationSettings:
    """One simulated run, in full: the same settings give the same bytes."""

    seed: int = 0
    drive: DriveSettings = field(default_factory=DriveSettings)
    vehicle: VehicleSettings = field(default_factory=VehicleSettings)
    encoder: EncoderSettings = field(default_factory=EncoderSettings)
    ahrs: AhrsSettings = field(default_factory=AhrsSettings)
    gnss: GnssSettings = field(default_factory=GnssSettings)
    clock: ClockSettings = field(default_factory=ClockSettings)

    def __post_init__(self) -> None:
        _not_negative(self, "seed")
