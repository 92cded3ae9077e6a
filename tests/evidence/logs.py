"""Simulated logs with effects in them, each made and fitted once however many tests ask for it."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from sccal.align import Aligned, align
from sccal.effects.catalogue import parse_effect
from sccal.evidence.model import Model, bare_model
from sccal.filter.options import FilterOptions
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.physics import Physics
from sccal.simulate.run import simulate_run
from tests.runs import SMALL, read

HEADING_HZ = 5.0
USUAL_S = 160.0
SETTINGS = (*SMALL, "gnss.outlier_fraction=0.01", "gnss.receive_delay_s=0", "gnss.receive_jitter_s=0")
"""One outlier in a hundred fixes; lines arrive at once: what they take would be part of a latency."""


def write_log(
    folder: Path,
    physics: Sequence[Physics],
    path: str = "general",
    duration_s: float = USUAL_S,
    seed: int = 3,
    settings: Sequence[str] = (),
) -> None:
    """Simulate and write."""
    chosen = settings_from([f"drive.path={path}", f"drive.duration_s={duration_s}", *SETTINGS, *settings], seed)
    write_run(simulate_run(chosen, physics), folder)
    write_vehicle_file(chosen, folder)


@cache
def aligned(
    *texts: str, path: str = "general", duration_s: float = USUAL_S, seed: int = 3, settings: tuple[str, ...] = ()
) -> Aligned:
    """A log with effects as the command line writes them."""
    physics = [effect.physics(values) for effect, values in map(parse_effect, texts)]
    with tempfile.TemporaryDirectory() as folder:
        write_log(Path(folder), physics, path, duration_s, seed, settings)
        return align(read(Path(folder)))


@cache
def bare(*texts: str, path: str = "general", duration_s: float = USUAL_S, settings: tuple[str, ...] = ()) -> Model:
    """The paper's model alone, fitted to one log."""
    log = aligned(*texts, path=path, duration_s=duration_s, settings=settings)
    return bare_model([log], FilterOptions(), HEADING_HZ)


@cache
def several() -> Model:
    """Three short runs of one vehicle, fitted together."""
    return bare_model([aligned(duration_s=120.0, seed=seed) for seed in (1, 2, 3)], FilterOptions(), HEADING_HZ)
