"""Results to JSON documents and back, by one rule for every type.

A document holds the fields of its type in their order, or what the type's WRITTEN says, in words of these forms:

    name            a field, or a property, which is written and never read
    key=name        where the file has another name for it; key=block.name for a part of one
    name!           where no document may lack it
    key=name(a b)   of a block, of each in a list, or of each by name, only these
    key=(a b)       a block of its own in the file, made of these
    *name           the parts of a block among their neighbours

Angles are radians here and degrees there, by the names of the two: ``turned_left_rad`` is ``turned_left_deg`` in a
file, ``gyro_radps`` is ``gyro_dps``. A number that is not finite, or not known, is null. What a document does not tell
reads as nothing: None, NaN, or empty.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache, partial
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import cattrs
import numpy as np

from sccal import __version__
from sccal.errors import DataError
from sccal.logs.inputs import InputFile
from sccal.logs.streams import Notice, Vehicle
from sccal.results.numbers import radians_of
from sccal.results.verdict import Verdict

Json = dict[str, Any]
Kind = TypeVar("Kind")

WRITTEN_OF_LOGS: Mapping[type, str] = {
    Notice: "source what count where severity text=__str__",
    InputFile: "name bytes=size_bytes sha256",
}
"""Layouts of what the readers of logs leave in results."""
_ANGLES = (("_radps", "_dps"), ("_rad", "_deg"))
_WORD = re.compile(r"(\w+=)?(\*?)([\w.]*)(\([^)]*\))?(!?)(?: |$)")


class WrongPartError(ValueError):
    """A part of a document that cannot be read, and its place: ``parameters.track_m.value``."""

    def __init__(self, what: str, place: str = "") -> None:
        super().__init__(f"{place}: {what}" if place else what)
        self.what, self.place = what, place


@dataclass(frozen=True)
class Entry:
    """One key of a document."""

    key: str
    """Empty where the parts of a block stand among their neighbours."""
    name: str
    """Of the field or property, with dots for a part of one; empty where ``parts`` are the type's own."""
    kind: Any
    """Its type."""
    is_field: bool
    needed: bool
    parts: tuple[Entry, ...] = ()
    """What of the block is written; empty for all of it."""

    @property
    def is_angle(self) -> bool:
        """Whether it turns into degrees."""
        return any(self.name.endswith(ending) for ending, _ in _ANGLES)


@cache
def entries_of(kind: type) -> tuple[Entry, ...]:
    """The keys of a type's documents, in order."""
    layout = (
        WRITTEN_OF_LOGS.get(kind) or getattr(kind, "WRITTEN", None) or " ".join(field.name for field in fields(kind))
    )
    return _entries(kind, layout)


def _entries(kind: type, layout: str) -> tuple[Entry, ...]:
    return tuple(_entry(kind, *found) for found in _WORD.findall(layout) if any(found))


def _entry(kind: type, key: str, star: str, name: str, parts: str, needed: str) -> Entry:
    hint = kind
    for one in name.split(".") if name else ():
        hint = _type_of(part_of(hint), one) if hint is kind else _or_none(_type_of(part_of(hint), one))
    inner = _entries(kind if not name else part_of(hint), parts[1:-1]) if parts else ()
    is_field = name in {field.name for field in fields(kind)}
    return Entry("" if star else key.rstrip("=") or name_in_files(name), name, hint, is_field, bool(needed), inner)


def part_of(hint: Any) -> Any:
    """The type of the blocks in a list, by name or where there may be none."""
    args = [part for part in get_args(hint) if part not in (type(None), ...)]
    return part_of(args[-1]) if args and get_origin(hint) is not Literal else hint


def _or_none(hint: Any) -> Any:
    return hint | None


def _type_of(kind: type, name: str) -> Any:
    """Of a field, a property or a method."""
    if name in {field.name for field in fields(kind)}:
        return get_type_hints(kind)[name]
    attribute = getattr(kind, name)
    function = getattr(attribute, "fget", attribute)
    return get_type_hints(function)["return"] if hasattr(function, "__globals__") else str


def name_in_files(name: str) -> str:
    """A field's name in a document, by its unit there."""
    for ending, instead in _ANGLES:
        if name.endswith(ending):
            return name.removesuffix(ending) + instead
    return name


def document_of(result: Any) -> Json:
    """A result as its JSON document, which json_text can write."""
    document: Json = _converter().unstructure(result)
    return document


def json_text(document: Json) -> str:
    """As it stands in a file: indented, UTF-8, one newline at the end."""
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def result_from(document: object, kind: type[Kind]) -> Kind:
    """A result from its document. Raises WrongPartError, with the place, where a part is missing or wrong."""
    return _converter().structure(document, kind)


def read_json(path: Path, option: str = "") -> tuple[Any, str | None]:
    """A JSON file's content and the schema that it names; None where it names none.

    ``option`` is the one on the command line that the path came with, for the message.

    Raises:
        DataError: it cannot be read, or is no JSON.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"{option} {path}: cannot be read as JSON ({error})".lstrip()) from error
    schema = document.get("schema") if isinstance(document, dict) else None
    return document, schema if isinstance(schema, str) else None


def not_told(kind: Any) -> Any:
    """What a field of that type holds where the document does not tell it."""
    origin, args = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType) and type(None) in args:
        return None
    if origin is Literal:
        return args[0]
    if origin is np.ndarray:
        return np.empty(0)
    if origin is not None:
        return () if origin is tuple else {}
    if kind in _NOTHING:
        return _NOTHING[kind]
    hints = get_type_hints(kind)
    return kind(**{field.name: not_told(hints[field.name]) for field in fields(kind) if not _has_default(field)})


def _has_default(field: Any) -> bool:
    return field.default is not MISSING or field.default_factory is not MISSING


@contextmanager
def _at(place: str) -> Iterator[None]:
    try:
        yield
    except WrongPartError as error:
        between = "." if error.place and not error.place.startswith("[") else ""
        raise WrongPartError(error.what, f"{place}{between}{error.place}") from error


def _writer_of(kind: type) -> Callable[[Any], Json]:
    entries, schema = entries_of(kind), getattr(kind, "SCHEMA", None)
    header = {} if schema is None else {"schema": schema, "sccal_version": __version__}

    return lambda result: header | _written(result, entries)


def _written(result: Any, entries: tuple[Entry, ...]) -> Json:
    document: Json = {}
    for entry in entries:
        value = result
        for name in entry.name.split(".") if entry.name else ():
            value = None if value is None else getattr(value, name)
        told = _in_part(value, entry.parts) if entry.parts else _whole(value, entry)
        document |= {entry.key: told} if entry.key else told
    return document


def _whole(value: Any, entry: Entry) -> Any:
    return _converter().unstructure(value() if callable(value) else _in_degrees(value) if entry.is_angle else value)


def _in_part(value: Any, parts: tuple[Entry, ...]) -> Any:
    if isinstance(value, Mapping):
        return {_text(name): _in_part(part, parts) for name, part in value.items()}
    if isinstance(value, tuple):
        return [_in_part(one, parts) for one in value]
    return None if value is None else _written(value, parts)


def _reader_of(kind: type) -> Callable[[Any, Any], Any]:
    entries, hints = entries_of(kind), get_type_hints(kind)
    further = getattr(kind, "further", None)

    def read(block: Any, _: Any) -> Any:
        found = _found(_block(block), entries)
        found |= {} if further is None else further(block, partial(_part, block))
        for field in fields(kind):
            if field.name not in found and not _has_default(field):
                found[field.name] = not_told(hints[field.name])
        return kind(**found)

    return read


def _block(found: Any) -> Mapping[str, Any]:
    if not isinstance(found, Mapping):
        raise WrongPartError("must be a block of names")
    return found


def _part(block: Mapping[str, Any], key: str, kind: Any) -> Any:
    if key not in block:
        raise WrongPartError("is missing", key)
    with _at(key):
        return _converter().structure(block[key], kind)


def _found(block: Mapping[str, Any], entries: tuple[Entry, ...]) -> dict[str, Any]:
    """The fields that a block tells."""
    found: dict[str, Any] = {}
    for entry in entries:
        if not entry.name and block.get(entry.key) is not None:
            with _at(entry.key):
                found |= _found(_block(block[entry.key]), entry.parts)
        elif entry.is_field and not entry.key:
            found[entry.name] = _converter().structure(block, entry.kind)
        elif entry.is_field and (entry.needed or block.get(entry.key) is not None):
            value = _part(block, entry.key, entry.kind)
            found[entry.name] = _in_radians(value) if entry.is_angle else value
    return found


def _in_degrees(value: Any) -> Any:
    if value is None:
        return None
    return math.degrees(value) if isinstance(value, float | int) else value.in_degrees


def _in_radians(value: Any) -> Any:
    if value is None:
        return None
    return radians_of(value) if isinstance(value, float | int) else value.in_radians


def _text(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _vehicle(name: str) -> Vehicle:
    return Vehicle(name, Path(), math.nan, math.nan)


_NOTHING: Mapping[Any, Any] = {
    float: math.nan, int: 0, bool: False, str: "", Path: Path(), Vehicle: _vehicle("")
}  # fmt: skip


def _read_number(value: Any, _: Any) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise WrongPartError(f"must be a number, not {value!r:.40}")
    if math.isinf(value):
        raise WrongPartError("is too large")
    return float(value)


def _read_whole(value: Any, _: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise WrongPartError(f"must be a whole number, not {value!r:.40}")
    return value


def _read_text(value: Any, _: Any) -> str:
    if not isinstance(value, str):
        raise WrongPartError(f"must be text, not {value!r:.40}")
    return value


def _read_flag(value: Any, _: Any) -> bool:
    if not isinstance(value, bool):
        raise WrongPartError("must be true or false")
    return value


def _read_choice(value: Any, kind: Any) -> Any:
    if value not in get_args(kind):
        raise WrongPartError(f"must be one of {', '.join(map(str, get_args(kind)))}, not {value!r:.40}")
    return value


def _read_verdict(value: Any, _: Any) -> Verdict:
    try:
        return Verdict.from_text(_read_text(value, str))
    except ValueError as error:
        raise WrongPartError(str(error)) from error


def _read_list(value: Any, kind: Any) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise WrongPartError("must be a list")
    args = get_args(kind)
    kinds = [args[0]] * len(value) if args[1:] == (...,) else list(args)
    if len(kinds) != len(value):
        raise WrongPartError(f"must be a list of {len(kinds)}")
    found = []
    for number, (one, of) in enumerate(zip(value, kinds, strict=True)):
        with _at(f"[{number}]"):
            found.append(_converter().structure(one, of))
    return tuple(found)


def _read_names(value: Any, kind: Any) -> dict[Any, Any]:
    of_key, of_value = get_args(kind)
    found = {}
    for key, one in _block(value).items():
        with _at(str(key)):
            if of_key is int and not key.lstrip("-").isdigit():
                raise WrongPartError("is no whole number")
            found[of_key(key)] = _converter().structure(one, of_value)
    return found


def _read_optional(value: Any, kind: Any) -> Any:
    (of,) = (part for part in get_args(kind) if part is not type(None))
    return None if value is None else _converter().structure(value, of)


def _read_array(value: Any, _: Any) -> Any:
    return np.array(value, dtype=np.float64)


def _of(*origins: Any) -> Callable[[Any], bool]:
    return lambda kind: get_origin(kind) in origins


@cache
def _converter() -> cattrs.Converter:
    converter = cattrs.Converter(detailed_validation=False)
    converter.register_unstructure_hook_factory(is_dataclass, _writer_of)
    converter.register_structure_hook_factory(is_dataclass, _reader_of)
    converter.register_unstructure_hook(str, _text)
    converter.register_unstructure_hook(float, lambda value: float(value) if math.isfinite(value) else None)
    converter.register_unstructure_hook(np.generic, lambda value: converter.unstructure(value.item()))
    converter.register_unstructure_hook(np.float64, lambda value: float(value) if math.isfinite(value) else None)
    converter.register_unstructure_hook(np.ndarray, lambda values: converter.unstructure(values.tolist()))
    for listed in (tuple, list):
        converter.register_unstructure_hook(listed, lambda values: [converter.unstructure(value) for value in values])
    converter.register_unstructure_hook(
        dict, lambda named: {_text(str(key)): converter.unstructure(value) for key, value in named.items()}
    )
    converter.register_unstructure_hook(Vehicle, lambda vehicle: _text(vehicle.name))
    converter.register_unstructure_hook(Verdict, lambda verdict: _text(str(verdict)))
    converter.register_unstructure_hook(Path, lambda path: _text(str(path)))
    for kind, read in ((float, _read_number), (int, _read_whole), (str, _read_text), (bool, _read_flag)):
        converter.register_structure_hook(kind, read)
    converter.register_structure_hook(Vehicle, lambda name, _: _vehicle(_read_text(name, str)))
    converter.register_structure_hook(Verdict, _read_verdict)
    converter.register_structure_hook_func(_of(Literal), _read_choice)
    converter.register_structure_hook_func(_of(tuple), _read_list)
    converter.register_structure_hook_func(_of(Mapping, dict), _read_names)
    converter.register_structure_hook_func(_of(np.ndarray), _read_array)
    converter.register_structure_hook_func(_of(Union, UnionType), _read_optional)
    return converter
