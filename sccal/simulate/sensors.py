"""What is logged: raw ticks, AHRS readings and fixes, each on its own clock.

    ticks    ⌊angle · ticks_per_rev / 2π⌋ + start, wrapped at the counter's width
    AHRS     θ + offset + Gauss-Markov + white, rounded; a compass (ned) reads 90° minus that
    fix      antenna + Gauss-Markov + white (+ a jump now and then), at whole fractions of UTC seconds

Every sensor has its own phase: no two share a clock edge. Times in ``true_t_s`` count from the start of the drive;
stamps are on the logging computer's clock.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.geodesy import TangentPlane
from sccal.randomness import gauss_markov, random_stream
from sccal.simulate.noise import in_order
from sccal.simulate.physics import Physics, Sensor
from sccal.simulate.settings import AhrsSettings, ClockSettings, EncoderSettings, GnssSettings
from sccal.simulate.world import Motion, State, WheelPair

_STAMP_GAP_S = 0.0002
_TILT_TIME_S = 5.0


@dataclass(frozen=True)
class EncoderLog:
    """What encoder.csv holds."""

    true_t_s: Floats
    host_t_s: Floats
    left_ticks: Ints
    right_ticks: Ints


@dataclass(frozen=True)
class AhrsLog:
    """What ahrs.csv holds, in the convention of the settings."""

    true_t_s: Floats
    host_t_s: Floats
    yaw_deg: Floats
    pitch_deg: Floats
    roll_deg: Floats


@dataclass(frozen=True)
class GnssLog:
    """What gnss.nmea holds: one row per epoch."""

    true_t_s: Floats
    utc_s: Floats
    host_t_s: Floats
    """Receive time of the epoch's first line."""
    lat_deg: Floats
    lon_deg: Floats
    alt_m: Floats
    quality: Ints
    speed_mps: Floats
    course_deg: Floats
    """Clockwise from north, in [0, 360)."""
    outlier: Bools
    """Known to the simulator only."""


def _host_time(
    sensor: Sensor, t_s: Floats, delay_s: Floats, clock: ClockSettings, physics: Sequence[Physics]
) -> Floats:
    host = t_s + (clock.start_utc_s - clock.host_epoch_offset_s)
    for effect in physics:
        host = effect.host_time(sensor, t_s, host)
    return in_order(host + delay_s, _STAMP_GAP_S)


def _shown(sensor: Sensor, t_s: Floats, physics: Sequence[Physics]) -> Floats:
    for effect in physics:
        t_s = effect.shown_time(sensor, t_s)
    return t_s


def _sample_times(sensor: Sensor, end_s: float, rate_hz: float, seed: int) -> Floats:
    phase = float(random_stream(seed, f"{sensor}.phase").uniform(0.0, 1.0 / rate_hz))
    return phase + np.arange(max(0, math.floor((end_s - phase) * rate_hz) + 1)) / rate_hz


def _arrival(sensor: Sensor, count: int, mean_s: float, seed: int) -> Floats:
    return random_stream(seed, f"{sensor}.arrival").standard_exponential(count) * mean_s


def wrap_counter(count: Ints, bits: int | None, signed: bool) -> Ints:
    """The count as a counter of that width shows it."""
    if bits is None:
        return count
    base = -(1 << (bits - 1)) if signed else 0
    return np.asarray((count - base) % (1 << bits) + base)


def read_encoders(
    motion: Motion,
    angle_rad: WheelPair,
    settings: EncoderSettings,
    clock: ClockSettings,
    seed: int,
    physics: Sequence[Physics] = (),
) -> EncoderLog:
    """Both counters, at the encoder rate."""
    t = _sample_times("encoder", float(motion.t_s[-1]), settings.rate_hz, seed)
    shown = _shown("encoder", t, physics)

    def ticks(grid_rad: Floats, start: int) -> Ints:
        turned = np.interp(shown, motion.t_s, grid_rad) * (settings.ticks_per_rev / (2.0 * math.pi))
        return wrap_counter(np.floor(turned).astype(np.int64) + start, settings.counter_bits, settings.counter_signed)

    return EncoderLog(
        true_t_s=t,
        host_t_s=_host_time("encoder", t, _arrival("encoder", t.size, settings.arrival_jitter_s, seed), clock, physics),
        left_ticks=ticks(angle_rad.left, settings.start_left_ticks),
        right_ticks=ticks(angle_rad.right, settings.start_right_ticks),
    )


def ahrs_reading_deg(enu_rad: Floats, settings: AhrsSettings) -> Floats:
    """A heading as the AHRS writes it: turned into its convention, rounded, wrapped.

    enu is written in (−180, 180], ned in [0, 360).
    """
    enu_deg = np.degrees(enu_rad)
    decimals = max(0, math.ceil(-math.log10(settings.resolution_deg) - 1e-9))

    def rounded(deg: Floats) -> Floats:
        return np.round(np.round(deg / settings.resolution_deg) * settings.resolution_deg, decimals)

    if settings.convention == "ned":
        return np.asarray(rounded((90.0 - enu_deg) % 360.0) % 360.0)
    return rounded(180.0 - rounded((180.0 - enu_deg) % 360.0) % 360.0)


def read_ahrs(
    motion: Motion, settings: AhrsSettings, clock: ClockSettings, seed: int, physics: Sequence[Physics] = ()
) -> AhrsLog:
    """Heading, pitch and roll, at the AHRS rate."""
    t = _sample_times("ahrs", float(motion.t_s[-1]), settings.rate_hz, seed)
    state = motion.at(_shown("ahrs", t, physics))
    step_s = 1.0 / settings.rate_hz

    def lasting(name: str, sigma_deg: float, time_s: float) -> Floats:
        rng = random_stream(seed, f"ahrs.{name}")
        return np.radians(gauss_markov(rng, t.size, step_s, sigma_deg, time_s))

    yaw = state.yaw_rad + math.radians(settings.heading_offset_deg)
    pitch, roll = np.zeros(t.size), np.zeros(t.size)
    for effect in physics:
        yaw = effect.heading(state, yaw)
        pitch, roll = effect.tilt(state, pitch, roll)
    pitch = pitch + lasting("pitch", settings.tilt_sigma_deg, _TILT_TIME_S)
    roll = roll + lasting("roll", settings.tilt_sigma_deg, _TILT_TIME_S)
    white = random_stream(seed, "ahrs.white").standard_normal(t.size) * math.radians(settings.white_sigma_deg)
    yaw = yaw + lasting("drift", settings.drift_sigma_deg, settings.drift_time_s) + white
    return AhrsLog(
        true_t_s=t,
        host_t_s=_host_time("ahrs", t, _arrival("ahrs", t.size, settings.arrival_jitter_s, seed), clock, physics),
        yaw_deg=ahrs_reading_deg(yaw, settings),
        pitch_deg=np.degrees(pitch),
        roll_deg=np.degrees(roll),
    )


def _epochs(end_s: float, rate_hz: float, start_utc_s: float) -> tuple[Floats, Floats]:
    """Whole multiples of the epoch interval within the drive: from its start, and as UTC."""
    first = math.ceil(start_utc_s * rate_hz - 1e-6)
    last = math.floor((start_utc_s + end_s) * rate_hz + 1e-6)
    number = np.arange(first, last + 1)
    return np.asarray((number - start_utc_s * rate_hz) / rate_hz, dtype=float), np.asarray(
        number / rate_hz, dtype=float
    )


def _antenna(state: State, settings: GnssSettings, physics: Sequence[Physics]) -> tuple[Floats, Floats]:
    cos, sin = np.cos(state.yaw_rad), np.sin(state.yaw_rad)
    forward, left = settings.antenna_forward_m, settings.antenna_left_m
    east = state.east_m + forward * cos - left * sin
    north = state.north_m + forward * sin + left * cos
    for effect in physics:
        east, north = effect.antenna(state, east, north)
    return east, north


def _doppler(state: State, settings: GnssSettings, seed: int) -> tuple[Floats, Floats]:
    """Speed and course of the antenna over ground."""
    forward = state.speed_mps - state.turn_rate_radps * settings.antenna_left_m
    left = state.side_speed_mps + state.turn_rate_radps * settings.antenna_forward_m
    cos, sin = np.cos(state.yaw_rad), np.sin(state.yaw_rad)
    noise = random_stream(seed, "gnss.speed").standard_normal((state.t_s.size, 2)) * settings.speed_sigma_mps
    east = forward * cos - left * sin + noise[:, 0]
    north = forward * sin + left * cos + noise[:, 1]
    return np.hypot(east, north), np.degrees(np.arctan2(east, north)) % 360.0


def origin(settings: GnssSettings) -> TangentPlane:
    """The plane of the drive, touching the earth where the robot starts."""
    return TangentPlane(float(settings.origin_lat_deg), float(settings.origin_lon_deg), float(settings.alt_m))


def read_gnss(
    motion: Motion, settings: GnssSettings, clock: ClockSettings, seed: int, physics: Sequence[Physics] = ()
) -> GnssLog:
    """One fix per epoch."""
    t, utc = _epochs(float(motion.t_s[-1]), settings.rate_hz, clock.start_utc_s)
    state = motion.at(_shown("gnss", t, physics))

    def error(axis: str) -> Floats:
        lasting = gauss_markov(
            random_stream(seed, f"gnss.drift.{axis}"),
            t.size,
            1.0 / settings.rate_hz,
            settings.drift_sigma_m,
            settings.drift_time_s,
        )
        white = random_stream(seed, f"gnss.white.{axis}").standard_normal(t.size)
        return lasting + white * settings.white_sigma_m

    jump = random_stream(seed, "gnss.outlier").random((t.size, 3))
    outlier = jump[:, 0] < settings.outlier_fraction
    span_m = settings.outlier_largest_m - settings.outlier_smallest_m
    size_m = np.where(outlier, settings.outlier_smallest_m + span_m * jump[:, 1], 0.0)
    way_rad = 2.0 * np.pi * jump[:, 2]

    east, north = _antenna(state, settings, physics)
    east = east + error("east") + size_m * np.cos(way_rad)
    north = north + error("north") + size_m * np.sin(way_rad)
    lat, lon = origin(settings).to_lat_lon(east, north)
    speed, course = _doppler(state, settings, seed)

    delay = np.full(t.size, settings.receive_delay_s)
    if settings.receive_jitter_s > 0:
        shape = (settings.receive_delay_s / settings.receive_jitter_s) ** 2
        delay = random_stream(seed, "gnss.arrival").gamma(shape, settings.receive_delay_s / shape, t.size)
    return GnssLog(
        true_t_s=t,
        utc_s=utc,
        host_t_s=_host_time("gnss", t, delay, clock, physics),
        lat_deg=lat,
        lon_deg=lon,
        alt_m=settings.alt_m + 1.5 * error("up"),
        quality=np.full(t.size, settings.quality, dtype=np.int64),
        speed_mps=speed,
        course_deg=course,
        outlier=outlier,
    )
