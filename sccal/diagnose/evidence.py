"""What one run says about every candidate: one scoring pass over it, block by block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sccal.arrays import Floats, Ints, Rows
from sccal.calibration.extension import Free, view_run
from sccal.effects.effect import Effect
from sccal.effects.view import DriveView
from sccal.filter.columns import Placed, kernel_columns
from sccal.filter.iterate import At, RunProblem
from sccal.filter.scoring import score

BLOCK_S = 20.0
MIN_BLOCKS, MAX_BLOCKS = 12, 40
SETTLING_S = 20.0
"""While the filter learns the radii, candidates that look like them would be paid for it."""


@dataclass(frozen=True)
class Evidence:
    """u and I of all candidates' parameters over the blocks of one run, in units of each parameter's prior sigma."""

    u: Floats
    """(b, K)"""
    information: Floats
    """(b, K, K)"""
    cost: Floats
    """(b,) Σ ν²/σ²."""
    count: Ints
    """(b,)"""

    @property
    def nis(self) -> float:
        """Mean normalised innovation squared; 1 where the noise is right."""
        return float(self.cost.sum() / max(self.count.sum(), 1))


def rows_of(candidates: Sequence[Effect]) -> dict[str, Ints]:
    """Places of each candidate's parameters among all, in order; parameters that are shapes have none."""
    rows: dict[str, Ints] = {}
    first = 0
    for effect in candidates:
        count = len(Free(effect).parameters)
        rows[effect.name] = np.arange(first, first + count)
        first += count
    return rows


def prior_sigmas(candidates: Sequence[Effect]) -> Floats:
    """(K,) of the candidates' parameters in file units."""
    return np.array([one.prior_sigma for effect in candidates for one in Free(effect).parameters])


def place(candidates: Sequence[Effect], view: DriveView) -> list[Placed]:
    """All candidates' columns at zero, numbered from 0."""
    placed: list[Placed] = []
    for effect, rows in zip(candidates, rows_of(candidates).values(), strict=True):
        if rows.size:
            placed += Free(effect).placed(view, [0.0] * rows.size, int(rows[0]))
    return placed


def gather(problem: RunProblem, at: At, candidates: Sequence[Effect]) -> Evidence:
    """Score all candidates on one run, linearised at the given constants along the given path."""
    clear = problem.clear_steps(at.constants)
    view = view_run(problem, at, clear)
    columns = kernel_columns(place(candidates, view), problem.timeline)
    return gather_columns(problem, at, clear, columns, prior_sigmas(candidates))


def gather_columns(
    problem: RunProblem, at: At, clear: tuple[Floats, Floats], columns: object, sigmas: Floats
) -> Evidence:
    """The same for columns made elsewhere; sigmas (K,) are the parameters' prior ones."""
    run = problem.begun(at, True, clear)
    block, used = blocks(problem)
    found = score(run.events, run.columns, columns, sigmas.size, run.model, run.x, run.P, block)  # type: ignore[arg-type]
    return Evidence(
        u=(found.u * sigmas)[used:],
        information=(found.information * np.outer(sigmas, sigmas))[used:],
        cost=found.cost[used:],
        count=found.count[used:],
    )


def blocks(problem: RunProblem) -> tuple[Rows, int]:
    """Number of each event's block (n,), and the first block that counts."""
    t_s = problem.timeline.t_s
    settled = min(problem.start.moving_from_s + SETTLING_S, 0.5 * (t_s[0] + t_s[-1]))
    count = int(np.clip((t_s[-1] - settled) / BLOCK_S, MIN_BLOCKS, MAX_BLOCKS))
    since = (t_s - settled) / max(t_s[-1] - settled, 1e-9)
    return np.where(t_s < settled, 0, 1 + np.minimum((since * count).astype(np.int32), count - 1)).astype(np.int32), 1
