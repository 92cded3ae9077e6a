"""The formats by name, what each needs, and what it leaves out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sccal.errors import UsageError
from sccal.export.ardupilot import write_ardupilot
from sccal.export.estimates import usable, why_not
from sccal.export.geojson import write_geojson
from sccal.export.gpx import write_gpx
from sccal.export.kml import write_kml
from sccal.export.result import Result
from sccal.export.robot_localization import write_robot_localization
from sccal.export.ros2_control import write_ros2_control
from sccal.export.tum import write_tum

_GEOMETRY = ("radius_right_m", "radius_left_m", "track_m")


@dataclass(frozen=True)
class Format:
    """One format: its name on the command line, what it is for, and its writer."""

    name: str
    purpose: str
    write: Callable[[Result], str]
    """The whole file's text. Raises UsageError where the result lacks what the format is about, DataError where a file
    is damaged."""
    parameters: tuple[str, ...] = ()
    """Of calibration.json's, those it holds; none for a format of the path."""
    effects: tuple[str, ...] = ()
    """Effects that it has a place for."""


FORMATS = {
    one.name: one
    for one in (
        Format(
            "ros2_control",
            "diff_drive_controller: nominal geometry and calibrated multipliers",
            write_ros2_control,
            _GEOMETRY,
        ),
        Format(
            "robot_localization",
            "ekf_node and navsat_transform_node: yaw_offset, the antenna's transform",
            write_robot_localization,
            ("heading_offset_deg",),
            ("lever_arm",),
        ),
        Format(
            "ardupilot",
            "parameter lines for a rover: encoders, antenna, age of the fixes",
            write_ardupilot,
            (*_GEOMETRY, "heading_offset_deg"),
            ("lever_arm", "gnss_latency"),
        ),
        Format("geojson", "the path for QGIS, geojson.io and web maps", write_geojson),
        Format("kml", "the path for Google Earth, with times", write_kml),
        Format("gpx", "the path for map and track viewers, with times", write_gpx),
        Format("tum", "the path for evo", write_tum),
    )
}
"""In the order in which they are listed."""


def format_named(name: str) -> Format:
    """The format of that name. Raises UsageError with all names where there is none."""
    if name not in FORMATS:
        raise UsageError(f"no format {name!r}; there are {', '.join(FORMATS)}")
    return FORMATS[name]


def left_out(chosen: Format, result: Result) -> list[str]:
    """What a reader of the file must not miss, a line each: a doubtful result, no value, no place in the format."""
    lines = []
    if result.verdict.startswith("doubtful"):
        lines.append(f"the result is {result.verdict}")
    lines += [
        f"{key} is not set: {why_not(result.parameters[key])}"
        for key in chosen.parameters
        if not usable(result.parameters[key])
    ]
    if chosen.parameters:
        for effect, named in result.effects.items():
            if effect not in chosen.effects:
                lines.append(f"{effect} was estimated too and is not written in this format")
            else:
                lines += [
                    f"{effect}: {key} is not set: {why_not(one)}" for key, one in named.items() if not usable(one)
                ]
    return lines
