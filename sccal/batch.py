"""Many runs in one call: each calibrated on its own, written at once, and none stopped by another's failure."""

from __future__ import annotations

import os
import re
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
from sccal.errors import DataError, Failure, SccalError, UsageError, as_known
from sccal.experiments.experiments import run_experiments
from sccal.experiments.result import Experiments
from sccal.filter.forward import say_if_compiling
from sccal.filter.iterate import RunProblem
from sccal.filter.start import find_start
from sccal.inspect.inspect import inspect_run
from sccal.inspect.result import Inspection
from sccal.logs.options import ReadOptions
from sccal.logs.run import RunSource, find_runs, read_run
from sccal.logs.streams import Vehicle
from sccal.report.diagnosis_write import write_diagnosis
from sccal.report.experiments_write import write_experiments
from sccal.report.inspect_write import write_inspection
from sccal.report.write import begin_loading, write_calibration, write_vehicle


@dataclass
class Batch:
    """What one call found and wrote."""

    calibrated: list[Calibration] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    vehicles: list[tuple[VehicleCalibration, Path]] = field(default_factory=list)
    """Each with the JSON file that was written."""


def calibrate_paths(
    paths: Sequence[Path],
    out: Path,
    options: CalibrationOptions,
    tell: Callable[[RunSource, Calibration | SccalError], None],
    read: ReadOptions | None = None,
    with_mcap: bool = False,
    with_pdf: bool = False,
) -> Batch:
    """Calibrate every run below the paths, write what each gives to out/<run>, then the vehicles to out.

    ``tell`` is called after each run, with its result or with why there is none; ``read`` is for logs of messages.
    ``with_mcap`` writes a calibration.mcap with each run's results, ``with_pdf`` a report.pdf.
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
            calibration, problem = calibrate_run(read_run(source, read), options)
            if options.effects:
                calibration = with_honest_effects(calibration, problem)
            write_calibration(calibration, out / source.name, with_mcap, with_pdf)
        except Exception as error:
            known = as_known(error)
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
    paths: Sequence[Path], out: Path, options: CalibrationOptions, read: ReadOptions | None = None
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
            aligned = align(read_run(source, read))
            find_start(aligned)
        except Exception as error:
            failures.append(Failure(source.name, as_known(error)))
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
            failures.append(Failure(name, as_known(error)))
            continue
        diagnosed.append((diagnosis, folder / "diagnosis.html"))
    return diagnosed, failures


def experiment_on_paths(
    paths: Sequence[Path],
    out: Path,
    seeds: int,
    duration_s: float,
    jobs: int | None,
    tell: Callable[[str], None],
) -> tuple[Experiments, Path, list[Failure]]:
    """The paper's experiments on simulated drives and on the runs below the paths, written to out.

    Returns what they gave, its page, and which paths and runs gave nothing.
    """
    sources, failures = find_runs(paths) if paths else ([], [])
    _check_out(out, sources)
    say_if_compiling()
    done = run_experiments(seeds, duration_s, sources, jobs, tell)
    failures += [Failure(one.name, DataError(one.reason)) for one in done.failed]
    return done, write_experiments(done, out), failures


def inspect_paths(
    paths: Sequence[Path], out: Path | None, read: ReadOptions | None = None
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
            found = inspect_run(source, read)
            page = None if out is None else write_inspection(found, out / source.name)
        except Exception as error:
            failures.append(Failure(source.name, as_known(error)))
            continue
        inspected.append((found, page))
    return inspected, failures


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
        if os.path.realpath(out / source.name) == os.path.realpath(source.path):
            raise UsageError(f"--out {out}: results would be written into the run's own folder {source.path}")
