"""Where a proposal goes: a whole file or none, and never over another one unless told."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from sccal.errors import UsageError
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.write import write_text


def place_for(logs: Path, out: Path | None, force: bool) -> Path:
    """The file to write. Raises UsageError where the logs are no folder, or the file must not be written."""
    if not logs.exists():
        raise UsageError(f"{logs}: no such folder")
    if not logs.is_dir():
        raise UsageError(f"{logs}: is a file; name the run's folder, or a folder of runs")
    place = logs / VEHICLE_FILE if out is None else out
    if place.is_dir():
        place = place / VEHICLE_FILE
    if not place.parent.is_dir():
        raise UsageError(f"--out {place}: there is no folder {place.parent}")
    if os.path.lexists(place) and not force:
        raise _in_the_way(place)
    return place


def write_new(place: Path, text: str, force: bool) -> None:
    """Write the whole file, in one step. Raises UsageError where one has come there since, or it cannot be written."""
    try:
        if force:
            write_text(place, text)
            return
        with tempfile.TemporaryDirectory(dir=place.parent, prefix=f".{place.name}.") as beside:
            whole = Path(beside) / place.name
            write_text(whole, text)
            try:
                os.link(whole, place)
            except FileExistsError:
                raise
            except OSError:  # a file system without hard links
                with place.open("x", encoding="utf-8") as file:
                    file.write(text)
    except FileExistsError as error:
        raise _in_the_way(place) from error
    except OSError as error:
        raise UsageError(f"{place}: cannot be written ({error.strerror or error})") from error


def _in_the_way(place: Path) -> UsageError:
    return UsageError(f"{place}: is there already; --force writes over it, --out FILE writes another one")
