"""A model as a diagnosis judged it, to start from again: effects in their shapes, constants, and noise by run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from sccal.align import Aligned
from sccal.calibration.result import Estimate, Parameters
from sccal.effects.effect import Effect
from sccal.effects.logged import LoggedColumn, Range
from sccal.errors import UsageError
from sccal.evidence.extension import Free, effect_by_name
from sccal.filter.levels import Noise
from sccal.logs.streams import Notice, Vehicle

SAME_SIZE = 1e-9
"""Relative difference up to which nominal sizes are the same."""


@dataclass(frozen=True)
class SavedEffect:
    """One effect of the model."""

    name: str
    title: str
    parameters: Mapping[str, Estimate]
    """In the files' units; of a run's parameter the mean over the runs."""
    units: Mapping[str, str]
    shapes: Mapping[str, float] = field(default_factory=dict)
    """Places, moments and time constants, as they were found."""
    run: str = ""
    """The run that it belongs to alone; empty for an effect of all runs."""
    told: bool = True
    """False for an effect too small to matter or too unsure to be told, which the model holds because it helps."""
    prior_scale: float = 1.0
    column: Range | None = None
    """Of an effect that follows a logged column: where its values lie over all runs, which its numbers refer to."""


@dataclass(frozen=True)
class SavedModel:
    """What model.json holds."""

    vehicle: str
    parameters: Parameters
    effects: tuple[SavedEffect, ...]
    noises: Mapping[str, Noise]
    """By run."""
    outage_end_rms_m: float | None
    """Drift of the model on data that fitted neither, and how it was judged."""
    how: str

    def free_effects(self, aligned: Aligned) -> tuple[Free, ...]:
        """The effects that a run has, to be estimated in it.

        A column that the run does not log is left out: the log cannot show what follows it.
        """
        mine = [one for one in self.effects if one.run in ("", aligned.name)]
        mine = [one for one in mine if "~" not in one.name or one.name.partition("~")[2] in aligned.extras]
        return tuple(Free(_effect_of(one, aligned), dict(one.shapes), one.prior_scale) for one in mine)


def _effect_of(saved: SavedEffect, aligned: Aligned) -> Effect:
    """The effect by its name; of a logged column with the reference that all runs share."""
    if saved.column is None:
        return effect_by_name(saved.name, aligned)
    where, _, column = saved.name.partition("~")
    return LoggedColumn(where, column, saved.column)


def check_vehicle(model: SavedModel | None, vehicle: Vehicle) -> None:
    """Raises UsageError where a model is another vehicle's: of another name, and of other nominal sizes."""
    if model is None or model.vehicle == vehicle.name:
        return
    p = model.parameters
    sizes = (
        (p.radius_right_m.nominal, vehicle.wheel_radius_m),
        (p.radius_left_m.nominal, vehicle.wheel_radius_m),
        (p.track_m.nominal, vehicle.track_m),
    )
    if not all(of_model is None or math.isclose(of_model, own, rel_tol=SAME_SIZE) for of_model, own in sizes):
        raise UsageError(
            f"--model is of the vehicle {model.vehicle!r}, and this run is of {vehicle.name!r}, whose wheels or track "
            "have another nominal size: diagnose the runs of this vehicle"
        )


def notices_on_vehicle(model: SavedModel | None, vehicle: Vehicle) -> tuple[Notice, ...]:
    """A word where a model goes by the name of another vehicle."""
    if model is None or model.vehicle == vehicle.name:
        return ()
    what = f"vehicle of two names: {model.vehicle!r} in the model, {vehicle.name!r} in the run; taken as the same one"
    return (Notice("model", what, 1, "", "warning"),)
