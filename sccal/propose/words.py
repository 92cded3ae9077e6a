"""Names of columns taken apart: ``gpsLat_deg`` is gps, lat and deg. A name only suggests; the numbers decide."""

from __future__ import annotations

import re

from sccal.logs.mapping import shown

LAT = frozenset({"lat", "latitude", "breite"})
LON = frozenset({"lon", "lng", "long", "longitude", "laenge"})
EAST = frozenset({"e", "east", "easting", "x", "posx", "rechts", "rechtswert", "ost"})
NORTH = frozenset({"n", "north", "northing", "y", "posy", "hoch", "hochwert", "nord"})
HEIGHT = frozenset({"alt", "altitude", "height", "elevation", "ele", "hoehe"})
UP = frozenset({"z", "h", "u", "up"})
"""Of a height where the same name with another letter is east."""
QUALITY = frozenset({"fix", "quality", "qual", "fixtype", "fixquality", "gga"})
SIGMA = frozenset({"sigma", "std", "stddev", "hacc", "accuracy", "sd"})
HEADING = frozenset({"heading", "hdg", "yaw", "azimuth", "compass", "psi", "theta", "kurs"})
COURSE = frozenset({"course", "cog", "track", "trk", "motion"})
"""Of a direction of travel, which is no heading."""
DERIVED = frozenset({"odom", "odometry", "ekf", "filtered", "estimate"})
"""Of what was computed from the wheels, and says nothing of its own."""
TIME = frozenset({"t", "time", "stamp", "timestamp", "date", "datetime", "clock", "epoch", "millis", "micros", "zeit"})
TIME_UNITS = {
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "usec", "micros", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanoseconds"), "ns"),
    **dict.fromkeys(("s", "sec", "secs", "seconds"), "s"),
}
LEFT = frozenset({"l", "left", "lft", "li", "links", "lh", "port"})
RIGHT = frozenset({"r", "right", "rgt", "re", "rechts", "rh", "starboard"})
_SIDES = (("left", LEFT), ("right", RIGHT))


def called(name: str) -> str:
    """A column's name for a message, or its number where no line names the columns."""
    return f"column {name}" if name.isdecimal() else shown(name)


def parts(name: str) -> tuple[str, ...]:
    """The words of a name in small letters, and its digits; utm33n_east is utm, 33n and east."""
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return tuple(re.findall(r"(?<=utm)\d\d?[ns](?![a-z])|[a-zäöü]+|\d+", spaced.lower()))


def has(name: str, words: frozenset[str]) -> bool:
    """Whether one of the words is part of a name, or all of it but for what says that a receiver wrote it."""
    found = parts(name)
    return any(part in words or part.removeprefix("gps").removeprefix("utm") in words for part in found)


def without(name: str, wanted: frozenset[str]) -> tuple[str, ...]:
    """A name's words but for those."""
    return tuple(part for part in parts(name) if part not in wanted and part.removeprefix("gps") not in wanted)


def side_of(name: str) -> tuple[str, tuple[str, ...]]:
    """``left``, ``right`` or nothing, and the name's words without the one that says so."""
    found = parts(name)
    for side, words in _SIDES:
        for at, part in enumerate(found):
            if part in words:
                return side, (*found[:at], *found[at + 1 :])
    for side, ends in (("left", ("left", "l")), ("right", ("right", "r"))):
        for end in ends:
            stem = found[-1].removesuffix(end) if found else ""
            if found and found[-1] != stem and stem in _STEMS:
                return side, (*found[:-1], stem)
            stem = found[0].removeprefix(end) if found else ""
            if found and found[0] != stem and stem in _STEMS:
                return side, (stem, *found[1:])
    return "", found


_STEMS = frozenset(
    {"enc", "ticks", "tick", "wheel", "rpm", "speed", "vel", "v", "w", "omega", "count", "counts", "odo"}
)
"""Words that are written together with a side's letter: encl, lwheel."""
