"""The compiled recursion against scipy's filters."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from sccal.align.whitening import innovations


@given(seed=st.integers(0, 1000), rows=st.integers(1, 60), lam=st.floats(-0.99, 0.99), order=st.integers(0, 14))
@settings(max_examples=40)
def test_it_is_what_two_filters_in_a_row_give(seed, rows, lam, order):
    rng = np.random.default_rng(seed)
    steps, ar = rng.normal(size=(rows, 3)), 0.2 * rng.normal(size=order)
    white = lfilter([1.0], [1.0, -lam], steps, axis=0)
    expected = lfilter(np.concatenate(([1.0], -ar)), [1.0], white, axis=0)
    assert innovations(steps, lam, ar) == pytest.approx(expected, abs=1e-12)
