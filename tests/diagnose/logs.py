"""Simulated logs and their diagnoses, each made once however many tests ask for it."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from sccal.align import Aligned, align
from sccal.arrays import Floats
from sccal.calibration.options import CalibrationOptions
from sccal.diagnose.diagnose import diagnose
from sccal.diagnose.shapes import best_forms
from sccal.effects.catalogue import parse_effect
from sccal.effects.effect import Effect
from sccal.evidence.candidates import Candidates, gather_candidates
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted
from sccal.evidence.posterior import PRICE_NATS
from sccal.evidence.saturated import Saturated, saturate
from sccal.results.diagnosis import Diagnosis
from sccal.simulate.choose import settings_from
from sccal.simulate.physics import Physics
from sccal.simulate.world import State
from tests.evidence.logs import HEADING_HZ, USUAL_S, aligned, bare, write_log
from tests.runs import SMALL, read

HARMONIC_DEG = 3.0
PER_AMPERE_DEG = 0.6
KNOTS_S = np.arange(0.0, 1000.0, 4.0)
CURRENT_A = 5.0 + np.random.default_rng(7).uniform(-4.0, 4.0, KNOTS_S.size)
"""A motor current that wanders without regard to the drive."""
OPTIONS = CalibrationOptions(heading_rate_hz=HEADING_HZ, outage_window_s=15.0)
"""Windows short enough that each stretch of a short log has several."""
SLOW = ("encoder.rate_hz=10", "ahrs.rate_hz=5", "gnss.rate_hz=2")
"""Streams of a long log."""


class ThirdHarmonic(Physics):
    """A heading error that no effect of the catalogue has."""

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return reading_rad + np.radians(HARMONIC_DEG) * np.cos(3.0 * state.yaw_rad + 0.4)


class MotorField(Physics):
    """A compass that the motors turn."""

    def heading(self, state: State, reading_rad: Floats) -> Floats:
        return reading_rad + np.radians(PER_AMPERE_DEG) * np.interp(state.t_s, KNOTS_S, CURRENT_A)


def write_current(folder: Path) -> None:
    """The motor current beside the ticks."""
    file = folder / "encoder.csv"
    head, *rows = file.read_text().splitlines()
    t_s = np.array([float(row.split(",")[0]) for row in rows])
    current = np.interp(t_s - settings_from(list(SMALL), 0).clock.start_utc_s, KNOTS_S, CURRENT_A)
    more = [f"{row},{value:.3f}" for row, value in zip(rows, current.tolist(), strict=True)]
    file.write_text("\n".join([f"{head},motor_current_a", *more]) + "\n")


@cache
def with_motor_field(*texts: str, column: bool = True) -> Aligned:
    """A log whose compass the motors turn, with effects of the catalogue, and perhaps the current as a column."""
    physics = [effect.physics(values) for effect, values in map(parse_effect, texts)]
    with tempfile.TemporaryDirectory() as folder:
        write_log(Path(folder), [MotorField(), *physics])
        if column:
            write_current(Path(folder))
        return align(read(Path(folder)))


@cache
def with_third_harmonic() -> Aligned:
    """A log with an error that has no name."""
    with tempfile.TemporaryDirectory() as folder:
        write_log(Path(folder), [ThirdHarmonic()], duration_s=120.0)
        return align(read(Path(folder)))


@cache
def diagnosis(
    *texts: str, path: str = "general", duration_s: float = USUAL_S, settings: tuple[str, ...] = ()
) -> Diagnosis:
    """Of one log with effects as the command line writes them."""
    return diagnosis_of(aligned(*texts, path=path, duration_s=duration_s, settings=settings))


_DIAGNOSES: dict[int, tuple[Aligned, Diagnosis]] = {}


def diagnosis_of(log: Aligned) -> Diagnosis:
    """Of any of the logs above."""
    if id(log) not in _DIAGNOSES:
        _DIAGNOSES[id(log)] = log, diagnose([log], OPTIONS)
    return _DIAGNOSES[id(log)][1]


@cache
def everything_free(path: str = "general") -> tuple[Saturated, Candidates]:
    """What an effect-free log says of all candidates."""
    model = bare(path=path)
    candidates = gather_candidates([model.view(0)])
    competing = best_forms(model, candidates, ())
    return saturate(model, competing, dict.fromkeys((one.key for one in competing), PRICE_NATS)), candidates


def free_beside(path: str, effects: Sequence[Effect]) -> tuple[Saturated, Candidates]:
    """The same for some effects only."""
    free = tuple(Free(one) for one in effects)
    prices = dict.fromkeys((one.key for one in free), PRICE_NATS)
    return saturate(bare(path=path), [Accepted(one) for one in free], prices, None), Candidates(free)
