"""Robots, drives and numbers of the further cases, each drawn from its own seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studies.arrays import stream
from studies.field.drives import Piece, varied
from studies.field.files import write_run
from studies.field.wanted import Truth
from studies.field.world import Ground, Instruments, Log, record
from studies.vehicles import Robot


@dataclass(frozen=True)
class Drawn:
    """One robot with its instruments and its drive."""

    seed: int
    robot: Robot
    told: Instruments
    pieces: tuple[Piece, ...]
    rng: np.random.Generator
    """For the numbers of the case itself."""

    def log(self, ground: Ground | None = None, told: Instruments | None = None) -> Log:
        """What is logged."""
        return record(self.pieces, self.seed, self.robot, ground, told or self.told)


def draw(seed: int, seconds: float = 180.0, reverse: bool = True) -> Drawn:
    """A robot between a small rover and a mower: sizes, counts, rates, mounting and drive."""
    rng = stream(seed, "further field case")
    nominal_m = round(float(rng.uniform(0.06, 0.2)), 3)
    radii = nominal_m * (1.0 + 0.012 * rng.standard_normal(2))
    nominal_track_m = round(nominal_m * float(rng.uniform(4.0, 8.0)), 2)
    robot = Robot(
        radius_right_m=float(radii[0]),
        radius_left_m=float(radii[1]),
        track_m=nominal_track_m * float(rng.uniform(0.96, 1.12)),
        nominal_radius_m=nominal_m,
        nominal_track_m=nominal_track_m,
        ticks_per_rev=int(rng.choice([1440, 2048, 4096, 10000, 16384])),
    )
    told = Instruments(
        encoder_hz=float(rng.choice([25.0, 50.0, 100.0])),
        ahrs_hz=float(rng.choice([20.0, 50.0, 100.0])),
        fix_hz=float(rng.choice([5.0, 10.0])),
        offset_deg=float(rng.uniform(-170.0, 170.0)),
    )
    pieces = varied(seconds, seed, float(rng.uniform(0.7, 1.1)), float(rng.uniform(0.45, 0.7)), reverse)
    return Drawn(seed, robot, told, tuple(pieces), rng)


Bend = Callable[[Drawn, Path], Truth]


def case_of(seed: int, bend: Bend, seconds: float = 180.0, reverse: bool = True) -> Callable[[Path], Truth]:
    """A building function of a drawn robot."""
    return lambda folder: bend(draw(seed, seconds, reverse), folder)


def logged(change: Callable[[Drawn, Log], Log]) -> Bend:
    """The plain folder of a changed log."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = change(drawn, drawn.log())
        write_run(folder, log)
        return Truth.of(drawn.log())

    return bend
