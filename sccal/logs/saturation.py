"""Counters that end at the greatest number they hold, and stay there while the robot drives on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sccal.arrays import Bools, Floats, Ints

_WIDTHS = (16, 24, 32)
STAYS_S = 2.0
"""A counter that wraps is at its end for a row or two."""
_BEFORE_S = 0.5
_FEWEST_COUNTS = 3.0
_MOVES_M = 0.2
"""By the other wheel, while the full one stays."""


@dataclass(frozen=True)
class Saturated:
    """A counter that is full."""

    side: int
    """0 left, 1 right."""
    count: int
    bits: int
    row: int
    """The first at the end."""
    stays_s: float
    """At its end, in all."""
    both: bool
    """Whether the other counter is full too."""


def saturated(t_s: Floats, counts: Floats, m_per_count: float, bits: int | None) -> Saturated | None:
    """The counter of (n, 2) at times (n,) that is full first; None where none is. ``bits`` are the declared ones."""
    found = [_of_side(t_s, counts, side, m_per_count, bits) for side in (0, 1)]
    full = [one for one in found if one is not None]
    return min(full, key=lambda one: one.row) if full else None


def _of_side(t_s: Floats, counts: Floats, side: int, m_per_count: float, bits: int | None) -> Saturated | None:
    own, other = counts[:, side], counts[:, 1 - side]
    for end, width in _ends(bits):
        if end != (own.max() if end > 0 else own.min()):
            continue
        stays_s, first = 0.0, -1
        for start, stop in _stretches(own == end):
            long = t_s[stop] - t_s[start] >= STAYS_S
            if long and _arrives(t_s, own, start) and _goes_on(other, start, stop, m_per_count, bits):
                stays_s += float(t_s[stop] - t_s[start])
                first = start if first < 0 else first
        if first >= 0:
            return Saturated(side, int(end), width, first, stays_s, bool(_is_end(other[first:], bits)))
    return None


def _ends(bits: int | None) -> list[tuple[float, int]]:
    """Greatest and least numbers of signed and unsigned counters, and their widths."""
    widths = dict.fromkeys((*_WIDTHS, *((bits,) if bits else ())))
    return [
        (end, width) for width in widths for half in (2.0 ** (width - 1),) for end in (half - 1, 2 * half - 1, -half)
    ]


def _is_end(values: Floats, bits: int | None) -> bool:
    extremes = (float(values.max()), float(values.min()))
    return any(end in extremes for end, _ in _ends(bits))


def _stretches(at: Bools) -> list[tuple[int, int]]:
    """First and last rows of the stretches in which ``at`` (n,) is True."""
    edges: Ints = np.flatnonzero(np.diff(np.concatenate(([False], at, [False]))))
    return [(int(start), int(stop) - 1) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def _arrives(t_s: Floats, own: Floats, start: int) -> bool:
    """Whether the counter came there by counting: one that wraps backwards from zero jumps there."""
    before = int(np.searchsorted(t_s, t_s[start] - _BEFORE_S))
    counted = abs(float(own[start] - own[before])) if before < start else 0.0
    return _FEWEST_COUNTS <= counted < 0.5 * abs(float(own[start]))


def _goes_on(other: Floats, start: int, stop: int, m_per_count: float, bits: int | None) -> bool:
    """Whether the other wheel drives meanwhile, or its counter is full as well."""
    own = other[start : stop + 1]
    return bool(np.ptp(own) * m_per_count > _MOVES_M) or any(end == own[-1] for end, _ in _ends(bits))
