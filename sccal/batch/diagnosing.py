"""Every vehicle of one call diagnosed, all its runs together."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

from sccal.align import Aligned, align
from sccal.batch.vehicles import as_file_name, check_out, free_stem, identity_of
from sccal.calibration.options import CalibrationOptions
from sccal.diagnose.diagnose import diagnose
from sccal.errors import Failure, as_known
from sccal.evidence.parallel import shared_among
from sccal.filter.forward import say_if_compiling
from sccal.filter.start import find_start
from sccal.logs.options import ReadOptions
from sccal.logs.run import find_runs, read_run
from sccal.processes import Workers
from sccal.report.write import begin_loading, write_diagnosis
from sccal.results.diagnosis import Diagnosis


def diagnose_paths(
    paths: Sequence[Path],
    out: Path,
    options: CalibrationOptions,
    read: ReadOptions | None = None,
    workers: Workers | None = None,
) -> tuple[list[tuple[Diagnosis, Path]], list[Failure]]:
    """Diagnose every vehicle below the paths, all its runs together, and write what is found to out.

    Several vehicles get a folder each below out. The runs of a vehicle are shared among the workers, else among threads
    of this process. Returns every diagnosis with its page, and what gave no result.
    """
    sources, failures = find_runs(paths)
    if sources:
        check_out(out, sources)
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
        of_vehicle.setdefault(identity_of(aligned.vehicle), []).append(aligned)
    diagnosed: list[tuple[Diagnosis, Path]] = []
    taken: set[str] = set()
    for runs in of_vehicle.values():
        name = runs[0].vehicle.name
        try:
            with nullcontext() if workers is None else shared_among(workers):
                diagnosis = diagnose(runs, options)
            folder = out if len(of_vehicle) == 1 else out / free_stem(as_file_name(name), taken)
            write_diagnosis(diagnosis, folder)
        except Exception as error:
            failures.append(Failure(name, as_known(error)))
            continue
        diagnosed.append((diagnosis, folder / "diagnosis.html"))
    return diagnosed, failures
