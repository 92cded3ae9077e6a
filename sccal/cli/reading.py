"""What every command that reads runs takes: their paths, and how logs of messages are read."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from sccal.errors import UsageError
from sccal.logs.options import ReadOptions

_CHOICES = {"time": ("header", "log", "publish"), "orientation": ("enu", "ned")}

Paths = Annotated[list[Path], typer.Argument(help="Runs, or folders of runs at any depth.", show_default=False)]

PathsOrUrls = Annotated[
    list[str],
    typer.Argument(help="Runs, folders of runs at any depth, or URLs as s3://bucket/logs/**.", show_default=False),
]


def local_or_url(text: str) -> Path | str:
    """An argument as a path, but for a URL: its slashes would not survive."""
    return text if "://" in text else Path(text)


def _told(what: str) -> Any:
    return typer.Option(help=what, show_default=False)


@dataclass(frozen=True)
class Reading:
    """How logs of messages (.mcap, .db3, .bag) are read: the fields of ReadOptions."""

    wheels_topic: Annotated[str, _told("Topic of the wheels, where several could be.")] = ""
    heading_topic: Annotated[str, _told("Topic of the heading, where several could be.")] = ""
    fix_topic: Annotated[str, _told("Topic of the fixes, where several could be.")] = ""
    left_joint: Annotated[str, _told("Joint of the left wheel, where the names do not say.")] = ""
    right_joint: Annotated[str, _told("Joint of the right wheel.")] = ""
    left_ticks: Annotated[str, _told("Field with the left wheel's ticks, as TOPIC:path, of any message.")] = ""
    right_ticks: Annotated[str, _told("Field with the right wheel's ticks.")] = ""
    left_rad: Annotated[str, _told("Field with the left wheel's angle, instead.")] = ""
    right_rad: Annotated[str, _told("Field with the right wheel's angle, instead.")] = ""
    yaw: Annotated[str, _told("Field with the heading: radians, or degrees where its name ends in deg.")] = ""
    latitude: Annotated[str, _told("Field with the latitude of the fixes, degrees.")] = ""
    longitude: Annotated[str, _told("Field with the longitude of the fixes, degrees.")] = ""
    time: Annotated[
        str, typer.Option(help="Time of messages: header (their own stamp, where not zero), log or publish.")
    ] = "header"
    orientation: Annotated[str, typer.Option(help="Quaternions in messages: enu (as ROS asks) or ned.")] = "enu"

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            text = getattr(self, name).strip()
            if text not in choices:
                raise UsageError(f"--{name} {text}: must be {', '.join(choices[:-1])} or {choices[-1]}")

    def options(self) -> ReadOptions:
        """As the readers take them."""
        chosen: dict[str, Any] = {name: text.strip() for name, text in asdict(self).items()}
        return ReadOptions(**chosen)
