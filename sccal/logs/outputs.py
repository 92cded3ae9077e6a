"""Where logs made from logs go: apart from those that they come from, each with the vehicle.toml that applies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from sccal.errors import Failure, SccalError, UsageError, as_known
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.run import RunSource

Made = TypeVar("Made")


def require_apart(out: Path, sources: Sequence[RunSource], paths: Sequence[Path]) -> None:
    """Logs are never written among the logs that they come from.

    ``paths`` are those of the command line: beside a file that was given by its name there is room for others.

    Raises UsageError where they would be.
    """
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out {out}: a file of that name is in the way")
    files = {path.resolve() for path in paths if path.is_file()}
    places = [(out, out.resolve()), *((out / source.name, (out / source.name).resolve()) for source in sources)]
    for source in sources:
        given = source.path.resolve() in files
        logs = [source.path] if given else [source.path, source.searched_up_to or source.path]
        for folder in logs:
            for place, there in places:
                real = folder.resolve()
                around = real in there.parents or there == real or (there in real.parents and not given)
                if around:
                    raise UsageError(
                        f"--out {out}: {place} overlaps with the logs in {folder}; name a folder outside of them"
                    )


def each_run(
    sources: Sequence[RunSource],
    work: Callable[[RunSource], Made],
    failures: list[Failure],
    tell: Callable[[RunSource, Made | SccalError], None],
) -> list[Made]:
    """What the work made of every run, told as it comes; one that fails is told, kept in failures, and stops none."""
    made: list[Made] = []
    for source in sources:
        try:
            one = work(source)
        except Exception as error:
            known = as_known(error)
            failures.append(Failure(source.name, known))
            tell(source, known)
            continue
        made.append(one)
        tell(source, one)
    return made


def vehicle_place(source: RunSource, out: Path, own: Path) -> tuple[Path, bool]:
    """Where the vehicle.toml of a run found below its root goes for the log made of it below ``out``.

    The place that corresponds to the one where it stands, or that of the run's folder ``own`` where another vehicle's
    file is there already; the second value says so.
    """
    vehicle = source.vehicle_toml
    assert vehicle is not None
    root = source.searched_up_to or source.path
    name = Path(source.name)
    above = vehicle.parent.relative_to(root).parts if vehicle.parent.is_relative_to(root) else ()
    if source.path.is_dir() and vehicle.parent == source.path:
        above = source.path.parent.relative_to(root).parts if source.path != root else ()
    prefix = 0
    if source.path != root:
        prefix = len(name.parts) - len(source.path.relative_to(root).parts)
    shared = out.joinpath(*name.parts[:prefix], *above, VEHICLE_FILE)
    if (own / VEHICLE_FILE).is_file() or (shared.is_file() and shared.read_bytes() != vehicle.read_bytes()):
        return own / VEHICLE_FILE, True
    return shared, False
