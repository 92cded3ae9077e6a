"""The catalogue of effects for the terminal: a line each, or one in full."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

from sccal.effects.catalogue import assignment
from sccal.effects.effect import Effect


def effects_text(effects: Iterable[Effect], width: int = 100) -> str:
    """One line an effect: name, parameters with units, what it is."""
    rows = [
        (effect.name, ", ".join(parameter.name for parameter in effect.parameters), effect.title) for effect in effects
    ]
    names = max(len(name) for name, _, _ in rows)
    parameters = max(len(text) for _, text, _ in rows)
    lines = [f"{name:<{names}}  {text:<{parameters}}  {title}".rstrip() for name, text, title in rows]
    return "\n".join(line if len(line) <= width else line[: width - 1] + "…" for line in lines) + "\n"


def effect_text(effect: Effect, width: int = 100) -> str:
    """One effect in full."""
    lines = [f"{effect.name}: {effect.title}", ""]
    for parameter in effect.parameters:
        own = "" if parameter.left_out is None else f", {parameter.left_out:g} where not told"
        kind = f"searched for{own}" if parameter.shape else f"prior ± {parameter.prior_sigma:g}"
        bounds = f"{parameter.lower:g} … {parameter.upper:g}"
        lines.append(f"  {parameter.name:<12} {parameter.unit:<14} {kind}, {bounds}, one for each {parameter.scope}")
    lines.append("")
    for label, text in (
        ("looks like", effect.looks_like),
        ("drive", effect.excited_by),
        ("source", effect.reference),
    ):
        lines += textwrap.wrap(text, width, initial_indent=f"{label:<11}", subsequent_indent=" " * 11)
    lines += ["", f"put it into a simulated log: sccal simulate OUT --effect {assignment(effect)}"]
    return "\n".join(lines) + "\n"
