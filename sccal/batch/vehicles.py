"""Whose runs these are, and where results may go."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from sccal.errors import UsageError
from sccal.logs.run import RunSource
from sccal.logs.streams import Vehicle


def identity_of(vehicle: Vehicle) -> tuple[object, ...]:
    """Runs belong to one vehicle if everything declared about it is the same, wherever the files stand."""
    return (
        vehicle.name,
        vehicle.wheel_radius_m,
        vehicle.track_m,
        vehicle.ticks_per_rev,
        vehicle.convention,
    )


def as_file_name(name: str) -> str:
    """The name with nothing that a file system or a shell would mind."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.") or "unnamed"


def free_stem(stem: str, taken: set[str]) -> str:
    """The stem, with a number where it is taken already; taken from now on."""
    count = 2
    free = stem
    while free in taken:
        free = f"{stem}-{count}"
        count += 1
    taken.add(free)
    return free


def check_out(out: Path, sources: Sequence[RunSource]) -> None:
    """Results must not land among the logs they come from."""
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out {out}: a file of that name is in the way")
    for source in sources:
        if os.path.realpath(out / source.name) == os.path.realpath(source.path):
            raise UsageError(f"--out {out}: results would be written into the run's own folder {source.path}")
