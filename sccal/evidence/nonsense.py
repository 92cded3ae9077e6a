"""Nonsense columns: what this log's own noise lets pass.

Each is made from a quantity of the drive or a column of the log by giving every frequency a random phase (Theiler et
al. 1992): as smooth, as large and as correlated as the real thing, and about nothing. Their evidence
beside the final model says how often this log would name a cause that is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sccal.align import Aligned, Series
from sccal.arrays import Floats
from sccal.effects.logged import LoggedColumn
from sccal.results.model import Range

COUNT = 8
STEP_S = 0.5
NAME = "nonsense"
WHERE = ("heading", "along", "yaw")


class NonsenseColumn(LoggedColumn):
    """A nonsense column at one port."""


def with_nonsense(runs: Sequence[Aligned], seed: int = 0) -> tuple[list[Aligned], tuple[NonsenseColumn, ...]]:
    """The runs with COUNT nonsense columns each, and these as candidates."""
    rng = np.random.default_rng(seed)
    dressed = []
    series: dict[str, list[Series]] = {}
    for aligned in runs:
        t_s, sources = _sources(aligned)
        extras = dict(aligned.extras)
        for k in range(COUNT):
            made = Series(t_s, shuffled(sources[k % len(sources)], rng))
            extras[f"{NAME}_{k}"] = made
            series.setdefault(f"{NAME}_{k}", []).append(made)
        dressed.append(replace(aligned, extras=extras))
    ranges = {name: Range.of(one.values for one in each) for name, each in series.items()}
    return dressed, tuple(
        NonsenseColumn(where, name, one) for name, one in ranges.items() if one.spread > 0 for where in WHERE
    )


def shuffled(values: Floats, rng: np.random.Generator) -> Floats:
    """A series (n,) with the same spectrum and random phases."""
    spectrum = np.fft.rfft(values - values.mean())
    phases = rng.uniform(0.0, 2.0 * np.pi, spectrum.size)
    phases[0] = 0.0
    return np.asarray(np.fft.irfft(np.abs(spectrum) * np.exp(1j * phases), values.size))


def _sources(aligned: Aligned) -> tuple[Floats, list[Floats]]:
    """Times, and what nonsense is made from: speed, turn rate, heading, and up to as many columns of the log."""
    first, last = aligned.span_s
    t_s = np.arange(first, last, STEP_S)
    speed = np.gradient(np.interp(t_s, aligned.wheel_t_s, aligned.travel_m), STEP_S)
    yaw = np.interp(t_s, aligned.heading_t_s, aligned.yaw_rad)
    sources = [speed, np.gradient(yaw, STEP_S), np.cos(yaw), np.sin(yaw)]
    columns = list(aligned.extras.values())[: COUNT - len(sources)]
    sources += [np.interp(t_s, one.t_s, one.values) for one in columns]
    return t_s, [one for one in sources if np.ptp(one) > 0.0]
