"""The ground and the running gear: how much of what the wheels say becomes motion of the body.

In one step, with s, Δθ, v, ω and a = d|v|/dt as the wheels say, and c − c₀ a logged column over its reference:

    along = s (1 − k_v |v| − k_ω |ω| − k_b max(−a, 0) − k_d max(a, 0) − slope (1 − cos pitch) + Σ p (c − c₀))
    turn  = Δθ (1 − k |ω| + Σ p (c − c₀)) + s Σ p (c − c₀)
    side  = s (−ω τ + Σ p (c − c₀)) − |s| ratio sin roll

Several shares of one step add, since each is a share of what the wheels say. The columns of these four sums act at the
ports `along`, `yaw`, `pull` and `side`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.arrays import Effects, FloatArray
from studies.columns import PER_UNIT, Column
from studies.terrain import Terrain


@dataclass(frozen=True)
class ColumnTerm:
    """What all logged columns together add at one port: own(t) + acceleration · max(a, 0) + turn · |ω|."""

    own: list[float]
    acceleration: float
    turn: float

    @staticmethod
    def at(port: str, effects: Effects, columns: Sequence[Column]) -> ColumnTerm | None:
        """The sum over the columns that drive something at this port, or None where none does."""
        own: FloatArray | None = None
        acceleration = turn = 0.0
        for column in columns:
            parameters = effects.get(f"{port}~{column.name}")
            if parameters is None:
                continue
            gain = parameters[PER_UNIT]
            term = gain * (column.own - column.reference)
            own = term if own is None else own + term
            acceleration += gain * column.per_acceleration
            turn += gain * column.per_turn_rate
        return None if own is None else ColumnTerm(own.tolist(), acceleration, turn)

    def value(self, step: int, w_radps: float, a_mps2: float) -> float:
        """The term in one step."""
        return self.own[step] + self.acceleration * max(a_mps2, 0.0) + self.turn * abs(w_radps)


class Ground:
    """All that acts between the wheels and the path."""

    def __init__(self, effects: Effects, columns: Sequence[Column], terrain: Terrain) -> None:
        def size(name: str, parameter: str) -> float:
            return effects.get(name, {}).get(parameter, 0.0)

        self.turn_slip = size("turn_slip", "per_radps")
        self.turn_scrub = size("turn_scrub", "per_radps")
        self.side_slip_s = size("side_slip", "s")
        self.speed_slip = size("speed_slip", "per_mps")
        self.brake_slip = size("brake_slip", "per_mps2")
        self.drive_slip = size("drive_slip", "per_mps2")
        self.slope = size("slope", "ratio")
        self.roll_slip = size("roll_slip", "ratio")
        self.terrain = terrain
        terms = [(port, ColumnTerm.at(port, effects, columns)) for port in ("along", "yaw", "side", "pull")]
        self.terms = [(port, term) for port, term in terms if term is not None]

    def shares(
        self, step: int, v: float, w: float, a: float, place: tuple[float, float, float]
    ) -> tuple[float, float, float, float]:
        """Of one step: the share that is travelled, the share that is turned, and side and turn for each metre of s."""
        along = 1.0 - self.speed_slip * abs(v) - self.turn_scrub * abs(w)
        along -= self.brake_slip * max(-a, 0.0) + self.drive_slip * max(a, 0.0)
        turn, side, pull = 1.0 - self.turn_slip * abs(w), -w * self.side_slip_s, 0.0
        if self.terrain.waves:
            pitch, roll = self.terrain.tilt_at(*place)
            along -= self.slope * (1.0 - math.cos(pitch))
            side -= math.copysign(1.0, v) * self.roll_slip * math.sin(roll)
        for port, term in self.terms:
            value = term.value(step, w, a)
            if port == "along":
                along += value
            elif port == "yaw":
                turn += value
            elif port == "side":
                side += value
            else:
                pull += value
        return along, turn, side, pull


@dataclass(frozen=True)
class Radii:
    """What the two wheels travel for their angles: warming, steps, and axles off their middle."""

    right_m: float
    left_m: float
    right_growth: list[float]
    left_growth: list[float]
    """1 + k t + ratio [t > at], for each step: what both wheels have, and what each has of its own."""
    track_growth: list[float]
    """1 + ratio [t > at], for each step."""
    right_off: tuple[float, float]
    left_off: tuple[float, float]
    """The parts cos and sin of ds = R (1 + cos · cos φ + sin · sin φ) dφ."""

    @staticmethod
    def of(right_m: float, left_m: float, effects: Effects, t_s: FloatArray) -> Radii:
        """The radii of a robot along its log."""
        grown = growth(effects, "", t_s)
        right, left = (effects.get(f"eccentric_{side}", {"cos": 0.0, "sin": 0.0}) for side in ("right", "left"))
        return Radii(
            right_m,
            left_m,
            (grown + growth(effects, "_right", t_s) - 1.0).tolist(),
            (grown + growth(effects, "_left", t_s) - 1.0).tolist(),
            stepped(effects.get("track_step"), t_s).tolist(),
            (right["cos"], right["sin"]),
            (left["cos"], left["sin"]),
        )


def growth(effects: Effects, side: str, t_s: FloatArray) -> FloatArray:
    """1 + k t + ratio [t > at] by the effects of both wheels, or of one side."""
    per_hour = effects.get(f"radius_drift{side}", {}).get("per_hour", 0.0)
    return stepped(effects.get(f"radius_step{side}"), t_s) + per_hour * np.maximum(t_s, 0.0) / 3600.0


def stepped(step: Mapping[str, float] | None, t_s: FloatArray) -> FloatArray:
    """1 + ratio [t > at]."""
    return np.ones(t_s.size) if step is None else 1.0 + step["ratio"] * (t_s > step["at_s"])


def eccentric_travel(off: tuple[float, float], from_rad: float, to_rad: float) -> float:
    """∫ (cos · cos φ + sin · sin φ) dφ between two angles: what an axle off its middle adds to the turned angle."""
    if off == (0.0, 0.0):
        return 0.0
    return off[0] * (math.sin(to_rad) - math.sin(from_rad)) - off[1] * (math.cos(to_rad) - math.cos(from_rad))
