"""A finding made small: lines, then bytes are left out as long as the failure stays the same."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from fuzz.readers import READERS, feed, signature


def failure_of(name: str, data: bytes, folder: Path) -> str:
    """The signature of what the bytes do to the reader; empty where all is well."""
    try:
        feed(READERS[name], data, folder)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return signature(error)
    return ""


def minimised(name: str, data: bytes, seconds: float = 20.0) -> bytes:
    """The smallest bytes found within so many seconds that fail in the same way."""
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        wanted = failure_of(name, data, folder)
        if not wanted:
            return data
        for cut in (lambda raw: raw.splitlines(keepends=True), lambda raw: [raw[i : i + 1] for i in range(len(raw))]):
            parts = cut(data)
            size = max(len(parts) // 2, 1)
            while size and time.monotonic() < end:
                at = 0
                while at < len(parts) and time.monotonic() < end:
                    fewer = parts[:at] + parts[at + size :]
                    if failure_of(name, b"".join(fewer), folder) == wanted:
                        parts = fewer
                    else:
                        at += size
                size //= 2
            data = b"".join(parts)
    return data
