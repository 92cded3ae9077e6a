"""Which columns hold where the robot was: pairs that draw a smooth path, in degrees or in metres."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.inspect.place import PlacedFixes, legs, placed_fixes
from sccal.logs.grids import is_of_metres, lat_lon_of_grid, lat_lon_of_plane
from sccal.logs.mapping import LOCAL, PLACE_UNITS
from sccal.logs.nmea import read_nmea
from sccal.logs.streams import FixStream
from sccal.propose import words
from sccal.propose.motion import moved_by, north_over_east
from sccal.propose.tables import Folder, Logged

FEWEST_LEGS = 10
"""Displacements that stand out from the noise: fewer show no speed and no turning."""
FASTEST_MPS = 60.0
"""As for wheels in sccal.logs.counter: no field robot is faster."""
_SMOOTH = 0.15
"""Of the whole spread: steps between neighbouring rows of a path are a small part of it, those of noise half of it."""
_MOST_LAT_DEG, _MOST_LON_DEG, _FIELD_DEG = 90.0, 360.0, 2.0
_UTM_EAST_M, _UTM_NORTH_M = (1e5, 9e5), (1.2e3, 1e7)
"""UTM: 166 to 834 km of easting, to 10000 km of northing, by its definition; a local plane is smaller."""
_LOCAL_M = 5e4
_STRETCH_SHOWS = 0.05
"""Wheels and fixes agree on lengths to some percent on any heading: a smaller stretch is none."""
_UTM_NAMED = re.compile(r"(?<!\d)([1-6]?\d)([ns])(?![a-z0-9])")


@dataclass(frozen=True)
class Places:
    """Fixes found: the columns, and where they lead."""

    file: str
    columns: dict[str, tuple[str, str]]
    """Column and unit by the mapping's key; empty for sentences."""
    crs: str
    stream: FixStream
    path: PlacedFixes
    named: bool
    why: str
    doubts: tuple[str, ...] = ()
    table: Logged | None = None


def places_in(folder: Folder, crs: str) -> list[Places]:
    """All that may be fixes, those first whose names say so; ``crs`` is what the user says of metres, or nothing."""
    found = [one for path in folder.sentences for one in _of_sentences(path)]
    for table in folder.tables:
        found += [one for one in _of_table(table, crs) if _is_a_path(one.path)]
    return sorted(found, key=lambda one: not one.named)


def _of_sentences(path: Path) -> Iterator[Places]:
    try:
        stream, _ = read_nmea(path)
    except DataError:
        return
    placed = _placed(stream)
    if placed is not None:
        yield Places(path.name, {}, "", stream, placed, True, f"holds NMEA sentences with {placed.t_s.size} fixes")


def _of_table(table: Logged, crs: str) -> Iterator[Places]:
    degrees = list(_pairs(table, words.LAT, words.LON))
    metres = list(_pairs(table, words.EAST, words.NORTH))
    if degrees or metres:
        yield from (one for first, second in degrees for one in _in_degrees(table, first, second, True))
        yield from (_in_metres(table, first, second, crs, True) for first, second in metres)
        return
    for first, second in _unnamed(table):
        yield from _in_degrees(table, first, second, False)
        yield _in_metres(table, first, second, crs, False)


def _pairs(table: Logged, first: frozenset[str], second: frozenset[str]) -> Iterator[tuple[str, str]]:
    """Columns that differ only in the word for the axis."""

    def by_rest(wanted: frozenset[str]) -> dict[tuple[str, ...], str]:
        named = [name for name in table.numbers if words.has(name, wanted)]
        return {words.without(name, wanted): name for name in reversed(named)}

    ones, others = by_rest(first), by_rest(second)
    both = [(ones[rest], others[rest]) for rest in ones if rest in others]
    if not both and len(ones) == len(others) == 1:
        both = [(next(iter(ones.values())), next(iter(others.values())))]
    yield from (pair for pair in both if pair[0] != pair[1])


def _unnamed(table: Logged) -> Iterator[tuple[str, str]]:
    smooth = [name for name, column in table.numbers.items() if _is_smooth(column)][:8]
    yield from ((one, other) for k, one in enumerate(smooth) for other in smooth[k + 1 :])


def _is_smooth(values: Floats) -> bool:
    known = values[np.isfinite(values)]
    steps = np.abs(np.diff(known))
    return known.size > FEWEST_LEGS and float(np.quantile(steps, 0.99)) < _SMOOTH * float(np.ptp(known))


def _in_degrees(table: Logged, lat: str, lon: str, named: bool) -> Iterator[Places]:
    """Latitude and longitude; exchanged where the first can be no latitude and the second can."""
    t_s, first, second = table.pair(lat, lon)
    for unit in ("deg", "1e-7 deg", "rad") if named else ("deg", "1e-7 deg"):
        a, b = PLACE_UNITS[unit] * first, PLACE_UNITS[unit] * second
        if unit == "rad" and not ("rad" in words.parts(lat) and "rad" in words.parts(lon)):
            continue
        if unit == "1e-7 deg" and not ((first == np.round(first)).all() and float(np.median(np.abs(first))) > 1e5):
            continue
        if a.size < FEWEST_LEGS or max(np.ptp(a), np.ptp(b)) > _FIELD_DEG or np.abs(b).max() > _MOST_LON_DEG:
            continue
        exchanged = bool(np.abs(a).max() > _MOST_LAT_DEG and np.abs(b).max() <= _MOST_LAT_DEG)
        if exchanged:
            lat, lon, a, b = lon, lat, b, a
        if np.abs(a).max() > _MOST_LAT_DEG or (np.ptp(a) == 0 and np.ptp(b) == 0):
            continue
        stream = _stream(table, t_s, a, b)
        placed = _placed(stream)
        if placed is not None:
            why = f"{words.called(lat)} and {words.called(lon)} are latitude and longitude"
            why += f": {a[0]:.5f} and {b[0]:.5f} degrees at first"
            told = (f"{words.called(lat)} is no longitude as its name says: {words.called(lon)} is beyond 90 degrees",)
            uses = {"latitude": (lat, unit), "longitude": (lon, unit)}
            yield Places(table.name, uses, "", stream, placed, named, why, told if exchanged else (), table)
            return


def _in_metres(table: Logged, east: str, north: str, crs: str, named: bool) -> Places:
    t_s, e, n = table.pair(east, north)
    grid, why, doubts = _grid_of(f"{table.name} {east} {north}", e, n, crs)
    lat, lon = lat_lon_of_plane(e, n) if grid == LOCAL else lat_lon_of_grid(e, n, grid)
    there = np.isfinite(lat) & np.isfinite(lon)
    stream = _stream(table, t_s[there], lat[there], lon[there])
    path = _placed(stream) or placed_fixes(replace(stream), (0.0, 0.0))
    told = f"{words.called(east)} and {words.called(north)} are metres east and north, {why}"
    if not named:
        doubts = (
            *doubts,
            f"which of {words.called(east)} and {words.called(north)} points east is a guess: no name says so",
        )
    uses = {"east": (east, "m"), "north": (north, "m")}
    return Places(table.name, uses, grid, stream, path, named, told, doubts, table)


def _grid_of(names: str, east: Floats, north: Floats, crs: str) -> tuple[str, str, tuple[str, ...]]:
    """The grid of some metres, why, and what is not known of it."""
    e, n = (float(np.median(one)) if one.size else 0.0 for one in (east, north))
    if crs:
        return crs, f"in {crs} as told", ()
    if max(abs(e), abs(n)) < _LOCAL_M:
        return (
            LOCAL,
            f"of a local plane: they stay within {max(np.abs(east).max(), np.abs(north).max()):.0f} m of zero",
            (),
        )
    if _UTM_EAST_M[0] < e < _UTM_EAST_M[1] and _UTM_NORTH_M[0] < n < _UTM_NORTH_M[1]:
        zone = _UTM_NAMED.search(names.lower())
        if zone is not None and 1 <= int(zone[1]) <= 60:
            code = (32600 if zone[2] == "n" else 32700) + int(zone[1])
            return f"EPSG:{code}", f"in UTM zone {zone[1]}{zone[2].upper()} by its name", ()
        doubt = (
            "the numbers look like UTM, and no number says which zone: zone 31 north stands in the file. Radii and "
            "track are the same in every northern zone, and only the place on the map is not: give "
            "--crs (EPSG:32633 is zone 33)"
        )
        return "EPSG:32631", f"as large as those of UTM ({e:.0f}, {n:.0f})", (doubt,)
    doubt = (
        f"east {e:.0f} and north {n:.0f} are those of a grid that the numbers do not name: they are taken as metres on "
        "the ground, and radii may be off by some 0.1 %: give --crs EPSG:…"
    )
    return LOCAL, "of a plane", (doubt,)


def require_grid(crs: str) -> str:
    """The user's word for a grid. Raises ValueError where it is none."""
    if crs in ("", LOCAL):
        return crs
    if not re.fullmatch(r"(?i:EPSG):\d{4,6}", crs):
        raise ValueError(f"{crs} must be an EPSG code such as EPSG:32633, or {LOCAL}")
    if not is_of_metres(crs):
        raise ValueError(f"{crs} is no projected grid of metres")
    return crs.upper()


def _stream(table: Logged, t_s: Floats, lat_deg: Floats, lon_deg: Floats) -> FixStream:
    """Fixes without those that only repeat the one before: a table may be faster than they are."""
    new = np.concatenate(([True], (np.diff(lat_deg) != 0) | (np.diff(lon_deg) != 0))) if t_s.size else np.zeros(0, bool)
    new &= (lat_deg != 0) | (lon_deg != 0)
    t, lat, lon = t_s[new], lat_deg[new], lon_deg[new]
    none = np.full(t.size, np.nan)
    unknown = np.full(t.size, -1, dtype=np.int64)
    return FixStream(t, none, False, lat, lon, none, unknown, none, none, np.zeros(t.size))


def _placed(stream: FixStream) -> PlacedFixes | None:
    times = stream.host_t_s if np.isfinite(stream.host_t_s).any() else stream.utc_s
    if times.size < FEWEST_LEGS or not np.isfinite(times).any():
        return None
    return placed_fixes(stream, (float(np.nanmin(times)), float(np.nanmax(times))))


def exchanged(places: Places, wheel_t_s: Floats, counted: Floats) -> Places | None:
    """Latitude and longitude under each other's names, where the way that the wheels go says so; else None.

    A degree of longitude is shorter than one of latitude. Read in exchange, north is too long by 1/cos φ and east too
    short by cos λ: the stretch by which the wheels go equally far every way is then cos φ cos λ, and else 1.
    """
    table = places.table
    if table is None or "latitude" not in places.columns or np.abs(places.stream.lon_deg).max() > _MOST_LAT_DEG:
        return None
    (lat, _), (lon, _) = places.columns["latitude"], places.columns["longitude"]
    angles = np.radians([np.median(places.stream.lat_deg), np.median(places.stream.lon_deg)])
    if_exchanged = float(np.log(np.prod(np.cos(angles))))
    found = float(np.log(north_over_east(moved_by(places.path), wheel_t_s, counted)))
    if if_exchanged > -_STRETCH_SHOWS or abs(found - if_exchanged) > 0.5 * abs(found):
        return None
    doubt = f"{words.called(lat)} and {words.called(lon)} are exchanged, by the way that the wheels go: look at a map"
    return next((replace(one, doubts=(doubt,)) for one in _in_degrees(table, lon, lat, True)), None)


def moved_in_time(places: Places, by_s: float, doubt: str) -> Places:
    """The same fixes with all of their times moved."""
    stream = replace(places.stream, host_t_s=places.stream.host_t_s + by_s, utc_s=places.stream.utc_s + by_s)
    path = replace(places.path, t_s=places.path.t_s + by_s)
    return replace(places, stream=stream, path=path, doubts=(*places.doubts, doubt))


def _is_a_path(path: PlacedFixes) -> bool:
    """Whether fixes go somewhere, no faster than a robot does, and mostly in small steps."""
    if path.t_s.size < FEWEST_LEGS:
        return False
    steps = np.abs(np.diff(path.east_m + 1j * path.north_m))
    speed = steps / np.diff(path.t_s)
    return float(np.median(speed)) < FASTEST_MPS and legs(path.east_m, path.north_m, path.leg_m).size > FEWEST_LEGS
