"""The shape of a drive in a few numbers, and what it must hold for an effect to show: rules of thumb.

They answer where a log's streams cannot be brought together, so that no filter can be asked.
"""

from __future__ import annotations

import math
from typing import Protocol

TURN_RAD = math.pi
"""Turned in all, from which on a drive counts as one with turns."""
CLEARLY_FASTER = 1.6
BACK_M = 5.0
ROUND = 8
"""Of twelve sectors, those that a harmonic of the heading takes."""
SOME = 2


class DriveShape(Protocol):
    """What the robot did, by wheels or by fixes."""

    @property
    def reversed_m(self) -> float | None:
        """None where only fixes tell of motion."""

    @property
    def speed_median_mps(self) -> float:
        """While it moves."""

    @property
    def speed_max_mps(self) -> float: ...

    @property
    def turned_left_rad(self) -> float: ...

    @property
    def turned_right_rad(self) -> float: ...

    @property
    def headings(self) -> int:
        """Of twelve sectors, those that the robot moved in."""

    @property
    def arcs(self) -> int: ...

    @property
    def pivots(self) -> int: ...


def both_ways(drive: DriveShape) -> bool:
    """Half a turn to either side."""
    return min(drive.turned_left_rad, drive.turned_right_rad) > TURN_RAD


def much_faster(drive: DriveShape) -> bool:
    """Fast at times, measured by its usual speed."""
    return drive.speed_max_mps > CLEARLY_FASTER * drive.speed_median_mps


def two_speeds(drive: DriveShape) -> bool:
    """Fast at times or, which is another speed as well, backwards."""
    return much_faster(drive) or (drive.reversed_m or 0.0) > BACK_M


def all_round(drive: DriveShape) -> bool:
    """In headings enough to show what follows the heading."""
    return drive.headings >= ROUND


def spins(drive: DriveShape) -> bool:
    """In place."""
    return drive.pivots >= SOME
