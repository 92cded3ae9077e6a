"""The same for several runs at once: the compiled kernels leave the interpreter free."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """The results in the order of the items; the first failure is raised."""
    items = list(items)
    if len(items) < 2:
        return [function(one) for one in items]
    with ThreadPoolExecutor(max_workers=min(os.cpu_count() or 1, len(items), 4)) as pool:
        return list(pool.map(function, items))
