"""What an AHRS reads of a heading: iron, fields, drifts, latency, noise and digits.

reading(t) = offset + [θ smoothed + h(θ) low-passed + speed field + drift + scale + step + local field + columns](t − τ)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.arrays import Effects, FloatArray, floats, recursive
from studies.columns import PER_UNIT, Column
from studies.motion import STEP_S, Motion


def harmonic_deviation(order: int, cos_deg: float, sin_deg: float, heading_rad: FloatArray) -> FloatArray:
    """The angle between the earth's field and its sum with a second field, exact at any strength, in radians.

    With a field of (−s, −c) over the earth's in the robot's frame, c and s the two sizes in radians and n the order:

        h = atan2(c cos nθ + s sin nθ, 1 + c sin nθ − s cos nθ)
    """
    c, s = np.radians(cos_deg), np.radians(sin_deg)
    cos, sin = np.cos(order * heading_rad), np.sin(order * heading_rad)
    return floats(np.arctan2(c * cos + s * sin, 1.0 + c * sin - s * cos))


def low_passed(values: FloatArray, tau_s: float) -> FloatArray:
    """A first-order low-pass on the grid, y' = (x − y) / τ, that begins at its input."""
    if tau_s <= 0.0:
        return values
    decay = float(np.exp(-STEP_S / tau_s))
    return recursive((1.0 - decay) * values, decay, float(values[0]))


def compass_rad(motion: Motion, effects: Effects, columns: Sequence[Column]) -> FloatArray:
    """The AHRS without noise, offset and delay, in radians and not wrapped, on the grid of the truth."""
    t_s, heading = motion.t_s, motion.heading_rad
    reading = low_passed(heading, effects.get("heading_smoothing", {}).get("s", 0.0)).copy()
    speed = motion.of_steps(motion.v_in_step_mps, t_s)
    for order, name, of_cos, of_sin in (
        (1, "hard_iron", "cos_deg", "sin_deg"),
        (2, "soft_iron", "cos2_deg", "sin2_deg"),
    ):
        if iron := effects.get(name):
            deviation = harmonic_deviation(order, iron[of_cos], iron[of_sin], heading)
            reading += low_passed(deviation, iron.get("tau_s", 0.0))
    if field := effects.get("speed_field"):
        reading += np.radians(field["deg_per_mps"]) * speed
    if drift := effects.get("heading_drift"):
        reading += np.radians(drift["deg_per_hour"]) * np.maximum(t_s, 0.0) / 3600.0
    if scale := effects.get("heading_scale"):
        reading += scale["ratio"] * (heading - heading[0])
    if step := effects.get("heading_step"):
        reading += np.radians(step["deg"]) * (t_s > step["at_s"])
    if local := effects.get("local_field"):
        away_m = np.hypot(motion.east_m - local["east_m"], motion.north_m - local["north_m"])
        reading += np.radians(local["deg"]) * np.exp(-0.5 * (away_m / local["radius_m"]) ** 2)
    return reading + np.radians(column_heading_deg(motion, effects, columns))


def column_heading_deg(motion: Motion, effects: Effects, columns: Sequence[Column]) -> FloatArray:
    """The part of the reading that logged columns cause: Σ p (c − c₀)."""
    total = np.zeros_like(motion.t_s)
    for column in columns:
        if parameters := effects.get(f"heading~{column.name}"):
            total += parameters[PER_UNIT] * (column_on_grid(motion, column) - column.reference)
    return total


def column_on_grid(motion: Motion, column: Column) -> FloatArray:
    """A logged quantity on the grid of the truth."""
    acceleration = motion.of_steps(motion.a_in_step_mps2, motion.t_s)
    return column.values(acceleration, motion.of_steps(motion.w_in_step_radps, motion.t_s))


def readings_rad(
    motion: Motion, effects: Effects, columns: Sequence[Column], t_s: FloatArray, offset_deg: float
) -> FloatArray:
    """The AHRS's answers at its own times, without noise: what its output was by the latency earlier."""
    latency_s = effects.get("heading_latency", {}).get("s", 0.0)
    delayed = np.interp(t_s - latency_s, motion.t_s, compass_rad(motion, effects, columns))
    return floats(delayed + np.radians(offset_deg))
