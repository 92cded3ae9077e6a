"""Speed offset: a source of wheel speed that reads too fast by a constant while the robot moves.

along = s − p sign(v) dt while |v| is above a crawl      nothing where it stands or spins in place

Where a source begins to read too much is its maker's secret, and a robot that works slowly spends much of its time
there: the crawl is a shape, refined where the effect is in the model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.rims import speed_mps
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair

_CRAWL_MPS = 0.02


def way(read_mps: Floats, offset_mps: float, crawl_mps: float) -> Floats:
    """Direction of travel by the speed read, forward 1, backward −1, and 0 below a crawl, without a jump.

    What is read jumps by the offset where the robot passes the crawl, and is a mean over SMOOTH_S: half-way up the jump
    is the moment itself, and a limit at the crawl would take each stop for shorter than it was.
    """
    half_way = max(crawl_mps, 1e-3) + 0.5 * max(offset_mps, 0.0)
    return np.asarray(np.sign(read_mps) * np.clip(np.abs(read_mps) / half_way - 0.5, 0.0, 1.0))


class SpeedOffset(Effect):
    """What the wheels' speed reads too fast, m/s, forwards and backwards alike, and above which speed it does."""

    name = "speed_offset"
    stage = "wheels"
    title = "wheel speed that reads too fast by a constant"
    parameters = (
        Parameter("mps", "m/s", 0.05, -0.5, 0.5, matters=0.005),
        Parameter("above_mps", "m/s", 0.1, 0.0, 0.5, shape=True, default=_CRAWL_MPS),
    )
    looks_like = "both radii seem smaller on slow stretches than on fast ones, in proportion to the time they take"
    excited_by = "drive the same straight slowly and fast: at one speed it is the same as smaller wheels"
    reference = "UN Regulation No. 39: a speedometer may read too fast by a tenth and by 4 km/h, and never too slow"
    shown_against = "speed"
    search = "scale"

    def says(self, found: Mapping[str, Measured]) -> str:
        pace = "fast" if found["mps"].value > 0.0 else "slow"
        return f"the wheels read {size(found['mps'])} m/s too {pace} while the robot moves"

    def shape_grid(self, drive: DriveView) -> tuple[Mapping[str, float], ...]:
        return ({"above_mps": _CRAWL_MPS},)

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        moving = way(drive.steps.speed_mps, at["mps"], at.get("above_mps", _CRAWL_MPS))
        return (Column("mps", "along", -moving * drive.steps.dt_s),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Fast(values["mps"], values.get("above_mps", _CRAWL_MPS))


@dataclass(frozen=True)
class _Fast(Physics):
    mps: float
    above_mps: float = _CRAWL_MPS

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        above = {} if self.above_mps == _CRAWL_MPS else {"above_mps": self.above_mps}
        return {"speed_offset": {"mps": self.mps, **above}}

    def wheel_travel(self, motion: Motion, travel_m: WheelPair) -> WheelPair:
        speed = speed_mps(motion)
        more = np.where(np.abs(speed) > self.above_mps, np.copysign(self.mps * motion.step_s, speed * self.mps), 0.0)
        return WheelPair(left=travel_m.left + more, right=travel_m.right + more)
