"""Whether a file is MCAP at all: told before anything heavy is loaded."""

from __future__ import annotations

from pathlib import Path

from sccal.errors import DataError
from sccal.logs.compressed import head_of

MAGIC = b"\x89MCAP0\r\n"
"""The first and the last bytes of an MCAP file."""


def require_mcap(path: Path) -> None:
    """Look at the file's first bytes.

    Raises:
        DataError: the file cannot be read, is empty, or is no MCAP file.
    """
    begin = head_of(path, len(MAGIC))
    if not begin:
        raise DataError(f"{path}: is empty (0 bytes); log it again or remove it")
    if begin != MAGIC:
        raise DataError(
            f"{path}: not an MCAP file: at byte 0 stands {begin.hex(' ')}, not {MAGIC.hex(' ')}; "
            "it was never written to, or is something else"
        )
