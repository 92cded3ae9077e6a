"""What some parameters show with small amounts of all others allowed, and which effects are one to a drive."""

from __future__ import annotations

import numpy as np

from sccal.arrays import Floats, Ints

SAME = 0.98
"""Canonical correlation from which on two effects are one."""


def reduced(information: Floats, kept: Ints, small: Floats) -> Floats:
    """Information (k, k) about some parameters, the others marginalised within their small priors.

    ``information`` (K, K) and ``small`` (K,) are in units of the parameters' priors.
    """
    others = np.setdiff1d(np.arange(small.size), kept)
    inner = information[np.ix_(others, others)] + np.diag(1.0 / small[others] ** 2)
    cross = information[np.ix_(kept, others)]
    return np.asarray(information[np.ix_(kept, kept)] - cross @ np.linalg.solve(inner, cross.T))


def correlation(information: Floats, one: Ints, other: Ints, small: Floats) -> float:
    """Largest canonical correlation of two effects' columns, with small amounts of all others allowed."""
    both = reduced(information, np.concatenate((one, other)), small)
    a, ab, b = both[: one.size, : one.size], both[: one.size, one.size :], both[one.size :, one.size :]
    try:
        left, right = np.linalg.cholesky(a), np.linalg.cholesky(b)
    except np.linalg.LinAlgError:
        return 0.0
    return float(np.linalg.svd(np.linalg.solve(left, np.linalg.solve(right, ab.T).T), compute_uv=False).max())
