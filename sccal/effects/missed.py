"""Missed counts: a counter that loses a share of a wheel's counts while the wheel turns fast.

travel = R φ / (1 − ratio) while |rate| > above_radps, else R φ      φ as counted      rate of the wheel itself

From the counts the rate is known only by what is left of it, so a step counts as fast where its counted rate divided by
1 − ratio is above the limit. Between that limit and the limit times 1 − ratio a counted rate may be of either kind; a
wheel passes through that band in a moment. At above_radps = 0 the share is always lost: the radius by another name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Column, Effect, Parameter
from sccal.effects.one_wheel import wheels_turned
from sccal.effects.view import DriveView
from sccal.effects.words import Measured, percent, size
from sccal.simulate.physics import Physics
from sccal.simulate.world import Motion, WheelPair

_EXCITED_BY = (
    "drive straights of 20 m at two clearly different speeds; for a share lost at any speed measure the wheel's radius "
    "by hand: the log alone knows only the product of the two"
)
_REFERENCE = "counting: what is counted is 1 − ratio of what is turned"
_PARAMETERS = (
    Parameter("ratio", "1", 0.02, -0.5, 0.5, matters=0.005),
    Parameter("above_radps", "rad/s", 10.0, 0.0, 200.0, shape=True, unsaid=0.0),
)
_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.85, 0.95)
"""Of a wheel's rates, each weighed by the travel at it."""
_APART = 1.1
"""Ratio of neighbouring quantiles from which on a limit between them parts slow driving from fast."""
_COUNTER_S = 0.1
"""Over which the simulated wheel's rate is taken: its slip is white from step to step, a wheel's rate is not."""


class MissedLeft(Effect):
    """Share of the left wheel's counts that are lost, and the rate of the wheel above which they are."""

    name = "missed_left"
    stage = "wheels"
    title = "left counter that loses counts at speed"
    parameters = _PARAMETERS
    looks_like = "the left radius seems larger on fast stretches; there the path bends to the left by the wheels alone"
    excited_by = _EXCITED_BY
    reference = _REFERENCE
    shown_against = "speed"
    search = "scale"

    def says(self, found: Mapping[str, Measured]) -> str:
        return f"the left wheel's counter {_in_words(found)}"

    def shape_grid(self, drive: DriveView) -> tuple[Mapping[str, float], ...]:
        """Rates between the left wheel's slower and its faster ones."""
        return tuple({"above_radps": one} for one in limits_radps(drive.steps.left_rate_radps, drive.steps.left_m))

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        return (Column("ratio", "left_wheel", lost_m(drive.steps.left_m, drive.steps.left_rate_radps, at)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Losing("left", values["ratio"], values.get("above_radps", 0.0))


class MissedRight(Effect):
    """Share of the right wheel's counts that are lost, and the rate of the wheel above which they are."""

    name = "missed_right"
    stage = "wheels"
    title = "right counter that loses counts at speed"
    parameters = _PARAMETERS
    looks_like = (
        "the right radius seems larger on fast stretches; there the path bends to the right by the wheels alone"
    )
    excited_by = _EXCITED_BY
    reference = _REFERENCE
    shown_against = "speed"
    search = "scale"

    def says(self, found: Mapping[str, Measured]) -> str:
        return f"the right wheel's counter {_in_words(found)}"

    def shape_grid(self, drive: DriveView) -> tuple[Mapping[str, float], ...]:
        """Rates between the right wheel's slower and its faster ones."""
        return tuple({"above_radps": one} for one in limits_radps(drive.steps.right_rate_radps, drive.steps.right_m))

    def columns(self, drive: DriveView, at: Mapping[str, float]) -> tuple[Column, ...]:
        return (Column("ratio", "right_wheel", lost_m(drive.steps.right_m, drive.steps.right_rate_radps, at)),)

    def physics(self, values: Mapping[str, float]) -> Physics:
        return _Losing("right", values["ratio"], values.get("above_radps", 0.0))


def _in_words(found: Mapping[str, Measured]) -> str:
    ratio, above = found["ratio"], found["above_radps"]
    fast = f" above {size(above)} rad/s" if above.value > 0.0 else ""
    return f"{'loses' if ratio.value > 0.0 else 'adds'} {percent(ratio)} of its counts{fast}"


def lost_m(counted_m: Floats, rate_radps: Floats, at: Mapping[str, float]) -> Floats:
    """Travel that each step loses per unit of the ratio."""
    turned = 1.0 - at.get("ratio", 0.0)
    return counted_m / turned * share_above(np.abs(rate_radps) / turned, at.get("above_radps", 0.0))


def share_above(rate: Floats, limit: float) -> Floats:
    """Share of each step that is faster than the limit, the rate going straight from half-way to half-way of steps.

    Whole steps would do as well for the travel, but a likelihood over limits would jump from step to step.
    """
    if limit <= 0.0:
        return np.ones(rate.size)
    half_way = np.concatenate((rate[:1], 0.5 * (rate[1:] + rate[:-1]), rate[-1:]))
    low, high = np.minimum(half_way[1:], half_way[:-1]), np.maximum(half_way[1:], half_way[:-1])
    return np.asarray(np.clip((high - limit) / np.maximum(high - low, 1e-9), 0.0, 1.0))


def limits_radps(rate_radps: Floats, travel_m: Floats) -> list[float]:
    """Few limits that part the slower travel from the faster: half-way between quantiles that differ clearly.

    A limit within a speed that is held would part it by its ripple, and a limit that all travel exceeds, or none, would
    part nothing: there is no limit where the wheel has but one speed.
    """
    size, order = np.abs(rate_radps), np.argsort(np.abs(rate_radps))
    driven = np.cumsum(np.abs(travel_m)[order])
    if driven.size == 0 or driven[-1] <= 0.0:
        return []
    at = size[order][np.minimum(np.searchsorted(driven, np.array(_QUANTILES) * driven[-1]), driven.size - 1)]
    clear = at[1:] > _APART * at[:-1]
    return [float(one) for one in (0.5 * (at[1:] + at[:-1]))[clear]]


@dataclass(frozen=True)
class _Losing(Physics):
    wheel: Literal["left", "right"]
    ratio: float
    above_radps: float

    def truth(self) -> Mapping[str, Mapping[str, float]]:
        limit = {"above_radps": self.above_radps} if self.above_radps > 0.0 else {}
        return {f"missed_{self.wheel}": {"ratio": self.ratio, **limit}}

    def wheel_angle(self, motion: Motion, angle_rad: WheelPair) -> WheelPair:
        return wheels_turned((self.wheel,), angle_rad, lambda turned_rad: self._counted(turned_rad, motion.t_s))

    def _counted(self, turned_rad: Floats, t_s: Floats) -> Floats:
        """Cumulative angle that arrives at the counter's other end."""
        middle = 0.5 * (t_s[1:] + t_s[:-1])
        before, after = (np.clip(middle + half, t_s[0], t_s[-1]) for half in (-0.5 * _COUNTER_S, 0.5 * _COUNTER_S))
        rate = (np.interp(after, t_s, turned_rad) - np.interp(before, t_s, turned_rad)) / (after - before)
        kept = np.where(np.abs(rate) > self.above_radps, 1.0 - self.ratio, 1.0)
        kept = kept if self.above_radps > 0.0 else np.full(kept.size, 1.0 - self.ratio)
        return np.concatenate((turned_rad[:1], turned_rad[0] + np.cumsum(kept * np.diff(turned_rad))))
