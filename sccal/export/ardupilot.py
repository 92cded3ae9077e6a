"""Parameter lines for an ArduPilot rover (NAME,VALUE; metres): wheel encoders, antenna and age of the fixes.

Names and signs: the parameter tables of AP_WheelEncoder.cpp, AP_GPS_Params.cpp and AP_Compass.cpp in
github.com/ArduPilot/ardupilot, and ardupilot.org/rover/docs/wheel-encoder.html. ArduPilot's body frame is forward,
right, down, where sccal's is forward, left: every Y changes its sign. Its headings are clockwise from north, where
sccal's are counter-clockwise from east: a reading too large by the offset there is too small by it here, and the offset
is what has to be added. A file is read by Mission Planner and MAVProxy, which take a comment on a line of its own only
(pymavlink's mavparm.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sccal import __version__
from sccal.export.estimates import usable, why_not, with_sigma
from sccal.export.result import Result
from sccal.logs.names import VEHICLE_FILE
from sccal.results.calibration import Estimate

MOST_DELAY_MS = 250
CERTAIN = 2.0
"""Sigmas from which on an age of the fixes is set in place of the receiver's default."""


def write_ardupilot(result: Result) -> str:
    """The parameters of one vehicle; what was not estimated stands as a comment, so that loading leaves it alone."""
    parameters = result.parameters
    track = parameters["track_m"]
    lines = [
        f"# {result.subject}",
        f"# {result.verdict}",
        f"# Written by sccal {__version__}. X forward, Y right, metres from the middle between the wheels.",
        "# If the origin of your positions is elsewhere, add where that middle is to every _POS_X and _POS_Y.",
        "# WENC is the left wheel's encoder, WENC2 the right wheel's: exchange the two if yours are wired otherwise.",
        f"# WENC_CPR and WENC2_CPR are counts per turn of the wheel: ticks_per_rev in {VEHICLE_FILE}.",
        *_line("WENC_RADIUS", 1.0, "left radius", parameters["radius_left_m"]),
        *_line("WENC2_RADIUS", 1.0, "right radius", parameters["radius_right_m"]),
        *_line("WENC_POS_Y", -0.5, "minus half of the track,", track),
        *_line("WENC2_POS_Y", 0.5, "half of the track,", track),
        *_antenna(result.effects.get("lever_arm")),
        *_delay(result.effects.get("gnss_latency")),
        *_heading(parameters["heading_offset_deg"]),
    ]
    return "\n".join(lines) + "\n"


def _line(name: str, factor: float, what: str, estimate: Estimate) -> list[str]:
    """A comment and a line; only comments where the data gave no value. The value is factor times the estimate."""
    if usable(estimate):
        return [f"# {what} {with_sigma(estimate, 'm')}", f"{name},{factor * estimate.value + 0.0:.6f}"]
    nominal = "" if estimate.nominal is None else f" nominal {factor * estimate.nominal + 0.0:.6f},"
    return [f"# {name} left as it is:{nominal} {why_not(estimate)}"]


def _antenna(lever_arm: Mapping[str, Estimate] | None) -> list[str]:
    if lever_arm is None:
        return ["# The antenna's place was not estimated: GPS1_POS_X and GPS1_POS_Y are left as they are."]
    return [
        "# Before ArduPilot 4.6 these are GPS_POS1_X and GPS_POS1_Y.",
        *_line("GPS1_POS_X", 1.0, "antenna forward", lever_arm["forward_m"]),
        *_line("GPS1_POS_Y", -1.0, "minus antenna left,", lever_arm["left_m"]),
    ]


def _delay(latency: Mapping[str, Estimate] | None) -> list[str]:
    """Whole milliseconds within what the parameter may hold, where 0 stands for the receiver's default."""
    if latency is None:
        return []
    age = latency["s"]
    if not usable(age):
        return [f"# GPS1_DELAY_MS left as it is: {why_not(age)}"]
    if not abs(age.value) > CERTAIN * age.sigma:
        return [f"# GPS1_DELAY_MS left as it is: the fixes' age, {with_sigma(age, 's')}, may as well be zero"]
    milliseconds = round(1e3 * age.value)
    if not 1 <= milliseconds <= MOST_DELAY_MS:
        return [
            f"# GPS1_DELAY_MS left as it is: fixes are {with_sigma(age, 's')} old, and it holds 1 to {MOST_DELAY_MS} ms"
        ]
    return [
        f"# age of the fixes {with_sigma(age, 's')} against their stamps in the log: right if those are",
        "# ArduPilot's own times of arrival. Before ArduPilot 4.6 it is GPS_DELAY_MS.",
        f"GPS1_DELAY_MS,{milliseconds}",
    ]


def _heading(offset: Estimate) -> list[str]:
    """A comment: which compass was logged, and whether with a declination, is not known here."""
    if not usable(offset):
        return [f"# Heading offset: {why_not(offset)}."]
    clockwise_rad = math.radians(offset.value)
    return [
        f"# Heading offset {with_sigma(offset, 'deg')} counter-clockwise: the logged compass reads too far left.",
        f"# What to add to its clockwise reading is {clockwise_rad:+.6f} rad. That is COMPASS_DEC",
        "# (and COMPASS_AUTODEC 0) only if the log holds ArduPilot's own compass heading without any declination:",
        "# no line sets it.",
    ]
