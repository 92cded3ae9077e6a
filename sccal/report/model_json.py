"""model.json: schema ``sccal.model/1``, strict JSON, written by a diagnosis and read back for a calibration.

Angles in degrees, effects' parameters in the units that stand beside them; what is missing or not finite is null.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn, cast, get_args

from sccal import __version__
from sccal.effects.catalogue import CATALOGUE
from sccal.errors import DataError, UsageError
from sccal.report.as_json import Json, estimate_block, json_text, noise_block, parameter_blocks, strict_document
from sccal.results.calibration import Estimate, Noise, Parameters, Status
from sccal.results.model import JudgedEffect, JudgedModel, Range
from sccal.results.saved_model import MODEL_SCHEMA

_LEVELS = {
    "heading_white_deg": "heading_white_rad",
    "heading_coloured_deg": "heading_coloured_rad",
    "heading_tau_s": "heading_tau_s",
    "fix_scale": "fix_scale",
    "fix_coloured_m": "fix_coloured_m",
    "fix_tau_s": "fix_tau_s",
    "slip_m_per_sqrt_m": "slip_m_per_sqrt_m",
}
"""Levels of the noise by their names in the file."""


def model_json(m: JudgedModel) -> Json:
    """A model as a document."""
    return strict_document(
        {
            "schema": MODEL_SCHEMA,
            "sccal_version": __version__,
            "vehicle": m.vehicle,
            "parameters": parameter_blocks(m.parameters),
            "effects": [_effect(one) for one in m.effects],
            "noise": [{"run": run, **noise_block(noise)} for run, noise in m.noises.items()],
            "held_out": {"outage_end_rms_m": m.outage_end_rms_m, "how": m.how},
        }
    )


def digest_of(m: JudgedModel) -> str:
    """SHA-256 of a model's content in hex: the same model, the same effects and noise."""
    document = {name: block for name, block in model_json(m).items() if name != "sccal_version"}
    return hashlib.sha256(json_text(document).encode()).hexdigest()


def read_model(path: Path) -> JudgedModel:
    """A model from its file.

    Raises:
        UsageError: there is no such file.
        DataError: it is no model of the schema; the message says what is wrong.
    """
    if not path.is_file():
        raise UsageError(f"--model {path}: no such file; `sccal diagnose` writes OUT/model.json")
    try:
        document = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_number)
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"{path}: cannot be read as JSON ({error})") from error
    return model_from(document, path)


def model_from(document: object, path: Path) -> JudgedModel:
    """A model from its document; ``path`` is for messages. Raises DataError where a part is missing or wrong."""
    whole = _Block(document, path, "")
    schema = whole.get("schema")
    if schema != MODEL_SCHEMA:
        raise DataError(f"{path}: its schema is {schema!r}, not {MODEL_SCHEMA}; name the model.json of a diagnosis")
    parameters, held_out = whole.block("parameters"), whole.block("held_out")
    right, left, track, offset_deg = (
        _estimate_from(parameters.block(key))
        for key in ("radius_right_m", "radius_left_m", "track_m", "heading_offset_deg")
    )
    noises: dict[str, Noise] = {}
    for one in whole.blocks("noise"):
        noises[one.text("run")] = _noise_from(one)
    return JudgedModel(
        vehicle=whole.text("vehicle"),
        parameters=Parameters(right, left, track, _in_radians(offset_deg)),
        effects=tuple(_effect_from(one) for one in whole.blocks("effects")),
        noises=noises,
        outage_end_rms_m=held_out.number_or_none("outage_end_rms_m"),
        how=held_out.text("how"),
    )


def _effect(one: JudgedEffect) -> Json:
    return {
        "effect": one.name,
        "title": one.title,
        "parameters": {
            name: {**estimate_block(estimate), "unit": one.units.get(name, "")}
            for name, estimate in one.parameters.items()
        },
        "shapes": {name: {"value": value, "unit": one.units.get(name, "")} for name, value in one.shapes.items()},
        "run": one.run or None,
        "told": one.told,
        "prior_scale": one.prior_scale,
        "column": None if one.column is None else {"reference": one.column.reference, "spread": one.column.spread},
    }


def _effect_from(block: _Block) -> JudgedEffect:
    name, run = block.text("effect"), block.get("run")
    if run is not None and not isinstance(run, str):
        block.wrong("run", "must be the name of a run, or null")
    told = block.get("told")
    if not isinstance(told, bool):
        block.wrong("told", "must be true or false")
    parameters, shapes = block.block("parameters"), block.block("shapes")
    known = [*parameters.each(), *shapes.each()]
    effect = JudgedEffect(
        name=name,
        title=block.text("title"),
        parameters={key: _estimate_from(one) for key, one in parameters.each().items()},
        units={key: one.text("unit") for key, one in (*parameters.each().items(), *shapes.each().items())},
        shapes={key: one.number("value") for key, one in shapes.each().items()},
        run=run or "",
        told=told,
        prior_scale=block.number("prior_scale"),
        column=_column_from(block) if "~" in name else None,
    )
    if not effect.prior_scale > 0.0:
        block.wrong("prior_scale", "must be above zero")
    _check(name, known, set(effect.shapes), block)
    return effect


def _column_from(block: _Block) -> Range:
    column = block.block("column")
    found = Range(column.number("reference"), column.number("spread"))
    if not found.spread > 0.0:
        column.wrong("spread", "must be above zero")
    return found


def _check(name: str, known: list[str], shapes: set[str], block: _Block) -> None:
    """What this version's effects need to be made again is there, and nothing else."""
    if "~" in name:
        if shapes:
            block.wrong("shapes", "a logged column has none")
        return
    if name not in CATALOGUE:
        block.wrong("effect", f"no effect called {name!r}; there are {', '.join(CATALOGUE)}")
    own = {one.name: one for one in CATALOGUE[name].parameters}
    for key in known:
        if key not in own or own[key].shape is not (key in shapes):
            part = "shapes" if key in shapes else "parameters"
            block.wrong(f"{part}.{key}", f"{name} has no such one; it has {', '.join(own)}")
    lacking = [one.name for one in own.values() if one.shape and one.default is None and one.name not in shapes]
    if lacking:
        block.wrong(f"shapes.{lacking[0]}", f"is missing, and {name} is nothing without it")


def _estimate_from(block: _Block) -> Estimate:
    status = block.text("status")
    if status not in get_args(Status):
        block.wrong("status", f"must be one of {', '.join(get_args(Status))}")
    value, sigma = block.number_or_none("value"), block.number_or_none("sigma")
    return Estimate(
        math.nan if value is None else value,
        math.nan if sigma is None else sigma,
        cast(Status, status),
        block.text("reason"),
        block.number_or_none("nominal"),
        block.number_or_none("prior_sigma"),
    )


def _in_radians(offset: Estimate) -> Estimate:
    def turned(value: float | None) -> float | None:
        return None if value is None else math.radians(value)

    return replace(
        offset,
        value=math.radians(offset.value),
        sigma=math.radians(offset.sigma),
        nominal=turned(offset.nominal),
        prior_sigma=turned(offset.prior_sigma),
    )


def _noise_from(block: _Block) -> Noise:
    levels: dict[str, Any] = {}
    for key, field in _LEVELS.items():
        level = block.number(key)
        if not level > 0.0:
            block.wrong(key, "must be above zero")
        levels[field] = math.radians(level) if key.endswith("_deg") else level
    others: dict[int, float] = {}
    scales = block.block("other_fix_scale")
    for quality in scales.keys:
        if not quality.lstrip("-").isdigit():
            scales.wrong(quality, "is no quality of fixes, which is a whole number")
        others[int(quality)] = scales.number(quality)
    stated, apart = block.number_or_none("fix_stated_m"), block.number_or_none("apart_nats")
    return Noise(
        **levels,
        source=block.text("source"),
        other_fix_scale=others,
        fix_stated_m=math.nan if stated is None else stated,
        apart_nats=0.0 if apart is None else apart,
    )


class _Block:
    """One block of a document, that knows where it stands."""

    def __init__(self, found: object, path: Path, place: str) -> None:
        self._path, self._place = path, place
        if not isinstance(found, Mapping):
            raise DataError(f"{path}: {place or 'it'} must be a block of names")
        self._found: Mapping[str, object] = found

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(self._found)

    def wrong(self, key: str, what: str) -> NoReturn:
        raise DataError(f"{self._path}: {self._at(key)}: {what}")

    def get(self, key: str) -> object:
        if key not in self._found:
            self.wrong(key, "is missing")
        return self._found[key]

    def block(self, key: str) -> _Block:
        return _Block(self.get(key), self._path, self._at(key))

    def each(self) -> dict[str, _Block]:
        return {key: self.block(key) for key in self._found}

    def blocks(self, key: str) -> list[_Block]:
        found = self.get(key)
        if not isinstance(found, list):
            self.wrong(key, "must be a list")
        return [_Block(one, self._path, f"{self._at(key)}[{number}]") for number, one in enumerate(found)]

    def text(self, key: str) -> str:
        found = self.get(key)
        if not isinstance(found, str):
            self.wrong(key, f"must be text, not {found!r:.40}")
        return found

    def number(self, key: str) -> float:
        found = self.number_or_none(key)
        if found is None:
            self.wrong(key, "must be a number, not null")
        return found

    def number_or_none(self, key: str) -> float | None:
        found = self.get(key)
        if found is None:
            return None
        if isinstance(found, bool) or not isinstance(found, int | float):
            self.wrong(key, f"must be a number, not {found!r:.40}")
        if not math.isfinite(found):
            self.wrong(key, "is too large")
        return float(found)

    def _at(self, key: str) -> str:
        return f"{self._place}.{key}" if self._place else key


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number of JSON")
