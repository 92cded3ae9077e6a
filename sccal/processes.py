"""Work in processes of this machine: started early, each with one thread, replaced where the system kills one."""

from __future__ import annotations

import contextlib
import gc
import importlib
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, Protocol, TypeVar

from sccal.errors import SccalError

Result = TypeVar("Result")
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_JOIN_S = 2.0


class Workers(Protocol):
    """Who does tasks: functions without arguments that can be pickled, and raise nothing."""

    def results(self, tasks: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result | SccalError]]:
        """Place and result of each task as they come; an error for one whose process was killed."""
        ...

    def close(self) -> None:
        """Nothing more will be asked."""
        ...

    def stop(self) -> None:
        """At once, whatever is being done."""
        ...


class Here:
    """Work in this process, one task after the other."""

    def results(self, tasks: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result | SccalError]]:
        """In order."""
        for place, task in enumerate(tasks):
            yield place, task()

    def close(self) -> None:
        """Nothing to do."""

    def stop(self) -> None:
        """Nothing to do."""


class Processes:
    """Work in processes that are started at once and load the modules that the work needs meanwhile."""

    def __init__(self, count: int, loads: Sequence[str] = ()) -> None:
        self._idle: list[_Worker] = []
        self._busy: dict[_Worker, int] = {}
        self._count = count
        self._loads = tuple(loads)
        for _ in range(count):
            self._idle.append(_Worker(self._loads))

    def results(self, tasks: Sequence[Callable[[], Result]]) -> Iterator[tuple[int, Result | SccalError]]:
        """As they are done. The task that a process was killed with is told; another process takes its place.

        Where the caller stops asking, or a task cannot be sent, what is still being done is not finished.
        """
        waiting = deque(enumerate(tasks))
        try:
            while waiting or self._busy:
                while waiting and len(self._busy) < self._count:
                    worker = self._idle.pop() if self._idle else _Worker(self._loads)
                    place, task = waiting.popleft()
                    self._busy[worker] = place
                    worker.begin(task)
                ready = wait([worker.connection for worker in self._busy])
                for worker in [one for one in self._busy if one.connection in ready]:
                    place = self._busy.pop(worker)
                    try:
                        result = worker.connection.recv()
                    except (EOFError, OSError):
                        yield place, worker.death()
                        continue
                    self._idle.append(worker)
                    yield place, result
        finally:
            self._stop(self._busy)
            self._busy = {}

    def close(self) -> None:
        """The processes end by themselves when nobody speaks to them any more."""
        for worker in self._idle:
            worker.connection.close()
        for worker in self._idle:
            worker.end()
        self._idle = []

    def stop(self) -> None:
        """Kill them."""
        self._stop([*self._busy, *self._idle])
        self._busy, self._idle = {}, []

    @staticmethod
    def _stop(workers: Collection[_Worker]) -> None:
        for worker in workers:
            worker.process.kill()
        for worker in workers:
            worker.end()


class _Worker:
    """One process and the line to it."""

    def __init__(self, loads: Sequence[str]) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(target=_serve, args=(theirs, loads), daemon=True)
        with _child_environment():
            self.process.start()
        theirs.close()

    def begin(self, task: Callable[[], Any]) -> None:
        # Where the process is dead already, receiving tells it.
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.connection.send(task)

    def death(self) -> SccalError:
        """Why there is no result, once the line is broken."""
        self.end()
        code = self.process.exitcode
        if code is not None and code < 0:
            name = signal.Signals(-code).name
            return SccalError(
                f"its process was killed ({name}); where memory ran out (long runs side by side), use fewer --jobs"
            )
        return SccalError(f"its process ended with exit code {code} in the middle of the work; please report it")

    def end(self) -> None:
        self.connection.close()
        self.process.join(_JOIN_S)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


@contextlib.contextmanager
def _child_environment() -> Iterator[None]:
    """Of a process being started: one thread each, and Ctrl-C is for the parent to answer."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    in_main = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if in_main else None
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        if in_main and handler is not None:
            signal.signal(signal.SIGINT, handler)


def _serve(connection: Connection, loads: Sequence[str]) -> None:
    """Do what comes, until nobody is there any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    for module in loads:
        importlib.import_module(module)
    # What is loaded stays; looking through it again and again for garbage costs a tenth of the work.
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            connection.send(connection.recv()())


def _end_with(sentinel: int) -> None:
    """No process outlives the one that started it, however that ended."""
    wait([sentinel])
    os._exit(1)
