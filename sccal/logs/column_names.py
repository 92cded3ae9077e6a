"""Columns under other names than the contract's: capitals, units in brackets, and what loggers usually call them.

A name of the contract always means itself. Another one is taken for it only where the file needs that column and has no
column of the contract's name, and where one column alone can be meant.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from sccal.logs.wheel_units import UNITS

_SECONDS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "usecs", "micros", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanos", "nanoseconds"), 1e-9),
}
_TIME = re.compile(
    r"(?:(?:t|time|stamp|timestamp|time_stamp|date_?time|clock|epoch|elapsed|unix|unix_?time|ros_?time|host_?time|"
    r"header_stamp|field_header_stamp)(?:_(?P<unit>[a-z]+))?|(?P<alone>[a-z]+))"
)
_COUNTS = r"(?:ticks?|counts?|enc|encoder|enc(?:oder)?_?(?:ticks?|counts?|pos(?:ition)?|value))"
_SIDES = {"left": "(?:left|l|lft)", "right": "(?:right|r|rgt)"}
_WHEEL = r"(?:wheel_|motor_)?"
_ANGLE = r"(?:angle_|pos_|position_)?"
_MEASURED = r"(?:actual_|measured_)?(?:(?:speed|velocity|vel|rate|omega|travel|distance|dist|pos|position)_)?"
_QUALITY = r"fix_?quality|gps_?quality|gnss_?quality|gga_?quality|gps_?qual|quality|fix_?type_?gga"
_PATTERNS = {
    **{
        f"{side}_ticks": rf"{_WHEEL}{mark}_{_WHEEL}{_COUNTS}|{_COUNTS}_{_WHEEL}{mark}(?:_wheel)?(?:_(?:ticks|counts))?"
        for side, mark in _SIDES.items()
    },
    **{
        f"{side}_rad": rf"{_WHEEL}{mark}_{_WHEEL}{_ANGLE}(?:rad|radians?)|{_ANGLE}{mark}_rad"
        for side, mark in _SIDES.items()
    },
    **{
        f"{side}_{name}": rf"{_WHEEL}{mark}_{_WHEEL}{_MEASURED}(?:{name}|{unit.spelled})|"
        rf"{_MEASURED}{_WHEEL}{mark}(?:_wheel)?_(?:{name}|{unit.spelled})|{name}_{_WHEEL}{mark}"
        for side, mark in _SIDES.items()
        for name, unit in UNITS.items()
    },
    "yaw_deg": r"(?:yaw|heading|hdg|azimuth|compass)_(?:deg|degs|degrees?|°)|(?:deg|degrees)_(?:yaw|heading)",
    "yaw_rad": r"(?:yaw|heading|hdg|azimuth|compass)_(?:rad|rads|radians?)",
    "lat_deg": r"(?:gps_|gnss_)?lat(?:itude)?(?:_(?:deg|degs|degrees?))?",
    "lon_deg": r"(?:gps_|gnss_)?(?:lon|lng|long|longitude)(?:_(?:deg|degs|degrees?))?",
    "alt_m": r"(?:gps_|gnss_)?(?:alt|altitude|height|elevation|ele)(?:_(?:m|meters?|metres?))?",
    "fix_quality": _QUALITY,
}
PLAIN_YAW = re.compile(r"(?:ahrs_|imu_)?(?:yaw|heading|hdg|azimuth)")
"""A heading whose name does not say its unit."""
OPTIONAL = ("alt_m", "fix_quality")


@dataclass(frozen=True)
class Named:
    """The names of a file's columns as the contract has them."""

    names: list[str]
    taken: dict[str, str]
    """What the file calls a column, by the contract's name; only those that differ."""
    time_unit_s: float = 1.0
    plain_yaw: bool = False
    """Whether the unit of yaw_deg has to be found by its values."""
    declared: bool = False
    """Whether the unit of times is declared, and not to be found; it is not a number where dates are declared."""


def folded(name: str) -> str:
    """A name in small letters with single underscores: ``Time [s]`` is time_s."""
    return re.sub(r"[^a-z0-9°]+", "_", name.lower()).strip("_")


def contract_names(names: Sequence[str], alternatives: Sequence[Sequence[str]]) -> Named:
    """The columns that one of the alternatives needs, found under other names; the names as they are if not all are."""
    if any(set(alternative) <= set(names) for alternative in alternatives):
        return Named(list(names), {})
    for alternative in alternatives:
        found = {wanted: _column_for(wanted, names) for wanted in alternative if wanted not in names}
        if all(place is not None for place in found.values()):
            places = {wanted: place for wanted, place in found.items() if place is not None}
            return _renamed(names, places, alternatives)
    return Named(list(names), {})


def _renamed(names: Sequence[str], places: dict[str, int], alternatives: Sequence[Sequence[str]]) -> Named:
    used = set(places.values())
    for wanted in OPTIONAL if any("lat_deg" in alternative for alternative in alternatives) else ():
        place = _column_for(wanted, names)
        if wanted not in names and place is not None and place not in used:
            places[wanted] = place
    renamed = list(names)
    for wanted, place in places.items():
        renamed[place] = wanted
    unit_s = 1.0
    if "t" in places:
        match = _TIME.fullmatch(folded(names[places["t"]]))
        unit_s = _SECONDS.get((match["unit"] or match["alone"] or "s") if match else "s", 1.0)
    plain = "yaw_deg" in places and PLAIN_YAW.fullmatch(folded(names[places["yaw_deg"]])) is not None
    taken = {wanted: names[place] for wanted, place in places.items()}
    return Named(renamed, taken, unit_s, plain)


def _column_for(wanted: str, names: Sequence[str]) -> int | None:
    """Which column is meant by a name of the contract; None where none or several may be."""
    spelled = [folded(name) for name in names]
    if wanted in spelled:
        return spelled.index(wanted)
    places = [place for place, name in enumerate(spelled) if _means(wanted, name)]
    return places[0] if len(places) == 1 else None


def _means(wanted: str, name: str) -> bool:
    if wanted != "t":
        plain = wanted == "yaw_deg" and PLAIN_YAW.fullmatch(name) is not None
        return plain or re.fullmatch(_PATTERNS.get(wanted, re.escape(wanted)), name) is not None
    match = _TIME.fullmatch(name)
    if match is None:
        return False
    return (
        match["alone"] in _SECONDS if match["alone"] else match["unit"] is None or match["unit"] in (*_SECONDS, "utc")
    )
