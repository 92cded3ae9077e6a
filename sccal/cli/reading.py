"""What every command that reads runs takes: their paths, and how logs of messages are read."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from sccal.errors import UsageError

READ_OPTIONS = {
    "wheels_topic": "Topic of the wheels, where several could be.",
    "heading_topic": "Topic of the heading, where several could be.",
    "fix_topic": "Topic of the fixes, where several could be.",
    "left_joint": "Joint of the left wheel, where the names do not say.",
    "right_joint": "Joint of the right wheel.",
    "left_ticks": "Field with the left wheel's ticks, as TOPIC:path, of any message.",
    "right_ticks": "Field with the right wheel's ticks.",
    "left_rad": "Field with the left wheel's angle, instead.",
    "right_rad": "Field with the right wheel's angle, instead.",
    "yaw": "Field with the heading: radians, or degrees where its name ends in deg.",
    "latitude": "Field with the latitude of the fixes, degrees.",
    "longitude": "Field with the longitude of the fixes, degrees.",
    "time": "Time of messages: header (their own stamp, where not zero), log or publish.",
    "orientation": "Quaternions in messages: enu (as ROS asks) or ned.",
}
"""How logs of messages (.mcap, .db3, .bag) are read: the fields of ReadOptions, with their help."""
_READ_CHOICES = {"time": ("header", "log", "publish"), "orientation": ("enu", "ned")}

Paths = Annotated[list[Path], typer.Argument(help="Runs, or folders of runs at any depth.", show_default=False)]

PathsOrUrls = Annotated[
    list[str],
    typer.Argument(help="Runs, folders of runs at any depth, or URLs as s3://bucket/logs/**.", show_default=False),
]


def local_or_url(text: str) -> Path | str:
    """An argument as a path, but for a URL: its slashes would not survive."""
    return text if "://" in text else Path(text)


def with_read_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with an option for each field of ReadOptions, which it gets together as ``read``."""

    @functools.wraps(command)
    def with_options(**given: Any) -> None:
        from sccal.logs.options import ReadOptions

        chosen = {name: given.pop(name).strip() for name in READ_OPTIONS}
        for name, choices in _READ_CHOICES.items():
            if chosen[name] not in choices:
                raise UsageError(f"--{name} {chosen[name]}: must be {', '.join(choices[:-1])} or {choices[-1]}")
        command(**given, read=ReadOptions(**chosen))

    command.__annotations__["read"] = object  # its module is heavy, and typer never sees it
    own = inspect.signature(command, eval_str=True)
    kept = [parameter for name, parameter in own.parameters.items() if name != "read"]
    added = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=_READ_CHOICES.get(name, ("",))[0],
            annotation=Annotated[str, typer.Option(help=text, show_default=name in _READ_CHOICES)],
        )
        for name, text in READ_OPTIONS.items()
    ]
    parameters = [*kept, *added]
    del with_options.__wrapped__
    with_options.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {one.name: one.annotation for one in parameters}
    return with_options
