"""Simulation settings by name, as the command line gives them: ``ahrs.heading_offset_deg=137``."""

from __future__ import annotations

import types
from collections.abc import Iterator, Sequence
from dataclasses import MISSING, Field, fields
from typing import Any, get_args, get_type_hints

from sccal.errors import UsageError
from sccal.simulate.settings import SimulationSettings

SEED = "seed"


def settings_from(assignments: Sequence[str], seed: int) -> SimulationSettings:
    """Settings with ``group.name=value`` put in, later ones over earlier. Raises UsageError for what is unknown."""
    groups = dict(_groups())
    chosen: dict[str, dict[str, Any]] = {name: {} for name in groups}
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        group, dot, name = key.strip().partition(".")
        known = [f"{g}.{f.name}" for g, kind in groups.items() for f in fields(kind)]
        if not equals or not dot or f"{group}.{name}" not in known:
            raise UsageError(f"simulation: no setting {assignment!r}; `sccal simulate --list .` shows all of them")
        chosen[group][name] = _parsed(get_type_hints(groups[group])[name], text.strip(), key)
    return SimulationSettings(seed=seed, **{name: groups[name](**values) for name, values in chosen.items()})


def describe_settings() -> Iterator[str]:
    """One line for each setting: its full name and its default."""
    for group, kind in _groups():
        for field in fields(kind):
            yield f"{group}.{field.name}={_default(field)}"


def _groups() -> Iterator[tuple[str, Any]]:
    hints = get_type_hints(SimulationSettings)
    return ((field.name, hints[field.name]) for field in fields(SimulationSettings) if field.name != SEED)


def _default(field: Field[Any]) -> object:
    return field.default if field.default is not MISSING else ""


def _parsed(kind: Any, text: str, key: str) -> Any:
    """The text as a value of the annotated kind."""
    choices = [kind] if not isinstance(kind, types.UnionType) else list(get_args(kind))
    if type(None) in choices and text.lower() == "none":
        return None
    for choice in choices:
        try:
            if choice is bool:
                return {"true": True, "false": False}[text.lower()]
            if choice in (int, float):
                return choice(text)
            if get_args(choice) and all(isinstance(one, str) for one in get_args(choice)):
                return {one: one for one in get_args(choice)}[text]
            if choice is str:
                return text
        except (ValueError, KeyError):
            continue
    raise UsageError(f"simulation: {key}={text!r} is not a value of {kind}")
