"""Nonsense columns: as the real ones in everything but meaning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align import Series
from sccal.effects.logged import logged_effects
from sccal.evidence.nonsense import COUNT, NAME, WHERE, NonsenseColumn, shuffled, with_nonsense
from tests.evidence.logs import aligned


def smooth(count, seed=0):
    steps = np.random.default_rng(seed).normal(size=count)
    return 7.0 + np.convolve(np.cumsum(steps), np.ones(9) / 9.0, mode="same")


@pytest.mark.parametrize("count", [400, 401])
def test_shuffling_keeps_the_spectrum_and_takes_the_mean_off(count):
    source = smooth(count)
    made = shuffled(source, np.random.default_rng(1))
    assert made.size == count
    assert made.mean() == pytest.approx(0.0, abs=1e-9)
    was, now = (np.abs(np.fft.rfft(one - one.mean())) for one in (source, made))
    # With an even count the last of all frequencies has no phase to be shuffled.
    assert now[:-1] == pytest.approx(was[:-1], abs=1e-6)
    assert made.std() == pytest.approx(source.std(), rel=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_shuffling_leaves_nothing_of_the_source(seed):
    source = smooth(2000, seed)
    made = shuffled(source, np.random.default_rng(seed))
    assert np.max(np.abs(made - (source - source.mean()))) > source.std()
    assert abs(np.corrcoef(made, source)[0, 1]) < 0.9
    fast = np.random.default_rng(seed + 50).normal(size=2000)
    assert abs(np.corrcoef(shuffled(fast, np.random.default_rng(seed)), fast)[0, 1]) < 0.15


def test_every_run_gets_the_columns_beside_its_own():
    plain = aligned()
    t_s = plain.wheel_t_s
    own = replace(plain, extras={"motor_current_a": Series(t_s, np.sin(t_s))})
    dressed, nonsense = with_nonsense([own, plain])
    assert [len(one.extras) for one in dressed] == [COUNT + 1, COUNT]
    assert dressed[0].extras["motor_current_a"] is own.extras["motor_current_a"]
    assert set(dressed[1].extras) == {f"{NAME}_{k}" for k in range(COUNT)}
    assert len(nonsense) == COUNT * len(WHERE)
    assert all(isinstance(one, NonsenseColumn) for one in nonsense)
    assert {one.where for one in nonsense} == set(WHERE)
    first, last = plain.span_s
    for series in dressed[1].extras.values():
        assert series.t_s[0] == first
        assert series.t_s[-1] > last - 1.0
    for name in dressed[1].extras:
        assert not np.array_equal(dressed[0].extras[name].values, dressed[1].extras[name].values)


def test_the_same_seed_makes_the_same_nonsense():
    one, again, other = (with_nonsense([aligned()], seed)[0][0].extras for seed in (0, 0, 1))
    for name in one:
        assert np.array_equal(one[name].values, again[name].values)
        assert not np.array_equal(one[name].values, other[name].values)


def test_the_log_itself_is_left_alone():
    plain = aligned()
    with_nonsense([plain])
    assert not plain.extras


def test_a_users_columns_are_not_taken_for_nonsense():
    dressed, nonsense = with_nonsense([aligned()])
    named = {one.name for one in logged_effects([dressed[0].extras])}
    assert {one.name for one in nonsense} < named
    assert not any(isinstance(one, NonsenseColumn) for one in logged_effects([dressed[0].extras]))
