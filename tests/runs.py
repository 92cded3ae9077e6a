"""Simulated runs for tests, in memory or on disk."""

from __future__ import annotations

from pathlib import Path

from sccal.logs.run import discover, read_run
from sccal.logs.streams import Run
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run

SMALL = ("encoder.rate_hz=20", "ahrs.rate_hz=10")


def written(folder: Path, *settings: str, path: str = "general", duration_s: float = 200.0, seed: int = 1) -> Path:
    """A simulated run's folder, small streams unless set otherwise."""
    chosen = settings_from([f"drive.path={path}", f"drive.duration_s={duration_s}", *SMALL, *settings], seed)
    write_run(simulate_run(chosen), folder)
    write_vehicle_file(chosen, folder)
    return folder


def read(folder: Path) -> Run:
    """The only run in a folder."""
    (source,) = discover([folder])
    return read_run(source)
