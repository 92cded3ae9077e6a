"""What competes: every effect of the catalogue that enters linearly, in each of its forms, and every logged column.

A logged column that is itself a function of the drive (the raw reading of a magnetometer is one of the heading, a motor
command one of the speed), or a copy of another, can say nothing that the effect behind it does not say better. Such
columns do not compete; they are told beside the effect that they follow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sccal.arrays import Floats
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect
from sccal.effects.logged import LoggedColumn, logged_effects
from sccal.effects.view import DriveView, Moments
from sccal.evidence.extension import Free

FOLLOWS = 0.98
"""Share of a column's variance that one quantity holds from which on it is that: its own 2 % are its sensor's noise."""
FOLLOWS_HEADING = 0.9
"""The same for two harmonics of the heading, which is itself known to some degrees only where iron is near: an error of
15° takes 7 % of a cosine's variance away. A cause that is no function of the heading holds a few per cent of it."""


@dataclass(frozen=True)
class Candidates:
    """Effects that may be free beside the paper's constants."""

    free: tuple[Free, ...]
    shadows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Logged columns at a port that do not compete, and the candidates that they follow."""

    @property
    def forms(self) -> dict[str, list[Free]]:
        """By effect: its forms, one for each value of its shapes that these drives can tell."""
        found: dict[str, list[Free]] = {}
        for one in self.free:
            found.setdefault(one.effect.name, []).append(one)
        return found


def linear_forms(effect: Effect, views: Sequence[DriveView]) -> list[Free]:
    """An effect as linear candidates: itself, or one for each of its shapes' values that these drives can tell."""
    if not any(one.shape for one in effect.parameters):
        return [Free(effect)]
    if effect.search != "scale":
        return []
    longest = max((effect.shape_grid(view) for view in views), key=len, default=())
    return [Free(effect, dict(shapes)) for shapes in longest]


def named_candidates(views: Sequence[DriveView]) -> list[Free]:
    """The catalogue's."""
    return [form for effect in CATALOGUE.values() for form in linear_forms(effect, views)]


def gather_candidates(views: Sequence[DriveView]) -> Candidates:
    """All that may compete in some runs of one vehicle."""
    named = named_candidates(views)
    columns = [Free(one) for one in logged_effects([view.logged for view in views])]
    kept, shadows = without_shadows(named, columns, views)
    return Candidates((*named, *kept), shadows)


def without_shadows(
    named: Sequence[Free], columns: Sequence[Free], views: Sequence[DriveView]
) -> tuple[list[Free], dict[str, tuple[str, ...]]]:
    """The columns that say something of their own, and the others with the candidates that they follow."""
    kept: list[Free] = []
    shadows: dict[str, tuple[str, ...]] = {}
    origin: dict[str, str] = {}
    for one in columns:
        effect = one.effect
        assert isinstance(effect, LoggedColumn)
        if effect.column not in origin:
            origin[effect.column] = _follows(effect.column, [name for name, of in origin.items() if not of], views)
        of = origin[effect.column]
        if not of:
            kept.append(one)
        elif of.startswith("column "):
            shadows[one.key] = (f"{effect.where}~{of.removeprefix('column ')}",)
        else:
            alike = [
                other for other in named if other.effect.shown_against == of and _port(other, views) == effect.port
            ]
            shadows[one.key] = tuple(dict.fromkeys(other.effect.name for other in alike))
    return kept, shadows


def _port(one: Free, views: Sequence[DriveView]) -> str:
    """Where a candidate acts first."""
    return one.effect.columns(views[0], {**{p.name: 0.0 for p in one.parameters}, **one.shapes})[0].port


def _follows(name: str, others: Sequence[str], views: Sequence[DriveView]) -> str:
    """What a column is a function of: heading, speed, turn_rate, acceleration, "column NAME"; empty for nothing."""
    seen = [view for view in views if name in view.logged]
    values = [view.logged_at(name, view.headings.t_s) for view in seen]
    harmonics = [[trig(k * view.headings.yaw_rad) for trig in (np.cos, np.sin) for k in (1, 2)] for view in seen]
    if _share(values, harmonics) > FOLLOWS_HEADING:
        return "heading"
    of_drive: dict[str, Callable[[Moments], Floats]] = {
        "speed": lambda at: at.speed_mps,
        "turn_rate": lambda at: at.turn_rate_radps,
        "acceleration": lambda at: at.acceleration_mps2,
    }
    for quantity, of in of_drive.items():
        for shape in (np.asarray, np.abs):
            if _share(values, [[shape(of(view.headings))] for view in seen]) > FOLLOWS:
                return quantity
    for other in others:
        if _share(values, [[view.logged_at(other, view.headings.t_s)] for view in seen]) > FOLLOWS:
            return f"column {other}"
    return ""


def _share(values: Sequence[Floats], basis: Sequence[Sequence[Floats]]) -> float:
    """Share of the variance of some runs' values that a constant per run and the basis hold."""
    y = np.concatenate([one - one.mean() for one in values])
    columns = np.concatenate([np.array([b - b.mean() for b in each]).T for each in basis])
    power = float(y @ y)
    if power <= 0.0:
        return 1.0
    left = y - columns @ np.linalg.lstsq(columns, y, rcond=1e-9)[0]
    return 1.0 - float(left @ left) / power
