"""The evidence of every subset of some effects, in closed form.

With everything free under priors N(0, Λ) the fit leaves N(µ, C). Holding the parameters A of the other effects at zero
changes the log-evidence by log N(0; µ_A, C_AA) − log N(0; 0, Λ_AA) (Savage and Dickey; Verdinelli and Wasserman 1995).
In units of the priors, with J = C⁻¹ and h = J µ, the evidence of keeping K and holding the rest at zero is therefore,
up to a constant,

    E(K) = ½ h_Kᵀ J_KK⁻¹ h_K − ½ log det J_KK

and the values given that the rest is zero are J_KK⁻¹ h_K with the covariance J_KK⁻¹. Occam's price is in the
determinant: a parameter that the data do not need costs what it could have done and did not.

How much it could have done is known to a decade or two only: iron turns some compasses by thirty degrees and many by a
tenth of one. So every effect's prior is a mixture of widths g Λ^½, evenly spread on a logarithmic scale from the
smallest size that matters to five times what is usual. With c the eigenvalues of an effect's C_AA in units of the prior
of the fit, ν its mean along them and c_g = 1/(1/c + 1/g² − 1), the width g changes the evidence by

    Σ ½ log(c_g/c) − log g + ½ ν² (c_g/c² − 1/c)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.evidence.extension import Free

CONSTANTS = 3
"""R_r, R_l and L are in every model."""
PRICE_NATS = 3.0
"""What an effect must bring to be in the model at all: minus the logarithm of its prior odds, 1 in 20. Some fifty
effects compete, and a robot has two or three of them."""
MOST_SWAPPED = 24
"""Exchanges are tried up to so many kept effects: beyond, a log that needs them all is not described by any."""


WIDTHS = 8
"""Of the priors: two a decade or more, from the smallest size that matters to the widest."""
WIDEST = 5.0
"""Times the usual size of an effect: what is in the model may be so large before its prior holds it back."""


def mixture_evidence(mean: Floats, covariance: Floats, widths: Floats) -> Floats:
    """(n,) what a mixture of prior widths adds to the evidence for n effects, in nats.

    ``mean`` (n, k) and ``covariance`` (n, k, k) are what one prior leaves, in its units; ``widths`` (n, w).
    """
    own, axes = np.linalg.eigh(covariance)
    # Disagreement of the data can make a sigma larger than the prior's, which then is all that is known.
    own = np.clip(own, 1e-12, 1.0)[:, None, :]
    along = np.einsum("nik,ni->nk", axes, mean)[:, None, :]
    narrow = 1.0 / (1.0 / own + (widths**-2.0 - 1.0)[:, :, None])
    log = 0.5 * np.log(narrow / own) + 0.5 * along**2 * (narrow / own - 1.0) / own
    each = log.sum(axis=2) - mean.shape[1] * np.log(widths)
    return np.asarray(np.logaddexp.reduce(each, axis=1) - np.log(widths.shape[1]))


@dataclass(frozen=True)
class Posterior:
    """What the saturated fit says of some effects, in units of their priors' sigmas."""

    rows: Mapping[str, Ints]
    """Of each effect (by key): the places of its parameters, all runs' copies."""
    mean: Floats
    """(G,) of R_r, R_l, L, then all effects' parameters."""
    covariance: Floats
    """(G, G), everything else marginalised."""
    sigma: Floats
    """(G,) the priors' sigmas in file units (of the constants: their values)."""
    price_nats: Mapping[str, float]
    """What each effect must bring for being there at all: minus the logarithm of its prior odds."""
    widths: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Of each effect's priors, narrowest and widest, in parts of that of the fit; none where it is not named."""

    @cached_property
    def _information(self) -> tuple[Floats, Floats]:
        J = np.linalg.inv(self.covariance)
        J = 0.5 * (J + J.T)
        return J, J @ self.mean

    def places(self, kept: Sequence[str]) -> Ints:
        """The constants, and all parameters of some effects."""
        return np.concatenate([np.arange(CONSTANTS), *(self.rows[name] for name in kept)]).astype(np.int64)

    def evidence(self, kept: Sequence[str]) -> float:
        """Logarithm of the evidence of keeping some effects and no others, over that of keeping none, prices paid."""
        return float(self.evidences([kept])[0])

    def evidences(self, several: Sequence[Sequence[str]]) -> Floats:
        """(n,) the same for several subsets at once.

        Their blocks of the information are filled up with ones on the diagonal to one size, which changes nothing.
        """
        J, h = self._information
        places = [self.places(kept) for kept in several]
        size = max(some.size for some in places)
        index = np.array([np.pad(some, (0, size - some.size)) for some in places])
        real = np.arange(size) < np.array([some.size for some in places])[:, None]
        block = np.where(real[:, :, None] & real[:, None, :], J[index[:, :, None], index[:, None, :]], np.eye(size))
        score = np.where(real, h[index], 0.0)
        covariance = np.linalg.inv(block)
        mean = np.einsum("nij,nj->ni", covariance, score)
        sign, logs = np.linalg.slogdet(block)
        found = 0.5 * (np.einsum("ni,ni->n", mean, score) - logs) - self._none
        found -= [sum(self.price_nats.get(name, 0.0) for name in kept) for kept in several]
        found += self._mixed(several, mean, covariance)
        return np.where((sign > 0.0) & np.isfinite(found), found, -np.inf)

    def _mixed(self, several: Sequence[Sequence[str]], mean: Floats, covariance: Floats) -> Floats:
        """(n,) what priors of all widths add to the evidence of the fit's, each effect's beside the others as fitted.

        ``mean`` (n, k) and ``covariance`` (n, k, k) are those of each subset.
        """
        total = np.zeros(len(several))
        of_size: dict[int, list[tuple[int, int, str]]] = {}
        for number, kept in enumerate(several):
            place = CONSTANTS
            for name in kept:
                if name in self.widths:
                    of_size.setdefault(self.rows[name].size, []).append((number, place, name))
                place += self.rows[name].size
        for size, some in of_size.items():
            subset = np.array([number for number, _, _ in some])[:, None]
            rows = np.array([place for _, place, _ in some])[:, None] + np.arange(size)
            widths = np.array([self._all_widths[name] for _, _, name in some])
            blocks = covariance[subset[:, :, None], rows[:, :, None], rows[:, None, :]]
            np.add.at(total, subset[:, 0], mixture_evidence(mean[subset, rows], blocks, widths))
        return total

    @cached_property
    def _all_widths(self) -> dict[str, Floats]:
        """Of each effect's priors (WIDTHS,)."""
        return {name: np.geomspace(*ends, WIDTHS) for name, ends in self.widths.items()}

    def _within(self, kept: Sequence[str]) -> list[Ints]:
        """Places of each kept effect's parameters among those of ``given``."""
        ends = CONSTANTS + np.cumsum([0, *(self.rows[name].size for name in kept)])
        return [np.arange(first, last) for first, last in pairwise(ends.tolist())]

    @cached_property
    def _none(self) -> float:
        J, h = self._information
        block, score = J[:CONSTANTS, :CONSTANTS], h[:CONSTANTS]
        return 0.5 * float(score @ np.linalg.solve(block, score) - np.linalg.slogdet(block)[1])

    def given(self, kept: Sequence[str]) -> tuple[Floats, Floats]:
        """Mean (3 + k,) and covariance of constants and kept parameters if the rest is zero, in their priors' units."""
        places = self.places(kept)
        J, h = self._information
        covariance: Floats = np.asarray(np.linalg.inv(J[np.ix_(places, places)]), dtype=np.float64)
        return covariance @ h[places], covariance

    def of(self, name: str, kept: Sequence[str]) -> tuple[Floats, Floats]:
        """Mean and covariance of one of the kept effects' parameters if the rest is zero, in their priors' units."""
        mean, covariance = self.given(kept)
        mine = np.flatnonzero(np.isin(self.places(kept), self.rows[name]))
        return mean[mine], covariance[np.ix_(mine, mine)]

    def t(self, name: str, kept: Sequence[str]) -> float:
        """Root of the χ² of one of the kept effects if the rest is zero."""
        mean, covariance = self.of(name, kept)
        return float(np.sqrt(max(float(mean @ np.linalg.solve(covariance, mean)), 0.0)))

    def size(self, free: Free, kept: Sequence[str]) -> float:
        """Largest parameter of a kept effect in units of the smallest size that matters, if the rest is zero."""
        least = [max(one.matters / one.prior_sigma, 1e-12) for one in free.parameters]
        return float((np.abs(self.of(free.key, kept)[0]) / least).max())

    def worth(self, name: str, kept: Sequence[str]) -> float:
        """What one of the kept effects brings: the evidence with it over that without."""
        return self.evidence(kept) - self.evidence([one for one in kept if one != name])

    def gain(self, name: str, kept: Sequence[str]) -> float:
        """What an effect would bring beside the kept ones."""
        return self.evidence([*kept, name]) - self.evidence(kept)

    def select(self, first: Sequence[str] = ()) -> list[str]:
        """The subset of most evidence, by adding, removing and exchanging until none of it helps.

        Two ways lead there, from nothing (or ``first``) upward and from everything downward; the better end counts.
        """
        ends = [self._climbed(list(first)), self._climbed(self._thinned())]
        return max(ends, key=self.evidence)

    def _thinned(self) -> list[str]:
        """Everything, less what brings nothing beside the rest as fitted, the most useless first."""
        kept = list(self.rows)
        while len(kept) > 1:
            worths = self._worths(kept)
            least = int(np.argmin(worths))
            if worths[least] > 0.0:
                break
            del kept[least]
        return kept

    def _worths(self, kept: Sequence[str]) -> list[float]:
        """What each of the kept effects brings, the prior widths of the others left alone: from one inversion."""
        mean, covariance = self.given(kept)
        worths = []
        for name, place in zip(kept, self._within(kept), strict=True):
            own, block = mean[place], covariance[np.ix_(place, place)]
            worth = 0.5 * float(own @ np.linalg.solve(block, own)) + 0.5 * float(np.linalg.slogdet(block)[1])
            if name in self.widths:
                widths = self._all_widths[name][None, :]
                worth += float(mixture_evidence(own[None, :], block[None, :, :], widths)[0])
            worths.append(worth - self.price_nats.get(name, 0.0))
        return worths

    def _climbed(self, kept: list[str]) -> list[str]:
        """One step up after another: an effect more or less, and where neither helps one exchanged for another."""
        best = self.evidence(kept)
        while True:
            others = [name for name in self.rows if name not in kept]
            moves = [[one for one in kept if one != name] for name in kept] + [[*kept, name] for name in others]
            swaps = []
            if len(kept) <= MOST_SWAPPED:
                swaps = [[*(one for one in kept if one != gone), name] for gone in kept for name in others]
            for some in (moves, swaps):
                if not some:
                    continue
                values = self.evidences(some)
                place = int(np.argmax(values))
                if values[place] > best + 1e-9:
                    best, kept = float(values[place]), some[place]
                    break
            else:
                return kept
