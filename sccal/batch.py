"""Many runs in one call: each calibrated on its own, written at once, and none stopped by another's failure."""

from __future__ import annotations

import re
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sccal.align import Aligned, align
from sccal.calibration.combine import combine
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.result import Calibration, VehicleCalibration
from sccal.calibration.single import calibrate_run
from sccal.diagnose.diagnose import diagnose
from sccal.diagnose.honest import with_honest_effects, with_honest_vehicle
from sccal.diagnose.result import Diagnosis
from sccal.errors import DataError, SccalError, UsageError
from sccal.filter.forward import say_if_compiling
from sccal.filter.iterate import RunProblem
from sccal.filter.start import find_start
from sccal.inspect.inspect import inspect_run
from sccal.inspect.result import Inspection
from sccal.logs.run import RunSource, discover, read_run
from sccal.logs.streams import Vehicle
from sccal.report.diagnosis_write import write_diagnosis
from sccal.report.inspect_write import write_inspection
from sccal.report.write import begin_loading, write_calibration, write_vehicle


@dataclass(frozen=True)
class Failure:
    """A run, or a path on the command line, that gave no result."""

    name: str
    error: SccalError


@dataclass
class Batch:
    """What one call found and wrote."""

    calibrated: list[Calibration] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    vehicles: list[tuple[VehicleCalibration, Path]] = field(default_factory=list)
    """Each with the JSON file that was written."""


def find_runs(paths: Sequence[Path]) -> tuple[list[RunSource], list[Failure]]:
    """All runs below the paths; a path that holds none is a failure of its own, not of the others.

    Raises UsageError where a path does not exist.
    """
    fruitful: list[Path] = []
    failures: list[Failure] = []
    for path in paths:
        try:
            discover([path])
        except DataError as error:
            failures.append(Failure(str(path), error))
        else:
            fruitful.append(path)
    return (discover(fruitful) if fruitful else []), failures


def calibrate_paths(
    paths: Sequence[Path],
    out: Path,
    options: CalibrationOptions,
    tell: Callable[[RunSource, Calibration | SccalError], None],
) -> Batch:
    """Calibrate every run below the paths, write what each gives to out/<run>, then the vehicles to out.

    ``tell`` is called after each run, with its result or with why there is none.
    """
    sources, failures = find_runs(paths)
    batch = Batch(failures=failures)
    if sources:
        _check_out(out, sources)
        say_if_compiling()
        begin_loading()
    of_vehicle: dict[tuple[object, ...], list[tuple[Calibration, RunProblem]]] = {}
    for source in sources:
        try:
            calibration, problem = calibrate_run(read_run(source), options)
            if options.effects:
                calibration = with_honest_effects(calibration, problem)
            write_calibration(calibration, out / source.name)
        except Exception as error:
            known = error if isinstance(error, SccalError) else _as_known(error)
            batch.failures.append(Failure(source.name, known))
            tell(source, known)
            continue
        batch.calibrated.append(calibration)
        of_vehicle.setdefault(_identity(calibration.vehicle), []).append((calibration, problem))
        tell(source, calibration)
    taken: set[str] = set()
    for members in of_vehicle.values():
        problems = [problem for _, problem in members]
        vehicle = combine([one for one, _ in members], problems)
        if options.effects and len(members) > 1:
            vehicle = with_honest_vehicle(vehicle, problems)
        stem = (
            "vehicle" if len(of_vehicle) == 1 else _free_stem(f"vehicle-{_as_file_name(vehicle.vehicle.name)}", taken)
        )
        write_vehicle(vehicle, out, stem)
        batch.vehicles.append((vehicle, out / f"{stem}.json"))
    return batch


def diagnose_paths(
    paths: Sequence[Path], out: Path, options: CalibrationOptions
) -> tuple[list[tuple[Diagnosis, Path]], list[Failure]]:
    """Diagnose every vehicle below the paths, all its runs together, and write what is found to out.

    Several vehicles get a folder each below out. Returns every diagnosis with its page, and what gave no result.
    """
    sources, failures = find_runs(paths)
    if sources:
        _check_out(out, sources)
        say_if_compiling()
        begin_loading()
    of_vehicle: dict[tuple[object, ...], list[Aligned]] = {}
    for source in sources:
        try:
            aligned = align(read_run(source))
            find_start(aligned)
        except Exception as error:
            failures.append(Failure(source.name, error if isinstance(error, SccalError) else _as_known(error)))
            continue
        of_vehicle.setdefault(_identity(aligned.vehicle), []).append(aligned)
    diagnosed: list[tuple[Diagnosis, Path]] = []
    taken: set[str] = set()
    for runs in of_vehicle.values():
        name = runs[0].vehicle.name
        try:
            diagnosis = diagnose(runs, options)
            folder = out if len(of_vehicle) == 1 else out / _free_stem(_as_file_name(name), taken)
            write_diagnosis(diagnosis, folder)
        except Exception as error:
            failures.append(Failure(name, error if isinstance(error, SccalError) else _as_known(error)))
            continue
        diagnosed.append((diagnosis, folder / "diagnosis.html"))
    return diagnosed, failures


def inspect_paths(
    paths: Sequence[Path], out: Path | None
) -> tuple[list[tuple[Inspection, Path | None]], list[Failure]]:
    """Inspect every run below the paths; with ``out``, a page and JSON for each to out/<run>.

    Returns every inspection with its page, and what could not be inspected at all.
    """
    sources, failures = find_runs(paths)
    if sources:
        if out is not None:
            _check_out(out, sources)
            begin_loading()
        say_if_compiling()
    inspected: list[tuple[Inspection, Path | None]] = []
    for source in sources:
        try:
            found = inspect_run(source)
            page = None if out is None else write_inspection(found, out / source.name)
        except Exception as error:
            failures.append(Failure(source.name, error if isinstance(error, SccalError) else _as_known(error)))
            continue
        inspected.append((found, page))
    return inspected, failures


def _as_known(error: Exception) -> SccalError:
    """A bug in one run must not take the others with it: shown in full now, counted as internal at the end."""
    traceback.print_exception(error)
    return SccalError(f"internal error ({type(error).__name__}: {error}); please report it with the lines above")


def _identity(vehicle: Vehicle) -> tuple[object, ...]:
    """Runs belong to one vehicle if everything declared about it is the same, wherever the files stand."""
    return (
        vehicle.name,
        vehicle.wheel_radius_m,
        vehicle.track_m,
        vehicle.ticks_per_rev,
        vehicle.convention,
    )


def _as_file_name(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.") or "unnamed"


def _free_stem(stem: str, taken: set[str]) -> str:
    count = 2
    free = stem
    while free in taken:
        free = f"{stem}-{count}"
        count += 1
    taken.add(free)
    return free


def _check_out(out: Path, sources: Sequence[RunSource]) -> None:
    """Results must not land among the logs they come from."""
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out {out}: a file of that name is in the way")
    for source in sources:
        if (out / source.name).resolve() == source.path.resolve():
            raise UsageError(f"--out {out}: results would be written into the run's own folder {source.path}")
