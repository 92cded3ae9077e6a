"""What this drive can show, what it cannot, and what it cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sccal.arrays import Floats
from sccal.diagnose.criteria import BEYOND_SIGMAS
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect
from sccal.effects.logged import LoggedColumn
from sccal.evidence.candidates import Candidates
from sccal.evidence.confounding import SAME, correlation, reduced
from sccal.evidence.extension import name_in
from sccal.evidence.model import Model
from sccal.evidence.nuisance import SMALL
from sccal.evidence.posterior import CONSTANTS, Posterior
from sccal.results.diagnosis import Detectable, Inseparable, NotExcited


def excitation(
    posterior: Posterior, candidates: Candidates, kept: Sequence[str], saturated: Model
) -> tuple[list[NotExcited], list[Detectable], list[Inseparable]]:
    """Of every effect with a name that was not found: whether it could have been, and from which size on.

    ``saturated`` is the fit that the posterior comes from, with every candidate in one form.
    """
    found = {name_in(one) for one in kept}
    seen = _Seen(posterior)
    free = {one.key: one.free for one in saturated.accepted if one.key not in kept and one.run is None}
    hidden: list[NotExcited] = []
    shown: list[tuple[str, Effect, Detectable]] = []
    hidden += [
        NotExcited(effect.name, effect.title, effect.excited_by)
        for effect in CATALOGUE.values()
        if effect.search == "scale" and effect.name not in candidates.forms and effect.name not in found
    ]
    for key, one in free.items():
        effect = one.effect
        # As much as is always possible explains nothing; what is beyond has to stand out.
        sigmas = seen.sigmas(key, len(one.parameters)) * np.array([p.prior_sigma for p in one.parameters])
        least = np.array([p.matters for p in one.parameters]) + BEYOND_SIGMAS * sigmas
        if np.any(least > [p.prior_sigma for p in one.parameters]):
            hidden.append(NotExcited(effect.name, effect.title, effect.excited_by))
            continue
        smallest = {p.name: float(size) for p, size in zip(one.parameters, least, strict=True)}
        units = {p.name: p.unit for p in one.parameters}
        shown.append((key, effect, Detectable(effect.name, effect.title, smallest, units)))
    named = {key: effect for key, effect, _ in shown if not isinstance(effect, LoggedColumn)}
    return hidden, [one for _, _, one in shown], _sets(seen, named)


class _Seen:
    """The information about all candidates, small amounts of all others allowed."""

    def __init__(self, posterior: Posterior) -> None:
        self.posterior = posterior
        precision = np.linalg.inv(posterior.covariance)
        size = precision.shape[0]
        self.information = precision - np.diag(np.r_[np.zeros(CONSTANTS), np.ones(size - CONSTANTS)])
        self.small = np.full(size, SMALL * 0.1)
        self.small[:CONSTANTS] = 1.0

    def sigmas(self, key: str, count: int) -> Floats:
        """(count,) of one effect's parameters, in units of their priors; of a run's parameter, the runs' best."""
        rows = self.posterior.rows[key]
        alone = reduced(self.information, rows, self.small) + np.eye(rows.size)
        sigma = np.sqrt(np.maximum(np.diag(np.linalg.inv(alone)), 0.0))
        return np.array([sigma[k::count].min() for k in range(count)]) if rows.size > count else sigma

    def correlation(self, one: str, other: str) -> float:
        """Of two effects' columns."""
        return correlation(self.information, self.posterior.rows[one], self.posterior.rows[other], self.small)


def _sets(seen: _Seen, effects: dict[str, Effect]) -> list[Inseparable]:
    """Effects that could each be seen alone and not beside each other."""
    sets: list[set[str]] = []
    keys = list(effects)
    for k, one in enumerate(keys):
        for other in keys[k + 1 :]:
            if seen.correlation(one, other) > SAME:
                joined = {one, other}
                for group in [group for group in sets if group & joined]:
                    joined |= group
                    sets.remove(group)
                sets.append(joined)
    return [_inseparable([effects[key] for key in keys if key in group]) for group in sets]


def _inseparable(effects: Sequence[Effect]) -> Inseparable:
    advice = "; ".join(dict.fromkeys(effect.excited_by for effect in effects))
    return Inseparable(tuple(effect.name for effect in effects), advice)
