"""What iron does to a compass: the deviation, its columns, and how slowly an AHRS lets it in.

With α the angle that the iron's field turns by (the robot's heading ψ in enu for hard iron, 2ψ for soft iron) and c, s
its strengths in parts of the earth's horizontal field, the compass is wrong by

    h = atan2(N, D)      N = c cos α + s sin α      D = 1 + c sin α − s cos α      −π < h ≤ π

to first order N itself. Where c² + s² > 1 the iron is stronger than the earth, and h winds once as α goes round.

The filter adds c · C + s · S, which is linear, and h is not: at 20° the harmonics alone leave a sixth of the amplitude.
So the columns are made for the current values, of h's slopes there and of what the slopes leave:

    C = ∂h/∂c + c r      S = ∂h/∂s + s r      r = (h − c ∂h/∂c − s ∂h/∂s) / (c² + s²)

Times those same values they give h exactly, at zero they are the harmonics, and across (c, s) they are h's slope, so
that estimating and computing the columns anew, again and again, ends at the truth. From zero it gets there for fields
up to nine tenths of the earth's and from the earth's on alike; near the earth's own strength, where at one heading the
two cancel and the compass points nowhere, it may not. (The secants h/N cos α and h/N sin α are exact as well, but they
are infinite where N = 0 and D < 0: beyond the earth's field nothing converges with them.)

An AHRS that lets its compass in slowly shows the deviation after a first-order filter, beginning at its value at the
first reading. That filter is linear, so the filtered columns times the values are the filtered deviation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import accumulate

import numpy as np

from sccal.arrays import Floats
from sccal.effects.effect import Parameter
from sccal.effects.low_pass import low_passed
from sccal.effects.view import DriveView, Moments
from sccal.simulate.world import State

TAU = Parameter("tau_s", "s", 20.0, 0.0, 120.0, shape=True, default=0.0)
"""Time constant with which the AHRS lets its compass in; Xsens state 10 to 30 s for the MTi series."""
TRIED_TAU_S = (0.0, 8.0, 30.0)
LEAST_TAUS = 4.0
"""A drive shows a time constant that it is several times as long as: a longer one it takes for a drift."""
_WEAKEST = 1e-3
"""Parts of the earth's field below which the compass is taken to point somewhere still."""
_PARTS = 8


def deviation_columns(angle_rad: Floats, cos_deg: float, sin_deg: float) -> tuple[Floats, Floats]:
    """rad per deg of field of a compass's cosine and sine deviation in ``angle_rad``, exact at the values given."""
    c, s = np.radians(cos_deg), np.radians(sin_deg)
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    across, along = c * cos + s * sin, 1.0 + c * sin - s * cos
    squared = np.maximum(across**2 + along**2, _WEAKEST**2)
    by_c, by_s = (along * cos - across * sin) / squared, (along * sin + across * cos) / squared
    strength2 = c * c + s * s
    if strength2 > 0.0:
        rest = (np.arctan2(across, along) - c * by_c - s * by_s) / strength2
        by_c, by_s = by_c + c * rest, by_s + s * rest
    return np.radians(by_c), np.radians(by_s)


def slow_deviation_columns(
    seen: Moments, times: float, cos_deg: float, sin_deg: float, tau_s: float
) -> tuple[Floats, Floats]:
    """The same at some headings, ``times`` a turn, after the AHRS's filter."""
    both = np.column_stack(deviation_columns(times * seen.yaw_rad, cos_deg, sin_deg))
    slow = low_passed(both, seen.t_s, tau_s)
    return slow[:, 0].copy(), slow[:, 1].copy()


def tried_taus(drive: DriveView) -> tuple[Mapping[str, float], ...]:
    """Time constants, evenly spread on a logarithmic scale, that are short enough for the drive."""
    return tuple({TAU.name: tau_s} for tau_s in TRIED_TAU_S if LEAST_TAUS * tau_s <= drive.duration_s)


def of_tau(tau_s: float) -> Mapping[str, float]:
    """The time constant for a truth file: not named where the AHRS is not slow."""
    return {TAU.name: tau_s} if tau_s > 0.0 else {}


def let_in(state: State, deviation: Callable[[Floats], Floats], tau_s: float) -> Floats:
    """The simulated AHRS: what a deviation that depends on the heading adds to each reading.

    Between two readings the deviation is computed at the middles of eight parts, through which the robot turns evenly,
    and each part is forgotten from its time on:  y(t) = y₀ e^(−(t−t₀)/τ) + ∫ h(u) e^(−(t−u)/τ) du/τ.
    """
    if tau_s <= 0.0 or state.t_s.size == 0:
        return deviation(state.yaw_rad)
    steps = np.diff(state.t_s)[:, None]
    share = np.arange(_PARTS + 1) / _PARTS
    yaw = state.yaw_rad[:-1, None] + np.diff(state.yaw_rad)[:, None] * (0.5 * (share[1:] + share[:-1]))
    left_at = np.exp(-steps * (1.0 - share) / tau_s)
    gained = (deviation(yaw) * np.diff(left_at, axis=1)).sum(axis=1)
    first = float(deviation(state.yaw_rad[:1])[0])
    pairs = zip(left_at[:, 0].tolist(), gained.tolist(), strict=True)
    return np.array(list(accumulate(pairs, lambda y, pair: y * pair[0] + pair[1], initial=first)))
