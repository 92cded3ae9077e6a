"""JSON messages: each is parsed, and the picked fields are taken by the way that worked for the message before it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np

from sccal.arrays import Ints
from sccal.logs.messages.layout import MOST_COLUMNS, MOST_FIELDS, Bytes, Part, Picker

_Way = tuple[str | int, ...]
_DEEPEST = 24
_PLANS_KEPT = 256
_CLOCK = re.compile(r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d")


@dataclass
class _Plan:
    """Where the picked fields of messages with these keys are, and what has been taken so far."""

    columns: tuple[tuple[str, _Way], ...]
    pinned: tuple[tuple[_Way, str], ...]
    text: _Way | None
    stamp: tuple[_Way, _Way] | None
    index: list[int] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    texts: list[bytes] = field(default_factory=list)


@dataclass
class JsonGatherer:
    """Gathers the picked columns of one channel's messages."""

    picker: Picker
    parts: list[Part] = field(default_factory=list)
    malformed: list[int] = field(default_factory=list)
    why: str = ""

    def __post_init__(self) -> None:
        self._plans: dict[tuple[str, ...], list[_Plan]] = {}
        self._plan_count = 0
        self._names: set[str] = set()

    def take(self, data: Bytes, begin: Ints, end: Ints, first: int) -> None:
        """Read the messages at [begin, end) of ``data``, numbered from ``first`` on."""
        used: list[_Plan] = []
        for i, (a, b) in enumerate(zip(begin.tolist(), end.tolist(), strict=True)):
            try:
                message = json.loads(data[a:b].tobytes())
                if not isinstance(message, dict):
                    raise ValueError("the message is no object")
                plan = self._take_one(message, first + i)
            except (ValueError, RecursionError) as error:
                self.why = self.why or f"JSON: {error}"
                self.malformed.append(first + i)
                continue
            if len(plan.index) == 1:
                used.append(plan)
        for plan in used:
            self._finish(plan)

    def _take_one(self, message: dict[str, Any], number: int) -> _Plan:
        keys = tuple(message)
        plans = self._plans.get(keys, [])
        for plan in plans:
            if _took(plan, message, number):
                return plan
        plan = self._planned(message)
        if not _took(plan, message, number):
            raise ValueError("fields of one message contradict each other")
        if self._plan_count < _PLANS_KEPT:
            self._plan_count += 1
            self._plans.setdefault(keys, []).append(plan)
        return plan

    def _planned(self, message: dict[str, Any]) -> _Plan:
        numbers: dict[str, _Way] = {}
        texts: dict[str, tuple[_Way, str]] = {}
        _flatten(message, "", (), numbers, texts)
        picked = self.picker(numbers, {path: text for path, (_, text) in texts.items()})
        if len(self._names | picked.columns.keys()) > MOST_COLUMNS:
            raise ValueError(f"its messages name more than {MOST_COLUMNS} different fields")
        self._names |= picked.columns.keys()
        return _Plan(
            columns=tuple((name, numbers[path]) for name, path in picked.columns.items()),
            pinned=tuple(texts[path] for path in picked.pinned),
            text=texts[picked.text][0] if picked.text else None,
            stamp=picked.stamp and (numbers[picked.stamp[0]], numbers[picked.stamp[1]]),
        )

    def _finish(self, plan: _Plan) -> None:
        values = np.array(plan.rows, dtype=np.float64).reshape(len(plan.index), len(plan.columns))
        self.parts.append(
            Part(
                np.array(plan.index, dtype=np.int64),
                {name: values[:, i].copy() for i, (name, _) in enumerate(plan.columns)},
                np.array(plan.stamps, dtype=np.int64) if plan.stamp else None,
                tuple(plan.texts) if plan.text else None,
            )
        )
        for taken in (plan.index, plan.rows, plan.stamps, plan.texts):
            taken.clear()


def found_ways(message: dict[str, Any]) -> tuple[dict[str, _Way], dict[str, _Way]]:
    """The ways (keys and indices, one below the other) to the numbers and to the texts of a message, by dotted path."""
    numbers: dict[str, _Way] = {}
    texts: dict[str, tuple[_Way, str]] = {}
    _flatten(message, "", (), numbers, texts)
    return numbers, {path: way for path, (way, _) in texts.items()}


def _took(plan: _Plan, message: Mapping[str, Any], number: int) -> bool:
    """Take the message by the plan, unless it does not fit."""
    try:
        if any(_at(message, way) != wanted for way, wanted in plan.pinned):
            return False
        row = [float(_at(message, way)) for _, way in plan.columns]
        stamp = 0
        if plan.stamp is not None:
            stamp = int(_at(message, plan.stamp[0])) * 1_000_000_000 + int(_at(message, plan.stamp[1]))
        text = str(_at(message, plan.text)).encode() if plan.text else b""
    except (KeyError, IndexError, TypeError, ValueError, OverflowError):
        return False
    plan.index.append(number)
    plan.rows.append(row)
    plan.stamps.append(stamp if abs(stamp) < 2**62 else 0)
    plan.texts.append(text)
    return True


def _at(value: Any, way: _Way) -> Any:
    for step in way:
        value = _clock(value)[step] if step in ("sec", "nanosec") and isinstance(value, str) else value[step]
    return value


def _clock(text: str) -> dict[str, int]:
    """Seconds and nanoseconds of a time written as text, as protobuf's JSON has it."""
    whole, _, rest = text.partition(".")
    digits = re.match(r"\d*", rest)
    fraction = digits[0] if digits else ""
    zone = rest[len(fraction) :] or ("" if whole.endswith("Z") else "Z")
    moment = datetime.fromisoformat(whole + zone)
    return {"sec": int(moment.timestamp()), "nanosec": int(fraction[:9].ljust(9, "0") or 0)}


def _flatten(value: Any, path: str, way: _Way, numbers: dict[str, _Way], texts: dict[str, tuple[_Way, str]]) -> None:
    """All numbers and strings below ``value`` by dotted path."""
    if len(way) > _DEEPEST or len(numbers) + len(texts) >= MOST_FIELDS:
        return
    if isinstance(value, dict):
        for key, below in value.items():
            _flatten(below, f"{path}.{key}" if path else key, (*way, key), numbers, texts)
    elif isinstance(value, list):
        for i, below in enumerate(value[:512]):
            _flatten(below, f"{path}[{i}]", (*way, i), numbers, texts)
    elif isinstance(value, int | float):
        numbers[path] = way
    elif isinstance(value, str):
        if _CLOCK.match(value):
            numbers[f"{path}.sec"], numbers[f"{path}.nanosec"] = (*way, "sec"), (*way, "nanosec")
        texts[path] = (way, value)
