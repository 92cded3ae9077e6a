"""The runs' evidence as one linear problem: gains, held-out gains and robust errors of any candidate, no more passes.

Parameters of the vehicle are shared, those of a run exist once per run. All are in units of their prior sigma. Beside
the candidate that is asked about, every other effect with a name is in the problem as a nuisance, with a prior of half
the smallest size that matters: a fix that is 10 ms old, which every log holds, must not pass for slip of the wheels,
and a candidate has to explain more than small amounts of everything else can.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sccal.arrays import Bools, Floats, Ints
from sccal.calibration.extension import Free
from sccal.diagnose.evidence import Evidence, prior_sigmas, rows_of
from sccal.diagnose.placebo import Placebo
from sccal.effects.effect import Effect
from sccal.effects.patterns import Pattern

TIME_FOLDS = 6
WHOLE_RUNS = 3
"""From so many runs on, what the vehicle shares is judged on whole runs left out."""
NUISANCE = 0.5
BOX_ROUNDS = 4
PROMISING = 16
PLACEBOS = 8


@dataclass(frozen=True)
class Score:
    """One candidate, judged at one moment of the loop."""

    effect: Effect
    gain_nats: float
    """In log-likelihood on the data that fitted it."""
    held_out_nats: float
    """On data that did not."""
    t: float
    """Size over its block-robust error (for several parameters: root of their joint χ²)."""
    values: Floats
    """(m,) one-step estimate in file units; of a run's parameter, the mean over the runs."""
    sigmas: Floats
    """(m,) block-robust."""
    size: float
    """Largest parameter in units of the smallest size that matters; of a run's parameter, the rms over the runs."""


class Pool:
    """Evidence of one or more runs about the same candidates."""

    def __init__(self, evidence: Sequence[Evidence], candidates: Sequence[Effect]) -> None:
        self.candidates = tuple(candidates)
        self.local = rows_of(candidates)
        self.sigma = prior_sigmas(candidates)
        parameters = [one for effect in candidates for one in Free(effect).parameters]
        runs = len(evidence)
        self.where: list[Ints] = [np.zeros(len(parameters), dtype=np.int64) for _ in range(runs)]
        owner: list[int] = []
        for k, one in enumerate(parameters):
            for run in range(runs):
                self.where[run][k] = len(owner)
                if one.scope == "run":
                    owner.append(k)
            if one.scope != "run":
                owner.append(k)
        self.owner = np.array(owner, dtype=np.int64)
        """Of each global parameter, its place among the candidates' parameters."""
        least = np.array([one.matters / one.prior_sigma for one in parameters])
        self.small = NUISANCE * np.where(least > 0, least, 0.1)[self.owner] if parameters else np.zeros(0)
        # Where the noise is not what the filter takes it for, a nat is worth less.
        self.evidence = [_deflated(one) for one in evidence]
        self.folds = self._folds(runs >= WHOLE_RUNS)
        self.time_folds = self._folds(False) if runs >= WHOLE_RUNS else self.folds

    @property
    def size(self) -> int:
        """Number of global parameters."""
        return int(self.owner.size)

    def _folds(self, whole_runs: bool) -> list[tuple[Floats, Floats]]:
        """u and I of each part that is left out in its turn."""
        parts = len(self.evidence) if whole_runs else TIME_FOLDS
        folds = [(np.zeros(self.size), np.zeros((self.size, self.size))) for _ in range(parts)]
        for run, one in enumerate(self.evidence):
            count = len(one.u)
            part = np.full(count, run) if whole_runs else np.arange(count) * parts // max(count, 1)
            for fold in np.unique(part):
                u, information = folds[int(fold)]
                where = self.where[run]
                u[where] += one.u[part == fold].sum(axis=0)
                information[np.ix_(where, where)] += one.information[part == fold].sum(axis=0)
        return folds

    @cached_property
    def total(self) -> tuple[Floats, Floats]:
        """u and I of everything."""
        return sum(u for u, _ in self.folds), sum(information for _, information in self.folds)  # type: ignore[return-value]

    @cached_property
    def _named(self) -> Bools:
        """Which global parameters belong to effects with a name."""
        unnamed = [row for e in self.candidates if isinstance(e, Pattern | Placebo) for row in self.local[e.name]]
        return ~np.isin(self.owner, unnamed)

    def rows(self, *effects: str) -> Ints:
        """Global places of some candidates' parameters, all runs' copies."""
        wanted = np.concatenate([self.local[name] for name in effects]) if effects else np.zeros(0, np.int64)
        return np.flatnonzero(np.isin(self.owner, wanted))

    def precision(self, free: Ints) -> Floats:
        """Prior precision (G,): free parameters at their prior, other named ones small, patterns held at zero."""
        prior = np.where(self._named, 1.0 / self.small**2, np.inf)
        prior[free] = 1.0
        return prior

    def _solve(self, u: Floats, information: Floats, free: Ints, held: Ints) -> Floats:
        """Most likely values (G,): free ones, nuisances within twice their prior sigma, zero where held."""
        prior = self.precision(free)
        prior[held] = np.inf
        loose = np.isfinite(prior)
        limit = np.where(np.isin(np.arange(u.size), free), np.inf, 2.0 * self.small)
        values = np.zeros(u.size)
        for _ in range(BOX_ROUNDS):
            kept = np.flatnonzero(loose)
            rest = u[kept] - information[np.ix_(kept, ~loose)] @ values[~loose]
            values[kept] = np.linalg.solve(information[np.ix_(kept, kept)] + np.diag(prior[kept]), rest)
            beyond = loose & (np.abs(values) > limit)
            if not beyond.any():
                break
            values[beyond] = np.sign(values[beyond]) * limit[beyond]
            loose &= ~beyond
        return values

    def held_out(self, free: Sequence[str], held: Sequence[str] = ()) -> Floats:
        """Log-likelihood over that at zero on each part, fitted on all other parts (parts,).

        Some candidates are free, some held at zero, and small amounts of all others are allowed.
        """
        loose, still = self.rows(*free), self.rows(*held)
        own = any(one.scope == "run" for e in self.candidates if e.name in free for one in e.parameters)
        folds = self.time_folds if own else self.folds
        u_all, information_all = sum(u for u, _ in folds), sum(i for _, i in folds)
        values = [self._solve(u_all - u, information_all - i, loose, still) for u, i in folds]
        return np.array([_quadratic(*fold, each) for fold, each in zip(folds, values, strict=True)])

    def gain(self, *effects: str) -> float:
        """Held-out gain of freeing some candidates, over small amounts of everything."""
        own = any(one.scope == "run" for e in self.candidates if e.name in effects for one in e.parameters)
        return float(self.held_out(effects).sum()) - self._small_gain[own]

    @cached_property
    def _small_gain(self) -> tuple[float, float]:
        """Held-out gain of small amounts of everything: over the folds, and over those of time."""
        values = []
        for folds in (self.folds, self.time_folds):
            u_all, information_all = sum(u for u, _ in folds), sum(i for _, i in folds)
            none = np.zeros(0, np.int64)
            each = [(u, i, self._solve(u_all - u, information_all - i, none, none)) for u, i in folds]
            values.append(float(sum(_quadratic(u, i, v) for u, i, v in each)))
        return values[0], values[1]

    def score(self, effect: Effect) -> Score:
        """Everything about one candidate."""
        free = self.rows(effect.name)
        u, information = self.total
        values = self._solve(u, information, free, free[:0])
        robust = self.robust(values, free)[np.ix_(free, free)]
        here = values[free]
        chi2 = float(here @ np.linalg.lstsq(robust + 1e-12 * np.eye(free.size), here, rcond=None)[0])
        t = float(np.sqrt(max(chi2 - (free.size - 1), 0.0)))
        means, sigmas, sizes = [], [], []
        for place, parameter in zip(self.local[effect.name], Free(effect).parameters, strict=True):
            copies = np.flatnonzero(self.owner[free] == place)
            typical = float(np.sqrt(np.mean(here[copies] ** 2))) * self.sigma[place]
            sizes.append(typical / max(parameter.matters, 1e-12))
            means.append(float(here[copies].mean()) * self.sigma[place])
            sigmas.append(float(np.sqrt(np.diag(robust)[copies].mean() / copies.size)) * self.sigma[place])
        without = self._solve(u, information, free[:0], free[:0])
        gain = _quadratic(u, information, values) - _quadratic(u, information, without)
        return Score(effect, gain, self.gain(effect.name), t, np.array(means), np.array(sigmas), max(sizes))

    def everything_free(self) -> Floats:
        """Sigmas (G,) with every parameter free under its whole prior, in units of that prior."""
        u, information = self.total
        free = np.arange(self.size)
        values = np.asarray(np.linalg.solve(information + np.eye(self.size), u), dtype=np.float64)
        return np.asarray(np.sqrt(np.diag(self.robust(values, free))))

    def robust(self, values: Floats, free: Ints) -> Floats:
        """Covariance (G, G) from the scatter of the blocks' scores, at least what the model says."""
        _, information = self.total
        prior = self.precision(free)
        kept = np.flatnonzero(np.isfinite(prior))
        covariance = np.zeros((self.size, self.size))
        covariance[np.ix_(kept, kept)] = np.linalg.inv(information[np.ix_(kept, kept)] + np.diag(prior[kept]))
        scores = []
        for run, one in enumerate(self.evidence):
            where = self.where[run]
            scores.append(np.zeros((len(one.u), self.size)))
            scores[-1][:, where] = one.u - one.information @ values[where]
        stacked = np.concatenate(scores)
        middle = stacked.T @ stacked
        sandwich = covariance @ middle @ covariance
        ratio = np.sqrt(np.maximum(np.diag(sandwich), np.diag(covariance)) / np.maximum(np.diag(sandwich), 1e-300))
        ratio = np.where(np.diag(sandwich) > 0, ratio, 1.0)
        return np.asarray(sandwich * np.outer(ratio, ratio))

    def ranked(self) -> list[Score]:
        """All candidates that any data speak of, the largest held-out gain first."""
        return self._best([e for e in self.candidates if not isinstance(e, Placebo)], PROMISING)

    def placebos(self) -> list[Score]:
        """The nonsense columns that gain most."""
        return self._best([e for e in self.candidates if isinstance(e, Placebo)], PLACEBOS)

    def _best(self, effects: Sequence[Effect], count: int) -> list[Score]:
        spoken = [e for e in effects if self.rows(e.name).size and np.any(self.total[0][self.rows(e.name)])]
        promising = sorted(spoken, key=lambda e: -self._alone(self.rows(e.name)))[:count]
        return sorted((self.score(e) for e in promising), key=lambda one: -one.held_out_nats)

    def _alone(self, rows: Ints) -> float:
        """Gain of some parameters with everything else at zero: an upper bound that costs nothing."""
        u, information = self.total
        values = np.linalg.solve(information[np.ix_(rows, rows)] + np.eye(rows.size), u[rows])
        return 0.5 * float(u[rows] @ values)


def _quadratic(u: Floats, information: Floats, values: Floats) -> float:
    """Log-likelihood at some values over that at zero."""
    return float(values @ u - 0.5 * values @ information @ values)


def _deflated(one: Evidence) -> Evidence:
    nis = max(one.nis, 1.0)
    return Evidence(one.u / nis, one.information / nis, one.cost / nis, one.count)
