"""How far a batch is: a bar where a person watches, nothing but the lines themselves elsewhere."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

    from sccal.batch.calibrating import Progress

_FEWEST_RUNS = 2


@contextmanager
def progress_on(stream: TextIO) -> Iterator[Progress | None]:
    """A bar below the lines that are printed meanwhile; None where there is no terminal that could show one."""
    if not shows_bars(stream):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(file=stream, highlight=False)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as shown:
        yield _Bar(shown)


def shows_bars(stream: TextIO) -> bool:
    """Whether a stream is a terminal that a person watches (not in CI, not dumb, not told to be plain)."""
    plain = os.environ.get("TERM") == "dumb" or any(os.environ.get(name) for name in ("CI", "NO_COLOR"))
    return stream.isatty() and not plain


class _Bar:
    def __init__(self, shown: RichProgress) -> None:
        self._shown = shown
        self._task = shown.add_task("runs", total=None, visible=False)

    def found(self, runs: int) -> None:
        """So many runs there are; one alone is soon done."""
        self._shown.update(self._task, total=runs, visible=runs >= _FEWEST_RUNS)

    def done(self) -> None:
        """One more is."""
        self._shown.advance(self._task)
