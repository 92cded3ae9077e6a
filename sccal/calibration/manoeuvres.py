"""What was driven, by the wheels: straight lines, arcs and spins to both sides, and backwards.

Straight lines show the radii and the heading offset, turning shows the track, and both sides tell one from the other.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from sccal.align import Aligned
from sccal.arrays import Bools, Floats
from sccal.results.calibration import Manoeuvre

STEP_S = 0.5
STANDING_MPS = 0.02
STRAIGHT_RADIUS_M = 20.0
"""An arc of a larger radius counts as straight."""
SPIN_RADIUS_TRACKS = 0.25
"""A turn about a point this near the middle, in track widths, counts as a turn in place: the wheels run against each
other."""

Kind = Literal["straight", "straight_back", "arc_left", "arc_right", "spin_left", "spin_right", "standing"]


def describe_manoeuvres(aligned: Aligned, values: Floats) -> tuple[Manoeuvre, ...]:
    """Every kind that the run has, from steps of STEP_S; values (4 + m,) begin with R_r, R_l and L."""
    first, last = aligned.span_s
    t_s = np.arange(first, last, STEP_S)
    if t_s.size < 2:
        return ()
    right = values[0] * np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.right_rad))
    left = values[1] * np.diff(np.interp(t_s, aligned.wheel_t_s, aligned.left_rad))
    travel, turn = 0.5 * (right + left), (right - left) / values[2]
    rim = np.maximum(np.abs(right), np.abs(left)) / STEP_S
    standing = rim < STANDING_MPS
    spinning = ~standing & (np.abs(travel) < SPIN_RADIUS_TRACKS * values[2] * np.abs(turn))
    straight = ~standing & ~spinning & (np.abs(travel) > STRAIGHT_RADIUS_M * np.abs(turn))
    arc = ~standing & ~spinning & ~straight
    rows: dict[Kind, Bools] = {
        "straight": straight & (travel > 0),
        "straight_back": straight & (travel <= 0),
        "arc_left": arc & (turn > 0),
        "arc_right": arc & (turn <= 0),
        "spin_left": spinning & (turn > 0),
        "spin_right": spinning & (turn <= 0),
        "standing": standing,
    }
    found = []
    for kind in get_args(Kind):
        some = rows[kind]
        if some.any():
            low, high = np.quantile(rim[some], (0.05, 0.95))
            found.append(
                Manoeuvre(
                    kind,
                    STEP_S * float(some.sum()),
                    float(np.abs(travel[some]).sum()),
                    float(np.abs(turn[some]).sum()),
                    (float(low), float(high)),
                )
            )
    return tuple(found)
