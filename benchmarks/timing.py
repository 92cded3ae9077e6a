"""How long calls take, and how that is printed."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

REPEATS = 5


def timed(what: Callable[[], object], repeats: int = REPEATS) -> tuple[float, float, float]:
    """Shortest, median and longest time of a call, s, after one that is not counted."""
    what()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        what()
        times.append(time.perf_counter() - begin)
    return min(times), statistics.median(times), max(times)


def show(name: str, times: tuple[float, float, float], note: str = "") -> None:
    print(f"{name:<44}{times[0]:8.3f}{times[1]:8.3f}{times[2]:8.3f}  {note}", flush=True)


def head(title: str) -> None:
    """The line above a table of times."""
    print(f"{title + ', seconds':<44}{'min':>8}{'median':>8}{'max':>8}", flush=True)
