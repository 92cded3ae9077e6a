"""The same for several runs at once: in processes where a caller offers some, else in threads.

The compiled kernels leave the interpreter free, so that threads share the cores, but all that lays columns out is
interpreted: beyond two cores only processes help. A program that is imported by others starts none by itself, because
every new process loads the program's main module again.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Generic, TypeVar

import numba

from sccal.errors import SccalError
from sccal.processes import Workers

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_THREADS = 4
_free = threading.Lock()
_offered: list[Workers] = []


@contextmanager
def shared_among(workers: Workers) -> Iterator[None]:
    """Let ``each_apart`` use these processes meanwhile."""
    _offered.append(workers)
    try:
        yield
    finally:
        _offered.remove(workers)


def each(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """The results in the order of the items, by threads; the first failure is raised."""
    items = list(items)
    cores = min(numba.get_num_threads(), MOST_THREADS)
    if len(items) < 2 or cores < 2:
        return [function(one) for one in items]
    with ThreadPoolExecutor(max_workers=min(cores, len(items))) as pool:
        return list(pool.map(function, items))


def each_apart(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """The same in processes where there are some: function, items and results can be pickled."""
    items = list(items)
    if not _offered or len(items) < 2 or not _free.acquire(blocking=False):
        return each(function, items)
    try:
        outcomes = dict(_offered[-1].results([_Task(function, one) for one in items]))
    finally:
        _free.release()
    return [_result(outcomes[place]) for place in range(len(items))]


@dataclass(frozen=True)
class _Raised:
    error: Exception


@dataclass(frozen=True)
class _Task(Generic[Item, Result]):
    """A task that raises nothing."""

    function: Callable[[Item], Result]
    item: Item

    def __call__(self) -> Result | _Raised:
        try:
            return self.function(self.item)
        except Exception as error:
            return _Raised(error)


def _result(outcome: Result | _Raised | SccalError) -> Result:
    if isinstance(outcome, _Raised):
        raise outcome.error
    if isinstance(outcome, SccalError):
        raise outcome
    return outcome
