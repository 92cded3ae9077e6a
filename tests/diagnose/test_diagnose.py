"""Whole diagnoses of simulated logs: what was put in is what is named first, and nothing else is."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.calibration.options import CalibrationOptions
from sccal.diagnose.diagnose import TRANSPORT_S, diagnose
from sccal.diagnose.result import Diagnosis
from sccal.effects.catalogue import parse_effect
from tests.diagnose.logs import (
    HARMONIC_DEG,
    PER_AMPERE_DEG,
    MotorField,
    ThirdHarmonic,
    aligned,
    diagnosis,
    diagnosis_with,
)

ALONE = ("lever_arm=0.3,-0.1", "gnss_latency=0.15", "soft_iron=4,-3", "turn_slip=0.22")
TOGETHER = ("lever_arm=-0.2,0.25", "soft_iron=4,-3")

each_alone = pytest.mark.parametrize("text", ALONE)


def names(found: Diagnosis) -> list[str]:
    return [one.name for one in found.findings]


def require_truth(found: Diagnosis, text: str) -> None:
    effect, values = parse_effect(text)
    (finding,) = (one for one in found.findings if one.name == effect.name)
    assert set(finding.parameters) == set(values)
    for name, truth in values.items():
        estimate = finding.parameters[name]
        assert abs(estimate.value - truth) < 3.0 * estimate.sigma, (name, estimate)
        assert estimate.sigma < 0.2 * max(abs(one) for one in values.values())
        assert finding.units[name] == next(one.unit for one in effect.parameters if one.name == name)


def require_better(found: Diagnosis) -> None:
    assert found.after.outage_end_rms_m < found.before.outage_end_rms_m
    assert found.after.nll_per_measurement < found.before.nll_per_measurement
    assert len(found.after.windows) == len(found.before.windows) > 3
    for judged in (found.before, found.after):
        low, high = judged.outage_end_interval_m
        assert low < judged.outage_end_rms_m < high


def require_constants(found: Diagnosis) -> None:
    p = found.parameters_after
    for estimate, truth in ((p.radius_right_m, 0.0808), (p.radius_left_m, 0.0796), (p.track_m, 0.728)):
        assert abs(estimate.value - truth) < 4.0 * estimate.sigma


@each_alone
def test_one_effect_is_named_with_its_size_and_sign(text):
    found = diagnosis(text)
    assert names(found) == [text.split("=")[0]]
    require_truth(found, text)
    require_better(found)
    require_constants(found)
    assert not found.unexplained.significant
    assert found.placebo.passed == 0


@each_alone
def test_a_finding_says_why_it_was_made(text):
    found = diagnosis(text)
    (finding,) = found.findings
    assert finding.held_out_gain_nats >= found.placebo.needed_nats
    assert finding.t > 4.5
    gains = [one.held_out_gain_nats for one in finding.ranking]
    assert gains == sorted(gains, reverse=True)
    assert finding.name in [one.name for one in finding.ranking]
    assert finding.drift_before_m == found.before.outage_end_rms_m
    assert finding.drift_after_m == found.after.outage_end_rms_m
    assert finding.indistinguishable_from == ()
    assert finding.advice == ""


@each_alone
def test_a_picture_shows_the_residual_go(text):
    picture = diagnosis(text).findings[0].picture
    assert picture is not None
    arrays = (picture.before, picture.before_sigma, picture.after, picture.after_sigma, picture.model)
    assert all(one.shape == picture.x.shape and np.all(np.isfinite(one)) for one in arrays)
    assert np.all(np.diff(picture.x) > 0)
    assert np.std(picture.after) < 0.5 * np.std(picture.before)


def test_a_latency_owns_up_to_what_no_log_shows():
    sigma = diagnosis("gnss_latency=0.15").findings[0].parameters["s"].sigma
    assert sigma >= TRANSPORT_S >= 0.01


def test_the_model_without_the_effect_is_the_one_before():
    """What is called before is the paper's model: the lever arm drifts by much more there."""
    found = diagnosis("lever_arm=0.3,-0.1")
    assert found.before.outage_end_rms_m > 2.0 * found.after.outage_end_rms_m
    assert found.before.gnss_innovation_rms_m > found.after.gnss_innovation_rms_m


@pytest.mark.parametrize("path", ["general", "rectangle"])
def test_nothing_is_found_where_nothing_is(path):
    found = diagnosis(path=path)
    assert found.findings == ()
    assert found.patterns == ()
    assert not found.unexplained.significant
    assert found.placebo.tried == 24
    assert found.placebo.passed == 0
    assert found.placebo.highest_nats < 8.0
    assert found.placebo.needed_nats == 8.0
    assert found.after.outage_end_rms_m == found.before.outage_end_rms_m
    require_constants(found)


def test_two_effects_at_once_are_told_apart():
    found = diagnosis(*TOGETHER)
    assert sorted(names(found)) == ["lever_arm", "soft_iron"]
    for text in TOGETHER:
        require_truth(found, text)
    require_better(found)
    first, second = found.findings
    assert first.drift_after_m == second.drift_before_m
    assert second.drift_after_m == found.after.outage_end_rms_m
    assert not found.unexplained.significant


def test_a_users_column_is_found_by_name():
    found = diagnosis_with(MotorField, column=True)
    assert names(found) == ["heading~motor_current_a"]
    estimate = found.findings[0].parameters["deg_per_unit"]
    assert abs(estimate.value - PER_AMPERE_DEG) < 3.0 * estimate.sigma
    assert estimate.sigma < 0.1 * PER_AMPERE_DEG
    assert found.findings[0].units == {"deg_per_unit": "deg/unit"}
    assert found.findings[0].picture.x_label == "motor_current_a"
    require_better(found)
    assert not found.unexplained.significant


def test_without_its_column_no_other_effect_takes_the_blame():
    found = diagnosis_with(MotorField)
    assert names(found) == []
    assert found.placebo.passed == 0


def test_what_has_no_name_is_told_by_port_and_by_what_it_follows():
    found = diagnosis_with(ThirdHarmonic)
    assert names(found) == []
    left = found.unexplained
    assert left.significant
    assert left.port == "heading"
    assert left.depends_on.startswith("heading")
    assert "third" in left.depends_on
    assert found.patterns == (f"heading with {left.depends_on}",)
    assert left.held_out_gain_nats > 50.0
    # The AHRS errs by 0.43 deg beside the harmonic's rms.
    share = HARMONIC_DEG**2 / 2.0
    assert left.variance_fraction == pytest.approx(share / (share + 0.43**2), abs=0.05)
    assert float(left.size.removeprefix("up to ").removesuffix(" deg")) == pytest.approx(HARMONIC_DEG, rel=0.2)
    assert left.picture is not None
    require_better(found)


def test_runs_share_what_is_found_and_each_is_left_out_in_its_turn():
    runs = [aligned("lever_arm=0.3,-0.1", duration_s=120.0, seed=seed) for seed in (1, 2)]
    found = diagnose(runs, CalibrationOptions(heading_rate_hz=5.0))
    assert names(found) == ["lever_arm"]
    require_truth(found, "lever_arm=0.3,-0.1")
    assert found.held_out_how.startswith("each of 2 runs")
    assert [one.run for one in found.noises] == [run.name for run in runs]
    require_better(found)
