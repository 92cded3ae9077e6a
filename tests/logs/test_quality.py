"""A quality that goes into a message and comes back is no better than it was."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.align.accuracy import table_sigma_m
from sccal.logs.quality import SIGMA_M, navsat_status, quality_of


@pytest.mark.parametrize("status", [-1, 0, 1, 2])
@pytest.mark.parametrize("sigma_m", [0.01, 0.5])
def test_a_status_comes_back(status, sigma_m):
    (quality,) = quality_of(np.array([float(status)]), np.array([sigma_m])).tolist()
    assert navsat_status(quality) == status


@pytest.mark.parametrize("quality", SIGMA_M)
def test_a_message_claims_no_more_than_the_fix_did(quality):
    sigma_m = SIGMA_M[quality]
    (back,) = quality_of(np.array([float(navsat_status(quality))]), np.array([sigma_m])).tolist()
    assert SIGMA_M[back] >= min(sigma_m, 1.0)


def test_the_table_is_what_fixes_are_weighed_by():
    qualities = np.array(list(SIGMA_M))
    assert table_sigma_m(qualities).tolist() == list(SIGMA_M.values())
    assert np.isnan(table_sigma_m(np.array([0, 6, 7]))).all()
