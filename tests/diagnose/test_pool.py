"""Candidates scored on linear problems whose truth is known, the evidence made by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from sccal.diagnose.evidence import Evidence, prior_sigmas
from sccal.diagnose.loop import aliases, chosen, is_flexible, passes
from sccal.diagnose.placebo import Placebo
from sccal.diagnose.pool import TIME_FOLDS, Pool
from sccal.effects.effect import Effect, Parameter
from sccal.effects.logged import Range
from sccal.effects.patterns import Pattern

BLOCKS, ROWS = 18, 60
PRIOR, MATTERS = 0.4, 0.02


class Made(Effect):
    """An effect of parameters alone."""

    looks_like = excited_by = reference = "made for a test"

    def __init__(self, name: str, count: int = 1, scope: str = "vehicle", matters: float = MATTERS) -> None:
        self.name = self.title = name
        self.parameters = tuple(
            Parameter(f"p{k}", "m", PRIOR, -10.0, 10.0, scope=scope, matters=matters) for k in range(count)
        )

    def columns(self, drive, at):
        raise NotImplementedError

    def physics(self, values):
        raise NotImplementedError


def columns_of(count: int, seed: int, rows: int = BLOCKS * ROWS) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(rows, count))


def said(
    columns: np.ndarray,
    truth: np.ndarray,
    candidates: Sequence[Effect],
    seed: int = 0,
    noise: float = 1.0,
    sigma: float = 1.0,
) -> Evidence:
    """What data with a true value of every parameter (k,), or one a row (n, k), in file units, say of the candidates.

    ``noise`` is what the data have, ``sigma`` what the filter takes it for.
    """
    rng = np.random.default_rng(1000 + seed)
    nu = (columns * truth).sum(axis=1) + noise * rng.normal(size=len(columns))
    scaled = columns * prior_sigmas(candidates) / sigma
    parts = np.split(np.arange(len(columns)), BLOCKS)
    return Evidence(
        u=np.array([scaled[part].T @ nu[part] / sigma for part in parts]),
        information=np.array([scaled[part].T @ scaled[part] for part in parts]),
        cost=np.array([float((nu[part] ** 2).sum()) / sigma**2 for part in parts]),
        count=np.array([part.size for part in parts]),
    )


def quiet(evidence: Evidence) -> Evidence:
    """The same with innovations as large as the filter expects, so that it is not deflated."""
    return Evidence(evidence.u, evidence.information, evidence.count.astype(float), evidence.count)


def one_of(names: Sequence[str], truth: Mapping[str, float], seed: int = 0) -> tuple[Pool, list[Made]]:
    """One run; effects of a parameter each."""
    candidates = [Made(name) for name in names]
    values = np.array([truth.get(name, 0.0) for name in names])
    return Pool([quiet(said(columns_of(len(names), seed), values, candidates, seed))], candidates), candidates


def test_the_true_candidate_is_found_with_its_size():
    pool, candidates = one_of(["true", "b", "c"], {"true": -0.3})
    score = pool.score(candidates[0])
    expected = 0.5 * BLOCKS * ROWS * 0.3**2
    assert score.held_out_nats == pytest.approx(expected, rel=0.3)
    assert score.gain_nats > score.held_out_nats > 8.0
    assert score.values[0] == pytest.approx(-0.3, abs=4.0 * score.sigmas[0])
    assert score.sigmas[0] == pytest.approx(1.0 / np.sqrt(BLOCKS * ROWS), rel=0.5)
    assert score.size == pytest.approx(abs(score.values[0]) / MATTERS)
    assert score.t == pytest.approx(abs(score.values[0]) / score.sigmas[0], rel=0.01)
    assert passes(score)
    assert pool.ranked()[0].effect is candidates[0]


@pytest.mark.parametrize("seed", range(6))
def test_noise_gains_nothing_where_it_was_not_fitted(seed):
    pool, candidates = one_of([f"c{k}" for k in range(8)], {}, seed)
    scores = [pool.score(one) for one in candidates]
    assert max(score.gain_nats for score in scores) > 0.0
    assert np.mean([score.held_out_nats for score in scores]) < 0.5
    assert max(score.held_out_nats for score in scores) < 5.0
    assert not any(passes(score) for score in scores)
    assert chosen(pool.ranked(), 0.0) is None


def test_several_parameters_are_judged_together():
    candidates = [Made("pair", 2), Made("other")]
    truth = np.array([0.2, -0.1, 0.0])
    pool = Pool([quiet(said(columns_of(3, 4), truth, candidates))], candidates)
    score = pool.score(candidates[0])
    assert score.values == pytest.approx([0.2, -0.1], abs=4.0 * score.sigmas.max())
    assert score.size == pytest.approx(np.abs(score.values).max() / MATTERS)
    expected = np.sqrt(float(((score.values / score.sigmas) ** 2).sum()) - 1.0)
    assert score.t == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize(("scope", "found"), [("run", True), ("vehicle", False)])
def test_what_differs_from_run_to_run_is_a_runs_own(scope, found):
    candidates = [Made("own", scope=scope), Made("other")]
    each = [np.array([value, 0.0]) for value in (0.3, -0.3, 0.3, -0.3)]
    evidence = [quiet(said(columns_of(2, k), truth, candidates, k)) for k, truth in enumerate(each)]
    pool = Pool(evidence, candidates)
    assert pool.rows("own").size == (4 if scope == "run" else 1)
    assert pool.size == pool.rows("own").size + 1
    score = pool.score(candidates[0])
    assert passes(score) == found
    if found:
        assert score.values[0] == pytest.approx(0.0, abs=0.05)
        assert score.size == pytest.approx(0.3 / MATTERS, rel=0.2)
        assert score.held_out_nats > 4 * 0.5 * BLOCKS * ROWS * 0.3**2 * 0.7
    else:
        assert score.held_out_nats < 0.0


def test_what_all_runs_have_is_shared():
    candidates = [Made("common"), Made("other")]
    runs = [quiet(said(columns_of(2, k), np.array([0.15, 0.0]), candidates, k)) for k in range(4)]
    one, four = Pool(runs[:1], candidates), Pool(runs, candidates)
    assert four.size == 2
    alone, together = one.score(candidates[0]), four.score(candidates[0])
    assert together.held_out_nats > 2.5 * alone.held_out_nats > 0.0
    assert together.sigmas[0] < 0.75 * alone.sigmas[0]
    assert together.values[0] == pytest.approx(0.15, abs=4.0 * together.sigmas[0])


def test_from_three_runs_on_the_shared_is_judged_on_whole_runs_left_out():
    candidates = [Made("common"), Made("own", scope="run")]
    runs = [quiet(said(columns_of(2, k), np.array([0.2, 0.0]), candidates, k)) for k in range(3)]
    assert Pool(runs, candidates).held_out(("common",)).size == 3
    assert Pool(runs, candidates).held_out(("own",)).size == TIME_FOLDS
    assert Pool(runs[:2], candidates).held_out(("common",)).size == TIME_FOLDS


def test_what_one_run_alone_has_does_not_pass_for_the_vehicles():
    candidates = [Made("common"), Made("other")]
    truths = (0.3, 0.0, 0.0, 0.0)
    runs = [quiet(said(columns_of(2, k), np.array([one, 0.0]), candidates, k)) for k, one in enumerate(truths)]
    pool = Pool(runs, candidates)
    score = pool.score(candidates[0])
    assert score.gain_nats > 8.0
    assert score.held_out_nats < 0.0


def alike(truth: float, with_cause: bool = True, share: float = 0.995, least: float = MATTERS) -> tuple[Pool, Effect]:
    """A cause of some size, and another candidate whose column is nearly the same; the alias is returned.

    ``least`` is the smallest size of the alias that matters.
    """
    alias = Made("alias", matters=least)
    candidates = [Made("cause"), alias, Made("other")][0 if with_cause else 1 :]
    rng = np.random.default_rng(6)
    columns = 30.0 * rng.normal(size=(BLOCKS * ROWS, 3))
    columns[:, 1] = share * columns[:, 0] + np.sqrt(1.0 - share**2) * columns[:, 1]
    nu = truth * columns[:, 0] + rng.normal(size=len(columns))
    scaled = PRIOR * columns[:, 0 if with_cause else 1 :]
    parts = np.split(np.arange(len(columns)), BLOCKS)
    evidence = Evidence(
        u=np.array([scaled[part].T @ nu[part] for part in parts]),
        information=np.array([scaled[part].T @ scaled[part] for part in parts]),
        cost=np.full(BLOCKS, float(ROWS)),
        count=np.full(BLOCKS, ROWS),
    )
    return Pool([evidence], candidates), alias


def test_little_of_one_effect_is_no_finding_of_another():
    """Half of what matters is always possible; only where the cause is no candidate its alias has to take the blame."""
    lone, alias = alike(0.5 * MATTERS, with_cause=False, least=MATTERS / 20.0)
    assert passes(lone.score(alias))
    pool, alias = alike(0.5 * MATTERS, with_cause=True, least=MATTERS / 20.0)
    assert pool.gain("alias") < 1.0
    assert not passes(pool.score(alias))


def test_a_nuisance_takes_no_more_than_what_matters():
    size = 8.0 * MATTERS
    pool, alias = alike(size)
    assert pool.score(alias).values[0] == pytest.approx(size - MATTERS, abs=0.15 * MATTERS)
    assert passes(pool.score(alias))
    assert pool.ranked()[0].effect.name == "cause"
    assert pool.ranked()[0].values[0] == pytest.approx(size, abs=0.5 * MATTERS)


def test_candidates_with_the_same_column_are_named_beside_each_other():
    pool, alias = alike(8.0 * MATTERS, share=1.0)
    assert pool.gain("cause") == pytest.approx(pool.gain("alias"), rel=1e-6)
    assert aliases(pool, pool.score(alias)) == ("cause",)
    apart, _ = alike(8.0 * MATTERS, share=0.5)
    assert apart.ranked()[0].effect.name == "cause"
    assert aliases(apart, apart.ranked()[0]) == ()


def test_a_nat_is_worth_less_where_the_noise_is_larger_than_thought():
    candidates = [Made("true"), Made("b")]
    honest = said(columns_of(2, 2), np.array([0.3, 0.0]), candidates, noise=2.0, sigma=2.0)
    bold = said(columns_of(2, 2), np.array([0.3, 0.0]), candidates, noise=2.0, sigma=1.0)
    assert bold.nis == pytest.approx(4.0, rel=0.15)
    right, deflated = (Pool([one], candidates).score(candidates[0]) for one in (honest, bold))
    assert deflated.held_out_nats == pytest.approx(right.held_out_nats, rel=0.1)
    assert Pool([bold], candidates).total[0] == pytest.approx(bold.u.sum(axis=0) / bold.nis)
    assert Pool([bold], candidates).total[1] == pytest.approx(bold.information.sum(axis=0) / bold.nis)


def test_a_nat_is_worth_no_more_where_the_noise_is_smaller_than_thought():
    candidates = [Made("true"), Made("b")]
    timid = said(columns_of(2, 2), np.array([0.3, 0.0]), candidates, noise=0.5, sigma=1.0)
    assert timid.nis < 0.5
    assert Pool([timid], candidates).total[0] == pytest.approx(timid.u.sum(axis=0))


def test_blocks_that_disagree_widen_the_sigma():
    candidates = [Made("changing"), Made("b")]
    columns = columns_of(2, 6)
    in_block = np.repeat(np.arange(BLOCKS), ROWS)
    swinging = np.stack([0.3 + 0.5 * np.where(in_block % 2, 1.0, -1.0), np.zeros(in_block.size)], axis=1)
    steady = np.stack([np.full(in_block.size, 0.3), np.zeros(in_block.size)], axis=1)
    disagreeing, agreeing = (
        Pool([quiet(said(columns, truth, candidates))], candidates).score(candidates[0]) for truth in (swinging, steady)
    )
    by_model = 1.0 / np.sqrt(BLOCKS * ROWS)
    assert by_model * 0.99 < agreeing.sigmas[0] < 1.6 * by_model
    assert disagreeing.sigmas[0] == pytest.approx(0.5 / np.sqrt(BLOCKS), rel=0.25)
    assert disagreeing.sigmas[0] > 3.0 * by_model
    assert disagreeing.t < 4.5 < agreeing.t


def test_everything_free_tells_what_cannot_be_told_apart():
    candidates = [Made("one"), Made("twin"), Made("third")]
    columns = columns_of(3, 8)
    columns[:, 1] = columns[:, 0] + 0.01 * columns[:, 1]
    sigma = Pool([quiet(said(columns, np.zeros(3), candidates))], candidates).everything_free()
    assert sigma[0] > 0.5
    assert sigma[1] > 0.5
    assert sigma[2] * PRIOR == pytest.approx(1.0 / np.sqrt(BLOCKS * ROWS), rel=0.5)


def made_pattern(name: str, count: int = 1) -> Pattern:
    return Pattern("along", name, lambda drive: [], count, PRIOR)


def test_a_pattern_is_no_nuisance():
    """What a pattern could explain stays there to be explained by an effect with a name."""
    pattern, named = made_pattern("anything"), Made("named")
    columns = columns_of(2, 3)
    columns[:, 0] = columns[:, 1]
    both = Pool([quiet(said(columns, np.array([0.0, 0.3]), [pattern, named]))], [pattern, named])
    alone = Pool([quiet(said(columns[:, 1:], np.array([0.3]), [named]))], [named])
    assert both.gain("named") == pytest.approx(alone.gain("named"), rel=1e-6)
    assert both.score(named).values == pytest.approx(alone.score(named).values)


@pytest.mark.parametrize(("share", "winner"), [(0.99, "named"), (0.6, "along with the truth")])
def test_a_pattern_wins_only_where_no_name_does_nearly_as_well(share, winner):
    pattern, named = made_pattern("the truth"), Made("named")
    columns = columns_of(2, 3)
    columns[:, 1] = share * columns[:, 0] + np.sqrt(1.0 - share**2) * columns[:, 1]
    pool = Pool([quiet(said(columns, np.array([0.3, 0.0]), [pattern, named]))], [pattern, named])
    assert all(passes(one) for one in pool.ranked())
    best = chosen(pool.ranked(), 0.0)
    assert best is not None
    assert best.effect.name == winner


def test_a_pattern_that_could_follow_anything_is_never_chosen():
    waves = made_pattern("time", 4)
    pool = Pool([quiet(said(columns_of(4, 3), np.array([0.3, 0.2, 0.1, 0.3]), [waves]))], [waves])
    assert is_flexible(waves)
    assert passes(pool.ranked()[0])
    assert chosen(pool.ranked(), 0.0) is None


def test_nonsense_is_not_ranked_and_raises_the_bar():
    named, nonsense = Made("named"), Placebo("heading", "nonsense_0", Range(0.0, 10.0 / PRIOR))
    assert nonsense.parameters[0].prior_sigma == pytest.approx(PRIOR)
    candidates = [named, nonsense]
    pool = Pool([quiet(said(columns_of(2, 9), np.array([0.2, 0.4]), candidates))], candidates)
    assert [one.effect for one in pool.ranked()] == [named]
    (placebo,) = pool.placebos()
    assert placebo.effect is nonsense
    assert placebo.held_out_nats > pool.ranked()[0].held_out_nats > 8.0
    assert chosen(pool.ranked(), 0.0) is not None
    assert chosen(pool.ranked(), placebo.held_out_nats) is None
