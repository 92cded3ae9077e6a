"""A first-order low-pass along uneven times, against its own differential equation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.effects.low_pass import low_passed

UNEVEN_S = np.cumsum(np.random.default_rng(1).exponential(0.2, 400))


def integrated(values, t_s, tau_s, parts=400):
    """The same by small steps of dy/dt = (x − y)/τ, x straight between its samples (Heun's method)."""
    y, out = values[0], [values[0]]
    for i in range(1, t_s.size):
        h = (t_s[i] - t_s[i - 1]) / parts
        x = np.linspace(values[i - 1], values[i], parts + 1)
        for k in range(parts):
            slope = (x[k] - y) / tau_s
            y = y + 0.5 * h * (slope + (x[k + 1] - y - h * slope) / tau_s)
        out.append(y)
    return np.array(out)


@pytest.mark.parametrize("tau_s", [0.3, 3.0, 40.0])
def test_it_solves_its_equation(tau_s):
    t_s = UNEVEN_S[:60]
    x = np.sin(1.7 * t_s) + 0.3 * t_s
    assert low_passed(x, t_s, tau_s) == pytest.approx(integrated(x, t_s, tau_s), abs=1e-5)


def test_a_step_is_let_in_by_the_time_constant():
    x = np.where(UNEVEN_S[0] < UNEVEN_S, 1.0, 0.0)
    after = low_passed(x, UNEVEN_S, 8.0)
    begun = after[1]
    assert after[1:] == pytest.approx(1.0 - (1.0 - begun) * np.exp(-(UNEVEN_S[1:] - UNEVEN_S[1]) / 8.0))


def test_it_begins_where_its_input_does_and_comes_behind():
    ramp = low_passed(5.0 + UNEVEN_S, UNEVEN_S, 4.0)
    assert ramp[0] == 5.0 + UNEVEN_S[0]
    assert ramp[-1] == pytest.approx(5.0 + UNEVEN_S[-1] - 4.0, abs=1e-6)


def test_without_slowness_it_is_its_input():
    x = np.sin(UNEVEN_S)
    assert low_passed(x, UNEVEN_S, 0.0) == pytest.approx(x)
    assert low_passed(x, UNEVEN_S, 1e-9) == pytest.approx(x, abs=1e-6)
    assert low_passed(np.zeros(0), np.zeros(0), 5.0).size == 0


def test_readings_at_one_time_are_harmless():
    doubled = np.repeat(UNEVEN_S, 2)
    twice = low_passed(np.repeat(np.sin(UNEVEN_S), 2), doubled, 5.0)
    assert twice[::2] == pytest.approx(low_passed(np.sin(UNEVEN_S), UNEVEN_S, 5.0))


@settings(max_examples=50)
@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(0.01, 120.0))
def test_it_is_linear_and_takes_columns(a, b, tau_s):
    x, y = np.sin(3.0 * UNEVEN_S), np.cos(UNEVEN_S)
    both = low_passed(np.column_stack((x, y)), UNEVEN_S, tau_s)
    assert a * both[:, 0] + b * both[:, 1] == pytest.approx(low_passed(a * x + b * y, UNEVEN_S, tau_s), abs=1e-9)
