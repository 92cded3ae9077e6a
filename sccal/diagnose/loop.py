"""The one loop: saturate, let the evidence choose, refit, look for moments and shapes, until nothing changes.

all candidates free beside the noise  →  evidence of every subset  →  the chosen ones refitted with their own noise
→  time constants and thresholds refined, moments and places looked for beside them  →  again with what was found
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sccal.align import Aligned
from sccal.arrays import Floats
from sccal.diagnose.criteria import LEAST_NATS, LEAST_T, SEARCH_NATS
from sccal.diagnose.shapes import Found, best_forms, find_moments, refined, settled
from sccal.effects.effect import Parameter
from sccal.evidence.candidates import Candidates, gather_candidates
from sccal.evidence.extension import Free
from sccal.evidence.held_out_gain import WHOLE_RUNS, held_out_gain
from sccal.evidence.joint import Key
from sccal.evidence.model import Accepted, Model, Trust, bare_model, refitted
from sccal.evidence.posterior import PRICE_NATS, WIDEST, Posterior
from sccal.evidence.saturated import Saturated, posterior_of, saturate
from sccal.filter.noise import Reach
from sccal.filter.options import FilterOptions
from sccal.results.noise import Noise

MOST_ROUNDS = 5
STAYS = 0.3
"""Of its sigma: a shape that moves less has not moved."""


@dataclass(frozen=True)
class Sized:
    """One effect of the model as it came out."""

    accepted: Accepted
    worth_nats: float
    """The evidence with it over that without it, its price paid."""
    held_out_nats: float
    """What it brings on stretches or runs that did not fit it; infinite for a moment, which no other data can show."""
    t: float
    size: float
    """Largest parameter in units of the smallest that matters."""
    needed_nats: float = LEAST_NATS
    """What a finding must bring."""
    beyond: str = ""
    """A parameter that came out beyond what such an effect can be, in words."""

    @property
    def told(self) -> bool:
        """Whether it is a finding."""
        sure = self.worth_nats >= self.needed_nats and self.t >= LEAST_T
        return sure and self.size >= 1.0 and self.held_out_nats > 0.0 and not self.beyond

    @property
    def stays(self) -> bool:
        """Whether the model is better off with it: more likely than not, and a help on data that did not fit it.

        A moment, of which no other data can say anything, has to be a finding.
        """
        helps = self.worth_nats > 0.0 and 0.0 < self.held_out_nats < np.inf
        return self.told or (helps and not self.beyond)


@dataclass
class Loop:
    """The model as it was found."""

    first: Model
    model: Model
    candidates: Candidates
    saturated: Saturated
    moments: list[Found] = field(default_factory=list)
    shape_sigmas: dict[str, dict[str, float]] = field(default_factory=dict)
    """By effect (with its shapes, as refined): sigmas of the shapes."""
    taken_back: dict[str, str] = field(default_factory=dict)
    """Effects that the evidence chose and that did not hold, and why."""
    sized: list[Sized] = field(default_factory=list)
    """Of the final model, in the order in which the evidence adds them."""

    @property
    def posterior(self) -> Posterior:
        return self.saturated.posterior

    @property
    def kept(self) -> list[str]:
        return [one.key for one in self.model.accepted]


def run_loop(
    runs: Sequence[Aligned], options: FilterOptions, heading_rate_hz: float, trust: Trust = Trust.DETAIL
) -> Loop:
    """Find what the model lacks in some runs of one vehicle.

    Where details are not trusted and whole runs judge, what a run has alone says nothing to the judge (a clock of its
    own fits every run's details), and neither does a moment: there, only what the vehicle has competes.

    Raises:
        DataError: where a run hardly moves.
    """
    first = bare_model(runs, options, heading_rate_hz, trust)
    candidates = gather_candidates([first.view(k) for k in range(len(runs))])
    if trust is Trust.PATH and len(runs) >= WHOLE_RUNS:
        candidates = replace(candidates, free=tuple(one for one in candidates.free if _of_vehicle(one)))
    competing = best_forms(first, candidates, ())
    saturated = saturate(first, competing, prices(competing), Reach.ROUGH)
    loop = Loop(first, first, candidates, saturated)
    kept: list[Accepted] = []
    tried: list[tuple[Model, Saturated]] = []
    for count in range(MOST_ROUNDS):
        before = {one.key for one in kept}
        kept = _chosen(loop, competing)
        loop.model = _refitted(loop, kept)
        tried.append((loop.model, loop.saturated))
        kept = _with_shapes(loop, kept)
        at_rest = {one.key for one in kept} == before
        moments = _moments(loop) if at_rest or count == 0 else []
        if at_rest and not moments:
            break
        loop.moments += moments
        known = [*kept, *(one.accepted for one in loop.moments)]
        competing = [*best_forms(loop.model, candidates, kept), *(one for one in known if one.run is not None)]
        competing = list({one.key: one for one in competing}.values())
        # The noise beside all candidates changes with a moment that is new among them, and hardly with anything else.
        reach = Reach.LOOK if moments or count == 0 else None
        loop.saturated = saturate(loop.model, competing, prices(competing), reach, _noises(loop.saturated))
    else:
        tried.append((_refitted(loop, _chosen(loop, competing)), loop.saturated))
    # Where it comes to no rest, what was likeliest on the way.
    counted = 1.0 / min((model for model, _ in tried), key=lambda model: model.nll).fit.dispersion
    loop.model, loop.saturated = max(tried, key=lambda one: _score(one[0], counted))
    _take_back(loop)
    return loop


def _score(model: Model, counted: float) -> float:
    """Logarithm of a model's evidence, its nats counting by so much, and its prices paid."""
    return -counted * model.nll - sum(prices(model.accepted).values())


def _of_vehicle(free: Free) -> bool:
    return all(one.scope == "vehicle" for one in free.parameters)


def prices(competing: Sequence[Accepted]) -> dict[str, float]:
    """What each costs: its prior odds, and for what was searched for the places where it was looked for."""
    return {one.key: SEARCH_NATS if one.run is not None else PRICE_NATS for one in competing}


def _noises(saturated: Saturated) -> list[Noise]:
    return [problem.noise for problem in saturated.model.problems]


def _chosen(loop: Loop, competing: Sequence[Accepted]) -> list[Accepted]:
    by_key = {one.key: one for one in competing}
    keys = _in_order(loop.posterior, loop.posterior.select([key for key in loop.kept if key in by_key]))
    chosen = [by_key[key] for key in keys]
    # What is in the model may be larger than usual.
    return [replace(one, free=replace(one.free, prior_scale=WIDEST)) for one in chosen]


def _in_order(posterior: Posterior, kept: Sequence[str]) -> list[str]:
    """The kept effects, each the one that brings most beside those before it."""
    ordered: list[str] = []
    left = list(kept)
    while left:
        best = max(left, key=lambda key: posterior.gain(key, ordered))
        ordered.append(best)
        left.remove(best)
    return ordered


def _refitted(loop: Loop, kept: Sequence[Accepted]) -> Model:
    """The chosen effects with a noise that was looked at quickly, from where the saturated fit has them."""
    starts = loop.saturated.given([one.key for one in kept])
    return refitted(loop.saturated.model, kept, starts, Reach.LOOK, _noises(loop.saturated))


def _with_shapes(loop: Loop, kept: list[Accepted]) -> list[Accepted]:
    """The same effects with their time constants and thresholds where they are likeliest."""
    new: list[Accepted] = []
    for one in kept:
        if one.free.shapes and one.run is None:
            better, sigmas = refined(loop.model, one)
            # A shape that stays within its error keeps its value, so that the loop can come to rest.
            moved = any(abs(better.free.shapes[k] - one.free.shapes[k]) > STAYS * sigmas[k] for k in sigmas)
            new.append(better if moved else one)
            loop.shape_sigmas[new[-1].key] = sigmas
        else:
            new.append(one)
    return new


def _moments(loop: Loop) -> list[Found]:
    """The moment or place that stands out most beside the model, where one does."""
    if loop.model.trust is Trust.PATH:
        return []
    known = [one.free.effect.name for one in loop.moments]
    for rough in find_moments(loop.model, known):
        moment = settled(loop.model, rough)
        if moment.stands_out:
            loop.shape_sigmas[moment.free.key] = dict(moment.shape_sigmas)
            return [moment]
    return []


def leave_out(loop: Loop, keys: Sequence[str]) -> None:
    """The model without some effects, and without what does not hold any more without them."""
    loop.model = refitted(loop.model, [one for one in loop.model.accepted if one.key not in keys], reach=Reach.LOOK)
    _take_back(loop)


def _take_back(loop: Loop) -> None:
    """Leave what does not hold once it is fitted; what is too small or too unsure to be told may stay where it helps.

    First under a noise that was looked at quickly, then under that of the model that is left.
    """
    reach, whole = Reach.LOOK, True
    while True:
        loop.sized = sized_of(loop.model)
        weak = [one for one in loop.sized if not one.stays]
        _tell_weak(loop, weak)
        if not weak and reach is Reach.NEAR:
            break
        whole = whole and not weak
        gone = {one.accepted.key for one in weak}
        reach = Reach.LOOK if weak else Reach.NEAR
        rest = [one for one in loop.model.accepted if one.key not in gone]
        loop.model = refitted(loop.model, rest, reach=reach)
    if not whole:
        refine_again(loop)


def refine_again(loop: Loop) -> None:
    """Time constants and thresholds without what was left out, where the model is likelier with them and all holds."""
    kept = list(loop.model.accepted)
    better = _with_shapes(loop, kept)
    if [one.key for one in better] == [one.key for one in kept]:
        return
    model = refitted(loop.model, better, reach=Reach.NEAR)
    sized = sized_of(model)
    if model.nll < loop.model.nll and all(one.stays for one in sized):
        loop.model, loop.sized = model, sized
        # What else competes is asked beside the new forms: the posterior knows effects by their shapes.
        new = {one.free.effect.name: one for one in better if one.run is None}
        before = loop.saturated.model.accepted
        rivals = [one if one.run is not None else new.get(one.free.effect.name, one) for one in before]
        loop.saturated = saturate(model, rivals, prices(rivals), None, _noises(loop.saturated))


def need_more(loop: Loop, needed_nats: float) -> None:
    """Ask more of a finding, and take back what does not bring it."""
    loop.sized = [replace(one, needed_nats=max(needed_nats, LEAST_NATS)) for one in loop.sized]
    _tell_weak(loop, loop.sized)


def _tell_weak(loop: Loop, some: Sequence[Sized]) -> None:
    for one in some:
        if one.size >= 1.0 and not one.told:
            loop.taken_back[one.accepted.free.effect.name] = _why(one)


def _why(one: Sized) -> str:
    if one.beyond:
        return f"{one.beyond}, beyond what such an effect can be"
    kept = "; the model keeps it, as it helps on data that did not fit it" if one.stays else ""
    if one.worth_nats < one.needed_nats:
        return f"it brings {one.worth_nats:.1f} nats of evidence, and a finding needs {one.needed_nats:.1f}{kept}"
    if one.t < LEAST_T:
        return f"it is {one.t:.1f} times its sigma, and a finding needs {LEAST_T:g}{kept}"
    return "it does not help on the data that did not fit it"


def sized_of(model: Model) -> list[Sized]:
    """What every effect of a model brings and how large it is."""
    posterior = posterior_of(model, prices(model.accepted))
    keys = [one.key for one in model.accepted]
    found = []
    for one in model.accepted:
        values = values_in(model, one)
        t = joint_t(model, one)
        size = max(float(np.sqrt(np.mean(v**2))) / max(p.matters, 1e-12) for v, _, p in values)
        moments = [row for other in model.accepted if other.run is not None for row in rows_of(model, other)]
        # All evidence for a moment lies in it: no other part of the run can foretell it.
        gain = np.inf if one.run is not None else held_out_gain(model.fit, rows_of(model, one), moments)
        found.append(Sized(one, posterior.worth(one.key, keys), gain, t, size, beyond=_beyond(values)))
    return found


def _beyond(values: Sequence[tuple[Floats, Floats, Parameter]]) -> str:
    """The first parameter whose value no such effect has: something else hides behind it."""
    for some, _, parameter in values:
        worst = float(some[int(np.argmax(np.abs(some)))])
        if not parameter.lower <= worst <= parameter.upper:
            limits = f"{parameter.lower:g} … {parameter.upper:g}"
            return f"its {parameter.name} would be {worst:.3g} {parameter.unit}, not within {limits}"
    return ""


def rows_of(model: Model, accepted: Accepted) -> list[int]:
    """Places of an effect's parameters, all runs' copies, in the model's joint fit."""
    return [place for place, key in enumerate(model.fit.places.keys) if key[0] == accepted.key]


def joint_t(model: Model, accepted: Accepted) -> float:
    """Root of an effect's χ² less its degrees of freedom but one: for one parameter, its value over its sigma."""
    rows = rows_of(model, accepted)
    values = model.fit.values[rows]
    covariance = model.fit.all_robust[np.ix_(rows, rows)]
    hidden = np.array([_hidden(model, accepted.free, model.fit.places.keys[row]) for row in rows])
    covariance = covariance + np.diag(hidden**2)
    scale = np.sqrt(np.diag(covariance))
    chi2 = float((values / scale) @ np.linalg.solve(covariance / np.outer(scale, scale), values / scale))
    return float(np.sqrt(max(chi2 - (len(rows) - 1), 0.0)))


def _hidden(model: Model, free: Free, key: Key) -> float:
    """What no log shows of a parameter: of the vehicle's, what the run that shows most leaves."""
    runs = range(len(model.problems)) if key[2] < 0 else [key[2]]
    spans = [model.problems[run].aligned.span_s for run in runs]
    parameter = next(one for one in free.parameters if one.name == key[1])
    return free.effect.hidden_sigma(parameter, max(last - first for first, last in spans))


def values_in(model: Model, accepted: Accepted) -> list[tuple[Floats, Floats, Parameter]]:
    """Per free parameter of an effect: its values and sigmas, one of the vehicle's or one per run, and itself."""
    fit = model.fit
    sigmas = np.sqrt(np.diag(fit.all_robust))
    found = []
    for parameter in accepted.free.parameters:
        rows = [k for k, key in enumerate(fit.places.keys) if key[:2] == (accepted.key, parameter.name)]
        hidden = np.array([_hidden(model, accepted.free, fit.places.keys[row]) for row in rows])
        found.append((fit.values[rows], np.hypot(sigmas[rows], hidden), parameter))
    return found
