"""Iron near the compass: far beyond first order, and what the columns are there."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.hard_iron import deviation_secants
from tests.effects.harness import injected, innovations

LARGE = (("hard_iron", (15.0, 15.0)), ("hard_iron", (-25.0, 10.0)), ("soft_iron", (12.0, -9.0)))
TURN = np.linspace(-7.0, 7.0, 1401)


def rms(values):
    return float(np.sqrt(np.nanmean(np.square(values))))


def named(name, values):
    return dict(zip((p.name for p in CATALOGUE[name].parameters), values, strict=True))


def deviation(log, name, values):
    """Heading, and what the physics adds to the reading there."""
    state = log.simulated.motion.at(log.simulated.ahrs.true_t_s)
    return state.yaw_rad, CATALOGUE[name].physics(named(name, values)).heading(state, np.zeros(state.t_s.size))


@pytest.mark.parametrize(("name", "values"), LARGE)
def test_large_amplitudes_are_explained(name, values):
    log = injected(name, values)
    _, error = deviation(log, name, values)
    heading, _ = innovations(log, name, named(name, values))
    assert np.max(np.abs(error)) > np.radians(14.0)
    assert rms(heading) < 1e-3 * rms(error)


@pytest.mark.parametrize(("name", "values"), LARGE)
def test_columns_computed_anew_lead_from_zero_to_the_truth(name, values):
    yaw, error = deviation(injected(name, values), name, values)
    times = 2.0 if name == "soft_iron" else 1.0
    estimate = np.zeros(2)
    for _ in range(20):
        columns = np.stack(deviation_secants(times * yaw, *estimate), axis=1)
        estimate = np.linalg.lstsq(columns, error, rcond=None)[0]
    assert estimate == pytest.approx(values, abs=0.01)


def test_at_zero_they_are_the_harmonics():
    cos, sin = deviation_secants(TURN, 0.0, 0.0)
    assert cos == pytest.approx(np.radians(np.cos(TURN)))
    assert sin == pytest.approx(np.radians(np.sin(TURN)))


def test_no_heading_is_special():
    c, s = 20.0, -12.0
    cos, sin = deviation_secants(np.append(TURN, np.arctan2(-c, s)), c, s)
    assert np.all(np.abs(np.diff(cos[:-1])) < 5e-4)
    assert np.all(np.isfinite(cos))
    assert np.all(np.isfinite(sin))
