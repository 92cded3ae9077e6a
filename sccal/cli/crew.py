"""Who does the work of a batch: decided, and begun, before anything heavy is imported."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from sccal.batch.processes import ONE_THREAD, Crew, Here, Processes
from sccal.errors import UsageError

_A_RUN_HOLDS = ("encoder.csv", "ahrs.csv", "gnss.nmea", "gnss.csv", "metadata.yaml")


def crew_for(paths: Sequence[Path | str], jobs: int | None, scheduler: str = "") -> Crew:
    """This process for one job or one run; else processes, which begin loading at once; or a Dask cluster.

    Raises:
        UsageError: the cluster cannot be used.
    """
    if scheduler:
        if jobs is not None:
            raise UsageError("--jobs is for this machine; with --scheduler the cluster's workers decide")
        from sccal.batch.cluster import Cluster

        return Cluster(scheduler)
    count = usable_cores() if jobs is None else jobs
    return Processes(count) if count > 1 and _may_hold_several(paths) else Here()


def usable_cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def one_thread_each() -> None:
    """Linear algebra in this process starts no threads; to be called before numpy is imported."""
    for name in ONE_THREAD[:-1]:
        os.environ.setdefault(name, "1")


def _may_hold_several(paths: Sequence[Path | str]) -> bool:
    if len(paths) != 1:
        return True
    (only,) = paths
    if isinstance(only, str):
        return True
    return only.is_dir() and not any((only / name).exists() for name in _A_RUN_HOLDS)
