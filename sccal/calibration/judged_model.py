"""A model as a diagnosis judged it, to start from again: effects in their shapes, constants, and noise by run."""

from __future__ import annotations

import math

from sccal.align import Aligned
from sccal.effects.effect import Effect
from sccal.effects.logged import LoggedColumn
from sccal.errors import UsageError
from sccal.evidence.extension import Free, effect_by_name
from sccal.logs.streams import Notice, Vehicle
from sccal.results.model import JudgedEffect, JudgedModel

SAME_SIZE = 1e-9
"""Relative difference up to which nominal sizes are the same."""


def free_effects(model: JudgedModel, aligned: Aligned) -> tuple[Free, ...]:
    """The effects that a run has, to be estimated in it.

    A column that the run does not log is left out: the log cannot show what follows it.
    """
    mine = [one for one in model.effects if one.run in ("", aligned.name)]
    mine = [one for one in mine if "~" not in one.name or one.name.partition("~")[2] in aligned.extras]
    return tuple(Free(_effect_of(one, aligned), dict(one.shapes), one.prior_scale) for one in mine)


def _effect_of(saved: JudgedEffect, aligned: Aligned) -> Effect:
    """The effect by its name; of a logged column with the reference that all runs share."""
    if saved.column is None:
        return effect_by_name(saved.name, aligned)
    where, _, column = saved.name.partition("~")
    return LoggedColumn(where, column, saved.column)


def check_vehicle(model: JudgedModel | None, vehicle: Vehicle) -> None:
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


def notices_on_vehicle(model: JudgedModel | None, vehicle: Vehicle) -> tuple[Notice, ...]:
    """A word where a model goes by the name of another vehicle."""
    if model is None or model.vehicle == vehicle.name:
        return ()
    what = f"vehicle of two names: {model.vehicle!r} in the model, {vehicle.name!r} in the run; taken as the same one"
    return (Notice("model", what, 1, "", "warning"),)
