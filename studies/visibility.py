"""A rough signal-to-noise figure: how many nats an effect is worth in a log, before anybody looks for it.

The effect alone is simulated once more, without any noise, and its log is cut into windows. In each window three
differences are formed that would be zero without it, once radii, track and offset are free:

    turn    the turn that the AHRS tells − the turn that the wheels tell
    along   the way between two fixes, along the heading − the way that the wheels tell
    across  the way between two fixes, across the heading as the AHRS tells it

Each is weighed by the noise of that scenario (white and slow parts of heading and fixes, slip), the constants' columns
are projected out by least squares, and half the sum of the squared rest is the figure. Windows of half a second see
what is quick, windows of ten seconds what is slow; the larger sum counts. What other effects could explain is not taken
out, and slow errors are treated as if windows were independent: good within a factor of some three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studies.antenna import antenna_m
from studies.arrays import FloatArray, floats
from studies.compass import readings_rad
from studies.robot import Scenario, Simulated, simulate

MINIMUM_NATS = 60.0
"""Below this an effect of a study counts as invisible, and another drive or size is drawn.

A finding has to gain some ten nats after all other effects have had their part; the rest is room for the roughness.
"""
WINDOWS_S = (0.5, 10.0)


@dataclass(frozen=True)
class Windows:
    """What an effect does in each window, and what the wheels tell of it."""

    length_s: float
    told_m: FloatArray
    told_turn_rad: FloatArray
    turn_rad: FloatArray
    along_m: FloatArray
    across_m: FloatArray


def visible_nats(scenario: Scenario, name: str) -> float:
    """How visible one of a scenario's effects is."""
    alone = simulate(scenario.with_only(name))
    return max(_nats(_windows(alone, length_s), scenario) for length_s in WINDOWS_S)


def _windows(alone: Simulated, length_s: float) -> Windows:
    """The three differences of a log without noise."""
    motion, robot, effects = alone.motion, alone.scenario.robot, alone.scenario.effects
    edge_s = np.arange(1.0, alone.scenario.plan.total_s - 1.0, length_s)
    right, left = (
        radius_m * np.diff(np.interp(edge_s, motion.t_s, told))
        for radius_m, told in zip((robot.radius_right_m, robot.radius_left_m), alone.told_rad, strict=True)
    )
    told_m, told_turn = 0.5 * (right + left), (right - left) / robot.track_m
    heading = np.interp(edge_s, motion.t_s, motion.heading_rad)
    error = readings_rad(motion, effects, alone.columns, edge_s, 0.0) - heading
    fix = np.stack(antenna_m(motion, effects, alone.terrain, edge_s))
    dead = _dead_reckoned(alone, edge_s)
    middle = 0.5 * (heading[1:] + heading[:-1])
    way_east, way_north = np.diff(fix, axis=1)
    along = way_east * np.cos(middle) + way_north * np.sin(middle)
    across = -way_east * np.sin(middle) + way_north * np.cos(middle)
    error_middle = 0.5 * (error[1:] + error[:-1])
    return Windows(
        length_s,
        told_m,
        told_turn,
        np.diff(error) + np.diff(heading) - told_turn,
        along - dead[0],
        across - dead[1] - told_m * error_middle,
    )


def _dead_reckoned(alone: Simulated, edge_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Along and across the true middle heading of each window: the way of the wheels' travel on the true headings."""
    motion, robot = alone.motion, alone.scenario.robot
    right, left = alone.told_rad
    step_m = 0.5 * (robot.radius_right_m * np.diff(right) + robot.radius_left_m * np.diff(left))
    heading = 0.5 * (motion.heading_rad[1:] + motion.heading_rad[:-1])
    east, north = (
        np.diff(np.interp(edge_s, motion.t_s, np.concatenate(([0.0], np.cumsum(step_m * way)))))
        for way in (np.cos(heading), np.sin(heading))
    )
    at_edge = np.interp(edge_s, motion.t_s, motion.heading_rad)
    middle = 0.5 * (at_edge[1:] + at_edge[:-1])
    return floats(east * np.cos(middle) + north * np.sin(middle)), floats(
        -east * np.sin(middle) + north * np.cos(middle)
    )


def _nats(windows: Windows, scenario: Scenario) -> float:
    """Half the weighed and projected sum of squares over the three differences."""
    noise, told = scenario.noise, scenario.instruments
    length_s, way_m = windows.length_s, np.abs(windows.told_m)
    reads = max(1.0, min(told.ahrs_hz, 10.0) * length_s)
    seen = max(1.0, told.fix_hz * length_s)
    thinned = min(1.0, told.fix_hz * length_s)
    white, slow = np.radians(noise.heading_white_deg), np.radians(noise.heading_slow_deg)
    fresh_heading = 1.0 - np.exp(-length_s / noise.heading_slow_s)
    fresh_fix = 1.0 - np.exp(-length_s / noise.fix_slow_s)
    slip_2 = noise.slip_m_per_sqrt_m**2 * way_m
    fix_2 = 2.0 * noise.fix_white_m**2 / seen + 2.0 * noise.fix_slow_m**2 * fresh_fix + 1e-6
    turn_2 = 2.0 * white**2 / reads + 2.0 * slow**2 * fresh_heading + 2.0 * slip_2 / scenario.robot.track_m**2 + 1e-8
    lasting = slow**2 * max(1.0, 2.0 * noise.heading_slow_s / length_s)
    across_2 = fix_2 + way_m**2 * (white**2 / reads + lasting)
    constants = [windows.told_m, windows.told_turn_rad]
    return float(
        _half_square(windows.turn_rad, turn_2, constants)
        + thinned * _half_square(windows.along_m, fix_2 + 0.5 * slip_2, constants)
        + thinned * _half_square(windows.across_m, across_2, constants)
    )


def _half_square(signal: FloatArray, variance: FloatArray, constants: list[FloatArray]) -> float:
    """½ Σ r²/σ² of what is left of a signal after a weighed fit of the constants' columns."""
    root = 1.0 / np.sqrt(variance)
    design = np.stack(constants, axis=1) * root[:, None]
    weighed = signal * root
    rest = weighed - design @ np.linalg.lstsq(design, weighed, rcond=None)[0]
    return 0.5 * float(rest @ rest)
