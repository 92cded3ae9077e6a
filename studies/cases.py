"""Many cases in a pool of processes: none stops another, and each can be made again alone."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

Case = TypeVar("Case")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Outcome(Generic[Case, Result]):
    """A case with its result, or with what went wrong."""

    case: Case
    result: Result | None
    error: str
    seconds: float


@dataclass(frozen=True)
class PoolOptions:
    """How the cases of a study are run."""

    jobs: int = 0
    keep: Path | None = None
    """Where the logs and sccal's results are kept; None throws them away."""
    only: tuple[int, ...] = ()
    """Numbers of the cases that are to be run; empty means all."""


def run_cases(
    work: Callable[[Case, Path], Result], cases: Sequence[Case], options: PoolOptions
) -> list[Outcome[Case, Result]]:
    """Run the work on all cases, each with a folder of its own, and say on stderr how far it is."""
    chosen = [(number, case) for number, case in enumerate(cases) if not options.only or number in options.only]
    outcomes: dict[int, Outcome[Case, Result]] = {}
    begun = time.monotonic()
    for number, outcome in _in_workers(work, chosen, options):
        outcomes[number] = outcome
        elapsed = time.strftime("%H:%M:%S", time.gmtime(time.monotonic() - begun))
        state = f"{outcome.seconds:.0f} s " + (outcome.error.splitlines()[-1] if outcome.error else "ok")
        print(
            f"[{len(outcomes):3d}/{len(chosen)}] {elapsed} case {number} {outcome.case} {state}",
            file=sys.stderr,
            flush=True,
        )
    return [outcomes[number] for number in sorted(outcomes)]


def _in_workers(
    work: Callable[[Case, Path], Result], chosen: Sequence[tuple[int, Case]], options: PoolOptions
) -> Iterator[tuple[int, Outcome[Case, Result]]]:
    """Outcomes as they come. Every worker is a pool of one process, so a process that dies takes one case with it."""
    local = threading.local()

    def run(number: int, case: Case) -> tuple[int, Outcome[Case, Result]]:
        if not hasattr(local, "worker"):
            local.worker = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
        begun = time.monotonic()
        try:
            return number, local.worker.submit(_guarded, work, case, number, options.keep).result()
        except BrokenProcessPool:
            local.worker.shutdown(wait=False)
            del local.worker
            return number, Outcome(case, None, "the process died", time.monotonic() - begun)

    with ThreadPoolExecutor(options.jobs or os.cpu_count() or 1) as threads:
        for done in as_completed([threads.submit(run, number, case) for number, case in chosen]):
            yield done.result()


def _guarded(work: Callable[[Case, Path], Result], case: Case, number: int, keep: Path | None) -> Outcome[Case, Result]:
    """One case; whatever goes wrong in it becomes text."""
    begun = time.monotonic()
    try:
        with _folder(number, keep) as folder:
            result = work(case, folder)
    except Exception as error:
        text = f"{traceback.format_exc()}\n{type(error).__name__}: {error}".strip()
        return Outcome(case, None, text, time.monotonic() - begun)
    return Outcome(case, result, "", time.monotonic() - begun)


@contextmanager
def _folder(number: int, keep: Path | None) -> Iterator[Path]:
    """A folder for one case: kept, or gone afterwards."""
    if keep is not None:
        folder = keep / f"case-{number:04d}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        yield folder
        return
    with tempfile.TemporaryDirectory(prefix="sccal-study-") as name:
        yield Path(name)
