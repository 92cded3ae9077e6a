"""The proposal as the text of a vehicle.toml."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from sccal.logs.streams import Convention


@dataclass(frozen=True)
class Column:
    """One line of a section."""

    names: tuple[str, ...]
    unit: str = ""
    reversed: bool = False


@dataclass(frozen=True)
class MappedSection:
    """``[files.…]``: the file and its columns, or its form."""

    stream: str
    file: str
    columns: Mapping[str, Column] = field(default_factory=dict)
    crs: str = ""
    format: str = ""


@dataclass(frozen=True)
class Facts:
    """What vehicle.toml says of the vehicle itself."""

    name: str
    wheel_radius_m: float
    track_m: float
    ticks_per_rev: float | None
    convention: Convention


def document_of(facts: Facts, sections: tuple[MappedSection, ...], checks: Mapping[str, str]) -> str:
    """The whole text; ``checks`` are remarks by the key that they stand behind."""
    lines = [f"name = {quoted(facts.name)}"]
    if facts.ticks_per_rev is not None:
        lines += ["", "[encoder]", _remarked(f"ticks_per_rev = {facts.ticks_per_rev:.9g}", checks.get("ticks_per_rev"))]
    lines += ["", "[nominal]"]
    lines.append(_remarked(f"wheel_radius_m = {facts.wheel_radius_m:.9g}", checks.get("wheel_radius_m")))
    lines.append(_remarked(f"track_m = {facts.track_m:.9g}", checks.get("track_m")))
    lines += ["", "[ahrs]", f'convention = "{facts.convention}"']
    for section in sections:
        lines += ["", *_section(section)]
    return "\n".join(lines) + "\n"


def _section(section: MappedSection) -> list[str]:
    lines = [f"[files.{section.stream}]", f"file = {quoted(section.file)}"]
    if section.format:
        lines.append(f'format = "{section.format}"')
    wide = max((len(key) for key in section.columns), default=0)
    lines += [f"{key.ljust(wide)} = {_column(column)}" for key, column in section.columns.items()]
    if section.crs:
        lines.append(f'crs = "{section.crs}"')
    return lines


def _column(column: Column) -> str:
    if len(column.names) > 1:
        return f"{{ columns = [{', '.join(quoted(name) for name in column.names)}] }}"
    unit = f', unit = "{column.unit}"' if column.unit else ""
    back = ", reversed = true" if column.reversed else ""
    return f"{{ column = {quoted(column.names[0])}{unit}{back} }}"


def _remarked(line: str, remark: str | None) -> str:
    return line if not remark else f"{line}  # {remark}"


def quoted(text: str) -> str:
    """A basic string of TOML, which escapes as JSON does, and the character 127 too."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
