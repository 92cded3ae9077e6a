"""What can go wrong, in one place: every known failure is one line for the user and one exit code.

A bug is anything that is not an SccalError; it keeps its traceback and exits with 4.
"""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from enum import IntEnum


class Exit(IntEnum):
    """Exit codes of the command line; part of the contract with CI jobs."""

    FINE = 0
    GATE_FAILED = 1
    USAGE = 2
    DATA = 3
    INTERNAL = 4
    NOTHING_MATCHED = 5
    INTERRUPTED = 130


_LONGEST_MESSAGE = 3000


def one_line(text: str) -> str:
    """The text without line ends and other characters that a terminal would obey; what is endless is cut."""
    if not text.isprintable():
        text = "".join(mark if mark.isprintable() else " " if mark.isspace() else "?" for mark in text)
    return text if len(text) <= _LONGEST_MESSAGE else text[: _LONGEST_MESSAGE - 2] + " …"


class SccalError(Exception):
    """A failure that the user can act on. The message is one line: what, where, the numbers, what to do."""

    exit_code: Exit = Exit.INTERNAL

    def __str__(self) -> str:
        return one_line(super().__str__())


class UsageError(SccalError):
    """The command line asks for something that cannot be done."""

    exit_code = Exit.USAGE


class DataError(SccalError):
    """The data cannot support the answer: unreadable, missing, contradictory, or not excited."""

    exit_code = Exit.DATA


class Interrupted(SccalError):  # noqa: N818 (nothing went wrong)
    """The user stopped it; the message says what is done and how to go on."""

    exit_code = Exit.INTERRUPTED


@dataclass(frozen=True)
class Failure:
    """A run, or a path on the command line, that gave no result."""

    name: str
    error: SccalError


def as_known(error: Exception) -> SccalError:
    """A bug in one run must not take the others with it: shown in full now, counted as internal at the end."""
    if isinstance(error, SccalError):
        return error
    traceback.print_exception(error)
    return SccalError(f"internal error ({type(error).__name__}: {error}); please report it with the lines above")
