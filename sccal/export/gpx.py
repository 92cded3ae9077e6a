"""GPX 1.1 (topografix.com/GPX/1/1/gpx.xsd): the path as one track.

Degrees on WGS 84, times in UTC where the run has a date. No elevation: the robot's own height is not estimated.
"""

from __future__ import annotations

from xml.sax.saxutils import escape

from sccal import __version__
from sccal.export.result import Result

_HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    f'<gpx version="1.1" creator="sccal {__version__}" xmlns="http://www.topografix.com/GPX/1/1" '
    'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
    'xsi:schemaLocation="http://www.topografix.com/GPX/1/1 http://www.topografix.com/GPX/1/1/gpx.xsd">\n'
)


def write_gpx(result: Result) -> str:
    """The run's path as one segment of one track."""
    lat_deg, lon_deg = result.lat_lon_deg
    name = escape(result.subject)
    utc = result.utc
    times = [f"<time>{time}</time>" for time in utc] if utc else [""] * lat_deg.size
    metadata_time = f"<time>{utc[0]}</time>" if utc else ""
    lines = [
        f"<metadata><name>{name}</name>{metadata_time}</metadata>",
        f"<trk><name>{name}</name><desc>Path of the middle between the wheels</desc><trkseg>",
        *(
            f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}">{time}</trkpt>'
            for lat, lon, time in zip(lat_deg.tolist(), lon_deg.tolist(), times, strict=True)
        ),
        "</trkseg></trk>",
        "</gpx>",
        "",
    ]
    return _HEAD + "\n".join(lines)
