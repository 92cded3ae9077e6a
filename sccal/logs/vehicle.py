"""``vehicle.toml``: what the owner declares about the robot, checked key by key."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

from sccal.errors import DataError
from sccal.logs.limits import TICKS_PER_REV, TRACK_M, WHEEL_RADIUS_M
from sccal.logs.mapping import FileMapping, mapping_in
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.streams import Convention, Notice, Vehicle

MINIMAL_VEHICLE = (
    '[nominal] wheel_radius_m = 0.08, track_m = 0.70; [encoder] ticks_per_rev = 32768; [ahrs] convention = "enu"'
)
"""What a smallest vehicle.toml holds, in one line, for error messages."""

_KNOWN_KEYS = {
    "encoder": frozenset({"ticks_per_rev", "counter_bits"}),
    "nominal": frozenset({"wheel_radius_m", "track_m"}),
    "ahrs": frozenset({"convention"}),
}
_EXAMPLES = {
    ("nominal", "wheel_radius_m"): "wheel_radius_m = 0.08",
    ("nominal", "track_m"): "track_m = 0.70",
    ("encoder", "ticks_per_rev"): "ticks_per_rev = 32768",
    ("encoder", "counter_bits"): "counter_bits = 32",
    ("ahrs", "convention"): 'convention = "enu"',
}

_LARGEST_BYTES = 1 << 20
_RANGES = {"wheel_radius_m": WHEEL_RADIUS_M, "track_m": TRACK_M, "ticks_per_rev": TICKS_PER_REV}


def read_vehicle(path: Path) -> tuple[Vehicle, tuple[Notice, ...]]:
    """Read ``vehicle.toml``.

    Keys that are not known are named in a notice and otherwise ignored.

    Raises:
        DataError: the file cannot be read, is not TOML, lacks a nominal value, or holds a value out of range.
    """
    document, text = _load(path)
    tables = {name: _table(document, name, path) for name in _KNOWN_KEYS}
    bits = _number(tables, "encoder", "counter_bits", path)
    if bits is not None and not (8 <= bits <= 64 and bits == int(bits)):
        raise DataError(f"{path}: [encoder] counter_bits = {bits:g} must be a whole number from 8 to 64")
    radius_m = _required_number(tables, "nominal", "wheel_radius_m", path)
    track_m = _required_number(tables, "nominal", "track_m", path)
    name = document.get("name", path.resolve().parent.name)
    if not isinstance(name, str):
        raise DataError(f'{path}: name = {name!r} must be text, such as name = "tracked-demo"')
    vehicle = Vehicle(
        name=name.strip() or path.resolve().parent.name,
        path=path,
        wheel_radius_m=radius_m,
        track_m=track_m,
        ticks_per_rev=_number(tables, "encoder", "ticks_per_rev", path),
        counter_bits=None if bits is None else int(bits),
        convention=_convention(tables["ahrs"], path),
    )
    mapping_in(document, text, path)
    return vehicle, _unknown_keys(document, tables, path)


def read_mapping(path: Path) -> FileMapping:
    """What ``[files]`` of a vehicle.toml says of the runs' files; empty where it says nothing.

    Raises:
        DataError: the file cannot be read, or says something that is not understood.
    """
    document, text = _load(path)
    return mapping_in(document, text, path)


def _load(path: Path) -> tuple[dict[str, Any], str]:
    """The document, and the text that it was read from."""
    try:
        size = path.stat().st_size
        if size > _LARGEST_BYTES:
            raise DataError(f"{path}: {size} bytes are no {VEHICLE_FILE}; it should hold {MINIMAL_VEHICLE}")
        text = path.read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
        return tomllib.loads(text), text
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise DataError(
            f"{path}: not valid TOML ({' '.join(str(error).split())}); it should hold {MINIMAL_VEHICLE}"
        ) from error


def _table(document: dict[str, Any], name: str, path: Path) -> dict[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise DataError(f"{path}: {name} must be a table: put its keys below a line [{name}]")
    return table


def _number(tables: dict[str, dict[str, Any]], table: str, key: str, path: Path) -> float | None:
    value = tables[table].get(key)
    if value is None:
        return None
    example = _EXAMPLES[table, key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DataError(f"{path}: [{table}] {key} = {value!r} must be a number, such as {example}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number) or number <= 0:
        raise DataError(f"{path}: [{table}] {key} = {value} must be positive and finite, such as {example}")
    low, high = _RANGES.get(key, (0.0, math.inf))
    if not low <= number <= high:
        raise DataError(f"{path}: [{table}] {key} = {number:g} must lie from {low:g} to {high:g}, such as {example}")
    return number


def _required_number(tables: dict[str, dict[str, Any]], table: str, key: str, path: Path) -> float:
    number = _number(tables, table, key, path)
    if number is None:
        raise DataError(f"{path}: [{table}] lacks {key}; add a line such as {_EXAMPLES[table, key]} below [{table}]")
    return number


def _convention(ahrs: dict[str, Any], path: Path) -> Convention:
    value = ahrs.get("convention", "enu")
    folded = value.strip().lower() if isinstance(value, str) else value
    if folded == "enu":
        return "enu"
    if folded == "ned":
        return "ned"
    raise DataError(
        f'{path}: [ahrs] convention = {value!r} must be "enu" (counter-clockwise from east) or "ned" (a compass)'
    )


def _unknown_keys(document: dict[str, Any], tables: dict[str, dict[str, Any]], path: Path) -> tuple[Notice, ...]:
    unknown = [key for key in document if key not in ("name", "files") and key not in _KNOWN_KEYS]
    unknown += [f"{table}.{key}" for table, known in _KNOWN_KEYS.items() for key in tables[table] if key not in known]
    if not unknown:
        return ()
    return (Notice(path.name, f"unknown keys ignored: {', '.join(sorted(unknown))}", len(unknown)),)
