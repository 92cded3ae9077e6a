"""Which effects a study injects, and how large: sizes that are met in the field and can be seen by the eye.

A *label* is an effect's name, with a variant behind a slash where one effect has several faces:
`hard_iron/slow` is let in slowly, `hard_iron/strong` is 30 degrees and more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from studies.arrays import Effects, log_uniform, pick_sign
from studies.columns import CAUSES, COLUMN_PORTS, PER_UNIT
from studies.motion import drive
from studies.robot import Scenario

Parameters = dict[str, float]
Sizer = Callable[[np.random.Generator, Scenario], Parameters]

SHAPES = {"at_s", "radius_m", "above_radps", "tau_s"}
"""Parameters that are searched for and have no honest sigma of their own; the place of a local field is one too."""
ON_HILLS = {"slope", "roll_slip", "antenna_height"}
OWN_CLOCK = {"clock_skew"}
"""Effects that only a log without a second clock can show."""
SIDES = (("", "_left"), ("", "_right"), ("_left", "_right"))
CLASHES = (
    {"missed_left", "eccentric_left"},
    {"missed_right", "eccentric_right"},
    {"speed_offset", "eccentric_left"},
    {"speed_offset", "eccentric_right"},
    *({f"{what}{one}", f"{what}{other}"} for what in ("radius_drift", "radius_step") for one, other in SIDES),
)
"""Pairs without a meaning: an eccentric wheel's angle has to be counted whole, and what one wheel has both have too."""
COLUMN_SIZES = {
    "motor_current_a": 1.8,
    "ambient_c": 3.5,
    "payload_kg": 12.0,
    "soil_moisture_pct": 7.0,
    "hydraulic_bar": 40.0,
}
"""The usual swing of each column, by which the size of what it causes is scaled."""


@dataclass(frozen=True)
class Label:
    """A kind of effect: what the log calls it, and which face of it."""

    text: str

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.text.split("/")[0]

    @property
    def variant(self) -> str:
        """The face, or nothing."""
        return self.text.partition("/")[2]


def share_at(fastest: float, low: float, high: float, rng: np.random.Generator) -> float:
    """A gain with which a share between the limits is lost where the quantity is largest."""
    return log_uniform(rng, low, high) / fastest


def lever_arm(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """An antenna a hand's width to a track's width off the middle, in any direction."""
    size_m, towards = log_uniform(rng, 0.1, max(0.3, scenario.robot.track_m)), float(rng.uniform(0.0, 2.0 * math.pi))
    return {"forward_m": size_m * math.cos(towards), "left_m": size_m * math.sin(towards)}


def latency(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """Late by 60 to 400 ms; now and then early, as where a stream is stamped by its neighbour's clock."""
    return {"s": pick_sign(rng, 0.85) * log_uniform(rng, 0.06, 0.4)}


def clock_skew(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """A clock that gains 60 to 300 ms over the log."""
    return {"ppm": pick_sign(rng) * log_uniform(rng, 0.06, 0.3) / scenario.plan.duration_s * 1e6}


def iron(first: str, second: str, low_deg: float, high_deg: float) -> Sizer:
    """A harmonic of the heading of some size and any phase."""

    def size(rng: np.random.Generator, scenario: Scenario) -> Parameters:
        size_deg, phase = log_uniform(rng, low_deg, high_deg), float(rng.uniform(0.0, 2.0 * math.pi))
        return {first: size_deg * math.cos(phase), second: size_deg * math.sin(phase)}

    return size


def slow_iron(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """Iron that the AHRS lets in over 8 to 60 s, often strong."""
    return iron("cos_deg", "sin_deg", 5.0, 36.0)(rng, scenario) | {"tau_s": log_uniform(rng, 8.0, 60.0)}


def heading_drift(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """A heading that is off by 4 to 20 degrees at the end."""
    return {"deg_per_hour": pick_sign(rng) * log_uniform(rng, 4.0, 20.0) * 3600.0 / scenario.plan.duration_s}


def radius_drift(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """Radii that change by 1 to 5 % over the log."""
    return {"per_hour": pick_sign(rng) * log_uniform(rng, 0.01, 0.05) * 3600.0 / scenario.plan.duration_s}


def moment_s(rng: np.random.Generator, scenario: Scenario) -> float:
    """A moment well within the log."""
    return float(rng.uniform(0.25, 0.75)) * scenario.plan.duration_s


def radius_step(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """Radii that jump by 0.8 to 5 %."""
    return {"ratio": pick_sign(rng) * log_uniform(rng, 0.008, 0.05), "at_s": moment_s(rng, scenario)}


def track_step(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """A track that jumps by 4 to 25 %."""
    return {"ratio": pick_sign(rng) * log_uniform(rng, 0.04, 0.25), "at_s": moment_s(rng, scenario)}


def smoothing(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """A receiver or an AHRS that smooths over 0.3 to 1.5 s."""
    return {"s": log_uniform(rng, 0.3, 1.5)}


def heading_step(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """A heading that jumps by 3 to 30 degrees."""
    return {"deg": pick_sign(rng) * log_uniform(rng, 3.0, 30.0), "at_s": moment_s(rng, scenario)}


def base_shift(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """Fixes that jump by 0.3 to 3 m."""
    size_m, towards = log_uniform(rng, 0.3, 3.0), float(rng.uniform(0.0, 2.0 * math.pi))
    moved = {"east_m": size_m * math.cos(towards), "north_m": size_m * math.sin(towards)}
    return moved | {"at_s": moment_s(rng, scenario)}


def eccentric(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """An axle 1 to 5 % of the radius off its middle."""
    size, phase = log_uniform(rng, 0.012, 0.05), float(rng.uniform(0.0, 2.0 * math.pi))
    return {"cos": size * math.cos(phase), "sin": size * math.sin(phase)}


def missed(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """Two to twelve per cent of the counts, above a wheel speed that lies between the speeds of the drive."""
    share = float(rng.uniform(0.5, 0.65) if rng.random() < 0.5 else rng.uniform(0.76, 0.94))
    fastest_radps = scenario.robot.speed_mps / scenario.robot.nominal_radius_m
    return {"ratio": log_uniform(rng, 0.02, 0.12), "above_radps": share * fastest_radps}


def local_field(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """Five to thirty degrees beside a place that the drive passes often: of forty of its places one of the busiest."""
    unit_m = scenario.robot.unit_m
    radius_m = float(np.clip(unit_m * rng.uniform(0.12, 0.3), 0.4, 6.0))
    motion = drive(scenario.plan, scenario.robot, scenario.seed)
    points = rng.integers(0, motion.t_s.size, 40)
    away_m = np.hypot(
        motion.east_m[::20, None] - motion.east_m[points], motion.north_m[::20, None] - motion.north_m[points]
    )
    passes = np.sum(np.diff((away_m < radius_m).astype(int), axis=0) == 1, axis=0)
    place = points[np.argsort(passes)[-int(rng.integers(1, 4))]]
    aside_m = rng.normal(0.0, 0.3 * radius_m, 2)
    return {
        "deg": pick_sign(rng) * log_uniform(rng, 5.0, 30.0),
        "east_m": float(motion.east_m[place] + aside_m[0]),
        "north_m": float(motion.north_m[place] + aside_m[1]),
        "radius_m": radius_m,
    }


def speed_slip(rng: np.random.Generator, scenario: Scenario) -> Parameters:
    """One to ten per cent lost, or now and then gained, at the fastest speed."""
    return {"per_mps": pick_sign(rng, 0.85) * min(0.19, share_at(scenario.robot.speed_mps, 0.01, 0.1, rng))}


SIZES: dict[str, Sizer] = {
    "lever_arm": lever_arm,
    "gnss_latency": latency,
    "heading_latency": latency,
    "clock_skew": clock_skew,
    "hard_iron": iron("cos_deg", "sin_deg", 1.5, 20.0),
    "hard_iron/slow": slow_iron,
    "hard_iron/strong": iron("cos_deg", "sin_deg", 28.0, 38.0),
    "soft_iron": iron("cos2_deg", "sin2_deg", 1.5, 10.0),
    "heading_drift": heading_drift,
    "heading_scale": lambda rng, _: {"ratio": pick_sign(rng) * log_uniform(rng, 0.004, 0.03)},
    "heading_step": heading_step,
    "speed_field": lambda rng, s: {"deg_per_mps": pick_sign(rng) * share_at(s.robot.speed_mps, 2.0, 12.0, rng)},
    "local_field": local_field,
    "turn_slip": lambda rng, s: {"per_radps": share_at(s.robot.turn_rate_radps, 0.03, 0.18, rng)},
    "turn_scrub": lambda rng, s: {"per_radps": share_at(s.robot.turn_rate_radps, 0.03, 0.18, rng)},
    "side_slip": lambda rng, _: {"s": pick_sign(rng, 0.85) * log_uniform(rng, 0.04, 0.3)},
    "speed_slip": speed_slip,
    "speed_offset": lambda rng, s: {"mps": pick_sign(rng) * s.robot.speed_mps * log_uniform(rng, 0.01, 0.05)},
    "brake_slip": lambda rng, s: {"per_mps2": min(share_at(s.robot.acceleration_mps2, 0.05, 0.25, rng), 0.45)},
    "drive_slip": lambda rng, s: {"per_mps2": min(share_at(s.robot.acceleration_mps2, 0.05, 0.25, rng), 0.45)},
    "slope": lambda rng, _: {"ratio": float(rng.uniform(1.0, 6.0))},
    "roll_slip": lambda rng, _: {"ratio": pick_sign(rng, 0.9) * log_uniform(rng, 0.04, 0.4)},
    "antenna_height": lambda rng, _: {"m": float(rng.uniform(0.4, 2.5))},
    "radius_drift": radius_drift,
    "radius_step": radius_step,
    "base_shift": base_shift,
    "eccentric_left": eccentric,
    "eccentric_right": eccentric,
    "missed_left": missed,
    "missed_right": missed,
    "radius_drift_left": radius_drift,
    "radius_drift_right": radius_drift,
    "radius_step_left": radius_step,
    "radius_step_right": radius_step,
    "track_step": track_step,
    "fix_smoothing": smoothing,
    "heading_smoothing": smoothing,
}
COLUMN_SHARES = {
    "heading": (1.0, 6.0),
    "along": (0.008, 0.04),
    "yaw": (0.02, 0.1),
    "side": (0.01, 0.06),
}
"""What a usual swing of a column does: degrees at the heading, shares of the motion elsewhere."""


def column_effect(rng: np.random.Generator, scenario: Scenario, port: str, column: str) -> Parameters:
    """A cause that is a logged column: its usual swing moves the heading by degrees or the motion by per cents.

    `pull` turns the robot by so much on each metre; a usual swing bends its straights to a radius of 15 to 90 fields.
    """
    low, high = COLUMN_SHARES.get(port, (1.0, 1.0))
    if port == "pull":
        low, high = 0.011 / scenario.robot.unit_m, 0.066 / scenario.robot.unit_m
    return {PER_UNIT: pick_sign(rng) * log_uniform(rng, low, high) / COLUMN_SIZES[column]}


def all_labels(rng: np.random.Generator) -> list[Label]:
    """Every effect of the catalogue with its faces, and every port of the logged columns with a column drawn for it."""
    ports = [Label(f"{port}~{rng.choice(list(CAUSES))}") for port in COLUMN_PORTS]
    return [*(Label(text) for text in SIZES), *ports]


def draw_labels(rng: np.random.Generator, count: int) -> list[Label]:
    """Some effects that can be together: no effect twice, no column twice, none that makes another meaningless."""
    while True:
        labels = all_labels(rng)
        drawn = [labels[int(index)] for index in rng.choice(len(labels), count, replace=False)]
        names = {label.name for label in drawn}
        columns = [name.split("~")[1] for name in names if "~" in name]
        clash = any(pair <= names for pair in CLASHES)
        if len(names) == count and len(set(columns)) == len(columns) and not clash:
            return drawn


def draw_effects(rng: np.random.Generator, scenario: Scenario, labels: list[Label]) -> Effects:
    """Sizes for all of them."""
    effects: Effects = {}
    for label in labels:
        if "~" in label.name:
            port, column = label.name.split("~")
            effects[label.name] = column_effect(rng, scenario, port, column)
        else:
            effects[label.name] = SIZES[label.text](rng, scenario)
    return effects
