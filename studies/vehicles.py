"""Robots, their instruments and the noise of these, drawn from what drives about outdoors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from studies.arrays import log_uniform

FixKind = Literal["rtk", "float", "autonomous"]
FixFormat = Literal["nmea", "nmea_unix", "csv"]
QUALITY = {"rtk": 4, "float": 5, "autonomous": 1}


@dataclass(frozen=True)
class Robot:
    """What is true of one robot, and what its declaration says instead."""

    radius_right_m: float = 0.0808
    radius_left_m: float = 0.0796
    track_m: float = 0.728
    nominal_radius_m: float = 0.08
    nominal_track_m: float = 0.70
    ticks_per_rev: int = 32768
    heading_offset_deg: float = 12.5
    convention: Literal["enu", "ned"] = "enu"
    speed_mps: float = 1.0
    """The fastest speed that its driver asks for."""
    turn_rate_radps: float = 0.8
    acceleration_mps2: float = 0.6
    turn_acceleration_radps2: float = 1.2

    @property
    def unit_m(self) -> float:
        """The length by which its fields are measured: seven seconds at full speed."""
        return 7.0 * self.speed_mps


@dataclass(frozen=True)
class Noise:
    """The levels that a filter would have to know: white and Gauss-Markov parts, and slip that walks with distance."""

    heading_white_deg: float = 0.3
    heading_slow_deg: float = 0.4
    heading_slow_s: float = 20.0
    fix_white_m: float = 0.010
    fix_slow_m: float = 0.012
    fix_slow_s: float = 60.0
    slip_m_per_sqrt_m: float = 0.003
    """Standard deviation of one wheel's travel after one metre."""
    outlier_share: float = 0.0
    """Share of the fixes that are off by some fifteen times their usual error."""

    @staticmethod
    def none() -> Noise:
        """Instruments without any error."""
        return Noise(0.0, 0.0, 20.0, 0.0, 0.0, 60.0, 0.0)


@dataclass(frozen=True)
class Instruments:
    """How the streams are sampled, stamped and written."""

    encoder_hz: float = 50.0
    ahrs_hz: float = 20.0
    fix_hz: float = 5.0
    heading_digits: int = 2
    minute_digits: int = 8
    """Decimals of the minutes of arc in NMEA sentences."""
    tilt_logged: bool = True
    tilt_noise_deg: float = 0.1
    fix_kind: FixKind = "rtk"
    fix_format: FixFormat = "nmea"
    stated_sigma_factor: float = 1.0
    """What the receiver says of its error, over what it is."""
    states_sigma: bool = False
    """Whether GST sentences, or a column of sigmas, come with the fixes."""
    delay_s: float = 0.001
    jitter_s: float = 0.003
    """No line arrives before the delay; beyond it the transport time is exponential with this mean."""
    holds_still: bool = False
    """Whether the receiver repeats its last position while the robot stands."""
    gaps_s: tuple[tuple[float, float], ...] = ()
    """Spans of time without fixes."""


def draw_robot(rng: np.random.Generator) -> Robot:
    """A robot between a lawn mower's and a small tractor's size, with a declaration that is a few per cent off."""
    nominal_radius = round(log_uniform(rng, 0.05, 0.5), 3)
    nominal_track = round(float(np.clip(nominal_radius * rng.uniform(3.5, 9.0), 0.3, 2.0)), 2)
    speed = float(np.clip(log_uniform(rng, 0.35, 1.8) * np.sqrt(nominal_radius / 0.1), 0.2, 4.0))
    turn_rate = float(np.clip(rng.uniform(0.8, 1.6) * speed / nominal_track, 0.25, 1.2))
    radius = nominal_radius * (1.0 + float(np.clip(rng.normal(0.0, 0.015), -0.04, 0.04)))
    unequal = float(np.clip(rng.normal(0.0, 0.006), -0.015, 0.015))
    return Robot(
        radius_right_m=radius * (1.0 + unequal),
        radius_left_m=radius * (1.0 - unequal),
        track_m=nominal_track * float(rng.uniform(0.92, 1.25)),
        nominal_radius_m=nominal_radius,
        nominal_track_m=nominal_track,
        ticks_per_rev=int(rng.choice([1024, 2048, 4096, 16384, 32768])),
        heading_offset_deg=float(rng.uniform(-180.0, 180.0)),
        convention="ned" if rng.random() < 0.4 else "enu",
        speed_mps=speed,
        turn_rate_radps=turn_rate,
        acceleration_mps2=float(np.clip(speed / rng.uniform(0.8, 2.5), 0.15, 1.5)),
        turn_acceleration_radps2=turn_rate / float(rng.uniform(0.4, 1.2)),
    )


def draw_noise(rng: np.random.Generator, fix_kind: FixKind = "rtk", wandering: bool = False) -> Noise:
    """Levels as AHRS, receivers and wheels have them; a wandering heading is off by some degrees for half a minute."""
    white_m, slow_m, slow_s = {
        "rtk": ((0.004, 0.02), (0.004, 0.02), (20.0, 120.0)),
        "float": ((0.02, 0.08), (0.08, 0.35), (60.0, 250.0)),
        "autonomous": ((0.1, 0.6), (0.6, 1.8), (80.0, 400.0)),
    }[fix_kind]
    return Noise(
        heading_white_deg=log_uniform(rng, 0.08, 1.0),
        heading_slow_deg=log_uniform(rng, 2.0, 4.0) if wandering else log_uniform(rng, 0.1, 1.0),
        heading_slow_s=log_uniform(rng, 15.0, 70.0) if wandering else log_uniform(rng, 5.0, 60.0),
        fix_white_m=log_uniform(rng, *white_m),
        fix_slow_m=log_uniform(rng, *slow_m),
        fix_slow_s=log_uniform(rng, *slow_s),
        slip_m_per_sqrt_m=log_uniform(rng, 0.001, 0.01),
        outlier_share=0.005 if rng.random() < 0.25 else 0.0,
    )


def draw_instruments(rng: np.random.Generator, fix_kind: FixKind = "rtk") -> Instruments:
    """Rates, digits and transport as loggers have them."""
    return Instruments(
        encoder_hz=float(rng.choice([20.0, 25.0, 50.0, 100.0])),
        ahrs_hz=float(rng.choice([10.0, 20.0, 50.0, 100.0])),
        fix_hz=float(rng.choice([1.0, 5.0, 5.0, 10.0])),
        heading_digits=int(rng.choice([1, 2, 2, 3])),
        minute_digits=int(rng.choice([7, 8])) if fix_kind == "rtk" else int(rng.choice([5, 6, 7])),
        tilt_logged=bool(rng.random() < 0.7),
        tilt_noise_deg=float(rng.uniform(0.03, 0.2)),
        fix_kind=fix_kind,
        fix_format=str(rng.choice(["nmea", "nmea", "nmea_unix", "csv"])),  # type: ignore[arg-type]
        stated_sigma_factor=log_uniform(rng, 0.6, 1.7),
        states_sigma=bool(rng.random() < 0.4),
        delay_s=float(rng.uniform(0.0, 0.002)),
        jitter_s=log_uniform(rng, 0.0005, 0.005),
    )


def with_gaps(instruments: Instruments, rng: np.random.Generator, duration_s: float) -> Instruments:
    """The same instruments with some spans of 10 to 60 s in which no fix comes."""
    count = int(rng.integers(2, 2 + max(1, round(duration_s / 150.0)) + 1))
    starts = np.sort(rng.uniform(30.0, duration_s - 30.0, count))
    gaps = tuple((float(start), float(start + rng.uniform(10.0, 60.0))) for start in starts)
    return replace(instruments, gaps_s=gaps)
