"""JSON Schema (draft 2020-12) of every document, made from the types by the rule that writes them."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from pathlib import Path
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np

from sccal.logs.streams import Vehicle
from sccal.results.calibration import Calibration, VehicleCalibration
from sccal.results.comparison import Comparison
from sccal.results.converter import Entry, Json, entries_of
from sccal.results.diagnosis import Diagnosis
from sccal.results.experiments import Experiments
from sccal.results.gates import BatchOutcome
from sccal.results.inspection import Inspections
from sccal.results.model import JudgedModel
from sccal.results.summary import Summary
from sccal.results.verdict import Verdict

DOCUMENTS: Mapping[str, type] = {
    "calibration": Calibration,
    "vehicle": VehicleCalibration,
    "diagnosis": Diagnosis,
    "model": JudgedModel,
    "inspect": Inspections,
    "summary": Summary,
    "comparison": Comparison,
    "experiments": Experiments,
    "batch": BatchOutcome,
}
"""By the name of the schema's file."""
_SINGLE: Mapping[Any, Json] = {
    float: {"type": ["number", "null"]},
    int: {"type": "integer"},
    bool: {"type": "boolean"},
    str: {"type": "string"},
    Path: {"type": "string"},
    Vehicle: {"type": "string"},
    Verdict: {"type": "string", "pattern": "^(good|partial|doubtful)( – [^:]+)?: "},
    type(None): {"type": "null"},
}


def schema_of(kind: type) -> Json:
    """What a document of that type must hold; further keys may come."""
    blocks: dict[str, Json] = {}
    root = _of(kind, blocks)["$ref"].rpartition("/")[2]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **blocks.pop(root), "$defs": blocks}


def _of(kind: Any, blocks: dict[str, Json]) -> Json:
    origin, args = get_origin(kind), get_args(kind)
    if kind in _SINGLE:
        return dict(_SINGLE[kind])
    if origin is Literal:
        return {"enum": list(args)}
    if origin in (Union, UnionType):
        return {"anyOf": [_of(part, blocks) for part in args]}
    if origin is np.ndarray:
        return {"type": "array"}
    if origin is tuple:
        return _list(args, blocks)
    if origin is not None:
        return {"type": "object", "additionalProperties": _of(args[1], blocks)}
    if issubclass(kind, IntEnum):
        return {"enum": [int(one) for one in kind]}
    if kind.__name__ not in blocks:
        blocks[kind.__name__] = {}
        blocks[kind.__name__] = _block(kind, blocks)
    return {"$ref": f"#/$defs/{kind.__name__}"}


def _list(args: tuple[Any, ...], blocks: dict[str, Json]) -> Json:
    if args[1:] == (...,):
        return {"type": "array", "items": _of(args[0], blocks)}
    return {"type": "array", "prefixItems": [_of(part, blocks) for part in args], "minItems": len(args)}


def _block(kind: type, blocks: dict[str, Json]) -> Json:
    schema = getattr(kind, "SCHEMA", None)
    head: Json = {} if schema is None else {"schema": {"const": schema}, "sccal_version": {"type": "string"}}
    told = " ".join((kind.__doc__ or "").split())
    return {"description": told, **_object(head | _parts(entries_of(kind), blocks))}


def _parts(entries: tuple[Entry, ...], blocks: dict[str, Json]) -> Json:
    known: Json = {}
    for entry in entries:
        if not entry.key:
            known |= _parts(entries_of(entry.kind), blocks)
        else:
            known[entry.key] = _in_part(entry.kind, entry.parts, blocks) if entry.parts else _of(entry.kind, blocks)
    return known


def _in_part(kind: Any, parts: tuple[Entry, ...], blocks: dict[str, Json]) -> Json:
    """Of a block, of each in a list or of each by name, only some parts."""
    origin, args = get_origin(kind), get_args(kind)
    if origin is tuple:
        return {"type": "array", "items": _in_part(args[0], parts, blocks)}
    if origin in (Union, UnionType):
        return {"anyOf": [_in_part(args[0], parts, blocks), {"type": "null"}]}
    if origin is not None:
        return {"type": "object", "additionalProperties": _in_part(args[1], parts, blocks)}
    return _object(_parts(parts, blocks))


def _object(known: Json) -> Json:
    return {"type": "object", "properties": known, "required": list(known)}
