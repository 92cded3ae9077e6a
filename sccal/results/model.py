"""A model as a diagnosis judged it, to start from again: effects in their shapes, constants, and noise by run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sccal.arrays import Floats
from sccal.results.calibration import Estimate, Parameters
from sccal.results.noise import Noise

FAR_FROM_ZERO = 3.0


@dataclass(frozen=True)
class Range:
    """Where a column's values lie, over all runs."""

    reference: float
    spread: float

    @classmethod
    def of(cls, values: Iterable[Floats]) -> Range:
        """Of all runs' values together, each (n,)."""
        joined = np.concatenate(list(values))
        mean, spread = float(joined.mean()), float(joined.std())
        return cls(mean if abs(mean) > FAR_FROM_ZERO * spread else 0.0, spread)


@dataclass(frozen=True)
class JudgedEffect:
    """One effect of the model."""

    name: str
    title: str
    parameters: Mapping[str, Estimate]
    """In the files' units; of a run's parameter the mean over the runs."""
    units: Mapping[str, str]
    shapes: Mapping[str, float] = field(default_factory=dict)
    """Places, moments and time constants, as they were found."""
    run: str = ""
    """The run that it belongs to alone; empty for an effect of all runs."""
    told: bool = True
    """False for an effect too small to matter or too unsure to be told, which the model holds because it helps."""
    prior_scale: float = 1.0
    column: Range | None = None
    """Of an effect that follows a logged column: where its values lie over all runs, which its numbers refer to."""


@dataclass(frozen=True)
class JudgedModel:
    """What model.json holds."""

    vehicle: str
    parameters: Parameters
    effects: tuple[JudgedEffect, ...]
    noises: Mapping[str, Noise]
    """By run."""
    outage_end_rms_m: float | None
    """Drift of the model on data that fitted neither, and how it was judged."""
    how: str
