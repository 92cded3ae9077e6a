"""Whether a file is MCAP at all: told before anything heavy is loaded."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sccal.errors import DataError

MAGIC = b"\x89MCAP0\r\n"
"""The first and the last bytes of an MCAP file."""


def require_mcap(path: Path) -> None:
    """Look at the file's first bytes.

    Raises:
        DataError: the file cannot be read, is empty, or is no MCAP file.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(len(MAGIC))
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from error
    if not begin:
        raise DataError(f"{path}: is empty (0 bytes); log it again or remove it")
    if begin != MAGIC:
        raise DataError(
            f"{path}: not an MCAP file: at byte 0 stands {begin.hex(' ')}, not {MAGIC.hex(' ')}; "
            "it was never written to, or is something else"
        )


def require_any_mcap(paths: Sequence[Path]) -> None:
    """Where all that is given are files named .mcap, raise DataError of the first unless at least one is MCAP."""
    if not paths or not all(path.suffix.lower() == ".mcap" and path.is_file() for path in paths):
        return
    failures = []
    for path in paths:
        try:
            require_mcap(path)
        except DataError as error:
            failures.append(error)
    if len(failures) == len(paths):
        raise DataError("; ".join(str(failure) for failure in failures))
