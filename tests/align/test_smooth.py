"""A reading freed of its white noise: nearer to the truth, and no attenuation of what is regressed on it."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.align.smooth import without_white_noise


def walk(seed, step=0.1, count=6000):
    return np.cumsum(step * np.random.default_rng(seed).normal(size=count))


def slope(y, x):
    """Of y on x, both about their means."""
    y, x = y - y.mean(), x - x.mean()
    return float(y @ x / (x @ x))


@pytest.mark.parametrize("white", [0.2, 1.0, 3.0])
def test_it_is_nearer_to_the_truth_and_attenuates_nothing(white):
    slopes, as_read = [], []
    for seed in range(8):
        truth = walk(seed)
        truth -= np.linspace(truth[0], truth[-1], truth.size)
        read = truth + white * np.random.default_rng(100 + seed).normal(size=truth.size)
        smooth = without_white_noise(read)
        assert np.std(smooth - truth) < 0.9 * white
        slopes.append(slope(truth, smooth))
        as_read.append(slope(truth, read))
    assert np.mean(slopes) == pytest.approx(1.0, abs=0.02)
    assert np.mean(as_read) < np.mean(slopes)


def test_neither_a_constant_nor_a_reading_without_white_noise_is_changed():
    quiet = walk(1)
    assert np.abs(without_white_noise(quiet) - quiet).max() < 0.2
    np.testing.assert_allclose(without_white_noise(np.full(500, 0.3)), 0.3, rtol=1e-12)


def test_what_cannot_be_told_stays_as_it_is():
    short = np.random.default_rng(0).normal(size=20)
    gap = np.where(np.arange(500) == 100, np.nan, 0.1)
    assert without_white_noise(short) is short
    assert without_white_noise(gap) is gap


def test_it_does_not_shift_in_time():
    truth = np.repeat([0.0, 1.0, 0.0], 400)
    read = truth + 0.3 * np.random.default_rng(3).normal(size=truth.size)
    smooth = without_white_noise(read)
    up, down = 400, 800
    near = np.arange(-60, 60)
    assert np.argmin(np.abs(smooth[up + near] - 0.5)) == pytest.approx(60, abs=8)
    assert np.argmin(np.abs(smooth[down + near] - 0.5)) == pytest.approx(60, abs=8)
