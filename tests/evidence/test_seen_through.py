"""Where readings are late and smoothed, what turns the robot shows late and smoothed: by differences of the whole."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.evidence.extension import Free, FreeEffects
from tests.evidence.logs import bare

EFFECTS = ("eccentric_right", "turn_slip", "heading_latency", "heading_smoothing")
VALUES = np.array([0.02, -0.03, 0.1, -0.4, 0.7])
"""Of their parameters in order: cos and sin, share per rad/s, s, s."""


@pytest.fixture(scope="module")
def view():
    return bare(duration_s=90.0).view(0)


def readings(view, values):
    """What all effects add to the readings, and what further turning of the wheels they show."""
    laid = FreeEffects(tuple(Free(CATALOGUE[name]) for name in EFFECTS)).laid(view, values)
    own = [one for one in laid.placed if one.column.port == "heading"]
    return sum(values[one.parameter] * one.column.values for one in own) + laid.known_rad


@pytest.mark.parametrize("parameter", range(5))
def test_the_columns_are_the_derivatives_of_what_the_readings_add(view, parameter):
    effects = FreeEffects(tuple(Free(CATALOGUE[name]) for name in EFFECTS))
    laid = effects.laid(view, VALUES)
    column = sum(
        one.column.values for one in laid.placed if one.column.port == "heading" and one.parameter == parameter
    )
    step = np.zeros(5)
    step[parameter] = 1e-4
    by_difference = (readings(view, VALUES + step) - readings(view, VALUES - step)) / 2e-4
    # The last readings show what comes after the log's end.
    inside = view.headings.t_s < view.headings.t_s[-1] - 2.0
    assert np.std((column - by_difference)[inside]) < 0.1 * np.std(by_difference)


def test_further_effects_are_laid_out_once(view):
    """Those that are known already are not seen through a second time."""
    known = FreeEffects(tuple(Free(CATALOGUE[name]) for name in EFFECTS))
    whole = FreeEffects((*known.effects, Free(CATALOGUE["speed_slip"])))
    values = np.append(VALUES, 0.01)
    at_once, in_steps = whole.laid(view, values), whole.laid(view, values, known.laid(view, VALUES))
    assert sorted(one.parameter for one in at_once.placed) == sorted(one.parameter for one in in_steps.placed)
