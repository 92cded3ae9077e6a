"""Known cases of wheels: wired the wrong way, other numbers of counts, skids, tyres, and drives that show little."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from studies.arrays import FloatArray, IntArray
from studies.field.drives import Piece, headlands, road, rows, spins, varied
from studies.field.files import write_run, write_vehicle
from studies.field.known_tables import NO_DIRECTION
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
from studies.field.world import Ground, Instruments, Log, record
from studies.vehicles import Robot

WIRING = Chapter("known", "counters")
COUNTS = Chapter("known", "counts per turn")
SKIDS = Chapter("known", "skid steering")
TYRES = Chapter("known", "tyres")
DRIVES = Chapter("known", "drives that show little")
SCALES = Chapter("known", "large, small, coarse")
ARMS = Chapter("known", "arm and side slip")
CHAPTERS = (WIRING, COUNTS, SKIDS, TYRES, DRIVES, SCALES, ARMS)

Counts = Callable[[IntArray, IntArray], tuple[IntArray, IntArray]]
"""Left and right counts made of the true ones."""


def miscounted(
    pieces: list[Piece], seed: int, change: Counts, truth: Callable[[Log], Truth] = Truth.of
) -> Callable[[Path], Truth]:
    """A plain drive with other counts."""

    def build(folder: Path) -> Truth:
        log = record(pieces, seed)
        left, right_counts = change(log.left, log.right)
        write_run(folder, replace(log, left=left, right=right_counts))
        return truth(log)

    return build


def rising(counts: IntArray) -> IntArray:
    """A counter that rises either way."""
    return np.concatenate([[0], np.cumsum(np.abs(np.diff(counts)))])


def either_way(log: Log) -> Truth:
    """The robot as it is, or one that faces backwards: its sides exchanged and its heading turned round."""
    true = log.constants
    turned = {
        "radius_right_m": true["radius_left_m"],
        "radius_left_m": true["radius_right_m"],
        "track_m": true["track_m"],
        "heading_offset_deg": true["heading_offset_deg"] + 180.0,
    }
    return Truth((true, turned))


BACKWARDS = r"(negat|backwards|revers|wrong way)"
EXCHANGED = r"(exchang|swap|crossed)"
BOTH_FIRST = (
    r"^(?:(?!exchang|swap)[\s\S])*?"
    r"((negat\w*|revers\w*|backwards?)[^.;]{0,40}both|both[^.;]{0,60}(negat|backwards?|revers))"
)
WIRING.add(
    "counter-right-reversed", miscounted(varied(200.0, 51), 51, lambda left, r: (left, -r)), refused("right", BACKWARDS)
)
WIRING.add("counter-both-reversed", miscounted(varied(200.0, 52), 52, lambda left, r: (-left, -r)), refused(BOTH_FIRST))
WIRING.add("counter-exchanged", miscounted(varied(200.0, 53), 53, lambda left, r: (r, left)), refused(EXCHANGED))
for name, pieces in (
    ("counter-exchanged-reversed", varied(200.0, 54)),
    ("counter-exchanged-reversed-rows", rows(9, 14.0, 0.7, 0.6)),
):
    WIRING.add(
        name,
        miscounted(pieces, 54, lambda left, r: (-r, -left), either_way),
        refused(EXCHANGED, BACKWARDS),
        honest(EXCHANGED, BACKWARDS),
    )
WIRING.add(
    "counter-exchanged-rows",
    miscounted(rows(9, 14.0, 0.7, 0.6), 55, lambda left, r: (r, left)),
    refused(EXCHANGED, BACKWARDS),
)
WIRING.add(
    "counter-only-up-spins",
    miscounted(varied(200.0, 41, reverse=False), 41, lambda left, r: (rising(left), rising(r))),
    refused(NO_DIRECTION),
    doubted(NO_DIRECTION),
)
WIRING.add(
    "counter-only-up-reverse-once",
    miscounted(
        [(6.0, 0.0, 0.0)]
        + [(9.0, 0.8, 0.0), (5.0, 0.6, 0.35), (9.0, 0.8, 0.0), (5.0, 0.6, -0.35)] * 7
        + [(5.0, -0.5, 0.0), (9.0, 0.8, 0.0)],
        43,
        lambda left, r: (rising(left), rising(r)),
    ),
    refused(NO_DIRECTION),
    doubted(NO_DIRECTION),
)


def slowest(counts: IntArray, share: float) -> IntArray:
    """A counter that cannot count faster than a share of what is asked of it."""
    steps = np.diff(counts)
    most = int(share * np.max(np.abs(steps)))
    return np.concatenate([[0], np.cumsum(np.clip(steps, -most, most))])


SATURATES = (
    r"(saturat|cannot count faster|counts? [^.;]{0,30}(lost|missed) above|(lost|missed|loses|misses) [^.;]{0,20}counts)"
)
WIRING.add(
    "counter-right-saturates",
    miscounted(varied(220.0, 164), 164, lambda left, r: (left, slowest(r, 0.75))),
    doubted(),
    refused(SATURATES),
    honest(SATURATES),
    diagnosis=Diagnosis(names=("missed_right",), or_says=(SATURATES,)),
)


def declared(counted: int, told: int, change: Counts | None = None) -> Callable[[Path], Truth]:
    """Another number of counts in a turn than declared; the wheel then seems as much smaller or larger."""

    def build(folder: Path) -> Truth:
        log = record(varied(180.0, 6), 61, Robot(ticks_per_rev=counted))
        left, right_counts = (log.left, log.right) if change is None else change(log.left, log.right)
        shown = replace(log, left=left, right=right_counts)
        write_run(folder, shown)
        write_vehicle(folder, shown, ticks=told)
        scale = told / counted
        return Truth.of(
            log, radius_right_m=log.robot.radius_right_m * scale, radius_left_m=log.robot.radius_left_m * scale
        )

    return build


PER_TURN = r"(ticks_per_rev|counts? (per|of a|in a|in one) turn|quadrature)"
for name, counted, told in (("counts-x4", 1600, 400), ("counts-quarter", 400, 1600), ("counts-gear-34", 1632, 48)):
    COUNTS.add(name, declared(counted, told), doubted(PER_TURN), refused(PER_TURN))
COUNTS.add("counts-7pc", declared(1712, 1600), right(1.5))


def one_side(factor: float) -> Callable[[Path], Truth]:
    """The left counter counts so many times too much."""

    def build(folder: Path) -> Truth:
        log = record(varied(180.0, 64), 64, Robot(ticks_per_rev=1600))
        write_run(folder, replace(log, left=np.floor(log.left * factor).astype(np.int64)))
        return Truth.of(log, radius_left_m=log.robot.radius_left_m / factor)

    return build


COUNTS.add("counts-left-x2", one_side(2.0), doubted(PER_TURN), refused(PER_TURN))
COUNTS.add("counts-left-1.27", one_side(1.27), honest(r"(ticks_per_rev|counts|differ|apart|unequal)"))


SKID = Robot(0.1643, 0.1638, 0.555, 0.165, 0.555, 2000)


def skidding(
    seed: int, multiplier: float | None, track: Callable[..., FloatArray] | None, span: tuple[float, float]
) -> Callable[[Path], Truth]:
    """A skid steerer whose effective track is so many times the distance of its wheels, or a function."""

    def build(folder: Path) -> Truth:
        robot = replace(SKID, track_m=0.555 * (multiplier or 1.0))
        log = record(varied(220.0, 10), seed, robot, Ground(0.006, track))
        write_run(folder, log)
        return Truth.of(log) if multiplier else Truth.of(log, track_m=(0.555 * span[0], 0.555 * span[1]))

    return build


SKIDS.add("skid-1.65", skidding(100, 1.65, None, (0.0, 0.0)), right(3.0))
SKIDS.add("skid-2.1", skidding(101, 2.1, None, (0.0, 0.0)), right(3.0, ANY_LEVEL))
TWO_SIDES = r"(side of the turn|left and right turns|turns? to the (left|right)|left turns|right turns)"
SKIDS.add(
    "skid-sides",
    skidding(102, None, lambda v, w, t: 0.555 * np.where(w > 0.0, 1.45, 1.75), (1.45, 1.75)),
    Way("not good", (0,), NOT_GOOD),
    honest(TWO_SIDES),
    diagnosis=Diagnosis(or_says=(TWO_SIDES,), names=("turn_side", "track_side")),
)
SKIDS.add(
    "skid-radius",
    skidding(
        104, None, lambda v, w, t: 0.555 * (1.3 + 0.6 * np.exp(-np.abs(v) / (0.4 * np.abs(w) + 1e-3))), (1.3, 1.9)
    ),
    Way("not good", (0,), NOT_GOOD),
    honest(r"turn"),
)
GROUNDS = r"(track .{0,80}(chang|step|jump|differ)|two surfaces|surfaces? (chang|differ)|track_step)"
SKIDS.add(
    "skid-ground",
    skidding(103, None, lambda v, w, t: 0.555 * np.where(t < 110.0, 1.75, 1.45), (1.45, 1.75)),
    Way("not good", (0,), NOT_GOOD),
    diagnosis=Diagnosis(
        names=("track_step",), or_says=(GROUNDS,), not_named=("radius_step", "heading_step", "base_shift")
    ),
)


@SKIDS.case(
    "skid-two-runs",
    Way("not good", (0,), NOT_GOOD),
    honest(r"disagree"),
    diagnosis=Diagnosis(never=(r"nothing that the model lacks was found",)),
)
def two_runs(folder: Path) -> Truth:
    """Grass on one day, asphalt on the other."""
    for name, multiplier, seed in (("grass", 1.75, 170), ("asphalt", 1.45, 171)):
        robot = replace(SKID, track_m=0.555 * multiplier)
        write_run(folder / name, record(varied(180.0, seed), seed, robot, Ground(0.006)), name="skid")
    return Truth.of(record(varied(20.0, 1), 1, SKID), track_m=(0.555 * 1.45, 0.555 * 1.75))


def track_span(track_m: float, share: float) -> tuple[float, float]:
    """Where a constant track may lie whose wheels are of two sizes, in turn, that differ by a share."""
    low = min(share, 1.0 / share)
    return track_m * low, track_m / low


def grown(seed: int, right_factor: float, left_factor: float, at_s: float) -> Callable[[Path], Truth]:
    """Radii that change at a moment."""

    def build(folder: Path) -> Truth:
        def growth(t: FloatArray) -> tuple[FloatArray, FloatArray]:
            return np.where(t > at_s, right_factor, 1.0), np.where(t > at_s, left_factor, 1.0)

        log = record(varied(240.0, seed), seed, None, Ground(growth=growth))
        write_run(folder, log)
        right_m, left_m = log.robot.radius_right_m, log.robot.radius_left_m
        return Truth.of(
            log,
            {"radius_step": {"at_s": at_s}},
            radius_right_m=(min(right_m, right_m * right_factor), max(right_m, right_m * right_factor)),
            radius_left_m=(min(left_m, left_m * left_factor), max(left_m, left_m * left_factor)),
            track_m=track_span(log.robot.track_m, min(right_factor, left_factor)),
        )

    return build


NOT_GOOD_WAY = Way("not good", (0,), NOT_GOOD)
ONE_TYRE = (
    r"(right (wheel|tyre|radius)[^.;]{0,80}(chang|step|smaller|shrink|grow|loses)|"
    r"radius_step_right|right wheel's radius)"
)
TYRES.add(
    "tyre-puncture",
    grown(160, 0.97, 1.0, 110.0),
    NOT_GOOD_WAY,
    diagnosis=Diagnosis(names=("radius_step_right", "radius_drift_right"), or_says=(ONE_TYRE,)),
)
TYRES.add(
    "tyre-loaded", grown(161, 0.985, 0.985, 110.0), NOT_GOOD_WAY, honest(), diagnosis=Diagnosis(names=("radius_step",))
)


@TYRES.case("bank-slip", NOT_GOOD_WAY, diagnosis=Diagnosis(never=(r"nothing that the model lacks was found",)))
def bank_slip(folder: Path) -> Truth:
    """Both wheels slip by 12 % twice, for twenty seconds, on a bank that no column tells of."""

    def growth(t: FloatArray) -> tuple[FloatArray, FloatArray]:
        slips = ((t > 60.0) & (t < 80.0)) | ((t > 160.0) & (t < 180.0))
        return np.where(slips, 0.88, 1.0), np.where(slips, 0.88, 1.0)

    log = record(varied(240.0, 166), 166, None, Ground(growth=growth))
    write_run(folder, log)
    right_m, left_m = log.robot.radius_right_m, log.robot.radius_left_m
    return Truth.of(
        log,
        radius_right_m=(0.88 * right_m, right_m),
        radius_left_m=(0.88 * left_m, left_m),
        track_m=(0.88 * log.robot.track_m, log.robot.track_m / 0.88),
    )


def driven(
    pieces: list[Piece],
    seed: int,
    robot: Robot | None = None,
    told: Instruments | None = None,
    ground: Ground | None = None,
    soft_s: float = 0.8,
    named: tuple[str, ...] = (),
    **changed: tuple[float, float],
) -> Callable[[Path], Truth]:
    """A drive with a robot and its instruments; effects that are named have their values from these."""

    def build(folder: Path) -> Truth:
        seen = told or Instruments()
        log = record(pieces, seed, robot, ground, seen, soft_s)
        write_run(folder, log)
        known = {
            "lever_arm": {"forward_m": seen.lever_m[0], "left_m": seen.lever_m[1]},
            "gnss_latency": {"s": seen.late_s},
        }
        return Truth.of(log, {name: known[name] for name in named}, **changed)

    return build


REVERSE = [(6.0, 0.0, 0.0)] + [
    piece
    for lap in range(9)
    for piece in (
        (9.0, -0.7, 0.0),
        (5.0, -0.5, 0.35 * (1.0 if lap % 2 else -1.0)),
        (4.0, -0.35, 0.0),
        (3.0, 0.0, 0.4 * (1.0 if lap % 3 else -1.0)),
    )
]
DRIVES.add(
    "drive-reverse-only",
    driven(REVERSE, 140, told=Instruments(lever_m=(-0.35, 0.2)), named=("lever_arm",)),
    honest(),
    diagnosis=Diagnosis(names=("lever_arm",)),
)
NO_WAY = r"(at least 10 m|hardly moves|only turns|drive .{0,30}\d+ m|does not drive|spins)"
DRIVES.add("drive-spins-only", driven(spins(4), 141), refused(NO_WAY), doubted(NO_WAY))
DRIVES.add(
    "drive-spins-only-arm",
    driven(spins(4), 142, told=Instruments(lever_m=(0.3, 0.1))),
    refused(NO_WAY),
    doubted(NO_WAY),
    never=(r"negate", r"counts? backwards"),
)
DRIVES.add(
    "drive-standing",
    driven(
        [(100.0, 0.0, 0.0), (12.0, 0.8, 0.0), (6.0, 0.5, 0.4), (12.0, 0.8, 0.0), (6.0, 0.5, -0.4), (100.0, 0.0, 0.0)],
        143,
    ),
    honest(),
)
DRIVES.add(
    "drive-straight-only",
    driven([(5.0, 0.0, 0.0), (170.0, 0.9, 0.0), (5.0, 0.0, 0.0)], 144, told=Instruments(lever_m=(-0.35, 0.2))),
    honest(r"track"),
    diagnosis=Diagnosis(nothing=True),
)

CAR = Robot(0.3065, 0.3055, 1.53, 0.31, 1.55, 96)
LATE = Instruments(late_s=0.15, lever_m=(0.0, 0.0))
SCALES.add(
    "car-late-coarse",
    driven(road(240.0, 1), 130, CAR, LATE, Ground(0.01), 2.5, ("gnss_latency",)),
    honest(),
    diagnosis=Diagnosis(names=("gnss_latency", "lever_arm"), or_says=(r"latency|\blate\b",)),
)
SCALES.add(
    "car-late-fine",
    driven(road(240.0, 2), 271, replace(CAR, ticks_per_rev=2000), LATE, Ground(0.01), 2.5, ("gnss_latency",)),
    honest(),
    diagnosis=Diagnosis(names=("gnss_latency",), or_says=(r"latency|\blate\b",)),
)
SCALES.add(
    "car-arm",
    driven(
        road(240.0, 3),
        272,
        replace(CAR, ticks_per_rev=2000),
        Instruments(lever_m=(0.9, 0.0)),
        Ground(0.01),
        2.5,
        ("lever_arm",),
    ),
    honest(),
    diagnosis=Diagnosis(names=("lever_arm",)),
)
CREEP = [(8.0, 0.0, 0.0), *([(60.0, 0.1, 0.0), (16.0, 0.05, 0.1), (40.0, 0.1, 0.0), (12.0, 0.0, -0.13)] * 2)]
CREEPER = Robot(0.0825, 0.0822, 0.36, 0.0825, 0.35, 20)
SCALES.add(
    "creeper-coarse", driven(CREEP, 132, CREEPER, ground=Ground(0.002)), honest(), diagnosis=Diagnosis(nothing=True)
)
SCALES.add(
    "creeper-fine",
    driven(CREEP, 133, replace(CREEPER, ticks_per_rev=2000), ground=Ground(0.002)),
    honest(),
    diagnosis=Diagnosis(nothing=True),
)
TINY = [
    (5.0, 0.0, 0.0),
    *([(5.0, 0.2, 0.0), (3.14, 0.0, 0.5), (5.0, 0.2, 0.0), (3.14, 0.0, -0.5), (2.5, -0.2, 0.0), (6.28, 0.05, 0.5)] * 7),
]
SCALES.add(
    "tiny", driven(TINY, 134, Robot(0.0335, 0.0330, 0.142, 0.033, 0.145, 1440), soft_s=0.4), right(8.0, ANY_LEVEL)
)
UNAIDED = Instruments(fix_hz=1.0, quality=1, fix_white_m=0.3, fix_slow=(1.8, 90.0))
SCALES.add("autonomous-1hz", driven(varied(300.0, 13), 135, told=UNAIDED), honest())
SCALES.add("autonomous-1hz-rows", driven(rows(10, 20.0, 0.8, 0.6), 136, told=UNAIDED), honest())


TRACTOR = Robot(0.812, 0.806, 1.93, 0.8, 1.9, 32768)


def tractor(seed: int, arm: tuple[float, float], slip_m: float) -> Callable[[Path], Truth]:
    """A tractor on rows with arcs at the headlands, its antenna off the axle."""
    told = Instruments(lever_m=arm, late_s=-0.02, fix_slow=(0.01, 60.0))
    return driven(headlands(6, 45.0, 2.4), seed, TRACTOR, told, Ground(slip_m), 2.0, ("lever_arm",))


ARM_SAID = Diagnosis(names=("lever_arm",), never=(r"slides? inwards",))
for name, seed, arm, slip_m in (
    ("arm-behind", 190, (-1.1, 0.0), 0.01),
    ("arm-behind-left", 191, (-0.6, 0.4), 0.01),
    ("arm-ahead", 192, (1.4, 0.0), 0.01),
    ("arm-far-ahead", 193, (2.2, -0.3), 0.01),
    ("arm-behind-firm", 400, (-1.1, 0.0), 0.003),
):
    ARMS.add(name, tractor(seed, arm, slip_m), honest(), diagnosis=ARM_SAID)


def steered(ahead_m: float, seed: int) -> Callable[[Path], Truth]:
    """A car whose logged wheels are the steered ones in front, each rolling its own longer way."""

    def build(folder: Path) -> Truth:
        robot = Robot(0.32, 0.32, 1.5, 0.32, 1.5, 2000)
        pieces = [(lasts, 0.5 * v, 1.2 * w) for lasts, v, w in road(200.0, 5)]
        log = record(pieces, seed, robot, Ground(0.01), Instruments(lever_m=(ahead_m, 0.0)), 2.5)
        motion = log.motion
        turns = [
            np.cumsum(np.hypot(motion.v_mps + side * 0.75 * motion.w_radps, 2.7 * motion.w_radps)) * 0.005 / 0.32
            for side in (-1.0, 1.0)
        ]
        left, right_counts = (
            np.floor(np.interp(log.wheel_t, motion.t_s, turn) * 2000 / (2.0 * np.pi)).astype(np.int64) for turn in turns
        )
        write_run(folder, replace(log, left=left, right=right_counts))
        return Truth.of(log, {"lever_arm": {"forward_m": ahead_m}}, track_m=ANY)

    return build


SCALES.add(
    "steered-wheels",
    steered(0.0, 185),
    honest(),
    diagnosis=Diagnosis(not_named=("hard_iron", "soft_iron", "base_shift")),
)
