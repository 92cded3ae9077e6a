"""Where the antenna is: arms, heights, delays, clocks and bases."""

from __future__ import annotations

import numpy as np

from studies.arrays import Effects, FloatArray
from studies.compass import low_passed
from studies.motion import Motion
from studies.terrain import Terrain


def delay_s(effects: Effects, stamp_s: FloatArray) -> FloatArray:
    """How old a fix is by its own stamp: the latency, and t r / (1 + r) that a clock fast by r has gained."""
    rate = effects.get("clock_skew", {}).get("ppm", 0.0) * 1e-6
    return effects.get("gnss_latency", {}).get("s", 0.0) + stamp_s * rate / (1.0 + rate)


def antenna_m(motion: Motion, effects: Effects, terrain: Terrain, stamp_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """East and north of the antenna at the times that the stamps of the fixes mean, without noise."""
    t_s = stamp_s - delay_s(effects, stamp_s)
    if smoothing := effects.get("fix_smoothing"):
        # The receiver's filter takes in the antenna, arm and all.
        dense = [low_passed(one, smoothing["s"]) for one in unshifted_m(motion, effects, terrain, motion.t_s)]
        east, north = (np.interp(t_s, motion.t_s, one) for one in dense)
    else:
        east, north = unshifted_m(motion, effects, terrain, t_s)
    if shift := effects.get("base_shift"):
        after = stamp_s > shift["at_s"]
        east, north = east + shift["east_m"] * after, north + shift["north_m"] * after
    return east, north


def unshifted_m(motion: Motion, effects: Effects, terrain: Terrain, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """East and north of the antenna at some moments of the drive.

    With the arm (f, l, h) on a robot that is pitched by p (nose up) and rolled by r (left side up):

        forward = f cos p − l sin r sin p − h sin p cos r      left = l cos r − h sin r
    """
    east, north = np.interp(t_s, motion.t_s, motion.east_m), np.interp(t_s, motion.t_s, motion.north_m)
    heading = np.interp(t_s, motion.t_s, motion.heading_rad)
    arm, height_m = effects.get("lever_arm", {}), effects.get("antenna_height", {}).get("m", 0.0)
    f, l = arm.get("forward_m", 0.0), arm.get("left_m", 0.0)  # noqa: E741
    pitch, roll = terrain.tilts(east, north, heading)
    forward = f * np.cos(pitch) - l * np.sin(roll) * np.sin(pitch) - height_m * np.sin(pitch) * np.cos(roll)
    left = l * np.cos(roll) - height_m * np.sin(roll)
    return (
        east + forward * np.cos(heading) - left * np.sin(heading),
        north + forward * np.sin(heading) + left * np.cos(heading),
    )
