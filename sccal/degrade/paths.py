"""All runs of one call, degraded one by one, in the layout in which they were found.

A run found at LOGS/a/b goes to OUT/a/b, and the vehicle.toml that applies to it to the place that corresponds, so that
what is written can be calibrated on its own. One that stands above the path given goes to OUT.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from sccal.degrade.faults import Faults
from sccal.degrade.folder import DegradedRun, degrade_folder
from sccal.errors import Failure, SccalError, UsageError, as_known
from sccal.logs.run import RunSource, find_runs


def degrade_paths(
    paths: Sequence[Path],
    out: Path,
    faults: Faults,
    tell: Callable[[RunSource, DegradedRun | SccalError], None],
) -> tuple[list[DegradedRun], list[Failure]]:
    """Degrade every run below the paths into out/<run>; gives what was written, and what could not be.

    ``tell`` is called after each run, with its result or with why there is none.

    Raises:
        UsageError: a path that does not exist, or a place for the results that overlaps with the logs.
    """
    sources, failures = find_runs(paths)
    _check_out(out, sources)
    degraded: list[DegradedRun] = []
    runs = {source.path for source in sources}
    for source in sources:
        try:
            run = degrade_folder(source, out / source.name, faults, runs - {source.path})
            _copy_vehicle(source, out)
        except Exception as error:
            known = as_known(error)
            failures.append(Failure(source.name, known))
            tell(source, known)
            continue
        degraded.append(run)
        tell(source, run)
    return degraded, failures


def _copy_vehicle(source: RunSource, out: Path) -> None:
    """Put the vehicle.toml of a run where it applies to the new one; beside the run where another stands there."""
    vehicle = source.vehicle_toml
    if vehicle is None or vehicle.parent == source.path:
        return
    text = vehicle.read_bytes()
    root = source.searched_up_to or source.path
    name = Path(source.name)
    above = vehicle.parent.relative_to(root).parts if vehicle.parent.is_relative_to(root) else ()
    prefix = len(name.parts) - len(source.path.relative_to(root).parts) if source.path != root else 0
    own, shared = out / name / "vehicle.toml", out.joinpath(*name.parts[:prefix], *above, "vehicle.toml")
    if shared.exists() and shared.read_bytes() != text:
        _write(own, text)
        return
    own.unlink(missing_ok=True)
    if not shared.exists():
        _write(shared, text)


def _write(path: Path, text: bytes) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    temporary.write_bytes(text)
    temporary.replace(path)


def _check_out(out: Path, sources: Sequence[RunSource]) -> None:
    """Logs are never written among the logs that they come from."""
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out {out}: a file of that name is in the way")
    real = [
        Path(os.path.realpath(folder))
        for source in sources
        for folder in (source.path, source.searched_up_to or source.path)
    ]
    places = [(out, out.resolve()), *((out / source.name, (out / source.name).resolve()) for source in sources)]
    for place, there in places:
        for folder in real:
            if there == folder or there in folder.parents or folder in there.parents:
                raise UsageError(
                    f"--out {out}: {place} overlaps with the logs in {folder}; name a folder outside of them"
                )
