"""A model as a diagnosis judged it, to start from again: effects in their shapes, constants, and noise by run."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import MISSING, fields
from pathlib import Path

from sccal.align import Aligned
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect
from sccal.effects.logged import LoggedColumn
from sccal.errors import DataError, UsageError
from sccal.evidence.extension import Free, effect_by_name
from sccal.logs.streams import Notice, Vehicle
from sccal.results.converter import document_of, json_text, name_in_files
from sccal.results.files import read_model
from sccal.results.model import JudgedEffect, JudgedModel
from sccal.results.noise import Noise

SAME_SIZE = 1e-9
"""Relative difference up to which nominal sizes are the same."""
NOISE_LEVELS = tuple(one.name for one in fields(Noise) if one.default is MISSING and one.default_factory is MISSING)
"""What a noise cannot do without."""


def read_judged_model(path: Path) -> JudgedModel:
    """A model from its file, to calibrate with.

    Raises:
        UsageError: there is no such file.
        DataError: it is no model of the schema, or not of this version's effects; the message says what is wrong.
    """
    if not path.is_file():
        raise UsageError(f"--model {path}: no such file; `sccal diagnose` writes OUT/model.json")
    model = read_model(path)
    for place, what in _wrong(model):
        raise DataError(f"{path}: {place}: {what}")
    return model


def digest_of(model: JudgedModel) -> str:
    """SHA-256 of a model's content in hex: the same model, the same effects and noise."""
    document = {name: block for name, block in document_of(model).items() if name != "sccal_version"}
    return hashlib.sha256(json_text(document).encode()).hexdigest()


def _wrong(model: JudgedModel) -> Iterator[tuple[str, str]]:
    """What would not do for a calibration: its place in the file, and why."""
    for number, noise in enumerate(model.noises.values()):
        levels = (name for name in NOISE_LEVELS if not getattr(noise, name) > 0.0)
        yield from ((f"noise[{number}].{name_in_files(name)}", "must be a number above zero") for name in levels)
    for number, one in enumerate(model.effects):
        place = f"effects[{number}]"
        if not one.prior_scale > 0.0:
            yield f"{place}.prior_scale", "must be above zero"
        if "~" in one.name and (one.column is None or not one.column.spread > 0.0):
            yield f"{place}.column.spread", "must be above zero"
        yield from ((f"{place}.{part}", why) for part, why in _unlike_its_kind(one))


def _unlike_its_kind(one: JudgedEffect) -> Iterator[tuple[str, str]]:
    """What this version's effect of that name needs to be made again, and what it does not know."""
    if "~" in one.name:
        if one.shapes:
            yield "shapes", "a logged column has none"
        return
    if one.name not in CATALOGUE:
        yield "effect", f"no effect called {one.name!r}; there are {', '.join(CATALOGUE)}"
        return
    own = {parameter.name: parameter for parameter in CATALOGUE[one.name].parameters}
    for part, named in (("parameters", one.parameters), ("shapes", one.shapes)):
        for key in named:
            if key not in own or own[key].shape is not (part == "shapes"):
                yield f"{part}.{key}", f"{one.name} has no such one; it has {', '.join(own)}"
    for name, parameter in own.items():
        if parameter.shape and parameter.default is None and name not in one.shapes:
            yield f"shapes.{name}", f"is missing, and {one.name} is nothing without it"


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
