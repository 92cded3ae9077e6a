"""All runs of one call, degraded one by one, in the layout in which they were found.

A run found at LOGS/a/b goes to OUT/a/b, and the vehicle.toml that applies to it to the place that corresponds, so that
what is written can be calibrated on its own. One that stands above the path given goes to OUT.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from sccal.degrade.faults import Faults
from sccal.degrade.folder import DegradedRun, degrade_folder
from sccal.degrade.mcap import degrade_mcap
from sccal.errors import DataError, Failure, SccalError
from sccal.logs.compressed import is_packed, tool_for
from sccal.logs.formats import MCAP, message_format
from sccal.logs.messages.parts import parts_after
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.outputs import each_run, require_apart, shared_vehicle_place, vehicle_place
from sccal.logs.run import RunSource, find_runs
from sccal.logs.write import write_bytes


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
    require_apart(out, sources, paths)
    runs = {source.path for source in sources}

    def degrade(source: RunSource) -> DegradedRun:
        if message_format(source.path) is not None:
            return _degrade_file(source, out, faults)
        run = degrade_folder(source, out / source.name, faults, runs - {source.path})
        _copy_vehicle(source, out)
        return run

    return each_run(sources, degrade, failures, tell), failures


def _degrade_file(source: RunSource, out: Path, faults: Faults) -> DegradedRun:
    suffix = source.path.suffix
    if is_packed(source.path):
        raise DataError(f"{source.path}: compressed files are not degraded; unpack it first: `{tool_for(source.path)}`")
    if message_format(source.path) is not MCAP:
        raise DataError(f"{source.path}: of logs of messages only MCAP is degraded; `sccal convert` makes one of it")
    if parts := parts_after(source.path):
        raise DataError(
            f"{source.path}: one drive in {len(parts) + 1} files, and only single ones are degraded; "
            "`sccal convert` makes one of them"
        )
    name = source.name if source.name.endswith(suffix) else source.name + suffix
    place, own = (None, False) if source.vehicle_toml is None else vehicle_place(source, out, out / source.name)
    target = out / source.name / Path(name).name if own else out / name
    run = degrade_mcap(source, target, faults)
    if place is not None and source.vehicle_toml is not None and not place.exists():
        write_bytes(place, source.vehicle_toml.read_bytes())
    return run


def _copy_vehicle(source: RunSource, out: Path) -> None:
    """Put the vehicle.toml of a run where it applies to the new one; beside the run where another stands there."""
    vehicle = source.vehicle_toml
    if vehicle is None or vehicle.parent == source.path:
        return
    text = vehicle.read_bytes()
    own, shared = out / source.name / VEHICLE_FILE, shared_vehicle_place(source, out)
    if shared.exists() and shared.read_bytes() != text:
        write_bytes(own, text)
        return
    own.unlink(missing_ok=True)
    if not shared.exists():
        write_bytes(shared, text)
