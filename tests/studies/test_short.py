"""The studies' short form: what `make study-noise` and `make study-effects` ask of hundreds of logs, of a few."""

from __future__ import annotations

import pytest

from studies.cases import PoolOptions
from studies.effects import EffectCase, work
from studies.noise import run


@pytest.mark.slow
def test_the_noise_is_found_on_logs_of_another_simulator():
    """No likelihood below that of the true noise by more than a nat, and no verdict that names a cause."""
    _, data = run(2, 17, PoolOptions(jobs=1), False)
    assert len(data["cases"]) == 2
    for case in data["cases"]:
        assert not case["error"]
        assert case["margin_nats"] >= -1.0
        assert not case["names_a_cause"], case["verdict"]


@pytest.mark.slow
@pytest.mark.parametrize("label", ["lever_arm", "radius_step"])
def test_an_effect_that_another_simulator_makes_is_named_alone(tmp_path, label):
    found = work(EffectCase(1_700_001, (label,), "usual"), tmp_path)
    assert found.shows
    assert [one["effect"] for one in found.findings] == [label]
    assert found.score is not None
    assert all(abs(error) < 4.0 for error in found.score.errors.values())
    assert found.drift_after_m < found.drift_before_m
