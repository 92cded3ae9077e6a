"""Shapes without a name: what a residual may follow when no effect of the catalogue explains it.

Each is a port and a few columns of one quantity (time, speed, heading, …), tried like any effect. They are there to say
where something is missing and what it follows, and to keep an effect with a name from taking the blame for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Cause, Column, Effect, Parameter, Port
from sccal.effects.view import DriveView
from sccal.errors import UsageError
from sccal.simulate.physics import Physics

TURNING_RADPS = 0.1
PRIOR = {"heading": 0.1, "turn": 0.1, "along": 0.05, "side": 0.05}
"""rad of heading; share of the turning or of the travel."""
PRIOR_M = 0.3
REACH = 20.0
_SHOWN: tuple[tuple[str, Cause], ...] = (
    ("heading", "heading"),
    ("side of the", "turn_rate"),
    ("turn rate", "turn_rate"),
    ("speed", "speed"),
    ("direction of travel", "speed"),
    ("acceleration", "acceleration"),
    ("pitch", "pitch"),
    ("roll", "roll"),
    ("place", "east"),
)
"""What a residual is drawn against, by how the quantity that it follows begins; time for all others."""

Shapes = Callable[[DriveView], Sequence[Floats]]


class Pattern(Effect):
    """A port and the quantity that the residual there follows."""

    looks_like = "a residual that follows one quantity"
    excited_by = "let the quantity vary while everything else stays as it is"
    reference = "regression of the innovations"

    def __init__(self, port: Port, depends_on: str, shapes: Shapes, count: int) -> None:
        self.port, self.depends_on, self.shapes = port, depends_on, shapes
        self.name = f"{port} with {depends_on}"
        self.title = f"{port} follows {depends_on}"
        self.shown_against = next((cause for word, cause in _SHOWN if depends_on.startswith(word)), "time")
        sigma = PRIOR.get(port, PRIOR_M)
        unit = {"heading": "rad"}.get(port, "1")
        self.parameters = tuple(
            Parameter(f"p{k}", unit, sigma, -REACH * sigma, REACH * sigma, matters=0.05 * sigma) for k in range(count)
        )

    def __reduce__(self) -> tuple[Callable[[str], Pattern], tuple[str]]:
        """To another process by name: what makes the columns cannot be sent."""
        return _named, (self.name,)

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        return tuple(
            Column(one.name, self.port, np.asarray(values, dtype=np.float64))
            for one, values in zip(self.parameters, self.shapes(drive), strict=True)
        )

    def physics(self, values: Mapping[str, float]) -> Physics:
        """Raises UsageError: a pattern is a description, not a cause."""
        raise UsageError(f"effect {self.name}: a pattern cannot be simulated")


def _harmonics(angle: Floats, order: int) -> list[Floats]:
    return [np.cos(order * angle), np.sin(order * angle)]


def _waves(drive: DriveView, t_s: Floats, order: int) -> list[Floats]:
    """Half waves over the run: slow changes of any form, without their mean."""
    phase = np.pi * (t_s - drive.start_s) / max(drive.duration_s, 1.0)
    return [np.cos(k * phase) for k in range(1, order + 1)]


def _place(east: Floats, north: Floats, order: int) -> list[Floats]:
    """Half waves over the area driven, in either direction and across."""
    x, y = (np.pi * (one - one.min()) / max(float(np.ptp(one)), 1.0) for one in (east, north))
    waves = [np.cos(k * x) for k in range(1, order + 1)] + [np.cos(k * y) for k in range(1, order + 1)]
    return [*waves, np.cos(x) * np.cos(y)]


def _last_turn(rate: Floats) -> Floats:
    """+1 or −1: to which side the robot turned last."""
    turning = np.where(np.abs(rate) > TURNING_RADPS, np.sign(rate), 0.0)
    last = np.maximum.accumulate(np.where(turning != 0.0, np.arange(rate.size), 0))
    return np.asarray(turning[last])


def _heading_patterns() -> list[Pattern]:
    def heading(depends_on: str, shapes: Shapes, count: int) -> Pattern:
        return Pattern("heading", depends_on, shapes, count)

    return [
        heading("heading (third harmonic)", lambda d: _harmonics(d.headings.yaw_rad, 3), 2),
        heading("heading (fourth harmonic)", lambda d: _harmonics(d.headings.yaw_rad, 4), 2),
        heading("speed (squared)", lambda d: [d.headings.speed_mps * np.abs(d.headings.speed_mps)], 1),
        heading("turn rate (size)", lambda d: [np.abs(d.headings.turn_rate_radps)], 1),
        heading("side of the last turn", lambda d: [_last_turn(d.headings.turn_rate_radps)], 1),
        heading("acceleration", lambda d: [d.headings.acceleration_mps2], 1),
        heading("time", lambda d: _waves(d, d.headings.t_s, 6), 6),
        heading("place", lambda d: _place(d.headings.east_m, d.headings.north_m, 2), 5),
    ]


def _along_patterns() -> list[Pattern]:
    def along(depends_on: str, factor: Callable[[DriveView], Sequence[Floats]], count: int) -> Pattern:
        return Pattern("along", depends_on, lambda d: [d.steps.along_m * one for one in factor(d)], count)

    return [
        along("time", lambda d: _waves(d, d.steps.t_s, 4), 4),
        along("heading", lambda d: _harmonics(d.step_yaw_rad, 1), 2),
        along("place", lambda d: _place(*d.step_place_m, 2), 5),
        along("direction of travel", lambda d: [np.where(d.steps.speed_mps < 0, 1.0, 0.0)], 1),
        along("speed (squared)", lambda d: [d.steps.speed_mps**2], 1),
        along("pitch", lambda d: [d.steps.pitch_rad], 1),
    ]


def _turn_patterns() -> list[Pattern]:
    def turn(depends_on: str, shapes: Shapes, count: int) -> Pattern:
        return Pattern("turn", depends_on, shapes, count)

    def scaled(factors: Callable[[DriveView], Sequence[Floats]]) -> Shapes:
        return lambda d: [d.steps.turn_rad * one for one in factors(d)]

    def pulled(factors: Callable[[DriveView], Sequence[Floats]]) -> Shapes:
        return lambda d: [np.abs(d.steps.along_m) * one for one in factors(d)]

    return [
        turn("side of the turn", scaled(lambda d: [np.sign(d.steps.turn_rate_radps)]), 1),
        turn("speed", scaled(lambda d: [np.abs(d.steps.speed_mps)]), 1),
        turn("time", scaled(lambda d: _waves(d, d.steps.t_s, 4)), 4),
        turn("place", scaled(lambda d: _place(*d.step_place_m, 2)), 5),
        turn("direction of travel", pulled(lambda d: [np.where(d.steps.speed_mps < 0, 1.0, 0.0)]), 1),
        turn("roll", pulled(lambda d: [d.steps.roll_rad]), 1),
        turn("heading", pulled(lambda d: _harmonics(d.step_yaw_rad, 1)), 2),
        turn("speed squared (pull to one side)", pulled(lambda d: [d.steps.speed_mps]), 1),
        turn("acceleration", pulled(lambda d: [d.steps.acceleration_mps2]), 1),
    ]


def _other_patterns() -> list[Pattern]:
    return [
        Pattern("side", "heading", lambda d: [d.steps.along_m * one for one in _harmonics(d.step_yaw_rad, 1)], 2),
        Pattern("side", "time", lambda d: [d.steps.along_m * one for one in _waves(d, d.steps.t_s, 3)], 3),
        Pattern("antenna_forward", "acceleration", lambda d: [d.fixes.acceleration_mps2], 1),
        Pattern("antenna_left", "turn rate", lambda d: [d.fixes.turn_rate_radps], 1),
        Pattern("east", "time", lambda d: _waves(d, d.fixes.t_s, 4), 4),
        Pattern("north", "time", lambda d: _waves(d, d.fixes.t_s, 4), 4),
    ]


PATTERNS: tuple[Pattern, ...] = (
    *_heading_patterns(),
    *_along_patterns(),
    *_turn_patterns(),
    *_other_patterns(),
)


def _named(name: str) -> Pattern:
    return next(one for one in PATTERNS if one.name == name)
