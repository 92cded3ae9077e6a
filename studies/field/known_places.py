"""Known cases of fixes: float and wrong ones, a base that settles, filters, tilt, other coordinates."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from studies.arrays import FloatArray, floats, stream
from studies.field.drives import headlands, varied
from studies.field.files import FIX_HEAD, nmea_lines, stamped, without_fixes, write_fixes, write_lines, write_run
from studies.field.known_headings import lowpassed
from studies.field.known_tables import MIRRORED
from studies.field.known_wheels import TRACTOR
from studies.field.wanted import ANY_LEVEL, NOT_GOOD, Chapter, Diagnosis, Truth, Way, doubted, honest, refused, right
from studies.field.world import Ground, Log, record

RTK = Chapter("known", "fixes that jump")
FILTERS = Chapter("known", "fixes that lag")
TILT = Chapter("known", "antenna high above")
MEANING = Chapter("known", "coordinates")
CHAPTERS = (RTK, FILTERS, TILT, MEANING)
SPANS = ((45.0, 75.0), (110.0, 120.0), (160.0, 205.0))
NOT_GOOD_WAY = Way("not good", (0,), NOT_GOOD)


def beside(log: Log, seed: int, says: int, spans: tuple[tuple[float, float], ...] = SPANS, size_m: float = 1.8) -> Log:
    """Fixes that lie metres beside in some spans, wander there, and say some quality."""
    rng = stream(seed, "fixes beside")
    east, north, quality = log.east_m.copy(), log.north_m.copy(), log.quality.copy()
    for begin_s, end_s in spans:
        within = (log.fix_t >= begin_s) & (log.fix_t < end_s)
        off = rng.standard_normal(2) * size_m + np.cumsum(rng.standard_normal((int(within.sum()), 2)) * 0.03, axis=0)
        east[within] += off[:, 0]
        north[within] += off[:, 1]
        quality[within] = says
    return replace(log, east_m=east, north_m=north, quality=quality)


def bent(seed: int, change: Callable[[Log], Log], gst: Callable[[int], float] | None = None) -> Callable[[Path], Truth]:
    """A plain drive with bent fixes."""

    def build(folder: Path) -> Truth:
        log = change(record(varied(240.0, seed), seed))
        write_run(folder, log)
        if gst is not None:
            write_lines(folder / "gnss.nmea", stamped(nmea_lines(log, sigma=gst)))
        return Truth.of(log)

    return build


NOTHING = Diagnosis(nothing=True)
RTK.add("rtk-float-says-5", bent(120, lambda log: beside(log, 1, 5)), right(2.0, ANY_LEVEL), diagnosis=NOTHING)
RTK.add(
    "rtk-float-gst",
    bent(121, lambda log: beside(log, 2, 5), lambda q: 0.011 if q == 4 else 0.35),
    right(2.0, ANY_LEVEL),
    diagnosis=NOTHING,
)
RTK.add("rtk-float-seed-3", bent(220, lambda log: beside(log, 10, 5)), right(2.0, ANY_LEVEL), diagnosis=NOTHING)
RTK.add("rtk-wrong-fix", bent(122, lambda log: beside(log, 3, 4)), NOT_GOOD_WAY)
RTK.add(
    "base-survey-in",
    bent(
        123,
        lambda log: replace(
            log,
            east_m=log.east_m + 1.6 * np.exp(-log.fix_t / 110.0),
            north_m=log.north_m - 1.1 * np.exp(-log.fix_t / 110.0),
        ),
    ),
    honest(),
)
RTK.add(
    "positions-repeated",
    bent(124, lambda log: repeated(log, 2)),
    right(2.5, ANY_LEVEL),
)


def repeated(log: Log, times: int) -> Log:
    """A receiver that says each position so many times under new epochs."""
    kept = np.arange(log.fix_t.size) // times * times
    return replace(log, east_m=log.east_m[kept], north_m=log.north_m[kept])


def smoothed(log: Log, tau_s: float) -> Log:
    """A receiver whose navigation filter believes in slow platforms."""
    step_s = float(log.fix_t[1] - log.fix_t[0])
    return replace(log, east_m=lowpassed(log.east_m, step_s, tau_s), north_m=lowpassed(log.north_m, step_s, tau_s))


SMOOTH = Diagnosis(
    or_says=(r"(smooth|filter(s|ed|ing)? (of|by|in) the receiver|low.?pass)",),
    names=("fix_smoothing", "gnss_smoothing", "gnss_latency"),
)
FILTERS.add("fix-lowpass", bent(184, lambda log: smoothed(log, 0.9)), honest(), doubted(), diagnosis=SMOOTH)

HEIGHT_M = 2.8


def on_hills(
    seed: int, tilt: Callable[[Log, FloatArray], tuple[FloatArray, FloatArray]], height_m: float
) -> Callable[[Path], Truth]:
    """A tractor whose antenna swings with pitch and roll, which are logged."""

    def build(folder: Path) -> Truth:
        log = record(headlands(5, 45.0, 2.4), seed, TRACTOR, Ground(0.01), soft_s=2.0)
        pitch, roll = tilt(log, log.fix_t)
        heading = log.motion.at(log.motion.heading_rad, log.fix_t)
        forward, left = -height_m * np.sin(pitch), -height_m * np.sin(roll)
        shown = replace(
            log,
            east_m=log.east_m + forward * np.cos(heading) - left * np.sin(heading),
            north_m=log.north_m + forward * np.sin(heading) + left * np.cos(heading),
            tilt_deg=logged_tilt(tilt(log, log.yaw_t), seed),
        )
        write_run(folder, shown)
        return Truth.of(log, {"antenna_height": {"m": height_m}})

    return build


def logged_tilt(tilt: tuple[FloatArray, FloatArray], seed: int) -> tuple[FloatArray, FloatArray]:
    """Pitch and roll in degrees, with a little noise."""
    pitch, roll = (
        floats(np.degrees(angle) + 0.1 * stream(seed, name).standard_normal(angle.size))
        for angle, name in zip(tilt, ("pitch", "roll"), strict=True)
    )
    return pitch, roll


def plane(log: Log, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pitch and roll on a plane of four degrees."""
    heading = log.motion.at(log.motion.heading_rad, t)
    return np.radians(4.0) * np.cos(heading - 0.4), -np.radians(4.0) * np.sin(heading - 0.4)


def hills(log: Log, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Pitch and roll on waves of five degrees."""
    motion = log.motion
    x, y, heading = (motion.at(values, t) for values in (motion.east_m, motion.north_m, motion.heading_rad))
    rise_east = np.radians(5.0) * np.sin(x / 9.0) * np.cos(y / 14.0)
    rise_north = np.radians(5.0) * np.cos(x / 11.0 + 1.0) * np.sin(y / 7.0)
    pitch = rise_east * np.cos(heading) + rise_north * np.sin(heading)
    return pitch, -rise_east * np.sin(heading) + rise_north * np.cos(heading)


TILT.add(
    "antenna-high-plane",
    on_hills(91, plane, HEIGHT_M),
    honest(),
    diagnosis=Diagnosis(not_named=("hard_iron", "soft_iron")),
)
TILT.add("antenna-high-hills", on_hills(92, hills, HEIGHT_M), honest(), diagnosis=Diagnosis(names=("antenna_height",)))


def west(form: Callable[[float, float], tuple[str, str]], seed: int = 180) -> Callable[[Path], Truth]:
    """A place west of Greenwich, its coordinates written in some way."""

    def build(folder: Path) -> Truth:
        log = record(varied(200.0, seed), seed)
        without_fixes(folder, log)
        write_fixes(folder, FIX_HEAD, lambda k, t, lat, lon: [f"{t:.4f}", *form(lat, lon - 17.0), "4"], log)
        return Truth.of(log)

    return build


def digits(count: int) -> Callable[[float, float], tuple[str, str]]:
    """So many decimals."""
    return lambda lat, lon: (f"{lat:.{count}f}", f"{lon:.{count}f}")


COARSE = r"(float|32|step|resol|digit|decimal|coarse|rounded|0\.\d+ m)"
MEANING.add("place-right", west(digits(9)), right(1.3))
MEANING.add("place-no-sign", west(lambda lat, lon: (f"{lat:.9f}", f"{-lon:.9f}")), refused(MIRRORED), doubted(MIRRORED))
MEANING.add(
    "place-exchanged", west(lambda lat, lon: (f"{lon:.9f}", f"{lat:.9f}")), refused(MIRRORED), doubted(MIRRORED)
)
MEANING.add(
    "place-float32",
    west(lambda lat, lon: (f"{np.float32(lat):.9f}", f"{np.float32(lon):.9f}")),
    right(8.0, ANY_LEVEL),
    doubted(COARSE),
    refused(COARSE),
)
MEANING.add("place-7-decimals", west(digits(7)), right(1.3))
MEANING.add("place-6-decimals", west(digits(6)), right(3.0, ANY_LEVEL))


def in_minutes(lat: float, lon: float) -> tuple[str, str]:
    """Degrees, and minutes where the decimals of degrees should be: 8.4832 for 8° 48.32'."""
    north, east = (math.copysign(int(abs(angle)) + abs(angle) % 1.0 * 0.6, angle) for angle in (lat, lon))
    return f"{north:.9f}", f"{east:.9f}"


COMMON = r"(minutes|ddmm|notation|fixes' scale|scale of the fixes|both radii and the track|same (factor|share))"
MEANING.add("place-minutes-as-decimals", west(in_minutes), refused(COMMON), doubted(COMMON), honest(COMMON))
