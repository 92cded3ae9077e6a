"""What an effect brings on data that did not fit it, from the stretches' likelihoods alone, without another pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sccal.arrays import Floats
from sccal.evidence.joint import JointFit

FOLDS = 6
WHOLE_RUNS = 3
"""From so many runs on, whole runs are left out."""


def held_out_gain(fit: JointFit, rows: Sequence[int], known: Sequence[int] = ()) -> float:
    """Log-likelihood that some parameters of a fit add on data left out in turns, over holding them at zero.

    Every part of the data (whole runs, or sixths of the time) is judged by the values that all other parts give, with
    the parameters free and with them at zero. ``rows`` are their places in the fit; ``known`` those of parameters that
    stay as fitted, because all that is known of them comes from one moment (a step).
    """
    runs = len(fit.runs)
    own = all(fit.places.keys[row][2] >= 0 for row in rows)
    parts = _runs(fit) if runs >= WHOLE_RUNS and not own else _sixths(fit)
    free = np.setdiff1d(np.arange(fit.values.size), np.array(known, dtype=np.int64))
    held = np.setdiff1d(free, np.array(rows))
    precision = fit.prior.copy()
    vector = precision @ fit.centre
    for one, places in zip(fit.runs, fit.places.of_run, strict=True):
        precision[np.ix_(places, places)] += one.precision
        vector[places] += one.vector
    gain = 0.0
    for part_precision, part_vector in parts:
        rest, rest_vector = precision - part_precision, vector - part_vector
        likelihoods = []
        for kept in (free, held):
            values = np.where(np.isin(np.arange(fit.values.size), free), 0.0, fit.values)
            given = rest_vector - rest @ values
            scale = 1.0 / np.sqrt(np.diag(rest)[kept])
            block = rest[np.ix_(kept, kept)] * np.outer(scale, scale)
            values[kept] = scale * np.linalg.solve(block, scale * given[kept])
            likelihoods.append(float(values @ part_vector - 0.5 * values @ part_precision @ values))
        gain += likelihoods[0] - likelihoods[1]
    return gain


def _runs(fit: JointFit) -> list[tuple[Floats, Floats]]:
    size = fit.values.size
    parts = []
    for one, places in zip(fit.runs, fit.places.of_run, strict=True):
        precision, vector = np.zeros((size, size)), np.zeros(size)
        precision[np.ix_(places, places)] = one.precision
        vector[places] = one.vector
        parts.append((precision, vector))
    return parts


def _sixths(fit: JointFit) -> list[tuple[Floats, Floats]]:
    size = fit.values.size
    parts = [(np.zeros((size, size)), np.zeros(size)) for _ in range(FOLDS)]
    for one, places in zip(fit.runs, fit.places.of_run, strict=True):
        for number, stretch in enumerate(one.stretches):
            precision, vector = parts[number * FOLDS // len(one.stretches)]
            precision[np.ix_(places, places)] += stretch.precision
            vector[places] += stretch.vector
    return parts
