"""Effects as further parameters of the filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from sccal.align import Aligned
from sccal.arrays import Floats
from sccal.calibration.result import Estimate, Status
from sccal.effects.catalogue import effect_named
from sccal.effects.effect import Effect, Parameter
from sccal.effects.logged import logged_effects
from sccal.effects.view import Belief, DriveView, view_drive
from sccal.errors import DataError, UsageError
from sccal.filter.columns import Placed, kernel_columns
from sccal.filter.iterate import At, RunProblem
from sccal.filter.layout import Columns

UNOBSERVED_RATIO = 0.5
MIN_PATH = 10
"""Output times of a pass below which it does not show the path: the noise search keeps almost none."""


@dataclass(frozen=True)
class Free:
    """One effect whose parameters the filter estimates, its shapes (a place, a time) as found by a search."""

    effect: Effect
    shapes: Mapping[str, float] = field(default_factory=dict)
    prior_scale: float = 1.0
    """Factor on the priors: below one for an effect that is in the model only because every log has a little of it."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those that are estimated."""
        return tuple(one for one in self.effect.parameters if not one.shape)

    def placed(self, view: DriveView, values: Sequence[float], first: int) -> list[Placed]:
        """Its columns made at the values of its parameters, numbered from ``first``."""
        number = {one.name: first + k for k, one in enumerate(self.parameters)}
        at = {one.name: float(value) for one, value in zip(self.parameters, values, strict=True)}
        return [Placed(number[column.parameter], column) for column in self.effect.columns(view, {**at, **self.shapes})]


@dataclass(frozen=True)
class FreeEffects:
    """Some effects, their parameters free, in the order given: those of the vehicle before those of one run alone."""

    effects: tuple[Free, ...]

    @classmethod
    def named(cls, names: Sequence[str], aligned: Aligned | None = None) -> FreeEffects | None:
        """By name; None for no names. A further column of the log is named by port and column: heading~motor_current_a.

        Raises UsageError for unknown ones, and for those that need a search; DataError where the log lacks the column.
        """
        effects = tuple(Free(_by_name(name, aligned)) for name in dict.fromkeys(names))
        for free in effects:
            shapes = [parameter.name for parameter in free.effect.parameters if parameter.shape]
            if shapes:
                raise UsageError(
                    f"effect {free.effect.name}: its {', '.join(shapes)} must be searched for, not filtered: "
                    "`sccal diagnose` does"
                )
        return cls(effects) if effects else None

    @property
    def parameters(self) -> tuple[tuple[Effect, Parameter], ...]:
        """Every free parameter with its effect, as the filter holds them."""
        return tuple((free.effect, parameter) for free in self.effects for parameter in free.parameters)

    @property
    def prior_sigmas(self) -> Floats:
        """(m,) about zero, in file units."""
        return np.array([free.prior_scale * one.prior_sigma for free in self.effects for one in free.parameters])

    def columns(self, problem: RunProblem, at: At, clear: tuple[Floats, Floats]) -> Columns:
        """The kernel's columns, linearised at the given values along the given path."""
        return kernel_columns(self.placed(view_run(problem, at, clear), at.values), problem.timeline)

    def placed(self, view: DriveView, values: Floats) -> list[Placed]:
        """All columns made at the given values (m,)."""
        placed: list[Placed] = []
        first = 0
        for free in self.effects:
            last = first + len(free.parameters)
            placed += free.placed(view, values[first:last].tolist(), first)
            first = last
        return placed

    def estimates(self, values: Floats, covariance: Floats) -> dict[str, dict[str, Estimate]]:
        """What was found, by effect and parameter; values (m,) and covariance (m, m) in file units."""
        found: dict[str, dict[str, Estimate]] = {}
        sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        for (effect, one), value, sigma in zip(self.parameters, values.tolist(), sigmas.tolist(), strict=True):
            found.setdefault(effect.name, {})[one.name] = _judged(effect, one, value, sigma)
        return found


def view_run(problem: RunProblem, at: At, clear: tuple[Floats, Floats] | None) -> DriveView:
    """The drive as columns see it, along the given path."""
    return view_drive(problem.aligned, problem.timeline, _belief(problem, at), clear)


def _by_name(name: str, aligned: Aligned | None) -> Effect:
    if "~" not in name:
        return effect_named(name)
    logged = {one.name: one for one in logged_effects([aligned.extras] if aligned else [])}
    if name not in logged:
        raise DataError(
            f"effect {name!r}: this log has no such further column that varies; "
            + (f"there are {', '.join(logged)}" if logged else "it has none at all")
        )
    return logged[name]


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
