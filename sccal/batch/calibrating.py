"""Many runs in one call: each calibrated on its own, written at once, and none stopped by another's failure.

What is told and written does not depend on who did the work, how many did, or what stood there already.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from sccal.batch.folder import finished, write_run
from sccal.batch.record import RunRecord
from sccal.batch.remote import find_sources
from sccal.batch.tasks import AlsoWritten, CalibrateRun, Done, Source
from sccal.batch.vehicle_fit import Member, vehicle_of_runs
from sccal.batch.vehicles import as_file_name, check_out, free_stem, identity_of
from sccal.calibration.options import CalibrationOptions
from sccal.errors import Failure, Interrupted, SccalError, UsageError
from sccal.filter.forward import say_if_compiling
from sccal.logs.options import ReadOptions
from sccal.logs.run import RunSource
from sccal.processes import Here, Workers
from sccal.report.write import begin_loading, write_vehicle
from sccal.results.calibration import Calibration, VehicleCalibration

Told = Callable[[Source, Calibration | SccalError], None]


class Progress(Protocol):
    """Who wants to know how far it is."""

    def found(self, runs: int) -> None:
        """So many runs there are."""
        ...

    def done(self) -> None:
        """One more is."""
        ...


@dataclass
class Batch:
    """What one call found and wrote."""

    runs: list[Calibration] = field(default_factory=list)
    """In the order of the runs; without arrays over time."""
    failures: list[Failure] = field(default_factory=list)
    vehicles: list[tuple[VehicleCalibration, Path]] = field(default_factory=list)
    """Each with the JSON file that was written."""
    unchanged: int = 0
    """How many of the runs stood already and were not repeated."""


def calibrate_paths(
    paths: Sequence[Path | str],
    out: Path,
    options: CalibrationOptions,
    tell: Told,
    read: ReadOptions | None = None,
    also: AlsoWritten | None = None,
    *,
    workers: Workers | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Batch:
    """Calibrate every run below the paths, write what each gives to out/<run>, then the vehicles to out.

    ``tell`` is called for each run in order, with its result or with why there is none; ``read`` is for logs of
    messages. ``workers`` does the work: by default this process. With ``resume``, whole results in out from the same
    inputs, options and versions are not made again.

    Raises:
        UsageError: a path does not exist, or out cannot hold results.
        Interrupted: by Ctrl-C; what was done until then is written.
    """
    workers = workers or Here()
    sources, failures = find_sources(paths)
    batch = Batch(failures=failures)
    if sources:
        check_out(out, [source for source in sources if isinstance(source, RunSource)])
        say_if_compiling()
        if isinstance(workers, Here):
            begin_loading()
    tasks = [CalibrateRun(source, options, read or ReadOptions(), also or AlsoWritten()) for source in sources]
    runs = _Runs(tasks, out, batch, tell, progress)
    try:
        runs.work(workers, resume)
        runs.into_vehicles(workers)
    except KeyboardInterrupt:
        workers.stop()
        raise Interrupted(
            f"interrupted: {runs.count_done} of {len(tasks)} runs are done and stand in {out}/; "
            "the same command with --resume goes on from there"
        ) from None
    except BaseException:
        workers.stop()
        raise
    return batch


class _Runs:
    """The runs of one call on their way into the batch."""

    def __init__(
        self, tasks: Sequence[CalibrateRun], out: Path, batch: Batch, tell: Told, progress: Progress | None
    ) -> None:
        self.tasks, self.out, self.batch, self.tell, self.progress = tasks, out, batch, tell, progress
        self.results: list[RunRecord | SccalError | None] = [None] * len(tasks)
        self.told_texts = [""] * len(tasks)
        self.told = 0
        if progress is not None:
            progress.found(len(tasks))

    @property
    def count_done(self) -> int:
        """Runs whose results stand."""
        return sum(isinstance(result, RunRecord) for result in self.results)

    def folder(self, place: int) -> Path:
        """Where a run's results go."""
        return self.out / self.tasks[place].source.name

    def work(self, workers: Workers, resume: bool) -> None:
        """All runs, as they come; told in order."""
        standing = {place: finished(self.folder(place)) for place in range(len(self.tasks))} if resume else {}
        keys = {place: record.key for place, record in standing.items() if record is not None}
        tasks = [
            CalibrateRun(task.source, task.options, task.read, task.also, keys.get(place, ""))
            for place, task in enumerate(self.tasks)
        ]
        for place, done in workers.results(tasks):
            if isinstance(done, Done) and done.unchanged:
                self.results[place] = standing[place]
                self.batch.unchanged += 1
            else:
                self._keep(place, Done(error=done) if isinstance(done, SccalError) else done)
            if self.progress is not None:
                self.progress.done()
            self._tell_in_order()

    def _keep(self, place: int, done: Done) -> None:
        self.told_texts[place] = done.told
        if done.record is None or done.files is None:
            self.results[place] = done.error
            return
        try:
            write_run(self.folder(place), done.files, done.record)
            self.results[place] = done.record
        except UsageError as error:
            self.results[place] = error

    def _tell_in_order(self) -> None:
        while self.told < len(self.results) and (result := self.results[self.told]) is not None:
            source = self.tasks[self.told].source
            if self.told_texts[self.told]:
                print(self.told_texts[self.told], end="", file=sys.stderr, flush=True)
            if isinstance(result, SccalError):
                self.batch.failures.append(Failure(source.name, result))
                self.tell(source, result)
            else:
                self.tell(source, result.calibration)
            self.told += 1

    def into_vehicles(self, workers: Workers) -> None:
        """The vehicles from their runs, and their files."""
        of_vehicle: dict[tuple[object, ...], list[Member]] = {}
        for task, result in zip(self.tasks, self.results, strict=True):
            if isinstance(result, RunRecord):
                of_vehicle.setdefault(identity_of(result.calibration.vehicle), []).append(Member(task, result))
                self.batch.runs.append(result.calibration)
        taken: set[str] = set()
        for members in of_vehicle.values():
            declared = members[0].record.calibration.vehicle.name
            try:
                vehicle = vehicle_of_runs(members, workers)
            except SccalError as error:
                self.batch.failures.append(Failure(declared, error))
                continue
            name = as_file_name(declared)
            stem = "vehicle" if len(of_vehicle) == 1 else free_stem(f"vehicle-{name}", taken)
            write_vehicle(vehicle, self.out, stem)
            self.batch.vehicles.append((vehicle, self.out / f"{stem}.json"))
