"""Windows as users give them."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.errors import UsageError
from sccal.logs.windows import parse_window, windows_on_clock, within


def test_two_numbers_and_a_colon():
    assert parse_window("60:120") == (60.0, 120.0)
    assert parse_window("1717243260.5:1717243300") == (1717243260.5, 1717243300.0)


@pytest.mark.parametrize("text", ["", "60", "60-120", "120:60", "60:60", "a:b", "nan:1", "0:inf", "1:2:3"])
def test_anything_else_is_refused(text):
    with pytest.raises(UsageError, match="60:120"):
        parse_window(text)


def test_times_of_the_log_are_taken_as_they_are():
    assert windows_on_clock([(60.0, 120.0)], (0.47, 185.0)) == [(60.0, 120.0)]
    assert windows_on_clock([(1060.0, 1120.0)], (1000.0, 1300.0)) == [(1060.0, 1120.0)]


def test_other_times_count_from_the_start():
    assert windows_on_clock([(60.0, 120.0)], (1000.0, 1300.0)) == [(1060.0, 1120.0)]
    assert windows_on_clock([(0.0, 20.0)], (0.5, 100.0)) == [(0.5, 20.5)]


@pytest.mark.parametrize("window", [(400.0, 500.0), (-20.0, -10.0), (20.0, 10.0)])
def test_windows_outside_or_empty_are_refused(window):
    with pytest.raises(UsageError):
        windows_on_clock([window], (1000.0, 1300.0))


def test_ends_belong_to_a_window():
    t_s = np.array([0.9, 1.0, 1.5, 2.0, 2.1])
    assert within(t_s, [(1.0, 2.0)]).tolist() == [False, True, True, True, False]
