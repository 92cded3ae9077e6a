"""Several runs of one vehicle as one problem: shared radii, track and effects, own poses, offsets and run effects.

Each run's pass leaves the posterior of its constants and effects with everything else of its own marginalised; prior
taken out, that is the run's likelihood: precision Λ_i and vector η_i. Runs are independent given what they share, so
the joint posterior over the shared parameters and each run's own is Λ = Λ_0 + Σ Λ_i, η = Λ_0 m_0 + Σ η_i, the prior
counted once. All runs are linearised again at the joint answer until it stays.

Where runs, or stretches of one, disagree by more than their sigmas allow, something that the model lacks differs
between them. The sigmas then come from the scatter of their scores u_i = η_i − Λ_i m (Liang and Zeger 1986, stretches
and runs as clusters), if those are larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Protocol

import numpy as np

from sccal.arrays import Floats, Ints
from sccal.evidence.extension import FreeEffects
from sccal.evidence.parallel import each_apart
from sccal.filter.forward import ForwardPass, numeric_limits
from sccal.filter.iterate import MOST_HALVINGS, WORSE_NATS, At, RunProblem, whole_nll
from sccal.filter.layout import BASE_STATES, CONSTANTS
from sccal.filter.start import Constants

MAX_ROUNDS = 4
CLOSE_SIGMAS = 0.05
STRETCH_S = 20.0
FEWEST_STRETCHES, MOST_STRETCHES = 8, 30
SETTLING_S = 20.0
"""While the filter learns the radii, its scores say more of the start than of the model."""

Key = tuple[str, str, int]
"""Effect (with its shapes), parameter, and the run that it belongs to (−1: the vehicle)."""


class Gaussian(Protocol):
    """What a run says of k shared parameters."""

    @property
    def precision(self) -> Floats:
        """(k, k)"""
        ...

    @property
    def vector(self) -> Floats:
        """(k,) precision times the best values."""
        ...


@dataclass(frozen=True)
class Stretch:
    """What one stretch of a run adds to the likelihood, given all of the run before it."""

    precision: Floats
    """(3 + m, 3 + m)"""
    vector: Floats
    """(3 + m,)"""


@dataclass(frozen=True)
class RunLikelihood:
    """What one run says of its constants and effects (3 + m), no prior in it."""

    precision: Floats
    """(3 + m, 3 + m)"""
    vector: Floats
    """(3 + m,) precision times the best values."""
    path: ForwardPass
    nll: float
    """Negative log-likelihood of the measurements, constants and effects marginalised under their priors."""
    stretches: tuple[Stretch, ...] = ()

    @classmethod
    def of(cls, problem: RunProblem, at: At, with_stretches: bool = False) -> RunLikelihood:
        """From a pass linearised there."""
        run = problem.begun(at, True, with_sigmas=False)
        theta = np.concatenate((at.constants.as_array(), at.values))
        prior = _inverse(problem.prior)
        stretches: list[Stretch] = []
        so_far: list[tuple[Floats, Floats]] = []
        for end in _stretch_ends(problem) if with_stretches else []:
            run.run_to(end)
            so_far.append(_learnt(run.belief.covariance(), np.concatenate((run.belief.x, run.belief.p))))
        for before, after in pairwise(so_far):
            stretches.append(Stretch(after[0] - before[0], after[1] - before[1]))
        found = problem.with_whole_prior(at, run.finish(), at.prior_scale)
        precision, vector = _learnt(found.final_covariance, found.final_state)
        nll = whole_nll(problem, at, found)
        return cls(precision - prior, vector - prior @ theta, found, nll, tuple(stretches))


def _learnt(covariance: Floats, state: Floats) -> tuple[Floats, Floats]:
    """Precision and vector of R_r, R_l, L and the effects, from a filter's whole belief."""
    rows = np.r_[CONSTANTS, BASE_STATES : state.size]
    precision = _inverse(covariance[np.ix_(rows, rows)])
    return precision, precision @ state[rows]


def _inverse(covariance: Floats) -> Floats:
    """Of a covariance whose parameters have all kinds of units; symmetric."""
    scale = 1.0 / np.sqrt(np.diag(covariance))
    inverse = np.linalg.inv(covariance * np.outer(scale, scale)) * np.outer(scale, scale)
    return np.asarray(0.5 * (inverse + inverse.T))


def _stretch_ends(problem: RunProblem) -> list[int]:
    """Events at which stretches end, the first of them where the filter has settled."""
    t_s = problem.timeline.t_s
    settled = min(problem.start.moving_from_s + SETTLING_S, 0.5 * (t_s[0] + t_s[-1]))
    count = int(np.clip((t_s[-1] - settled) / STRETCH_S, FEWEST_STRETCHES, MOST_STRETCHES))
    return [int(k) for k in np.searchsorted(t_s, np.linspace(settled, t_s[-1], count + 1), side="right")]


@dataclass(frozen=True)
class Places:
    """Where each run's parameters stand among all."""

    keys: tuple[Key, ...]
    """(G,) R_r, R_l, L, then the effects' of the vehicle, then those of each run."""
    of_run: tuple[Ints, ...]
    """Per run (3 + m,)"""
    shared: int
    """How many belong to the vehicle; they come first."""

    @classmethod
    def of(cls, problems: Sequence[RunProblem]) -> Places:
        names = [names_of(problem) for problem in problems]
        scopes = [_scopes(problem) for problem in problems]
        core: list[Key] = [("", name, -1) for name in ("radius_right_m", "radius_left_m", "track_m")]
        keys: dict[Key, int] = {key: k for k, key in enumerate(core)}
        for own in (False, True):
            for run, (of_run, scope_of_run) in enumerate(zip(names, scopes, strict=True)):
                for name, scope in zip(of_run, scope_of_run, strict=True):
                    if (scope == "run") == own:
                        keys.setdefault((*name, run if own else -1), len(keys))
            if not own:
                shared = len(keys)
        places = []
        for run, (of_run, scope_of_run) in enumerate(zip(names, scopes, strict=True)):
            rest = [
                keys[*name, run if scope == "run" else -1] for name, scope in zip(of_run, scope_of_run, strict=True)
            ]
            places.append(np.array([0, 1, 2, *rest], dtype=np.int64))
        return cls(tuple(keys), tuple(places), shared)


def names_of(problem: RunProblem) -> list[tuple[str, str]]:
    """Effect (with its shapes) and parameter of everything that the filter holds beyond the paper's constants."""
    extension = problem.extension
    if not isinstance(extension, FreeEffects):
        return []
    return [(free.key, one.name) for free in extension.effects for one in free.parameters]


def _scopes(problem: RunProblem) -> list[str]:
    extension = problem.extension
    return [one.scope for _, one in extension.parameters] if isinstance(extension, FreeEffects) else []


@dataclass(frozen=True)
class JointFit:
    """The answer for all runs together."""

    places: Places
    values: Floats
    """(G,)"""
    covariance: Floats
    """(G, G) as the model has it."""
    prior: Floats
    """(G, G) precision of the prior."""
    centre: Floats
    """(G,) its mean."""
    runs: tuple[RunLikelihood, ...]

    @property
    def mode(self) -> Floats:
        """(k,) of the shared parameters: R_r, R_l, L, then the effects'."""
        return self.values[: self.places.shared]

    @cached_property
    def each(self) -> tuple[Floats, ...]:
        """Per run (3 + m,): the shared values, and its own given these."""
        return tuple(self.values[rows] for rows in self.places.of_run)

    @cached_property
    def all_robust(self) -> Floats:
        """(G, G) with every sigma at least what the scatter of stretches and of runs says."""
        found = self.covariance
        scores = self._scores()
        if scores.shape[0] > 1:
            found = at_least(found, self.covariance @ (scores.T @ scores) @ self.covariance)
        if len(self.runs) > 1:
            of_runs = self._run_scores()
            count = len(self.runs)
            more = self.covariance @ (of_runs.T @ of_runs) @ self.covariance * (count / (count - 1.0))
            shared = np.arange(more.shape[0]) < self.places.shared
            more[~shared, :] = 0.0
            found = at_least(found, more)
        return found

    @property
    def robust(self) -> Floats:
        """(k, k) of the shared parameters."""
        return self.all_robust[: self.places.shared, : self.places.shared]

    @property
    def chi2_per_dof(self) -> float | None:
        """Disagreement of the runs about the shared parameters; None for one run."""
        k = self.places.shared
        shared = [_marginal(one, rows, k, self.prior) for one, rows in zip(self.runs, self.places.of_run, strict=True)]
        return disagreement(shared, self.mode, self.prior[:k, :k])

    @property
    def misfit(self) -> float:
        """χ² per degree of freedom of the stretches' scores: 1 where noise and model are right, however many runs."""
        chi2, directions = self.stretches_chi2
        return chi2 / max(directions, 1)

    @cached_property
    def stretches_chi2(self) -> tuple[float, int]:
        """χ² of the stretches' scores, and how many directions they show."""
        chi2, directions = 0.0, 0
        for one, rows in zip(self.runs, self.places.of_run, strict=True):
            scale = 1.0 / np.sqrt(np.diag(self.prior)[rows])
            for stretch in one.stretches:
                more, seen = _chi2(stretch, self.values[rows], scale)
                chi2, directions = chi2 + more, directions + seen
        return chi2, directions

    @property
    def dispersion(self) -> float:
        """How many times the stretches' χ² is what it ought to be, at least 1: so much less the nats of a log mean."""
        return max(self.misfit, 1.0)

    @property
    def nll(self) -> float:
        """Negative log-likelihood of all runs."""
        return sum(one.nll for one in self.runs)

    def _scores(self) -> Floats:
        """(b, G) of all stretches."""
        scores = []
        for one, rows in zip(self.runs, self.places.of_run, strict=True):
            for stretch in one.stretches:
                scores.append(np.zeros(self.values.size))
                scores[-1][rows] = stretch.vector - stretch.precision @ self.values[rows]
        return np.array(scores).reshape(-1, self.values.size)

    def _run_scores(self) -> Floats:
        """(r, G)"""
        scores = np.zeros((len(self.runs), self.values.size))
        for score, one, rows in zip(scores, self.runs, self.places.of_run, strict=True):
            score[rows] = one.vector - one.precision @ self.values[rows]
        return scores


@dataclass(frozen=True)
class _Marginal:
    precision: Floats
    vector: Floats


def _marginal(one: RunLikelihood, rows: Ints, shared: int, prior: Floats) -> _Marginal:
    """What a run says of the k shared parameters, its own marginalised under their prior."""
    own = np.flatnonzero(rows >= shared)
    common = np.flatnonzero(rows < shared)
    precision = np.zeros((shared, shared))
    vector = np.zeros(shared)
    block, part = one.precision[np.ix_(common, common)], one.vector[common]
    if own.size:
        inner = one.precision[np.ix_(own, own)] + prior[np.ix_(rows[own], rows[own])]
        across = one.precision[np.ix_(common, own)]
        gain = np.linalg.solve(inner, across.T).T
        block, part = block - gain @ across.T, part - gain @ one.vector[own]
    precision[np.ix_(rows[common], rows[common])] = block
    vector[rows[common]] = part
    return _Marginal(precision, vector)


def fit_jointly(
    problems: Sequence[RunProblem], first: Sequence[At], max_rounds: int = MAX_ROUNDS, with_stretches: bool = False
) -> JointFit:
    """Posterior mode for all runs; first is where each starts: its own parameters, and the shared ones' median.

    ``with_stretches`` keeps the last pass's scores by stretch, for sigmas that own up to disagreement within a run.
    """
    places = Places.of(problems)
    size = len(places.keys)
    prior, centre = _prior(problems, places)
    lower, upper = numeric_limits(problems[0].centre)
    own = [np.concatenate((at.constants.as_array(), at.values)) for at in first]
    paths = [at.path for at in first]
    values = np.zeros(size)
    for key in range(size):
        seen = [theta[rows == key] for theta, rows in zip(own, places.of_run, strict=True)]
        values[key] = float(np.median(np.concatenate(seen)))
    best: _Round | None = None
    halvings = 0
    while max_rounds > 0:
        found = _round(problems, places, values, paths, prior, centre)
        if best is not None and not found.nll < best.nll + WORSE_NATS:
            # The step went too far: half of it, from where the data were likeliest.
            if halvings >= MOST_HALVINGS:
                break
            halvings += 1
            values = 0.5 * (values + best.at)
            continue
        best = found
        max_rounds -= 1
        values = found.answer.copy()
        values[:3] = np.clip(values[:3], lower, upper)
        moved = np.abs(values - found.at) / np.sqrt(np.diag(found.covariance))
        if moved.max() < CLOSE_SIGMAS:
            break
        paths = [one.path if problem.extra else None for one, problem in zip(found.runs, problems, strict=True)]
    assert best is not None
    values = best.answer.copy()
    values[:3] = np.clip(values[:3], lower, upper)
    runs = best.runs
    if with_stretches:
        runs = _round(problems, places, best.at, best.before, prior, centre, True).runs
    return JointFit(places, values, best.covariance, prior, centre, runs)


@dataclass(frozen=True)
class _Round:
    """One pass over every run."""

    at: Floats
    """(G,) where it was linearised."""
    before: Sequence[ForwardPass | None]
    """The paths along which."""
    runs: tuple[RunLikelihood, ...]
    answer: Floats
    covariance: Floats

    @property
    def nll(self) -> float:
        return sum(one.nll for one in self.runs)


def _round(
    problems: Sequence[RunProblem],
    places: Places,
    values: Floats,
    paths: Sequence[ForwardPass | None],
    prior: Floats,
    centre: Floats,
    with_stretches: bool = False,
) -> _Round:
    each_at = (values[rows] for rows in places.of_run)
    at = [At(Constants.of(theta), theta[3:], path) for theta, path in zip(each_at, paths, strict=True)]
    runs = each_apart(partial(_likelihood, with_stretches), zip(problems, at, strict=True))
    precision, vector = prior.copy(), prior @ centre
    for one, rows in zip(runs, places.of_run, strict=True):
        precision[np.ix_(rows, rows)] += one.precision
        vector[rows] += one.vector
    covariance = _inverse(precision)
    return _Round(values, list(paths), tuple(runs), covariance @ vector, covariance)


def _likelihood(with_stretches: bool, run: tuple[RunProblem, At]) -> RunLikelihood:
    return RunLikelihood.of(*run, with_stretches)


def _prior(problems: Sequence[RunProblem], places: Places) -> tuple[Floats, Floats]:
    """Precision (G, G) and mean (G,) of the prior: of the vehicle's once, of each run's own for it."""
    size = len(places.keys)
    precision, mean = np.zeros((size, size)), np.zeros(size)
    counted: set[int] = set()
    for problem, rows in zip(problems, places.of_run, strict=True):
        new = [k for k, row in enumerate(rows.tolist()) if row not in counted]
        counted.update(rows.tolist())
        inverse = _inverse(problem.prior)
        precision[np.ix_(rows[new], rows[new])] = inverse[np.ix_(new, new)]
    mean[:3] = np.median([problem.prior_mean[:3] for problem in problems], axis=0)
    return precision, mean


def _chi2(one: Gaussian, at: Floats, scale: Floats) -> tuple[float, int]:
    """χ² of what a likelihood says against some values (k,), and how many directions it shows beyond the prior.

    ``scale`` (k,) are the sigmas of the prior.
    """
    score = scale * (one.vector - one.precision @ at)
    values, vectors = np.linalg.eigh(one.precision * np.outer(scale, scale))
    seen = values > 1.0
    return float(((vectors.T @ score)[seen] ** 2 / values[seen]).sum()), int(seen.sum())


def disagreement(likelihoods: Sequence[Gaussian], at: Floats, prior: Floats) -> float | None:
    """χ² of the runs' own answers around the joint one, per degree of freedom, over the directions they observe."""
    chi2, directions = 0.0, 0
    scale = np.sqrt(np.diag(prior))
    for one in likelihoods:
        more, seen = _chi2(one, at, 1.0 / scale)
        chi2, directions = chi2 + more, directions + seen
    dof = directions - at.size
    return chi2 / dof if dof > 0 and len(likelihoods) > 1 else None


def between_runs(likelihoods: Sequence[Gaussian], at: Floats, covariance: Floats) -> Floats:
    """Covariance from the scatter of the runs' scores."""
    scores = np.array([one.vector - one.precision @ at for one in likelihoods])
    count = len(likelihoods)
    return np.asarray(covariance @ (scores.T @ scores) @ covariance * (count / (count - 1.0)))


def at_least(covariance: Floats, other: Floats) -> Floats:
    """The covariance with every sigma raised to the other's where that is larger, correlations kept.

    What is held, without any variance, stays held.
    """
    sigma = np.sqrt(np.diag(covariance))
    larger = np.maximum(sigma, np.sqrt(np.maximum(np.diag(other), 0.0)))
    raised = np.divide(larger, sigma, out=np.ones_like(sigma), where=sigma > 0.0)
    return np.asarray(covariance * np.outer(raised, raised))
