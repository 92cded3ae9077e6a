"""What the rims run, taken apart into along and turn; for the physics of effects in which the wheels slip.

along = (right + left)/2      turn · L = right − left
"""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats
from sccal.simulate.world import Motion, WheelPair


def stretch_along(travel_m: WheelPair, factor: Floats) -> WheelPair:
    """The rims run ``factor`` times as far along, and turn as before."""
    more = 0.5 * (travel_m.left + travel_m.right) * (factor - 1.0)
    return WheelPair(left=travel_m.left + more, right=travel_m.right + more)


def stretch_turn(travel_m: WheelPair, factor: Floats) -> WheelPair:
    """The rims turn ``factor`` times as far, and run along as before."""
    more = 0.5 * (travel_m.right - travel_m.left) * (factor - 1.0)
    return WheelPair(left=travel_m.left - more, right=travel_m.right + more)


def speed_mps(motion: Motion) -> Floats:
    """Of the body, forward, in each step."""
    return np.asarray(motion.steps.along_m / motion.step_s)


def turn_rate_radps(motion: Motion) -> Floats:
    """Of the body in each step."""
    return np.asarray(motion.steps.turn_rad / motion.step_s)


def speeding_up_mps2(motion: Motion) -> Floats:
    """Growth of the body's speed, whichever way it drives, in each step; negative while it brakes."""
    speed = speed_mps(motion)
    return np.asarray(np.sign(speed) * np.gradient(speed, motion.step_s))


def loss_solved(loss: Floats) -> Floats:
    """The factor f with f (1 − loss · f) = 1: what the wheels do where each unit of it costs ``loss`` of itself.

    Beyond loss = 1/4 the wheels cannot do what the body does; f stays at 2 there.
    """
    return np.asarray(2.0 / (1.0 + np.sqrt(np.maximum(1.0 - 4.0 * loss, 0.0))))
