"""What acts on the right wheel, on the left one, or on both alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from sccal.arrays import Floats
from sccal.effects.effect import Column
from sccal.effects.view import Steps
from sccal.effects.words import Measured, percent
from sccal.simulate.world import WheelPair

Wheels = tuple[Literal["right", "left"], ...]


def wheel_columns(parameter: str, wheels: Wheels, steps: Steps, share: Floats) -> tuple[Column, ...]:
    """Columns of a parameter that is a share (n,) of the travel of some wheels in each step."""
    found = []
    if "right" in wheels:
        found.append(Column(parameter, "right_wheel", steps.right_m * share))
    if "left" in wheels:
        found.append(Column(parameter, "left_wheel", steps.left_m * share))
    return tuple(found)


def wheels_turned(wheels: Wheels, angle_rad: WheelPair, turned: Callable[[Floats], Floats]) -> WheelPair:
    """Cumulative angles of both wheels, those of some of them put through a function."""
    return WheelPair(
        left=turned(angle_rad.left) if "left" in wheels else angle_rad.left,
        right=turned(angle_rad.right) if "right" in wheels else angle_rad.right,
    )


def changes(wheels: Wheels, whose: str, share: Measured) -> str:
    """Whose radius grows or shrinks by a share: "both wheels' radii shrink by 2.00 %"."""
    verb = "grow" if share.value > 0.0 else "shrink"
    return f"{whose} {verb}{'s' if len(wheels) == 1 else ''} by {percent(share)}"
