"""What the experiments gave: everything that their page, table and JSON need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from sccal.arrays import Bools, Floats
from sccal.results.calibration import FILTERS, PARAMETERS, History, Parameters, Status, Trajectory

TOLERANCE_PERCENT = 1.0
"""Of R_r, R_l and L, within which a trial counts as having found them."""
Variant = Literal["without", "with"]
VARIANTS: tuple[Variant, ...] = ("without", "with")
"""The paper's SC EKF, and SC EKF with offset estimation."""


@dataclass(frozen=True)
class Experiment:
    """One fault."""

    key: str
    title: str
    sigma_m: float = 0.0
    quality: int | None = None

    @property
    def is_loss(self) -> bool:
        """Whether the fixes are lost, not noised."""
        return self.sigma_m == 0.0


@dataclass(frozen=True)
class Filtered:
    """One variant on one trial."""

    variant: Variant
    error_m: Floats
    """(n,) distance of the forward filter's position from the truth, at the truth's times."""
    rms_m: float
    """Over the judged times."""
    end_m: float
    """At the last of them."""
    parameters: Parameters
    path: Trajectory
    history: History


@dataclass(frozen=True)
class Trial:
    """One drive under one fault."""

    t_s: Floats
    """(n,) from the start of the run."""
    true_east_m: Floats
    true_north_m: Floats
    judged: Bools
    """(n,) while the fault lasts."""
    fix_t_s: Floats
    """Of the fixes that the filters had, from the start of the run."""
    fix_east_m: Floats
    fix_north_m: Floats
    filtered: tuple[Filtered, ...]
    true_parameters: tuple[float, float, float, float] | None
    offset_wander_rad: Floats | None = None
    """(n,) what the magnetometer's offset was beyond its mean; None where nobody knows it."""

    def of(self, variant: Variant) -> Filtered:
        """One variant's part."""
        return next(run for run in self.filtered if run.variant == variant)


@dataclass(frozen=True)
class Spread:
    """A figure over several seeds."""

    median: float
    low: float
    high: float

    @property
    def interval(self) -> tuple[float, float]:
        """From low to high."""
        return self.low, self.high


@dataclass(frozen=True)
class BySeed:
    """One parameter in the order of the seeds, in the unit of its name."""

    value: Floats
    sigma: Floats
    status: tuple[Status, ...]


@dataclass(frozen=True)
class FaultInShort:
    """The fault of a cell; sigma and times are None where it has none."""

    kind: Literal["loss", "noise"]
    sigma_m: float | None
    quality: int | None
    from_s: float | None
    to_s: float | None


@dataclass(frozen=True)
class Wander:
    """How the simulated magnetometer's offset wanders: a first-order Gauss-Markov process."""

    sigma_deg: float
    time_s: float


MAGNETOMETER_WANDER = Wander(3.0, 60.0)


@dataclass(frozen=True)
class VariantFigures:
    """One variant in one cell, seed by seed (s,)."""

    rms_m: Floats
    """Position error while the fault lasted, root mean square."""
    end_m: Floats
    """Position error at the end of the fault."""
    values: Floats
    """(s, 4) final PARAMETERS; the offset in degrees."""
    sigmas: Floats
    statuses: tuple[tuple[Status, ...], ...]
    """Per seed, of the four."""
    error_over_time_m: tuple[Floats, Floats, Floats]
    """Median, 5th and 95th percentile over the seeds (n,), at Cell.t_s."""
    rms_spread_m: Spread
    """Median and 5th to 95th percentile of rms_m."""
    end_spread_m: Spread

    WRITTEN: ClassVar[str] = (
        "rms_m rms_median_m=rms_spread_m.median rms_5_95_m=rms_spread_m.interval end_m "
        "end_median_m=end_spread_m.median end_5_95_m=end_spread_m.interval parameters=parameters_by_seed"
    )

    @property
    def parameters_by_seed(self) -> Mapping[str, BySeed]:
        """PARAMETERS, each seed by seed."""
        return {
            name: BySeed(self.values[:, k], self.sigmas[:, k], tuple(each[k] for each in self.statuses))
            for k, name in enumerate(PARAMETERS)
        }


@dataclass(frozen=True)
class Cell:
    """One drive under one fault, all seeds."""

    experiment: Experiment
    path: str
    """The drive's name, or the run's."""
    measured: bool
    seeds: tuple[int, ...]
    t_s: Floats
    """(n,) from the start of the run."""
    judged: Bools
    """(n,) while the fault lasts."""
    figures: Mapping[Variant, VariantFigures]
    ratio: Spread
    """rms without the offset state over rms with it: geometric mean and its 95 % interval (Student's t on the seeds'
    logarithms); the mean alone, low and high not finite, with one seed."""
    truth: tuple[float, float, float, float] | None
    """True PARAMETERS, the offset in degrees; for a measured run those of its undisturbed calibration."""
    errors_percent: Floats
    """(s, 3) of R_r, R_l and L with the offset state, (value − truth) / truth; empty without truth."""
    within_percent: int
    """Seeds in which all three are within TOLERANCE_PERCENT of the truth."""
    why_not: str
    """Why some are not; empty where all are."""
    shown: Trial
    """The first seed in full."""

    WRITTEN: ClassVar[str] = (
        "experiment=experiment.key title=experiment.title fault path measured seeds variants "
        "ratio=ratio(mean=median interval_95=interval) truth=truth_by_name "
        "errors_percent=errors_by_name within_percent=within why_not"
    )

    @property
    def fault(self) -> FaultInShort:
        """The experiment's fault, and from when to when it lasted."""
        lasted, loss = self.t_s[self.judged], self.experiment.is_loss
        begin, end = (float(lasted[0]), float(lasted[-1])) if lasted.size else (None, None)
        sigma_m = None if loss else self.experiment.sigma_m
        return FaultInShort("loss" if loss else "noise", sigma_m, self.experiment.quality, begin, end)

    @property
    def variants(self) -> Mapping[str, VariantFigures]:
        """The figures by the filters' names in files."""
        return {FILTERS[variant == "with"]: self.figures[variant] for variant in VARIANTS}

    @property
    def truth_by_name(self) -> Mapping[str, float] | None:
        """The truth by PARAMETERS."""
        return None if self.truth is None else dict(zip(PARAMETERS, self.truth, strict=True))

    @property
    def errors_by_name(self) -> Mapping[str, Floats]:
        """Errors in percent by parameter, seed by seed."""
        return dict(zip(PARAMETERS[:3], self.errors_percent.T, strict=True))

    @property
    def within(self) -> int | None:
        """Seeds within the tolerance; None without truth."""
        return None if self.truth is None else self.within_percent


@dataclass(frozen=True)
class Failed:
    """A run, or a run under one fault, that gave nothing."""

    name: str
    reason: str


@dataclass(frozen=True)
class Experiments:
    """All cells: simulated drives first, then the runs that were given."""

    cells: tuple[Cell, ...]
    duration_s: float
    """Of the simulated drives."""
    seeds: tuple[int, ...]
    failed: tuple[Failed, ...] = ()
    tolerance_percent: float = TOLERANCE_PERCENT
    magnetometer_wander: Wander = MAGNETOMETER_WANDER

    SCHEMA: ClassVar[str] = "sccal.experiments/1"
    WRITTEN: ClassVar[str] = "duration_s seeds tolerance_percent magnetometer_wander cells failed"
