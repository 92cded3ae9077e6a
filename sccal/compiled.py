"""Compilation of the kernel, with a cache that cannot go stale.

numba's cache watches the file of the compiled function only: after an edit to another file that it calls, it would
silently run the old code. The cache folder is therefore keyed by a hash of every source that compiles anything.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def _cache_home() -> Path:
    """The user's cache folder; a temporary one where that cannot be written."""
    for base in (os.environ.get("SCCAL_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME"), str(Path.home() / ".cache")):
        if not base:
            continue
        folder = Path(base) / "sccal"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return Path(tempfile.gettempdir()) / f"sccal-{os.getuid() if hasattr(os, 'getuid') else 'user'}"


def source_key() -> str:
    """Hash of the sources that use this module, and of what compiles them."""
    digest = hashlib.sha256(f"{sys.version_info[:2]} {numba.__version__}".encode())
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        source = path.read_bytes()
        if b"sccal.compiled" in source or path == Path(__file__):
            digest.update(source)
    return digest.hexdigest()[:16]


CACHE_DIR = _cache_home() / source_key()


def is_compiled() -> bool:
    """Whether an earlier call left the machine code behind (if not, the first call takes some seconds)."""
    return CACHE_DIR.is_dir() and any(CACHE_DIR.rglob("*.nbc"))


def compiled(function: F) -> F:
    """``numba.njit`` without the GIL, cached under CACHE_DIR, put into whatever compiled function calls it.

    A call that is not inlined hands over every field of every array of every tuple, some three hundred words: it made
    the filter of ten states four times slower.
    """
    settings: Any = numba.config
    before = settings.CACHE_DIR
    settings.CACHE_DIR = str(CACHE_DIR)
    try:
        return cast(F, numba.njit(cache=True, nogil=True, error_model="numpy", forceinline=True)(function))
    finally:
        settings.CACHE_DIR = before
