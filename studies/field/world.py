"""A small world: a body that moves as asked, wheels that turn as the ground needs it, and three instruments.

The body follows a speed v and a turn rate ω; the wheels travel v ± L ω / 2 with an effective track L and slip that
walks with the root of distance, and turn by travel over radius. A case bends this by functions of time and motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from studies.arrays import FloatArray, IntArray, floats, gauss_markov, stream
from studies.earth import Origin, to_geodetic
from studies.field.drives import Piece
from studies.vehicles import Robot

STEP_S = 0.005
START_S = 1717243200.0
"""The logging computer's clock when the log begins: noon UTC of a day in June 2024."""
ORIGIN = Origin(47.4, 8.5, 450.0)

OfMotion = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""A quantity of speed, turn rate and time."""


@dataclass(frozen=True)
class Ground:
    """How wheels and body belong together where it is not the plain robot."""

    slip_m: float = 0.003
    """Standard deviation of a wheel's travel after a metre."""
    track: OfMotion | None = None
    side: OfMotion | None = None
    """Sliding to the left, m/s."""
    growth: Callable[[FloatArray], tuple[FloatArray, FloatArray]] | None = None
    """Factors of the right and left radius at a time."""


@dataclass(frozen=True)
class Motion:
    """What happened, every five milliseconds."""

    t_s: FloatArray
    v_mps: FloatArray
    w_radps: FloatArray
    heading_rad: FloatArray
    """Counter-clockwise from east, not wrapped."""
    east_m: FloatArray
    north_m: FloatArray
    right_rad: FloatArray
    left_rad: FloatArray

    def at(self, values: FloatArray, t_s: FloatArray) -> FloatArray:
        """A quantity at other times."""
        return floats(np.interp(t_s, self.t_s, values))

    @property
    def end_s(self) -> float:
        """The length of the drive."""
        return float(self.t_s[-1])


def move(
    pieces: Sequence[Piece],
    seed: int,
    robot: Robot,
    ground: Ground | None = None,
    soft_s: float = 0.8,
    begin_rad: float | None = None,
) -> Motion:
    """Drive the pieces with rounded corners."""
    ground = ground or Ground()
    v, w = _profile(pieces, 1, soft_s), _profile(pieces, 2, soft_s)
    t_s = floats(np.arange(v.size) * STEP_S)
    begin = float(stream(seed, "field start").uniform(-3.0, 3.0)) if begin_rad is None else begin_rad
    heading = begin + _summed(w)
    middle = heading - 0.5 * w * STEP_S
    side = np.zeros_like(v) if ground.side is None else ground.side(v, w, t_s)
    east = _summed(v * np.cos(middle) - side * np.sin(middle))
    north = _summed(v * np.sin(middle) + side * np.cos(middle))
    track = np.full_like(v, robot.track_m) if ground.track is None else ground.track(v, w, t_s)
    ones = (np.ones_like(v), np.ones_like(v))
    grown_right, grown_left = ones if ground.growth is None else ground.growth(t_s)
    normal = stream(seed, "field slip").standard_normal((2, v.size)) * ground.slip_m / np.sqrt(STEP_S)
    right, left = v + 0.5 * track * w, v - 0.5 * track * w
    right, left = right + np.sqrt(np.abs(right)) * normal[0], left + np.sqrt(np.abs(left)) * normal[1]
    right_rad = _summed(right / (robot.radius_right_m * grown_right))
    left_rad = _summed(left / (robot.radius_left_m * grown_left))
    return Motion(t_s, v, w, heading, east, north, right_rad, left_rad)


def _profile(pieces: Sequence[Piece], which: int, soft_s: float) -> FloatArray:
    """Speed or turn rate at each step, averaged under a cosine window so that nothing jumps."""
    steps = np.concatenate([np.full(max(1, round(piece[0] / STEP_S)), piece[which]) for piece in pieces])
    window = floats(np.hanning(max(3, int(soft_s / STEP_S) + 2)))
    before, after = np.full(window.size, steps[0]), np.full(window.size, steps[-1])
    padded = np.convolve(np.concatenate([before, steps, after]), window / window.sum(), "same")
    return floats(padded[window.size : -window.size])


def _summed(rate: FloatArray) -> FloatArray:
    """The integral from the first step on, which is zero."""
    return np.concatenate([[0.0], np.cumsum(rate[1:] * STEP_S)])


@dataclass(frozen=True)
class Instruments:
    """Rates and errors of the three streams."""

    encoder_hz: float = 50.0
    ahrs_hz: float = 50.0
    fix_hz: float = 5.0
    offset_deg: float = 12.5
    yaw_white_deg: float = 0.15
    yaw_slow: tuple[float, float] = (0.4, 15.0)
    """Degrees, and seconds."""
    yaw: Callable[[FloatArray, FloatArray], FloatArray] | None = None
    """What the AHRS makes of times and true headings (rad), before offset and noise."""
    fix_white_m: float = 0.01
    fix_slow: tuple[float, float] = (0.01, 60.0)
    """Metres, and seconds."""
    lever_m: tuple[float, float] = (0.0, 0.0)
    late_s: float = 0.0
    """The fix shows where the antenna was so much before its epoch."""
    quality: int = 4
    delay_s: float = 0.02
    jitter_s: float = 0.004


@dataclass(frozen=True)
class Log:
    """What the instruments say of one drive, as numbers; times are seconds since the log's beginning."""

    seed: int
    robot: Robot
    motion: Motion
    wheel_t: FloatArray
    left: IntArray
    right: IntArray
    yaw_t: FloatArray
    yaw_deg: FloatArray
    """As the AHRS reads, turned into east-north, not wrapped."""
    fix_t: FloatArray
    """The receiver's own epoch."""
    received_t: FloatArray
    east_m: FloatArray
    north_m: FloatArray
    quality: IntArray
    offset_deg: float
    tilt_deg: tuple[FloatArray, FloatArray] | None = None
    """Pitch and roll at the times of the yaw."""
    columns: dict[str, FloatArray] = field(default_factory=dict)
    """Further columns of the wheels."""

    @property
    def places(self) -> tuple[FloatArray, FloatArray]:
        """Latitudes and longitudes of the fixes."""
        return to_geodetic(ORIGIN, self.east_m, self.north_m)

    @property
    def constants(self) -> dict[str, float]:
        """The four true constants by sccal's names."""
        return {
            "radius_right_m": self.robot.radius_right_m,
            "radius_left_m": self.robot.radius_left_m,
            "track_m": self.robot.track_m,
            "heading_offset_deg": self.offset_deg,
        }

    def clockwise_deg(self, t_s: FloatArray) -> FloatArray:
        """The yaw as a compass would show it, at any times."""
        return floats((90.0 - np.interp(t_s, self.yaw_t, self.yaw_deg)) % 360.0)


def sense(motion: Motion, seed: int, robot: Robot, told: Instruments | None = None) -> Log:
    """Let the instruments look at a motion."""
    told = told or Instruments()
    wheel_t = np.arange(0.0, motion.end_s, 1.0 / told.encoder_hz)
    left, right = (
        np.floor(motion.at(angle, wheel_t) / (2.0 * np.pi) * robot.ticks_per_rev + 0.37).astype(np.int64)
        for angle in (motion.left_rad, motion.right_rad)
    )
    yaw_t = np.arange(0.003, motion.end_s, 1.0 / told.ahrs_hz)
    heading = motion.at(motion.heading_rad, yaw_t)
    read = heading if told.yaw is None else told.yaw(yaw_t, heading)
    yaw_deg = np.degrees(read) + told.offset_deg + _noise(seed, "field yaw", yaw_t, told.yaw_white_deg, told.yaw_slow)
    fix_t = np.round(np.arange(0.5, motion.end_s - 0.3, 1.0 / told.fix_hz), 3)
    at_t = fix_t - told.late_s
    true = motion.at(motion.heading_rad, at_t)
    forward, aside = told.lever_m
    east = motion.at(motion.east_m, at_t) + forward * np.cos(true) - aside * np.sin(true)
    north = motion.at(motion.north_m, at_t) + forward * np.sin(true) + aside * np.cos(true)
    east = east + _noise(seed, "field east", fix_t, told.fix_white_m, told.fix_slow)
    north = north + _noise(seed, "field north", fix_t, told.fix_white_m, told.fix_slow)
    received = fix_t + told.delay_s + told.jitter_s * stream(seed, "field jitter").random(fix_t.size)
    quality = np.full(fix_t.size, told.quality, dtype=np.int64)
    return Log(
        seed,
        robot,
        motion,
        wheel_t,
        left,
        right,
        yaw_t,
        yaw_deg,
        fix_t,
        received,
        east,
        north,
        quality,
        told.offset_deg,
    )


def _noise(seed: int, name: str, t_s: FloatArray, white: float, slow: tuple[float, float]) -> FloatArray:
    """White noise and a slow error at equal steps."""
    rng = stream(seed, name)
    step_s = float(t_s[1] - t_s[0])
    return white * rng.standard_normal(t_s.size) + gauss_markov(rng.standard_normal(t_s.size), step_s, *slow)


def record(
    pieces: Sequence[Piece],
    seed: int,
    robot: Robot | None = None,
    ground: Ground | None = None,
    told: Instruments | None = None,
    soft_s: float = 0.8,
    begin_rad: float | None = None,
) -> Log:
    """Drive and log in one call."""
    robot = robot or Robot()
    return sense(move(pieces, seed, robot, ground, soft_s, begin_rad), seed, robot, told)


def moved(log: Log, seconds: float) -> Log:
    """The same log by a logging clock that is ahead of UTC; the receiver's epochs stay."""
    return replace(
        log,
        wheel_t=log.wheel_t + seconds,
        yaw_t=log.yaw_t + seconds,
        received_t=log.received_t + seconds,
    )
