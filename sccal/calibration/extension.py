"""Effects of the catalogue as further parameters of the filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats
from sccal.calibration.result import Estimate, Status
from sccal.effects.catalogue import effect_named
from sccal.effects.effect import Effect, Parameter
from sccal.effects.view import Belief, view_drive
from sccal.errors import UsageError
from sccal.filter.columns import Placed, kernel_columns
from sccal.filter.iterate import At, RunProblem
from sccal.filter.layout import Columns

UNOBSERVED_RATIO = 0.5


@dataclass(frozen=True)
class FreeEffects:
    """Some effects, their parameters free, in the order given."""

    effects: tuple[Effect, ...]

    @classmethod
    def named(cls, names: Sequence[str]) -> FreeEffects | None:
        """By name; None for no names. Raises UsageError for unknown ones, and for those that need a search."""
        effects = tuple(effect_named(name) for name in dict.fromkeys(names))
        for effect in effects:
            shapes = [parameter.name for parameter in effect.parameters if parameter.shape]
            if shapes:
                raise UsageError(f"effect {effect.name}: its {', '.join(shapes)} must be searched for, not filtered")
        return cls(effects) if effects else None

    @property
    def parameters(self) -> tuple[tuple[Effect, Parameter], ...]:
        """Every parameter with its effect, as the filter holds them."""
        return tuple((effect, parameter) for effect in self.effects for parameter in effect.parameters)

    @property
    def prior_sigmas(self) -> Floats:
        """(m,) about zero, in file units."""
        return np.array([parameter.prior_sigma for _, parameter in self.parameters])

    def columns(self, problem: RunProblem, at: At) -> Columns:
        """The kernel's columns, linearised at the given values along the given path."""
        view = view_drive(problem.aligned, problem.timeline, _belief(problem, at))
        numbers = {(effect.name, one.name): k for k, (effect, one) in enumerate(self.parameters)}
        placed = []
        for effect in self.effects:
            values = {one.name: float(at.values[numbers[effect.name, one.name]]) for one in effect.parameters}
            placed += [
                Placed(numbers[effect.name, column.parameter], column) for column in effect.columns(view, values)
            ]
        return kernel_columns(placed, problem.timeline)

    def estimates(self, values: Floats, covariance: Floats) -> dict[str, dict[str, Estimate]]:
        """What was found, by effect and parameter; values (m,) and covariance (m, m) in file units."""
        found: dict[str, dict[str, Estimate]] = {}
        sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        for (effect, one), value, sigma in zip(self.parameters, values.tolist(), sigmas.tolist(), strict=True):
            found.setdefault(effect.name, {})[one.name] = _judged(effect, one, value, sigma)
        return found


def _judged(effect: Effect, parameter: Parameter, value: float, sigma: float) -> Estimate:
    status: Status = "estimated"
    reason = ""
    if sigma > UNOBSERVED_RATIO * parameter.prior_sigma:
        status = "unobserved"
        reason = f"this drive does not show {effect.name} {parameter.name}: {effect.excited_by}"
    elif not parameter.lower < value < parameter.upper:
        status = "at_bound"
        reason = f"{effect.name} {parameter.name} beyond {parameter.lower:g} … {parameter.upper:g} {parameter.unit}"
    return Estimate(value, sigma, status, reason, None, parameter.prior_sigma)


def _belief(problem: RunProblem, at: At) -> Belief:
    """The path of an earlier pass, or the wheels laid out along the AHRS yaw from where the run starts."""
    constants, start = at.constants, problem.start
    if at.path is not None:
        state = at.path.state
        t_s, east, north, yaw = at.path.timeline.out_t_s, state[:, 0], state[:, 1], state[:, 2]
    if at.path is None or t_s.size < MIN_PATH:
        aligned = problem.aligned
        turned = start.wheel_scale * np.exp(-1j * start.offset_rad) * aligned.path_along_yaw
        t_s = aligned.wheel_t_s
        east, north = start.east_m + turned.real, start.north_m + turned.imag
        yaw = np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad) - start.offset_rad
    return Belief(constants.radius_right_m, constants.radius_left_m, constants.track_m, t_s, yaw, east, north)


MIN_PATH = 10
"""Output times of a pass below which it does not show the path: the noise search keeps almost none."""
