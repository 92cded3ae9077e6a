"""A model as a diagnosis judged it, to start from again: effects in their shapes, constants, and noise by run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

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
class Measured(Estimate):
    """A parameter of an effect with its unit, "1" for ratios."""

    unit: str = ""

    WRITTEN: ClassVar[str] = f"{Estimate.WRITTEN} unit"


@dataclass(frozen=True)
class Shape:
    """A place, a moment or a time constant, as it was found."""

    value: float
    unit: str

    WRITTEN: ClassVar[str] = "value! unit!"


def measured(parameters: Mapping[str, Estimate], units: Mapping[str, str]) -> dict[str, Measured]:
    """Parameters with their units."""
    return {name: Measured(**vars(estimate), unit=units.get(name, "")) for name, estimate in parameters.items()}


def unmeasured(found: Mapping[str, Measured]) -> tuple[dict[str, Estimate], dict[str, str]]:
    """Parameters, and their units."""
    estimates = {
        name: Estimate(one.value, one.sigma, one.status, one.reason, one.nominal, one.prior_sigma)
        for name, one in found.items()
    }
    return estimates, {name: one.unit for name, one in found.items()}


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

    WRITTEN: ClassVar[str] = (
        "effect=name! title! parameters=measured shapes=measured_shapes run=of_run told! prior_scale! column!"
    )

    @property
    def measured(self) -> Mapping[str, Measured]:
        """The parameters, each with its unit."""
        return measured(self.parameters, self.units)

    @property
    def measured_shapes(self) -> Mapping[str, Shape]:
        """The shapes, each with its unit."""
        return {name: Shape(value, self.units.get(name, "")) for name, value in self.shapes.items()}

    @property
    def of_run(self) -> str | None:
        """The run that it belongs to alone."""
        return self.run or None

    @staticmethod
    def further(_: Mapping[str, Any], part: Any) -> dict[str, Any]:
        """What a document tells in other words."""
        parameters, units = unmeasured(part("parameters", Mapping[str, Measured]))
        shapes = part("shapes", Mapping[str, Shape])
        return {
            "parameters": parameters,
            "units": units | {name: one.unit for name, one in shapes.items()},
            "shapes": {name: one.value for name, one in shapes.items()},
            "run": part("run", str | None) or "",
        }


@dataclass(frozen=True)
class RunNoise:
    """The noise of one run with the effects in the model."""

    run: str
    noise: Noise

    WRITTEN: ClassVar[str] = "run! *noise"


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

    SCHEMA: ClassVar[str] = "sccal.model/1"
    WRITTEN: ClassVar[str] = "vehicle! parameters! effects! noise held_out=(outage_end_rms_m how!)"

    @property
    def noise(self) -> tuple[RunNoise, ...]:
        """The noise, run by run."""
        return tuple(RunNoise(run, noise) for run, noise in self.noises.items())

    @staticmethod
    def further(_: Mapping[str, Any], part: Any) -> dict[str, Any]:
        """What a document tells in other words."""
        noises = {one.run: one.noise for one in part("noise", tuple[RunNoise, ...])}
        return {"noises": noises}
