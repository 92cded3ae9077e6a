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
from sccal.effects.drive_shape import DriveShape
from sccal.effects.view import DriveView
from sccal.effects.words import Measured
from sccal.simulate.physics import Physics

MotionPort = Literal["along", "side", "turn", "right_wheel", "left_wheel"]
FixPort = Literal["antenna_forward", "antenna_left", "east", "north"]
Port = MotionPort | Literal["heading"] | FixPort
"""along, side, right_wheel, left_wheel in m, turn and heading in rad, the rest in m; see sccal.filter.kernel."""

Scope = Literal["vehicle", "run"]
Cause = Literal["heading", "speed", "turn_rate", "acceleration", "time", "pitch", "roll", "east"]
"""What a residual may be drawn against."""
Search = Literal["none", "scale", "moment", "place"]
Stream = Literal["headings", "fixes", "motion"]
Stage = Literal["wheels", "ground", "body"]
"""What the counters say becomes the wheels' travel, this the body's motion, and this what late readings show."""
STAGES: tuple[Stage, ...] = ("wheels", "ground", "body")


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
    default: float | None = None
    """Of a shape: the value at which the effect is an ordinary linear candidate; None: it has to be searched for."""
    unsaid: float | None = None
    """Of a shape without default: its value in a simulation that is not told one; None: it has to be told."""
    hidden_sigma: float = 0.0
    """Part of its uncertainty that no log shows, in its unit."""

    @property
    def left_out(self) -> float | None:
        """Its value in a simulation that is not told one; None where it has to be told."""
        if not self.shape:
            return None
        return self.unsaid if self.default is None else self.default


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
    bends_heading: bool = False
    """Whether its columns at the heading follow its own values or the robot's heading, as iron's do."""
    stage: Stage = "ground"
    """Where it stands between the counters and the body: what comes later is made of what the earlier leave."""
    is_antenna: bool = False
    """Whether its two parameters are where the antenna stands, forward and left: the path shows that roughly."""
    on_every_robot: bool = False
    """Whether every robot with a receiver has some of it, so that a drive that cannot show it is worth a word."""
    shown_against: Cause = "time"
    """The quantity that its residual follows, to draw it against."""
    search: Search = "none"
    """How its shapes are found: a size on a grid and refined, a moment of the run, a place; none where it has none."""
    beside: str = ""
    """An effect that is free wherever this one is: what the alignment has put right of this one, it takes back."""
    undone_for: Stream | None = None
    """The stream whose stamps the alignment moves where this effect is large: it is then found before the fit."""
    suspect_stream: Stream = "motion"
    """Of a moment or a place: the measurements whose innovations are large there."""

    def says(self, found: Mapping[str, Measured]) -> str:
        """What a machine with these values does, as a clause of a sentence: "the wheels read 0.04 m/s too fast".

        ``found`` holds finite values, of all parameters but shapes with a default, which may be missing. The title
        where no words say more.
        """
        return self.title

    def shown_by(self, drive: DriveShape) -> bool | None:
        """Whether a drive of this shape would show it, by a rule of thumb; None where there is no such rule."""
        return None

    def hidden_sigma(self, parameter: Parameter, duration_s: float) -> float:
        """Part of a parameter's uncertainty that no run of that length shows, in file units."""
        return parameter.hidden_sigma

    def shape_grid(self, drive: DriveView) -> tuple[Mapping[str, float], ...]:
        """Few values of its shapes at which it competes as a linear candidate in this drive before they are refined.

        For ``search`` "scale"; empty where no value of the shapes makes it anything that this drive could show.
        """
        return ()

    def fix_delay_s(self, drive: DriveView, at: Mapping[str, float]) -> Floats | None:
        """How much older the fixes are than their stamps say, (f,) s; None for effects that have nothing to do with it.

        What else acts on the antenna then acts in the direction in which the robot stood that much earlier.
        """
        return None

    def heading_delay_s(self, at: Mapping[str, float]) -> float:
        """How much older the AHRS readings are than their stamps say."""
        return 0.0

    def shown_turning(self, drive: DriveView, at: Mapping[str, float], turn_rad: Floats) -> Floats | None:
        """What it adds to the readings (h, k) where the robot turned further, by (n, k) in the motion events.

        None for effects that do not depend on how the robot turned. What else turns the robot is then seen through it.
        """
        return None

    @abstractmethod
    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        """Columns of all parameters that are not shapes; ``at`` holds the current values of all (file units).

        Where the effect is not linear, a column is its derivative at zero, and elsewhere values times columns add up to
        the whole effect at ``at``: refitting with columns made at the last answer ends at the exact effect. A shape
        with a value of its own (``left_out``) may be missing in ``at``.
        """

    @abstractmethod
    def physics(self, values: Mapping[str, float]) -> Physics:
        """The exact effect for the simulator, parameters in file units. A real machine with these values does this."""
