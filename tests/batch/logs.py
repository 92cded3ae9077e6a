"""Runs of a minute on disk, and what a command line call leaves of them."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

from tests.runs import written

NAMES = ("a", "b", "c", "d")
COMMAND = (sys.executable, "-m", "sccal", "calibrate")


def some_runs(folder: Path, names: tuple[str, ...] = NAMES, duration_s: float = 60.0) -> Path:
    """A run for each name, every one with noise of its own."""
    for seed, name in enumerate(names):
        written(folder / name, seed=seed, duration_s=duration_s)
    return folder


def contents(folder: Path) -> dict[str, str]:
    """Hash of every file by its path below, hidden ones too."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def calibrate(*arguments: object, expected: int = 0, **environment: str) -> str:
    """Run the command; what it printed on both streams."""
    done = subprocess.run(
        [*COMMAND, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, **environment},
        timeout=120,
        check=False,
    )
    assert done.returncode == expected, done.stdout
    return done.stdout
