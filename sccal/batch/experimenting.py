"""The paper's experiments in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from sccal.batch.vehicles import check_out
from sccal.errors import DataError, Failure
from sccal.experiments.experiments import run_experiments
from sccal.filter.forward import say_if_compiling
from sccal.logs.run import find_runs
from sccal.report.write import write_experiments
from sccal.results.experiments import Experiments


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
    check_out(out, sources)
    say_if_compiling()
    done = run_experiments(seeds, duration_s, sources, jobs, tell)
    failures += [Failure(failure.name, DataError(failure.reason)) for failure in done.failed]
    return done, write_experiments(done, out), failures
