"""Effect columns put into the kernel's form: ports become numbers, parameters become states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sccal.align import Timeline
from sccal.arrays import Floats
from sccal.filter import layout
from sccal.filter.layout import Columns

MOTION_PORTS = {
    "along": layout.PORT_ALONG,
    "side": layout.PORT_SIDE,
    "turn": layout.PORT_TURN,
    "right_wheel": layout.PORT_RIGHT_WHEEL,
    "left_wheel": layout.PORT_LEFT_WHEEL,
}
FIX_PORTS = {
    "antenna_forward": layout.PORT_ANTENNA_FORWARD,
    "antenna_left": layout.PORT_ANTENNA_LEFT,
    "east": layout.PORT_EAST,
    "north": layout.PORT_NORTH,
}


class ColumnLike(Protocol):
    """What a column must have; the kernel's room knows no effect."""

    @property
    def port(self) -> str: ...

    @property
    def values(self) -> Floats: ...


@dataclass(frozen=True)
class Placed:
    """A column and the number of the parameter (0, 1, …) that scales it."""

    parameter: int
    column: ColumnLike


@dataclass(frozen=True)
class HeadingBend:
    """What makes the heading's columns exact where effects are not linear; (h,) each, see sccal.filter.kernel."""

    known_rad: Floats
    slope: Floats
    at_rad: Floats


def kernel_columns(placed: Sequence[Placed], timeline: Timeline, bend: HeadingBend | None = None) -> Columns:
    """The kernel's columns; the rows of each column must be those of its port."""
    straight = np.zeros(timeline.heading_index.size)

    def stack(chosen: list[Placed], rows: int) -> Floats:
        return np.array([one.column.values for one in chosen]).T.copy() if chosen else np.zeros((rows, 0))

    motion = [one for one in placed if one.column.port in MOTION_PORTS]
    heading = [one for one in placed if one.column.port == "heading"]
    fix = [one for one in placed if one.column.port in FIX_PORTS]
    return Columns(
        motion=stack(motion, timeline.t_s.size),
        motion_port=np.array([MOTION_PORTS[one.column.port] for one in motion], dtype=np.int32),
        motion_param=np.array([one.parameter for one in motion], dtype=np.int32),
        heading=stack(heading, timeline.heading_index.size),
        heading_param=np.array([one.parameter for one in heading], dtype=np.int32),
        heading_known=straight if bend is None else bend.known_rad,
        heading_slope=straight if bend is None else bend.slope,
        heading_at=straight if bend is None else bend.at_rad,
        fix=stack(fix, timeline.fix_index.size),
        fix_port=np.array([FIX_PORTS[one.column.port] for one in fix], dtype=np.int32),
        fix_param=np.array([one.parameter for one in fix], dtype=np.int32),
        fix_at=np.zeros(0),
    )
