"""The names that a gate may use: dotted paths into calibration.json, to one number or one text.

A parameter without a field means its value: ``parameters.track_m`` is ``parameters.track_m.value``. Names of effects
and of logged columns may hold dots themselves; what the document holds decides.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_origin

from sccal.results.calibration import PARAMETERS, Estimate, Fit, HeldOut, Outage
from sccal.results.converter import Json, entries_of
from sccal.results.numbers import listed


def _single(kind: type) -> tuple[str, ...]:
    """What a type's document holds in one value each."""
    lists = (tuple, Mapping)
    return tuple(one.key for one in entries_of(kind) if get_origin(one.kind) not in lists)


FIELDS = _single(Estimate)
"""Of every parameter, the four of the model and those of effects."""
FIXED: Mapping[str, tuple[str, ...]] = {
    "fit": _single(Fit),
    "outage": _single(Outage),
    "held_out": _single(HeldOut),
    "parameters": tuple(f"{key}{field}" for key in PARAMETERS for field in ("", *(f".{field}" for field in FIELDS))),
}
"""Blocks whose names are known before any document is there."""
OPEN = ("effects", "origin", "reference", "noise", "drive", "clock", "provenance")
"""Blocks whose names only the document knows."""
SINGLE = ("verdict", "run", "vehicle", "variant", "started", "sccal_version", "schema", "consistency_chi2_per_dof")


class UnknownNameError(Exception):
    """The document has nothing of that name; the message says which names are near."""


@dataclass(frozen=True)
class Named:
    """What a name stands for in one document."""

    value: float | str | None
    parameter: Json | None
    """The parameter's whole block where the name is of one."""
    field: str
    """Last part of the path: ``sigma``."""


def near(name: str, names: Iterable[str]) -> str:
    """``; did you mean A or B?``, or nothing."""
    close = difflib.get_close_matches(name, list(names), n=3, cutoff=0.6)
    return f"; did you mean {' or '.join(close)}?" if close else ""


def why_impossible(name: str) -> str:
    """Why no calibration can have this name; empty where one may."""
    root, _, rest = name.partition(".")
    known = [f"{block}.{key}" for block, keys in FIXED.items() for key in keys]
    if name in SINGLE or (root in OPEN and rest) or name in known:
        return ""
    if name in FIXED or name in OPEN:
        return f"{name} is a block of names, not one value: try {_first_of(name)}"
    if root in FIXED:
        return f"{root} has no {rest}{near(name, known)}"
    everything = [*known, *SINGLE, *(f"{block}.…" for block in OPEN)]
    tails = [one for one in known if one.partition(".")[2] == name]
    hint = f"; did you mean {tails[0]}?" if tails else near(name, everything)
    return f"there is no {name}{hint or f'; names begin with {listed((*FIXED, *OPEN))}, or are {listed(SINGLE)}'}"


def look_up(document: Json, name: str) -> Named:
    """The value of ``name``; None where it, or a block above it, is null.

    Raises:
        UnknownNameError: the document has no such name, or it is no single value.
    """
    for found, block, field in _walk(document, name, None, ""):
        if isinstance(found, Mapping) and _is_parameter(found):
            return Named(_scalar(found["value"], name), dict(found), "value")
        if isinstance(found, Mapping):
            raise UnknownNameError(f"{name} is a block of names, not one value{near(name, _below(found, name))}")
        return Named(_scalar(found, name), block, field)
    raise UnknownNameError(f"there is no {name}{near(name, single_values(document))}")


def single_values(document: Json) -> Iterator[str]:
    """Every name of the document that stands for one value."""
    return _below(document, "")


def _first_of(block: str) -> str:
    return f"{block}.{FIXED[block][0]}" if block in FIXED else f"{block}.NAME"


def _walk(node: Any, path: str, block: Json | None, field: str) -> Iterator[tuple[Any, Json | None, str]]:
    if not path:
        yield node, block, field
        return
    if node is None and field:
        yield None, block, field
        return
    if not isinstance(node, Mapping):
        return
    inside = dict(node) if _is_parameter(node) else None
    for key, value in node.items():
        if path == key:
            yield value, inside, key
        elif path.startswith(f"{key}."):
            yield from _walk(value, path[len(key) + 1 :], inside, key)


def _is_parameter(node: Mapping[str, Any]) -> bool:
    return "value" in node and "status" in node


def _below(node: Any, path: str) -> Iterator[str]:
    if isinstance(node, Mapping):
        if _is_parameter(node):
            yield path
        for key, value in node.items():
            yield from _below(value, f"{path}.{key}" if path else str(key))
    elif not isinstance(node, list):
        yield path


def _scalar(found: Any, name: str) -> float | str | None:
    if isinstance(found, bool):
        return "true" if found else "false"
    if isinstance(found, int | float):
        return float(found)
    if found is None or isinstance(found, str):
        return found
    raise UnknownNameError(f"{name} is a list, not one value")
