"""What is tried: three faults, three drives, two filters. Numbers that the paper does not print are ours, and say so.

Section 4 of the paper has the experiments and their figures; of the faults it states the levels (sigma 1 m with
quality 2, sigma 5 m with quality 1). When they begin, how long the fixes are gone, the drives' sizes and how the
magnetometer's offset wanders are chosen here.
"""

from __future__ import annotations

from sccal.degrade.faults import Faults
from sccal.results.experiments import Experiment
from sccal.simulate.settings import (
    AhrsSettings,
    ClockSettings,
    DriveSettings,
    EncoderSettings,
    GnssSettings,
    PathName,
    SimulationSettings,
)

PATHS: tuple[PathName, ...] = ("rectangle", "circle", "general")
FIXES_FIRST_S = 40.0
"""So long the noisy experiments begin with good fixes; at most a fifth of the run."""
LOSS = (0.5, 0.7)
"""Of the run: from where to where its fixes are lost."""


def judged_s(experiment: Experiment, span_s: tuple[float, float]) -> tuple[float, float]:
    """From when to when the position error counts, on the run's clock: while the fault lasts."""
    first, last = span_s
    if experiment.is_loss:
        return first + LOSS[0] * (last - first), first + LOSS[1] * (last - first)
    return first + min(FIXES_FIRST_S, 0.2 * (last - first)), last


def faults_of(experiment: Experiment, span_s: tuple[float, float], seed: int) -> Faults:
    """The fault for a run that lasts from the first to the second time."""
    begin, end = judged_s(experiment, span_s)
    if experiment.is_loss:
        return Faults(losses_s=((begin, end),), seed=seed)
    return Faults(sigma_m=experiment.sigma_m, quality=experiment.quality, from_s=begin, seed=seed)


EXPERIMENTS = (
    Experiment("gps_loss", "fixes lost"),
    Experiment("lowered_quality", "fixes with σ = 1 m, quality 2", 1.0, 2),
    Experiment("low_quality", "fixes with σ = 5 m, quality 1", 5.0, 1),
)


def robot(path: PathName, seed: int, duration_s: float) -> SimulationSettings:
    """The paper's robot on one of its drives: RTK at 5 Hz, encoders at 50 Hz, AHRS at 20 Hz, no outliers."""
    start_utc_s = ClockSettings().start_utc_s
    return SimulationSettings(
        seed=seed,
        drive=DriveSettings(path=path, duration_s=duration_s, stand_first_s=5.0),
        encoder=EncoderSettings(rate_hz=50.0),
        ahrs=AhrsSettings(rate_hz=20.0),
        gnss=GnssSettings(rate_hz=5.0),
        clock=ClockSettings(start_utc_s, host_epoch_offset_s=start_utc_s),
    )
