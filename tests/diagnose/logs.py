"""Simulated logs for diagnoses, each made, fitted and diagnosed once however many tests ask for it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from sccal.align import Aligned, align
from sccal.arrays import Floats
from sccal.calibration.options import CalibrationOptions
from sccal.diagnose.confounded import linear_effects
from sccal.diagnose.diagnose import diagnose
from sccal.diagnose.loop import evidence_of
from sccal.diagnose.model import Model, fine_regime, first_model
from sccal.diagnose.pool import Pool
from sccal.diagnose.result import Diagnosis
from sccal.effects.catalogue import parse_effect
from sccal.filter.options import FilterOptions
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.physics import Physics
from sccal.simulate.run import simulate_run
from sccal.simulate.world import State
from tests.runs import read

RATES = ("encoder.rate_hz=50", "ahrs.rate_hz=20", "gnss.outlier_fraction=0.01")
HARMONIC_DEG = 3.0
PER_AMPERE_DEG = 0.6
KNOTS_S = np.arange(0.0, 1000.0, 4.0)
CURRENT_A = 5.0 + np.random.default_rng(7).uniform(-4.0, 4.0, KNOTS_S.size)
"""A motor current that wanders without regard to the drive."""


class ThirdHarmonic(Physics):
    """A heading error that no effect of the catalogue has."""

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return reading_rad + np.radians(HARMONIC_DEG) * np.cos(3.0 * state.yaw_rad + 0.4)


class MotorField(Physics):
    """A compass that the motors turn."""

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return reading_rad + np.radians(PER_AMPERE_DEG) * np.interp(state.t_s, KNOTS_S, CURRENT_A)


def logged(
    folder: Path,
    physics: Sequence[Physics],
    path: str = "general",
    duration_s: float = 320.0,
    seed: int = 3,
    settings: Sequence[str] = (),
) -> Aligned:
    """Simulate, write, read back and align."""
    chosen = settings_from([f"drive.path={path}", f"drive.duration_s={duration_s}", *RATES, *settings], seed)
    write_run(simulate_run(chosen, physics), folder)
    write_vehicle_file(chosen, folder)
    return align(read(folder))


@cache
def aligned(
    *texts: str, path: str = "general", duration_s: float = 320.0, seed: int = 3, settings: tuple[str, ...] = ()
) -> Aligned:
    """A log with effects as the command line writes them, and one outlier in a hundred fixes."""
    effects = [parse_effect(text) for text in texts]
    with tempfile.TemporaryDirectory() as folder:
        physics = [effect.physics(values) for effect, values in effects]
        return logged(Path(folder), physics, path, duration_s, seed, settings)


@cache
def with_physics(kind: Callable[[], Physics], column: bool = False) -> Aligned:
    """A log with an effect that is not in the catalogue, and perhaps the motor current beside the ticks."""
    with tempfile.TemporaryDirectory() as folder:
        found = logged(Path(folder), [kind()])
        if column:
            file = Path(folder) / "encoder.csv"
            head, *rows = file.read_text().splitlines()
            t_s = np.array([float(row.split(",")[0]) for row in rows])
            start_s = settings_from(list(RATES), 0).clock.start_utc_s
            current = np.interp(t_s - start_s, KNOTS_S, CURRENT_A)
            more = [f"{row},{value:.3f}" for row, value in zip(rows, current.tolist(), strict=True)]
            file.write_text("\n".join([f"{head},motor_current_a", *more]) + "\n")
            found = align(read(Path(folder)))
    return found


@cache
def diagnosis(*texts: str, path: str = "general") -> Diagnosis:
    """The diagnosis of one log of the usual length."""
    return diagnose([aligned(*texts, path=path)], CalibrationOptions())


@cache
def diagnosis_with(kind: Callable[[], Physics], column: bool = False) -> Diagnosis:
    """The diagnosis of a log with an effect that is not in the catalogue."""
    return diagnose([with_physics(kind, column)], CalibrationOptions())


@cache
def bare(*texts: str, path: str = "general", duration_s: float = 320.0) -> Model:
    """The paper's model alone, fitted."""
    return first_model([aligned(*texts, path=path, duration_s=duration_s)], fine_regime(FilterOptions(), 10.0))


@cache
def several() -> Model:
    """Three runs of one vehicle, fitted together."""
    runs = [aligned(duration_s=150.0, seed=seed) for seed in (1, 2, 3)]
    return first_model(runs, fine_regime(FilterOptions(), 5.0))


@cache
def pooled(path: str = "general") -> Pool:
    """What an effect-free log says of all effects with a name."""
    effects = linear_effects()
    return Pool(evidence_of(bare(path=path), effects), effects)
