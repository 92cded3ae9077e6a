"""Everything free at once: noise, constants and all candidates together, and what that says of each candidate.

Estimated before the effects, noise swallows them: a heading that wanders and wheels that slip explain anything a
little. Estimated with all candidates free beside it under their priors, what is missing in the model can no longer
pass for noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.effects.effect import Parameter
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, Model, refitted
from sccal.evidence.posterior import WIDEST, Posterior
from sccal.filter.iterate import At
from sccal.filter.noise import Reach
from sccal.filter.start import Constants
from sccal.results.noise import Noise


@dataclass(frozen=True)
class Saturated:
    """The fit with all candidates free, and their posterior."""

    model: Model
    posterior: Posterior

    def given(self, kept: Sequence[str]) -> list[At]:
        """Per run, where constants and kept effects stand if the rest is zero: to start the kept ones' own fit."""
        fit = self.model.fit
        values = fit.values.copy()
        rows = self.posterior.places(kept)
        mean, _ = self.posterior.given(kept)
        values[rows] = mean * self.posterior.sigma[rows]
        starts = []
        for run, places in enumerate(fit.places.of_run):
            wanted = [place for place in places[3:].tolist() if fit.places.keys[place][0] in kept]
            by_key = {fit.places.keys[place][:2]: values[place] for place in wanted}
            ordered = [by_key[key, one.name] for key in kept for one in self._free(key, run)]
            starts.append(At(Constants.of(values), np.array(ordered, dtype=np.float64), self.model.path(run)))
        return starts

    def _free(self, key: str, run: int) -> tuple[Parameter, ...]:
        """The parameters that a run holds of an effect."""
        extension = self.model.problems[run].extension
        assert extension is not None
        return next((one.parameters for one in extension.effects if one.key == key), ())  # type: ignore[attr-defined]


def saturate(
    model: Model,
    accepted: Sequence[Accepted],
    price_nats: Mapping[str, float],
    reach: Reach | None = Reach.NEAR,
    noises: Sequence[Noise] = (),
) -> Saturated:
    """Fit with all of some effects free, noise included unless ``reach`` is None.

    Each effect costs what ``price_nats`` says: its prior odds.
    """
    full = refitted(model, accepted, reach=reach, noises=noises)
    return Saturated(full, posterior_of(full, price_nats))


def posterior_of(model: Model, price_nats: Mapping[str, float]) -> Posterior:
    """What a fit says of the effects in it, its data counted by how far they agree with their noise.

    Where stretches disagree by more than their noise, κ times in χ² per degree of freedom, what the data say is worth
    1/κ of its nats (the dispersion of a quasi-likelihood; Wedderburn 1974): values given that others are zero
    stay what they are, and every sigma is √κ times as large.
    """
    fit = model.fit
    sigma = 1.0 / np.sqrt(np.diag(fit.prior))
    sigma[:3] = fit.values[:3]
    rows: dict[str, list[int]] = {}
    for place, (effect, _, _) in enumerate(fit.places.keys):
        if effect:
            rows.setdefault(effect, []).append(place)
    places: dict[str, Ints] = {key: np.array(some, dtype=np.int64) for key, some in rows.items()}
    prior = fit.prior * np.outer(sigma, sigma)
    whole = np.linalg.inv(fit.covariance / np.outer(sigma, sigma))
    centre = prior @ (fit.centre / sigma)
    counted = 1.0 / fit.dispersion
    precision = prior + counted * (whole - prior)
    covariance: Floats = np.asarray(np.linalg.inv(0.5 * (precision + precision.T)), dtype=np.float64)
    mean = covariance @ (centre + counted * (whole @ (fit.values / sigma) - centre))
    widths = {one.key: _widths(one.free) for one in model.accepted}
    return Posterior(places, mean, covariance, sigma, price_nats, widths)


def _widths(free: Free) -> tuple[float, float]:
    """Of an effect's priors, in parts of that of its fit."""
    matters = min(one.matters / one.prior_sigma for one in free.parameters)
    return min(matters if matters > 0.0 else 1.0, 1.0) / free.prior_scale, WIDEST / free.prior_scale
