"""What this drive can show, what it cannot, and what it cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.calibration.extension import Free
from sccal.diagnose.loop import MIN_T
from sccal.diagnose.placebo import Placebo
from sccal.diagnose.pool import Pool
from sccal.diagnose.result import Detectable, Inseparable, NotExcited
from sccal.effects.effect import Effect
from sccal.effects.logged import LoggedColumn
from sccal.effects.patterns import Pattern

BEYOND = 1.5
SAME = 0.98
"""Correlation from which on two effects are one."""


def excitation(pool: Pool, found: Sequence[Effect]) -> tuple[list[NotExcited], list[Detectable], list[Inseparable]]:
    """Of every effect with a name that was not found: whether it could have been, and from which size on."""
    names = {effect.name for effect in found}
    named = [e for e in pool.candidates if not isinstance(e, Pattern | Placebo) and e.name not in names]
    hidden: list[NotExcited] = []
    shown: list[tuple[Effect, Detectable]] = []
    for effect in named:
        parameters = Free(effect).parameters
        if not parameters:
            continue
        sigmas = pool.score(effect).sigmas
        # As much as is always possible explains nothing; what is beyond has to stand out.
        least = np.array([one.matters for one in parameters]) + BEYOND * MIN_T * sigmas
        if np.any(least > [one.prior_sigma for one in parameters]):
            hidden.append(NotExcited(effect.name, effect.title, effect.excited_by))
            continue
        smallest = {one.name: float(size) for one, size in zip(parameters, least, strict=True)}
        units = {one.name: one.unit for one in parameters}
        shown.append((effect, Detectable(effect.name, effect.title, smallest, units)))
    return (
        hidden,
        [one for _, one in shown],
        _sets(pool, [effect for effect, _ in shown if not isinstance(effect, LoggedColumn)]),
    )


def _sets(pool: Pool, effects: Sequence[Effect]) -> list[Inseparable]:
    """Effects that could each be seen alone and not beside each other."""
    sets: list[set[str]] = []
    for k, one in enumerate(effects):
        for other in effects[k + 1 :]:
            if _correlation(pool, one, other) > SAME:
                joined = {one.name, other.name}
                for group in [group for group in sets if group & joined]:
                    joined |= group
                    sets.remove(group)
                sets.append(joined)
    by_name = {effect.name: effect for effect in effects}
    return [
        Inseparable(
            tuple(name for name in by_name if name in group), _advice([by_name[n] for n in by_name if n in group])
        )
        for group in sets
    ]


def _advice(effects: Sequence[Effect]) -> str:
    return "; ".join(dict.fromkeys(effect.excited_by for effect in effects))


def _correlation(pool: Pool, one: Effect, other: Effect) -> float:
    """Largest canonical correlation of two effects' columns, with small amounts of all others allowed."""
    a, b = pool.rows(one.name), pool.rows(other.name)
    both = np.concatenate((a, b))
    reduced = _reduced(pool, both)
    aa, bb = reduced[: a.size, : a.size], reduced[a.size :, a.size :]
    ab = reduced[: a.size, a.size :]
    try:
        left, right = np.linalg.cholesky(aa), np.linalg.cholesky(bb)
    except np.linalg.LinAlgError:
        return 0.0
    whitened = np.linalg.solve(left, np.linalg.solve(right, ab.T).T)
    return float(np.linalg.svd(whitened, compute_uv=False).max())


def _reduced(pool: Pool, kept: Ints) -> Floats:
    """Information about some parameters with the others, at their small priors, marginalised."""
    _, information = pool.total
    prior = pool.precision(kept)
    others = np.setdiff1d(np.flatnonzero(np.isfinite(prior)), kept)
    inner = information[np.ix_(others, others)] + np.diag(prior[others])
    cross = information[np.ix_(kept, others)]
    return np.asarray(information[np.ix_(kept, kept)] - cross @ np.linalg.solve(inner, cross.T))
