"""Further cases of what the numbers mean: counters, arms, tyres, tracks, gains, jumps and fixes, all drawn anew."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from studies.arrays import FloatArray, IntArray
from studies.field.drives import Piece, headlands, spins, varied
from studies.field.files import write_run
from studies.field.further_robots import Bend, Drawn, case_of
from studies.field.known_headings import field_in_body, held, lowpassed
from studies.field.known_places import beside, smoothed
from studies.field.known_tables import NO_DIRECTION
from studies.field.known_wheels import (
    BACKWARDS,
    BOTH_FIRST,
    EXCHANGED,
    NO_WAY,
    SATURATES,
    TRACTOR,
    TWO_SIDES,
    either_way,
    rising,
    slowest,
    track_span,
)
from studies.field.wanted import (
    ANY,
    ANY_LEVEL,
    NOT_GOOD,
    Chapter,
    Diagnosis,
    Truth,
    Way,
    doubted,
    honest,
    refused,
    right,
)
from studies.field.world import Ground, Instruments, Log, move, record, sense
from studies.vehicles import Robot

COUNTERS = Chapter("further", "counters")
ARMS = Chapter("further", "arm and side slip")
GROUND = Chapter("further", "good with wrong numbers")
HEADINGS = Chapter("further", "headings")
FIXES = Chapter("further", "fixes")
CHAPTERS = (COUNTERS, ARMS, GROUND, HEADINGS, FIXES)
NOT_GOOD_WAY = Way("not good", (0,), NOT_GOOD)

Counts = Callable[[Drawn, Log], tuple[IntArray, IntArray]]


def counted(change: Counts, truth: Callable[[Log], Truth] = Truth.of) -> Bend:
    """Other counts of left and right."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        left, right_counts = change(drawn, log)
        write_run(folder, replace(log, left=left, right=right_counts))
        return truth(log)

    return bend


def after(log: Log, counts: IntArray, begin_s: float) -> IntArray:
    """A counter that stops at a moment."""
    last = int(counts[np.searchsorted(log.wheel_t, begin_s)])
    return np.where(log.wheel_t < begin_s, counts, last)


SILENT = (
    r"left[^.;]{0,80}"
    r"(never|does not|do not|stands still|silent|stuck|constant|stops?|hardly moves|not (change|move|count))"
)
STOPS = (
    r"right[^.;]{0,60}(counter|ticks|wheel|encoder)[^.;]{0,80}"
    r"(stops|silent|stuck|stands still|does not (move|count|change)|no longer|hardly moves|frozen)"
)
STAYS = r"(saturat|32767|stays at|stuck|stops? (counting|at)|full|stands)"
COUNTERS.add(
    "counter-left-silent", case_of(5000, counted(lambda d, log: (np.zeros_like(log.left), log.right))), refused(SILENT)
)
COUNTERS.add(
    "counter-right-dies",
    case_of(5001, counted(lambda d, log: (log.left, after(log, log.right, float(d.rng.uniform(70.0, 120.0)))))),
    refused(STOPS),
    doubted(STOPS),
)
COUNTERS.add(
    "counter-right-only-up",
    case_of(5002, counted(lambda d, log: (log.left, rising(log.right)))),
    refused(NO_DIRECTION),
    doubted(NO_DIRECTION),
)
COUNTERS.add(
    "counter-both-only-up",
    case_of(5003, counted(lambda d, log: (rising(log.left), rising(log.right)))),
    refused(NO_DIRECTION),
    doubted(NO_DIRECTION),
)
COUNTERS.add(
    "counter-left-saturates",
    case_of(5004, counted(lambda d, log: (slowest(log.left, float(d.rng.uniform(0.6, 0.7))), log.right)), 220.0),
    doubted(),
    refused(SATURATES),
    honest(SATURATES),
    diagnosis=Diagnosis(names=("missed_left",), or_says=(SATURATES,)),
)
COUNTERS.add(
    "counter-16-bit-stays",
    case_of(5005, counted(lambda d, log: (np.minimum(log.left, most_of(log)), np.minimum(log.right, most_of(log))))),
    refused(STAYS),
    doubted(STAYS),
)
COUNTERS.add(
    "counter-exchanged-forward",
    case_of(5006, counted(lambda d, log: (log.right, log.left)), reverse=False),
    refused(EXCHANGED),
)
COUNTERS.add(
    "counter-exchanged-one-reversed",
    case_of(5007, counted(lambda d, log: (-log.right, log.left))),
    refused(BACKWARDS),
    refused(EXCHANGED),
)
COUNTERS.add(
    "counter-reversed-forward",
    case_of(5008, counted(lambda d, log: (-log.left, -log.right)), reverse=False),
    refused(BOTH_FIRST),
)
COUNTERS.add(
    "counter-exchanged-both-reversed",
    case_of(5009, counted(lambda d, log: (-log.right, -log.left), either_way)),
    refused(EXCHANGED, BACKWARDS),
    honest(EXCHANGED, BACKWARDS),
)


def most_of(log: Log) -> int:
    """Where the counters end to count: at the greatest number of fifteen bits, or sooner on a short drive."""
    return min(32767, int(0.6 * max(log.left.max(), log.right.max())))


def spins_with_arm(drawn: Drawn, folder: Path) -> Truth:
    """Turns on the spot with the antenna off the middle, and two short straights."""
    arm = tuple(float(value) for value in drawn.rng.uniform(0.2, 0.6, 2) * drawn.rng.choice([-1.0, 1.0], 2))
    log = record(
        spins(4, int(drawn.rng.integers(0, 2))),
        drawn.seed,
        drawn.robot,
        told=replace(drawn.told, lever_m=(arm[0], arm[1])),
    )
    write_run(folder, log)
    return Truth.of(log)


for seed in (5010, 5011):
    COUNTERS.add(
        f"spins-with-arm-{seed}",
        case_of(seed, spins_with_arm),
        refused(NO_WAY),
        doubted(NO_WAY),
        never=(r"negate", r"counts? backwards"),
    )


def driven(
    log_of: Callable[[Drawn], tuple[list[Piece], Robot, Instruments, Ground, float]],
    effects: Callable[[Drawn], dict[str, dict[str, float]]],
) -> Bend:
    """A drive, a robot, its instruments and its ground, all of a case's own."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        pieces, robot, told, ground, soft_s = log_of(drawn)
        log = record(pieces, drawn.seed, robot, ground, told, soft_s)
        write_run(folder, log)
        return Truth.of(log, effects(drawn))

    return bend


VAN = Robot(0.3395, 0.3385, 1.61, 0.34, 1.6, 2048)


def arm_of(drawn: Drawn) -> tuple[float, float]:
    """An antenna ahead or behind by a drawn length, and a little aside."""
    rng = np.random.default_rng(drawn.seed)
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(0.7, 2.0)), float(rng.uniform(-0.4, 0.4))


def arm_effect(drawn: Drawn) -> dict[str, dict[str, float]]:
    """The arm as an effect."""
    forward_m, left_m = arm_of(drawn)
    return {"lever_arm": {"forward_m": forward_m, "left_m": left_m}}


def one_speed(
    robot: Robot, slip_m: float, side: float = 0.0
) -> Callable[[Drawn], tuple[list[Piece], Robot, Instruments, Ground, float]]:
    """Rows with arcs that are all driven alike; sliding outwards by so many seconds times v ω."""

    def log_of(drawn: Drawn) -> tuple[list[Piece], Robot, Instruments, Ground, float]:
        arm = (0.0, 0.0) if side and drawn.seed % 2 else arm_of(drawn)
        ground = Ground(slip_m, side=(lambda v, w, t: -side * v * w) if side else None)
        return headlands(6, 40.0, 2.2, 1.3, 0.3), robot, Instruments(lever_m=arm, late_s=-0.02), ground, 2.0

    return log_of


ARM_SAID = Diagnosis(names=("lever_arm",), never=(r"slides? inwards",))
for seed, robot, slip_m in ((5100, TRACTOR, 0.01), (5101, VAN, 0.01), (5102, VAN, 0.005), (5103, TRACTOR, 0.008)):
    ARMS.add(
        f"arm-one-speed-{seed}",
        case_of(seed, driven(one_speed(robot, slip_m), arm_effect)),
        honest(),
        diagnosis=ARM_SAID,
    )
ARMS.add(
    "side-slip-one-speed",
    case_of(
        5105,
        driven(one_speed(TRACTOR, 0.008, 0.35), lambda d: {"side_slip": {"s": 0.35}, "lever_arm": {"forward_m": 0.0}}),
    ),
    honest(),
    diagnosis=Diagnosis(names=("side_slip", "lever_arm")),
)
ARMS.add(
    "arm-and-side-slip",
    case_of(5106, driven(one_speed(VAN, 0.006, 0.3), lambda d: {**arm_effect(d), "side_slip": {"s": 0.3}})),
    honest(),
    diagnosis=Diagnosis(names=("lever_arm", "side_slip")),
)
ARMS.add(
    "arm-two-speeds",
    case_of(
        5107,
        driven(
            lambda d: (
                varied(260.0, d.seed, 1.6, 0.4),
                VAN,
                Instruments(lever_m=arm_of(d), late_s=-0.02),
                Ground(0.006),
                1.2,
            ),
            arm_effect,
        ),
    ),
    honest(),
    diagnosis=ARM_SAID,
)


def grounds(make: Callable[[Drawn], tuple[Ground, dict[str, tuple[float, float]]]]) -> Bend:
    """A ground that bends the constants; spans in which each of these may lie."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        ground, spans = make(drawn)
        log = drawn.log(ground)
        write_run(folder, log)
        return Truth.of(log, {}, **spans)

    return bend


def one_tyre(which: str, low: float, high: float) -> Callable[[Drawn], tuple[Ground, dict[str, tuple[float, float]]]]:
    """A radius that changes by a drawn share at a drawn moment."""

    def make(drawn: Drawn) -> tuple[Ground, dict[str, tuple[float, float]]]:
        share, at_s = 1.0 + float(drawn.rng.uniform(low, high)), float(drawn.rng.uniform(80.0, 140.0))

        def growth(t: FloatArray) -> tuple[FloatArray, FloatArray]:
            changed, same = np.where(t > at_s, share, 1.0), np.ones_like(t)
            return (changed, same) if which == "right" else (same, changed)

        radius_m = drawn.robot.radius_right_m if which == "right" else drawn.robot.radius_left_m
        return Ground(growth=growth), {
            f"radius_{which}_m": (min(radius_m, radius_m * share), max(radius_m, radius_m * share)),
            "track_m": track_span(drawn.robot.track_m, share),
        }

    return make


def one_wheel_said(which: str) -> Diagnosis:
    """A finding that names the wheel."""
    pattern = rf"({which} (wheel|tyre|radius|side)[^.;]{{0,80}}(chang|step|smaller|larger|shrink|grow|drift|loses))"
    return Diagnosis(names=(f"radius_step_{which}", f"radius_drift_{which}"), or_says=(pattern,))


GROUND.add(
    "tyre-left-loses",
    case_of(5200, grounds(one_tyre("left", -0.035, -0.02)), 240.0),
    NOT_GOOD_WAY,
    diagnosis=one_wheel_said("left"),
)
GROUND.add(
    "tyre-right-mud",
    case_of(5201, grounds(one_tyre("right", 0.015, 0.03)), 240.0),
    NOT_GOOD_WAY,
    diagnosis=one_wheel_said("right"),
)


def two_sides(drawn: Drawn) -> tuple[Ground, dict[str, tuple[float, float]]]:
    """Left turns need another track than right turns."""
    more = 1.0 + float(drawn.rng.uniform(0.08, 0.2))
    track_m = drawn.robot.track_m
    ground = Ground(0.004, track=lambda v, w, t: track_m * np.where(w > 0.0, 1.0, more))
    return ground, {"track_m": (track_m, track_m * more)}


def two_surfaces(drawn: Drawn) -> tuple[Ground, dict[str, tuple[float, float]]]:
    """Another track from a moment on."""
    share, at_s = float(drawn.rng.uniform(0.75, 0.88)), float(drawn.rng.uniform(80.0, 140.0))
    track_m = drawn.robot.track_m
    ground = Ground(0.004, track=lambda v, w, t: track_m * np.where(t < at_s, 1.0, share))
    return ground, {"track_m": (track_m * share, track_m)}


GROUND.add(
    "turns-differ",
    case_of(5202, grounds(two_sides), 240.0),
    NOT_GOOD_WAY,
    honest(TWO_SIDES),
    diagnosis=Diagnosis(names=("turn_side", "track_side"), or_says=(TWO_SIDES,)),
)
SURFACES = r"(track[^.;]{0,80}(chang|step|jump|differ)|two surfaces|surfaces? (chang|differ)|track_step)"
GROUND.add(
    "two-surfaces",
    case_of(5203, grounds(two_surfaces), 240.0),
    NOT_GOOD_WAY,
    diagnosis=Diagnosis(
        names=("track_step",), or_says=(SURFACES,), not_named=("radius_step", "heading_step", "base_shift")
    ),
)


def slippery_stretch(drawn: Drawn) -> tuple[Ground, dict[str, tuple[float, float]]]:
    """Both wheels slip for half a minute."""
    keeps, at_s = float(drawn.rng.uniform(0.85, 0.92)), float(drawn.rng.uniform(60.0, 120.0))

    def growth(t: FloatArray) -> tuple[FloatArray, FloatArray]:
        slipping = np.where((t > at_s) & (t < at_s + 30.0), keeps, 1.0)
        return slipping, slipping

    robot = drawn.robot
    return Ground(growth=growth), {
        "radius_right_m": (keeps * robot.radius_right_m, robot.radius_right_m),
        "radius_left_m": (keeps * robot.radius_left_m, robot.radius_left_m),
        "track_m": track_span(robot.track_m, keeps),
    }


GROUND.add(
    "slippery-stretch",
    case_of(5204, grounds(slippery_stretch), 240.0),
    NOT_GOOD_WAY,
    diagnosis=Diagnosis(never=(r"nothing that the model lacks was found",)),
)


def read_as(
    yaw: Callable[[Drawn, FloatArray, FloatArray, FloatArray], FloatArray],
    effects: Callable[[Drawn], dict[str, dict[str, float]]] = lambda drawn: {},
    **changed: float | tuple[float, float] | list[float],
) -> Bend:
    """An AHRS that reads something else: of the whole heading every five milliseconds, of its times and headings."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        motion = move(drawn.pieces, drawn.seed, drawn.robot)
        told = replace(drawn.told, yaw=lambda t, heading: yaw(drawn, motion.heading_rad, t, heading))
        log = sense(motion, drawn.seed, drawn.robot, told)
        write_run(folder, log)
        return Truth.of(log, effects(drawn), **changed)

    return bend


def gain_of(drawn: Drawn) -> float:
    """A gain between 0.7 and 1.5 % off, to either side."""
    rng = np.random.default_rng(drawn.seed)
    return float(rng.choice([-1.0, 1.0]) * rng.uniform(0.007, 0.015))


for seed in (5300, 5301):
    HEADINGS.add(
        f"gain-{seed}",
        case_of(
            seed,
            read_as(
                lambda d, whole, t, heading: whole[0] + (1.0 + gain_of(d)) * (heading - whole[0]),
                lambda d: {"heading_scale": {"ratio": gain_of(d)}},
            ),
            280.0,
        ),
        honest(),
        diagnosis=Diagnosis(names=("heading_scale",)),
    )
GAIN = r"(gain is off|gain of|\bgyro|slope (of )?(1\.9|2\.0)|twice|double|heading_scale)"
HEADINGS.add(
    "gain-double",
    case_of(5302, read_as(lambda d, whole, t, heading: whole[0] + 2.0 * (heading - whole[0]), heading_offset_deg=ANY)),
    refused(GAIN),
    doubted(GAIN),
)
JUMP = r"(jumps?|headings? (of|from|between)|bad headings|reboot)"
HEADINGS.add(
    "yaw-reboots",
    case_of(
        5303,
        read_as(lambda d, whole, t, heading: heading + np.radians(40.0) * ((t > 90.0) & (t < 90.0 + 25.0))),
        240.0,
    ),
    NOT_GOOD_WAY,
    right(2.5),
    diagnosis=Diagnosis(names=("heading_step", "heading_window", "bad_headings"), or_says=(JUMP,)),
)
HEADINGS.add(
    "yaw-frozen-minute",
    case_of(5304, read_as(lambda d, whole, t, heading: held(heading, (t > 80.0) & (t < 120.0))), 240.0),
    NOT_GOOD_WAY,
    right(3.0, ANY_LEVEL),
    refused(r"(frozen|does not|stands|\d+ s)"),
)
HEADINGS.add(
    "yaw-slow-filter",
    case_of(
        5305,
        read_as(lambda d, whole, t, heading: np.interp(t, 0.005 * np.arange(whole.size), lowpassed(whole, 0.005, 0.5))),
        240.0,
    ),
    honest(),
    diagnosis=Diagnosis(names=("heading_latency", "heading_lag", "heading_smoothing")),
)
HEADINGS.add(
    "iron-drawn",
    case_of(
        5306,
        read_as(lambda d, whole, t, heading: field_in_body(0.3, 0.25)(None, t, heading), heading_offset_deg=ANY),  # type: ignore[arg-type]
        260.0,
    ),
    honest(),
    diagnosis=Diagnosis(names=("hard_iron",)),
)
BEYOND = r"(go(es)? (all the way )?round|beyond|larger than the earth|stronger than|does not turn with|full turn)"
HEADINGS.add(
    "iron-beyond-again",
    case_of(
        5307,
        read_as(lambda d, whole, t, heading: field_in_body(-0.8, 1.3)(None, t, heading), heading_offset_deg=ANY),  # type: ignore[arg-type]
        220.0,
    ),
    refused(BEYOND),
    doubted(BEYOND),
)


def fixed_as(change: Callable[[Drawn, Log], Log]) -> Bend:
    """Bent fixes."""

    def bend(drawn: Drawn, folder: Path) -> Truth:
        log = drawn.log()
        write_run(folder, change(drawn, log))
        return Truth.of(log)

    return bend


def spans_of(drawn: Drawn) -> tuple[tuple[float, float], ...]:
    """Two spans, drawn."""
    first, second = float(drawn.rng.uniform(50.0, 80.0)), float(drawn.rng.uniform(130.0, 160.0))
    return (first, first + float(drawn.rng.uniform(10.0, 30.0))), (
        second,
        second + float(drawn.rng.uniform(10.0, 30.0)),
    )


FIXES.add(
    "wrong-fix-twice",
    case_of(5400, fixed_as(lambda d, log: beside(log, d.seed, 4, spans_of(d), 1.2)), 240.0),
    NOT_GOOD_WAY,
)
FIXES.add(
    "float-honest-again",
    case_of(5401, fixed_as(lambda d, log: beside(log, d.seed, 5, spans_of(d), 0.8)), 240.0),
    right(2.5, ANY_LEVEL),
    diagnosis=Diagnosis(nothing=True),
)
FIXES.add(
    "fixes-smoothed",
    case_of(5402, fixed_as(lambda d, log: smoothed(log, float(d.rng.uniform(0.5, 0.8)))), 240.0),
    honest(),
    diagnosis=Diagnosis(names=("fix_smoothing", "gnss_smoothing", "gnss_latency"), or_says=(r"smooth|low.?pass",)),
)


def plain_unaided(drawn: Drawn, folder: Path) -> Truth:
    """No corrections at all, and the receiver says so."""
    log = drawn.log(told=replace(drawn.told, quality=1, fix_white_m=0.2, fix_slow=(1.2, 120.0)))
    write_run(folder, log)
    return Truth.of(log)


FIXES.add("unaided-5hz", case_of(5403, plain_unaided, 300.0), honest())
