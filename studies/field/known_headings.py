"""Known cases of headings: gyro gain, drift, jumps, compasses, courses taken for headings, two antennas."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from studies.arrays import BoolArray, FloatArray, floats, recursive, stream
from studies.earth import sentence
from studies.field.drives import Piece, rows, varied
from studies.field.files import (
    heading_of,
    nmea_lines,
    stamped,
    write_encoder,
    write_lines,
    write_run,
    write_vehicle,
)
from studies.field.wanted import (
    ANY,
    NOT_GOOD,
    Chapter,
    Diagnosis,
    Truth,
    Way,
    doubted,
    exported,
    honest,
    inspected,
    refused,
    right,
)
from studies.field.world import Instruments, Log, Motion, move, record, sense
from studies.vehicles import Robot

GAINS = Chapter("known", "heading gain")
JUMPS = Chapter("known", "heading jumps")
DRIFTS = Chapter("known", "heading drift")
COMPASS = Chapter("known", "compass")
COURSES = Chapter("known", "courses and filters")
ANTENNAS = Chapter("known", "two antennas")
ZEROS = Chapter("known", "zero of the heading")
CHAPTERS = (GAINS, JUMPS, DRIFTS, COMPASS, COURSES, ANTENNAS, ZEROS)

Yaw = Callable[[Motion, FloatArray, FloatArray], FloatArray]
"""What an AHRS makes of the motion, times and true headings."""
NOT_GOOD_WAY = Way("not good", (0,), NOT_GOOD)


def read_as(
    pieces: list[Piece],
    seed: int,
    yaw: Yaw,
    effects: dict[str, dict[str, float]] | None = None,
    told: Instruments | None = None,
    convention: str = "enu",
    begin_rad: float | None = None,
    **changed: float | tuple[float, float] | list[float],
) -> Callable[[Path], Truth]:
    """A plain drive whose AHRS reads something else."""

    def build(folder: Path) -> Truth:
        motion = move(pieces, seed, Robot(), begin_rad=begin_rad)
        instruments = replace(told or Instruments(), yaw=functools.partial(yaw, motion))
        log = sense(motion, seed, Robot(), instruments)
        write_run(folder, log, convention)
        return Truth.of(log, effects, **changed)

    return build


def gained(ratio: float) -> Yaw:
    """A gyro that reads so much of the turning, from its own start."""
    return lambda motion, t, heading: motion.heading_rad[0] + ratio * (heading - motion.heading_rad[0])


SCALE = Diagnosis(names=("heading_scale",))
GAINS.add(
    "gain-1pc",
    read_as(varied(300.0, 2), 21, gained(1.01), {"heading_scale": {"ratio": 0.01}}),
    honest(),
    diagnosis=SCALE,
)
GAINS.add("gain-0.3pc", read_as(varied(300.0, 2), 21, gained(1.003), {"heading_scale": {"ratio": 0.003}}), honest())
HALF = r"(\bhalf\b|gain is off|gain of|\bgyro|slope (of )?0\.[45]|heading_scale)"
GAINS.add("gain-half", read_as(varied(200.0, 3), 23, gained(0.5), heading_offset_deg=ANY), refused(HALF), doubted(HALF))
GAINS.add(
    "gain-rows",
    read_as(rows(9, 15.0, 0.7, 0.6), 22, gained(1.01), {"heading_scale": {"ratio": 0.01}}),
    honest(),
    diagnosis=Diagnosis(not_named=("hard_iron", "soft_iron", "base_shift")),
)


def between(begin_s: float, end_s: float, degrees: float) -> Yaw:
    """So many degrees more in a span of time."""
    return lambda motion, t, heading: heading + np.radians(degrees) * ((t >= begin_s) & (t < end_s))


JUMPS.add(
    "yaw-aligned-late",
    read_as(varied(220.0, 110), 110, between(0.0, 15.0, 97.0)),
    honest(),
    diagnosis=Diagnosis(
        names=("heading_step", "heading_window"), or_says=(r"(at|until|for|first|before) 1[2-8](\.\d+)? s",)
    ),
)
JUMPS.add(
    "yaw-jumps-twice",
    read_as(
        varied(240.0, 111),
        111,
        lambda motion, t, heading: heading + np.radians(33.0) * (t > 80.0) - np.radians(55.0) * (t > 160.0),
        heading_offset_deg=[12.5, 45.5, -9.5],
    ),
    doubted(r"(jump|step)"),
    refused(r"(jump|step)"),
    diagnosis=Diagnosis(says=(r"33\.\d|3[234](\.\d+)? ?(°|deg)", r"5[4-6]\.\d|5[456] ?(°|deg)")),
)
JUMPS.add(
    "yaw-jumps-and-back",
    read_as(varied(240.0, 112), 112, between(100.0, 140.0, 25.0)),
    NOT_GOOD_WAY,
    right(2.0),
    diagnosis=Diagnosis(names=("heading_step", "heading_window", "bad_headings")),
)
JUMPS.add(
    "yaw-sawtooth",
    read_as(
        varied(240.0, 113),
        113,
        lambda m, t, heading: heading + np.radians(6.0) * (t % 60.0) / 60.0,
        heading_offset_deg=(12.0, 19.0),
    ),
    NOT_GOOD_WAY,
    honest(),
)


def slow_frozen(motion: Motion, t: FloatArray, heading: FloatArray) -> FloatArray:
    """The yaw stands while the robot creeps, and comes back afterwards."""
    speed = np.abs(motion.at(motion.v_mps, t)) + 0.2 * np.abs(motion.at(motion.w_radps, t))
    return held(heading, (speed > 0.02) & (speed < 0.45))


def held(values: FloatArray, while_: BoolArray) -> FloatArray:
    """Values that keep the last one while something is so."""
    newest = np.where(while_, 0, np.arange(values.size))
    return floats(values[np.maximum.accumulate(newest)])


FROZEN = r"(frozen|stands? still|does not (move|change|turn)|stuck|constant|held)"
JUMPS.add("yaw-stuck-slow", read_as(varied(220.0, 31), 31, slow_frozen), refused(FROZEN), doubted(FROZEN))

DRIFTS.add(
    "gyro-bias",
    read_as(
        varied(300.0, 280),
        280,
        lambda m, t, heading: heading + np.radians(0.4 / 60.0) * t,
        {"heading_drift": {"deg_per_hour": 24.0}},
        Instruments(yaw_slow=(0.05, 15.0)),
        heading_offset_deg=(12.3, 14.7),
    ),
    honest(),
    diagnosis=Diagnosis(names=("heading_drift", "heading_scale")),
)


def wandering_bias(motion: Motion, t: FloatArray, heading: FloatArray) -> FloatArray:
    """A bias that walks by some degrees a minute."""
    steps = stream(281, "walking bias").standard_normal(motion.t_s.size) * np.radians(0.002) * np.sqrt(0.005)
    return heading + motion.at(np.cumsum(np.cumsum(steps)) * 0.005, t)


DRIFTS.add("gyro-walk", read_as(varied(300.0, 281), 281, wandering_bias, heading_offset_deg=(5.0, 20.0)), honest())


def field_in_body(forward: float, left: float) -> Yaw:
    """A compass with a field of its own, in shares of the earth's: it reads 90° at north."""

    def yaw(motion: Motion, t: FloatArray, heading: FloatArray) -> FloatArray:
        seen_forward, seen_left = np.sin(heading) + forward, np.cos(heading) + left
        reading = floats(np.pi / 2.0 - np.arctan2(seen_left, seen_forward))
        return floats(heading + (reading - heading + np.pi) % (2.0 * np.pi) - np.pi)

    return yaw


COMPASS.add(
    "iron-35deg",
    read_as(varied(260.0, 151), 151, field_in_body(0.45, -0.35), heading_offset_deg=ANY),
    honest(),
    diagnosis=Diagnosis(names=("hard_iron",)),
)
COMPASS.add(
    "iron-rows-north-south",
    read_as(
        rows(9, 16.0, 0.8, 0.6),
        152,
        lambda m, t, heading: heading + np.radians(12.5) * np.sin(heading),
        begin_rad=np.pi / 2.0,
        heading_offset_deg=ANY,
    ),
    honest(),
    diagnosis=Diagnosis(names=("hard_iron", "soft_iron")),
)
BEYOND = r"(go(es)? (all the way )?round|beyond|larger than the earth|stronger than|does not turn with|full turn)"
COMPASS.add(
    "iron-beyond-field",
    read_as(varied(220.0, 150), 150, field_in_body(1.1, 0.9), heading_offset_deg=ANY),
    refused(BEYOND),
    doubted(BEYOND),
    diagnosis=Diagnosis(not_named=("local_field", "heading_step"), or_says=(BEYOND,)),
)


def beside_shed(motion: Motion, t: FloatArray, heading: FloatArray) -> FloatArray:
    """Nine degrees beside a long wall of steel, half of it two metres away."""
    away_m = np.abs(motion.at(motion.east_m, t) - motion.east_m.max() - 1.0)
    return floats(heading + np.radians(9.0) / (1.0 + (away_m / 2.0) ** 2))


COMPASS.add("steel-shed", read_as(rows(9, 16.0, 0.8, 0.6), 154, beside_shed, heading_offset_deg=(12.0, 21.5)), honest())


def course(motion: Motion, t: FloatArray, heading: FloatArray) -> FloatArray:
    """The course over ground of the last 0.6 s, held while the robot is slow."""
    rng = stream(181, "course")
    moved = [motion.at(axis, t) - motion.at(axis, t - 0.6) for axis in (motion.east_m, motion.north_m)]
    east, north = (axis + 0.006 * rng.standard_normal(t.size) for axis in moved)
    newest = held(np.arctan2(north, east), np.hypot(east, north) < 0.12)
    return floats(np.unwrap(newest))


PLAIN = Instruments(ahrs_hz=10.0, offset_deg=0.0, yaw_white_deg=0.02, yaw_slow=(0.0, 15.0))
FORWARD = [(6.0, 0.0, 0.0), *([(9.0, 0.8, 0.0), (6.0, 0.6, 0.45), (9.0, 0.8, 0.0), (6.0, 0.6, -0.45)] * 7)]
REVERSING = [
    (6.0, 0.0, 0.0),
    *([(9.0, 0.8, 0.0), (5.0, 0.6, 0.45), (4.0, -0.5, 0.0), (3.0, 0.0, 0.5), (6.0, 0.7, -0.3)] * 8),
]
COURSES.add(
    "course-forward",
    read_as(FORWARD, 181, course, told=PLAIN),
    honest(),
    diagnosis=Diagnosis(names=("heading_latency",)),
)
COURSE = r"(course|180|flips?)"
COURSES.add(
    "course-reversing",
    read_as(REVERSING, 182, course, told=PLAIN, heading_offset_deg=ANY),
    refused(COURSE),
    doubted(COURSE),
)


def lagging(tau_s: float) -> Yaw:
    """The yaw behind a low-pass."""

    def yaw(motion: Motion, t: FloatArray, heading: FloatArray) -> FloatArray:
        return motion.at(lowpassed(motion.heading_rad, 0.005, tau_s), t)

    return yaw


def lowpassed(values: FloatArray, step_s: float, tau_s: float) -> FloatArray:
    """A first-order low-pass that begins settled."""
    share = float(np.exp(-step_s / tau_s))
    return recursive((1.0 - share) * values, share, float(values[0]))


COURSES.add(
    "yaw-lowpass",
    read_as(varied(240.0, 19), 183, lagging(0.8)),
    honest(),
    diagnosis=Diagnosis(names=("heading_latency", "heading_lag", "heading_smoothing")),
)


def two_antennas(
    mount_deg: float, arm: tuple[float, float], every: int = 1, pieces: list[Piece] | None = None
) -> Callable[[Path], Truth]:
    """No AHRS; the line of two antennas points so far to the right of the nose."""

    def build(folder: Path) -> Truth:
        told = Instruments(offset_deg=-mount_deg, yaw_white_deg=0.25, yaw_slow=(0.2, 30.0), lever_m=arm)
        log = record(pieces or varied(240.0, 70), 70, told=told)
        write_vehicle(folder, log)
        write_encoder(folder, log)
        write_hdt(folder, log, every)
        return Truth.of(log, {"lever_arm": {"forward_m": arm[0], "left_m": arm[1]}})

    return build


def write_hdt(folder: Path, log: Log, every: int = 1) -> None:
    """The receiver's headings among its sentences."""
    headings = heading_of(log)
    extra = lambda k, _: [sentence(f"GNHDT,{headings[k]:.3f},T")] if k % every == 0 else []  # noqa: E731
    write_lines(folder / "gnss.nmea", stamped(nmea_lines(log, extra)))


ARM_FOUND = Diagnosis(names=("lever_arm",))
ANTENNAS.add(
    "hdt-57",
    two_antennas(57.0, (-0.31, 0.42)),
    honest(),
    diagnosis=ARM_FOUND,
    asked=(exported("ardupilot", never=("COMPASS_DEC",)),),
)
ANTENNAS.add("hdt-minus-90", two_antennas(-90.0, (0.0, 0.0)), right(1.5))
ANTENNAS.add("hdt-1hz", two_antennas(57.0, (0.0, 0.0), 5), right(2.5))
ZEROS.add(
    "declination-west",
    read_as(varied(200.0, 80), 80, lambda m, t, heading: heading, told=Instruments(offset_deg=-11.9), convention="ned"),
    right(1.3),
    asked=(exported("ardupilot", never=(r"too far \*{0,2}left",)),),
)
ZEROS.add(
    "zero-north-ccw",
    read_as(varied(200.0, 81), 81, lambda m, t, heading: heading, told=Instruments(offset_deg=-90.0)),
    right(1.3),
)


@ZEROS.case("zero-at-power-up", right(1.5), asked=(exported("robot_localization", r"(power|start|this run|zero)"),))
def zero_at_start(folder: Path) -> Truth:
    """A yaw that begins at zero wherever the robot stands."""
    motion = move(varied(200.0, 82), 82, Robot())
    log = sense(motion, 82, Robot(), Instruments(offset_deg=-float(np.degrees(motion.heading_rad[0]))))
    write_run(folder, log)
    return Truth.of(log)


ZEROS.add(
    "inspect-arcs",
    read_as(varied(180.0, 180), 180, lambda m, t, heading: heading),
    right(1.3),
    asked=(inspected(r"yaw minus course of the fixes: 1[0-4]\.\d+ deg", never=(r"iron near the compass",)),),
)
