"""What the counters of the wheels tell: lost counts, and a speed loop that is off by a constant."""

from __future__ import annotations

import numpy as np

from studies.arrays import Effects, FloatArray
from studies.motion import STEP_S, Motion
from studies.vehicles import Robot

CRAWL_MPS = 0.05
"""Below this speed of the body an offset of the wheel-speed source does not show."""


def told_angles_rad(motion: Motion, robot: Robot, effects: Effects) -> tuple[FloatArray, FloatArray]:
    """The cumulative angles that the counters stand for, right and left, on the grid of the truth.

        told = Σ Δφ (1 − ratio [|φ̇| > above]) + sign(v) offset dt / R [|v| > crawl]

    with v the speed of the body and R the wheel's own radius.
    """
    v = motion.body_v_in_step_mps
    offset_m = effects.get("speed_offset", {}).get("mps", 0.0) * STEP_S * np.sign(v) * (np.abs(v) > CRAWL_MPS)
    told = []
    for side, angle, radius_m in (
        ("right", motion.right_rad, robot.radius_right_m),
        ("left", motion.left_rad, robot.radius_left_m),
    ):
        turned = np.diff(angle)
        if missed := effects.get(f"missed_{side}"):
            turned = turned * (1.0 - missed["ratio"] * (np.abs(turned) / STEP_S > missed["above_radps"]))
        told.append(np.concatenate(([0.0], np.cumsum(turned + offset_m / radius_m))))
    return told[0], told[1]
