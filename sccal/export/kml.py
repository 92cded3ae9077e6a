"""KML 2.2 (OGC 07-147r2) for Google Earth: a track with times (gx:Track) where the run has a date, else a line.

Degrees on WGS 84, longitude before latitude. The path is laid on the ground: the robot's own height is not estimated.
"""

from __future__ import annotations

from xml.sax.saxutils import escape

from sccal.export.result import Result

_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">
"""


def write_kml(result: Result) -> str:
    """The run's path as one Placemark."""
    lat_deg, lon_deg = result.lat_lon_deg
    rows = zip(lon_deg.tolist(), lat_deg.tolist(), strict=True)
    utc = result.utc
    name = escape(result.subject)
    lines = [
        "<Document>",
        f"<name>{name}</name>",
        '<Style id="path"><LineStyle><color>ffb27200</color><width>3</width></LineStyle></Style>',
        "<Placemark>",
        f"<name>{name}</name>",
        "<description>Path of the middle between the wheels</description>",
        "<styleUrl>#path</styleUrl>",
    ]
    if utc:
        lines += ["<gx:Track>", "<altitudeMode>clampToGround</altitudeMode>"]
        lines += [f"<when>{time}</when>" for time in utc]
        lines += [f"<gx:coord>{lon:.9f} {lat:.9f} 0</gx:coord>" for lon, lat in rows]
        lines += ["</gx:Track>"]
    else:
        lines += ["<LineString>", "<tessellate>1</tessellate>", "<altitudeMode>clampToGround</altitudeMode>"]
        lines += ["<coordinates>", *(f"{lon:.9f},{lat:.9f}" for lon, lat in rows), "</coordinates>", "</LineString>"]
    return _HEAD + "\n".join([*lines, "</Placemark>", "</Document>", "</kml>", ""])
