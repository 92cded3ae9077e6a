"""Logs of random names, units, signs, delimiters and encodings are mapped and calibrated to the truth."""

from __future__ import annotations

import pytest

from tests.propose.random_forms import tried


@pytest.mark.parametrize("seed", [1001, 1053, 2014, 3007])
def test_a_random_log_is_calibrated_to_the_truth_without_an_edit(tmp_path, seed):
    case = tried(seed, tmp_path)
    assert case.why == "", case.form


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(9000, 9060))
def test_many_random_logs_are(tmp_path, seed):
    case = tried(seed, tmp_path)
    assert case.why == "", case.form
