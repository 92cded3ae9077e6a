"""Sccal's commands, called as from a shell but in this process, with limits of time and memory."""

from __future__ import annotations

import contextlib
import io
import os
import re
import resource
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import FrameType

MEMORY_BYTES = 6 * 2**30
"""Address space that a command may take beyond what the process has."""
SECONDS = 240.0


@dataclass(frozen=True)
class Said:
    """How a command ended and all that it printed, on lines of any length and with single spaces."""

    code: int
    text: str
    last: str
    """The last line that is not empty: of the error stream where there is one."""

    def has(self, pattern: str) -> bool:
        """Whether a pattern is found, whatever the case of its letters."""
        return re.search(pattern, self.text, re.IGNORECASE | re.DOTALL) is not None


class TooSlowError(RuntimeError):
    """A command took longer than it may."""


def run_command(arguments: Sequence[str]) -> Said:
    """Call one command and catch its exit code and its texts."""
    from sccal.cli import main

    out, err = io.StringIO(), io.StringIO()
    code = 0
    before, os.environ["COLUMNS"] = sys.argv, "400"
    sys.argv = ["sccal", *arguments]
    try:
        with limits(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except (TooSlowError, MemoryError) as ended:
        code = 4
        err.write(f"\n{type(ended).__name__}")
    finally:
        sys.argv = before
    told = err.getvalue() if code else out.getvalue() + "\n" + err.getvalue()
    lines = [" ".join(line.split()) for line in told.splitlines() if line.strip()]
    return Said(code, " ".join((out.getvalue() + " " + err.getvalue()).split()), lines[-1] if lines else "")


@contextlib.contextmanager
def limits() -> Iterator[None]:
    """Not much more memory than now, and not for ever."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    timed = threading.current_thread() is threading.main_thread()
    resource.setrlimit(resource.RLIMIT_AS, (_address_space() + MEMORY_BYTES, hard))
    previous = signal.signal(signal.SIGALRM, _too_slow) if timed else None
    if timed:
        signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        if timed:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, previous)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _too_slow(_number: int, _frame: FrameType | None) -> None:
    raise TooSlowError


def _address_space() -> int:
    """What the process has now, in bytes."""
    with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 – a pseudo-file
        return int(file.read().split()[0]) * resource.getpagesize()
