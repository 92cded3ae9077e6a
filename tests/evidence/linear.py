"""Runs whose likelihood is exactly Gaussian: z = X θ + noise of variance one, θ the constants and some made effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pytest

from sccal.effects.effect import Effect, Parameter
from sccal.evidence import joint
from sccal.evidence.extension import Free, FreeEffects
from sccal.evidence.joint import JointFit, RunLikelihood, Stretch, fit_jointly
from sccal.filter.iterate import At
from sccal.filter.start import Constants

CENTRE = Constants(0.08, 0.08, 0.7)
CORE_SIGMA = np.array([0.008, 0.008, 0.2])
ROWS = 40
"""Measurements in a stretch."""


class Made(Effect):
    """An effect of parameters alone."""

    looks_like = excited_by = reference = "made for a test"

    def __init__(self, name: str, count: int = 1, scope: str = "vehicle", prior: float = 0.4) -> None:
        self.name = self.title = name
        self.parameters = tuple(
            Parameter(f"p{k}", "m", prior, -10.0, 10.0, scope=scope, matters=0.02) for k in range(count)
        )

    def columns(self, drive, at):
        raise NotImplementedError

    def physics(self, values):
        raise NotImplementedError


@dataclass(frozen=True)
class LinearRun:
    """A run, as the joint fit asks for it."""

    effects: tuple[Effect, ...]
    truth: np.ndarray
    """(3 + m,), or (b, 3 + m): one per stretch"""
    stretches: int = 12
    seed: int = 0

    @property
    def extension(self) -> FreeEffects:
        return FreeEffects(tuple(Free(one) for one in self.effects))

    @property
    def extra(self) -> int:
        return len(self.extension.parameters)

    @property
    def centre(self) -> Constants:
        return CENTRE

    @property
    def prior_mean(self) -> np.ndarray:
        return np.concatenate((CENTRE.as_array(), np.zeros(self.extra)))

    @property
    def prior(self) -> np.ndarray:
        return np.diag(np.concatenate((CORE_SIGMA, self.extension.prior_sigmas)) ** 2)

    @cached_property
    def design(self) -> np.ndarray:
        """(b, ROWS, 3 + m)"""
        rng = np.random.default_rng(self.seed)
        scale = np.concatenate((1.0 / CORE_SIGMA, np.ones(self.extra)))
        return rng.normal(size=(self.stretches, ROWS, 3 + self.extra)) * scale

    @cached_property
    def measured(self) -> np.ndarray:
        """(b, ROWS)"""
        rng = np.random.default_rng(1000 + self.seed)
        truth = np.broadcast_to(self.truth, (self.stretches, 3 + self.extra))
        return np.einsum("bij,bj->bi", self.design, truth) + rng.normal(size=(self.stretches, ROWS))

    def likelihood(self) -> RunLikelihood:
        """What it says, by stretch and as a whole."""
        stretches = tuple(Stretch(x.T @ x, x.T @ z) for x, z in zip(self.design, self.measured, strict=True))
        precision = sum(one.precision for one in stretches)
        return RunLikelihood(precision, sum(one.vector for one in stretches), None, 0.0, stretches)


def fitted(runs: Sequence[LinearRun], monkeypatch: pytest.MonkeyPatch) -> JointFit:
    """The joint fit of such runs."""

    def of(problem: Any, at: At, with_stretches: bool = False) -> RunLikelihood:
        return problem.likelihood()

    with monkeypatch.context() as patch:
        patch.setattr(joint.RunLikelihood, "of", staticmethod(of))
        first = [At(CENTRE, np.zeros(run.extra)) for run in runs]
        return fit_jointly(runs, first, with_stretches=True)


def true_values(effects: Sequence[Effect], by_name: Mapping[str, Sequence[float]]) -> np.ndarray:
    """(3 + m,), zero for effects that are not named."""
    values = [by_name.get(one.name, [0.0] * len(one.parameters)) for one in effects]
    return np.concatenate(([0.081, 0.079, 0.75], *values))
