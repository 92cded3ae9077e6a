"""What a log holds beside the streams that a calibration needs: currents, temperatures, loads, and idle numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from studies.arrays import FloatArray, gauss_markov, stream

COLUMN_PORTS = ("heading", "along", "yaw", "side", "pull")
PER_UNIT = "per_unit"
"""The one parameter of a cause that is a logged column."""


@dataclass(frozen=True)
class Column:
    """One logged quantity c(t) = own(t) + per_acceleration max(a, 0) + per_turn_rate |ω|, on the grid of the truth."""

    name: str
    own: FloatArray
    reference: float
    """The value at which the quantity does nothing: what it causes is in proportion to c − reference."""
    per_acceleration: float = 0.0
    per_turn_rate: float = 0.0
    file: Literal["encoder", "ahrs"] = "encoder"
    digits: int = 2

    def values(self, acceleration_mps2: FloatArray, turn_rate_radps: FloatArray) -> FloatArray:
        """The quantity along a drive."""
        driven = self.per_acceleration * np.maximum(acceleration_mps2, 0.0)
        return self.own + driven + self.per_turn_rate * np.abs(turn_rate_radps)


Drawer = Callable[[np.random.Generator, FloatArray], Column]


def wave(rng: np.random.Generator, t_s: FloatArray, sigma: float, tau_s: float) -> FloatArray:
    """A smoothly wandering quantity: Gauss-Markov at a coarse step, joined by straight lines."""
    step_s = min(max(tau_s / 20.0, 0.2), 5.0)
    coarse = np.arange(t_s[0] - step_s, t_s[-1] + 2.0 * step_s, step_s)
    return np.interp(t_s, coarse, gauss_markov(rng.standard_normal(coarse.size), step_s, sigma, tau_s))


def motor_current(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """Soil, grass and slope load the motors; speeding up and turning does so too."""
    own = 5.0 + wave(rng, t_s, 1.6, 12.0) + wave(rng, t_s, 0.8, 1.5)
    return Column("motor_current_a", own, 5.5, 2.0, 1.0)


def ambient(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """The air warms, and clouds pass."""
    total_s = float(t_s[-1] - t_s[0])
    swing = 4.0 * np.sin(2.0 * np.pi * (t_s / total_s * rng.uniform(0.7, 1.4) + rng.random()))
    return Column("ambient_c", 18.0 + swing + wave(rng, t_s, 2.0, 90.0), 18.0, digits=2)


def payload(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """Loads are taken on and set down."""
    changes = np.sort(rng.uniform(t_s[0], t_s[-1], int(rng.integers(4, 9))))
    loads = rng.uniform(0.0, 40.0, changes.size + 1)
    return Column("payload_kg", loads[np.searchsorted(changes, t_s)], 20.0, digits=1)


def soil(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """Wet and dry places."""
    return Column("soil_moisture_pct", 30.0 + wave(rng, t_s, 7.0, 40.0), 30.0, file="ahrs", digits=1)


def hydraulics(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """The pressure of an implement that works on and off."""
    works = wave(rng, t_s, 1.0, 20.0) > 0.0
    return Column("hydraulic_bar", np.where(works, 140.0, 60.0) + wave(rng, t_s, 8.0, 5.0), 100.0, digits=1)


def motor_temperature(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """Warm-up towards a value that the load moves."""
    warmed = 20.0 + 30.0 * (1.0 - np.exp(-(t_s - t_s[0]) / rng.uniform(200.0, 900.0)))
    return Column("motor_temp_c", warmed + wave(rng, t_s, 1.5, 120.0), 40.0, digits=1)


def battery(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """A voltage that sinks, and sags under acceleration."""
    fallen = 25.6 - 1.2 * (t_s - t_s[0]) / 1800.0
    return Column("battery_v", fallen + wave(rng, t_s, 0.05, 8.0), 25.0, -0.25, -0.05)


def random_walk(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """Nothing but a random walk."""
    return Column("tank_l", 50.0 + np.cumsum(rng.normal(0.0, 0.02, t_s.size)), 50.0, file="ahrs", digits=3)


def computer_load(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """Bursts without any tie to the drive."""
    return Column("cpu_load_pct", np.abs(wave(rng, t_s, 20.0, 3.0)) + 10.0, 20.0, digits=1)


def vibration(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """White noise, a little more of it in turns."""
    return Column("vibration_g", 0.3 + 0.05 * rng.standard_normal(t_s.size), 0.3, 0.02, 0.05, "ahrs", 3)


def wind(rng: np.random.Generator, t_s: FloatArray) -> Column:
    """Gusts."""
    return Column("wind_mps", 4.0 + wave(rng, t_s, 1.5, 25.0), 4.0, digits=1)


CAUSES: dict[str, Drawer] = {
    "motor_current_a": motor_current,
    "ambient_c": ambient,
    "payload_kg": payload,
    "soil_moisture_pct": soil,
    "hydraulic_bar": hydraulics,
}
"""The columns that may drive an effect."""
IDLE: dict[str, Drawer] = CAUSES | {
    "motor_temp_c": motor_temperature,
    "battery_v": battery,
    "tank_l": random_walk,
    "cpu_load_pct": computer_load,
    "vibration_g": vibration,
    "wind_mps": wind,
}
"""The columns that may stand idle in a log."""


def copy_of(column: Column, rng: np.random.Generator) -> Column:
    """A second sensor of the same quantity, with noise of its own."""
    noise = 0.3 * float(np.std(column.own)) * rng.standard_normal(column.own.size)
    return replace(column, name=f"{column.name}_2", own=column.own + noise)


def draw_columns(seed: int, t_s: FloatArray, causes: Sequence[str], idle: int) -> list[Column]:
    """The columns of a log: those that cause something, and so many idle ones, one of them now and then a copy."""
    rng = stream(seed, "which columns")
    columns = [CAUSES[name](stream(seed, name), t_s) for name in causes]
    others = [str(name) for name in rng.permutation([name for name in IDLE if name not in causes])]
    for name in others[:idle]:
        if columns and rng.random() < 0.15:
            twin = columns[int(rng.integers(len(columns)))]
            if not any(twin.name.removesuffix("_2") + "_2" == column.name for column in columns):
                columns.append(copy_of(replace(twin, name=twin.name.removesuffix("_2")), stream(seed, f"copy {name}")))
                continue
        columns.append(IDLE[name](stream(seed, name), t_s))
    return columns
