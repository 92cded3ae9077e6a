"""GeoJSON (RFC 7946): the path as a line, its start and its end as points; WGS 84, longitude before latitude.

Coordinates have 9 decimals of a degree (0.1 mm) and no height: the robot's own is not estimated. A path across the
180th meridian is cut there, as section 3.1.9 asks. Dated runs have their times in UTC as
``coordinateProperties.times``, one for each position, unless the path is cut.
"""

from __future__ import annotations

import json
from itertools import pairwise
from typing import Any

from sccal.export.result import Result

Position = tuple[float, float]


def write_geojson(result: Result) -> str:
    """The run's path as a FeatureCollection."""
    lat_deg, lon_deg = result.lat_lon_deg
    positions = list(zip(lon_deg.tolist(), lat_deg.tolist(), strict=True))
    utc = result.utc
    names = {"vehicle": result.vehicle, "run": result.name}
    features = []
    if len(positions) > 1:
        parts = cut_at_180(positions)
        line = {"type": "LineString", "coordinates": parts[0]}
        if len(parts) > 1:
            line = {"type": "MultiLineString", "coordinates": parts}
        whole = len(parts) == 1
        times = {"coordinateProperties": {"times": utc}} if utc and whole else {}
        features.append(_feature(line, names | {"what": "path of the middle between the wheels"} | times))
    for what, index in (("start", 0), ("end", -1)):
        time = {"time": utc[index]} if utc else {}
        features.append(_feature({"type": "Point", "coordinates": positions[index]}, names | {"what": what} | time))
    rows = ",\n".join(json.dumps(feature, ensure_ascii=False) for feature in features)
    return f'{{"type": "FeatureCollection", "features": [\n{rows}\n]}}\n'


def cut_at_180(positions: list[Position]) -> list[list[Position]]:
    """The line in parts of which none crosses the 180th meridian; a cut ends and begins parts on it."""
    parts = [[positions[0]]]
    for (lon, lat), (next_lon, next_lat) in pairwise(positions):
        if abs(next_lon - lon) > 180.0:
            side = 180.0 if lon > 0.0 else -180.0
            unwrapped = next_lon + 2.0 * side
            share = (side - lon) / (unwrapped - lon)
            crossing = round(lat + share * (next_lat - lat), 9)
            parts[-1].append((side, crossing))
            parts.append([(-side, crossing)])
        parts[-1].append((next_lon, next_lat))
    return parts


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}
