"""Simulated, aligned logs whose noise is known."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from sccal.align import Aligned, align
from tests.runs import read, written


@dataclass(frozen=True)
class TrueNoise:
    """What the simulator's sensors and wheels do, in its own units."""

    white_deg: float
    slow_deg: float
    slow_s: float
    fix_white_m: float
    fix_slow_m: float
    fix_slow_s: float
    slip: float

    @property
    def settings(self) -> tuple[str, ...]:
        """For the simulator."""
        return (
            f"ahrs.white_sigma_deg={self.white_deg}",
            f"ahrs.drift_sigma_deg={self.slow_deg}",
            f"ahrs.drift_time_s={self.slow_s}",
            f"gnss.white_sigma_m={self.fix_white_m}",
            f"gnss.drift_sigma_m={self.fix_slow_m}",
            f"gnss.drift_time_s={self.fix_slow_s}",
            f"vehicle.slip_m_per_sqrt_m={self.slip}",
        )


@cache
def aligned(path: str, noise: TrueNoise, seed: int, *settings: str, duration_s: float = 200.0) -> Aligned:
    """One log with that noise and nothing else."""
    with tempfile.TemporaryDirectory() as folder:
        run = written(Path(folder), *noise.settings, *settings, path=path, duration_s=duration_s, seed=seed)
        return align(read(run))
