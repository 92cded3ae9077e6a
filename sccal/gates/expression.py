"""The language of ``--gate``: ``[vehicle:]NAME OPERATOR THRESHOLD``, as ``outage.percent_of_distance<0.5``.

NAME is a dotted path into calibration.json (see ``names``), OPERATOR one of < <= > >= == !=, THRESHOLD a number in the
unit of the name, or for == and != a word. Blanks around each part mean nothing.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass

from sccal.errors import UsageError
from sccal.gates.names import why_impossible

VEHICLE_PREFIX = "vehicle:"
OPERATORS: Mapping[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
_SIGNS = re.compile(r"[<>=!]+")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_EXAMPLE = "write it as outage.percent_of_distance<0.5"


@dataclass(frozen=True)
class Gate:
    """One condition that every run's result, or the vehicle's, must keep."""

    text: str
    """As it was asked for, without blanks at its ends."""
    of_vehicle: bool
    name: str
    sign: str
    """One of OPERATORS."""
    threshold: float | str


def parse_gates(texts: Iterable[str]) -> tuple[Gate, ...]:
    """Every gate once, in the order asked for.

    Raises:
        UsageError: one cannot be read, or its name can be in no calibration.
    """
    return tuple(dict.fromkeys(parse_gate(text) for text in texts))


def require_effects(gates: Iterable[Gate], effects: Collection[str]) -> None:
    """Before anything is calibrated: a gate on an effect needs that effect estimated.

    Raises:
        UsageError: a gate names an effect that is not among ``effects``.
    """
    for gate in gates:
        parts = gate.name.split(".")
        if parts[0] == "effects" and not any(gate.name.startswith(f"effects.{effect}.") for effect in effects):
            asked = f"only {', '.join(effects)}" if effects else "none"
            raise UsageError(
                f'--gate "{gate.text}": {parts[1]} is not estimated ({asked} asked for); add --effects {parts[1]}'
            )


def parse_gate(text: str) -> Gate:
    """One gate.

    Raises:
        UsageError: what is wrong with it and at which character, counted from 1.
    """
    signs = list(_SIGNS.finditer(text))
    if not signs:
        raise _wrong(text, len(text.rstrip()) + 1, f"no operator ({' '.join(sorted(OPERATORS))}); {_EXAMPLE}")
    first = signs[0]
    if len(signs) > 1:
        raise _wrong(text, signs[1].start() + 1, f"a second operator, {signs[1].group()}; give two gates instead")
    if first.group() not in OPERATORS:
        meant = {"=": "==", "=<": "<=", "=>": ">=", "<>": "!=", "!": "!="}.get(first.group())
        instead = f"write {meant}" if meant else f"there are {' '.join(sorted(OPERATORS))}"
        raise _wrong(text, first.start() + 1, f"{first.group()} is no operator; {instead}")
    left, right = text[: first.start()], text[first.end() :]
    name = left.strip()
    of_vehicle = name.startswith(VEHICLE_PREFIX)
    name = name.removeprefix(VEHICLE_PREFIX).strip()
    if not name:
        raise _wrong(text, first.start() + 1, f"no name before {first.group()}; {_EXAMPLE}")
    if _NUMBER.fullmatch(name):
        raise _wrong(text, text.index(name) + 1, f"{name} is a number; the name comes first: {_EXAMPLE}")
    threshold = _threshold(text, right, first)
    problem = why_impossible(name)
    if problem:
        raise _wrong(text, text.index(name) + 1, problem)
    return Gate(text.strip(), of_vehicle, name, first.group(), threshold)


def _threshold(text: str, right: str, sign: re.Match[str]) -> float | str:
    word = right.strip()
    at = sign.end() + 1 + len(right) - len(right.lstrip())
    if not word:
        raise _wrong(text, sign.end() + 1, f"nothing after {sign.group()}; {_EXAMPLE}")
    if _NUMBER.fullmatch(word):
        number = float(word)
        if not math.isfinite(number):
            raise _wrong(text, at, f"{word} is too large for a number")
        return number
    if sign.group() not in ("==", "!="):
        raise _wrong(text, at, f"{word} is no number, and words can only be compared by == and != (no units here)")
    return word


def _wrong(text: str, character: int, what: str) -> UsageError:
    return UsageError(f'--gate "{text}", character {character}: {what}')
