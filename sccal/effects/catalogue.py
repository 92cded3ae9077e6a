"""All effects by name; an effect exists by standing in this list."""

from __future__ import annotations

from sccal.effects.effect import Effect
from sccal.effects.lever_arm import LeverArm
from sccal.errors import UsageError

CATALOGUE: dict[str, Effect] = {effect.name: effect for effect in (LeverArm(),)}


def effect_named(name: str) -> Effect:
    """The effect of that name. Raises UsageError with the names there are."""
    if name not in CATALOGUE:
        raise UsageError(f"no effect called {name!r}; there are {', '.join(sorted(CATALOGUE))}")
    return CATALOGUE[name]


def parse_effect(text: str) -> tuple[Effect, dict[str, float]]:
    """``lever_arm=0.3,-0.1``: the effect and its parameters' values in the order of ``sccal effects NAME``."""
    name, equals, numbers = text.partition("=")
    effect = effect_named(name.strip())
    names = [parameter.name for parameter in effect.parameters]
    try:
        values = [float(number) for number in numbers.split(",")] if equals else []
    except ValueError:
        values = []
    if len(values) != len(names):
        raise UsageError(f"effect {text!r}: {effect.name} takes {len(names)} numbers: {effect.name}={','.join(names)}")
    return effect, dict(zip(names, values, strict=True))
