"""What an effect is: parameters, the columns through which it enters the filter, and its exact physics.

Each parameter p adds p · c(t) at one or more ports, c a column computed from the log beforehand. "Held at zero" is a
parameter without variance, not another code path. The physics, used by the simulator only, is written without the
columns, so that each can be tested against the other.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from sccal.arrays import Floats
from sccal.effects.view import DriveView
from sccal.simulate.physics import Physics

MotionPort = Literal["along", "side", "turn", "right_wheel", "left_wheel"]
FixPort = Literal["antenna_forward", "antenna_left", "east", "north"]
Port = MotionPort | Literal["heading"] | FixPort
"""along, side, right_wheel, left_wheel in m, turn and heading in rad, the rest in m; see sccal.filter.kernel."""

Scope = Literal["vehicle", "run"]


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in the unit of the files."""

    name: str
    """As in the files: ``forward_m``."""
    unit: str
    prior_sigma: float
    lower: float
    upper: float
    scope: Scope = "vehicle"
    """Whether all runs of a vehicle share it."""
    matters: float = 0.0
    """Smallest size worth telling anybody; smaller ones are taken as always possible."""
    shape: bool = False
    """True for a place, a time or a size that its column depends on nonlinearly: searched for, never filtered."""


@dataclass(frozen=True)
class Column:
    """What one unit of a parameter adds at a port: one value per motion event, heading reading or fix."""

    parameter: str
    port: Port
    values: Floats


class Effect(ABC):
    """One physical effect."""

    name: str
    """As in the files: ``lever_arm``."""
    title: str
    """What it is, in a few words: "antenna off the middle between the wheels"."""
    parameters: tuple[Parameter, ...]
    looks_like: str
    """How it shows in a log that is fitted without it."""
    excited_by: str
    """What drive makes it visible, as advice: "turn both ways"."""
    reference: str

    @abstractmethod
    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        """Columns of all parameters that are not shapes; ``at`` holds the current values of all (file units).

        Where the effect is not linear, a column is its derivative at zero and its secant elsewhere: value times column
        is the whole effect at ``at``, so refitting with columns made at the last answer converges to the exact effect.
        """

    @abstractmethod
    def physics(self, values: Mapping[str, float]) -> Physics:
        """The exact effect for the simulator, parameters in file units. A real machine with these values does this."""
