"""Who does the work of a batch: decided, and begun, before anything heavy is imported."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from sccal.errors import UsageError
from sccal.logs.formats import MESSAGE_SUFFIXES, RUN_FILES, may_be_table
from sccal.logs.names import BAG_FILE
from sccal.processes import ONE_THREAD, Here, Processes, Workers

_RUN_FILES = {*RUN_FILES, BAG_FILE}
_MOST_FOLDERS = 10_000
CALIBRATING = ("sccal.batch.tasks", "sccal.report.run.page")
DIAGNOSING = ("sccal.diagnose.diagnose",)
"""What a process loads while it waits for its first task."""
_SHORT_BYTES = 4_000_000
"""Of the files of a run of five minutes or so."""


def workers_for(paths: Sequence[Path | str], jobs: int | None, scheduler: str = "") -> Workers:
    """This process for one job or one run; else processes, which begin loading at once; or a Dask cluster.

    Raises:
        UsageError: the cluster cannot be used.
    """
    if scheduler:
        if jobs is not None:
            raise UsageError("--jobs is for this machine; with --scheduler the cluster's workers decide")
        from sccal.batch.cluster import Cluster

        return Cluster(scheduler)
    cores = usable_cores()
    runs, size_bytes = runs_and_bytes(paths, 2 * cores if jobs is None else jobs)
    # A few short runs are done sooner here than another process has loaded what they need.
    worth = (runs + size_bytes // _SHORT_BYTES) // 2
    count = min(runs, worth, cores) if jobs is None else min(jobs, runs)
    return Processes(count, CALIBRATING) if count > 1 else Here()


def workers_among(paths: Sequence[Path], jobs: int | None) -> Workers | None:
    """Processes among which the runs of a vehicle are shared; None where threads of this process do as well."""
    most = usable_cores() if jobs is None else jobs
    runs, _ = runs_and_bytes(paths, most)
    count = min(runs, most)
    return Processes(count, DIAGNOSING) if count > 1 else None


def usable_cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def one_thread_each() -> None:
    """Linear algebra in this process starts no threads; to be called before numpy is imported."""
    for name in ONE_THREAD[:-1]:
        os.environ.setdefault(name, "1")


def runs_and_bytes(paths: Sequence[Path | str], most: int) -> tuple[int, int]:
    """How many runs the paths seem to hold (up to ``most``, and so many where it cannot be seen), and their bytes."""
    count = folders = size_bytes = 0
    for path in paths:
        if isinstance(path, str):
            return most, most * _SHORT_BYTES
        walk = [(str(path.parent), [], [path.name])] if path.is_file() else os.walk(path)
        for folder, below, files in walk:
            below[:] = [name for name in below if not name.startswith(".")]
            messages = [name for name in files if name.lower().endswith(MESSAGE_SUFFIXES)]
            tables = [name for name in files if name in _RUN_FILES or may_be_table(name)]
            count += bool(tables) + len(messages)
            for name in [*messages, *tables]:
                with suppress(OSError):
                    size_bytes += Path(folder, name).stat().st_size
            folders += 1
            if count >= most or folders >= _MOST_FOLDERS:
                return most, max(size_bytes, count * _SHORT_BYTES)
    return count, size_bytes
