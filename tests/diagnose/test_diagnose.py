"""Whole diagnoses of simulated logs: what was put in is what is named, and nothing else is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sccal.diagnose.criteria import LEAST_NATS, LEAST_T
from sccal.diagnose.diagnose import _aliases, diagnose
from sccal.effects.catalogue import CATALOGUE, parse_effect
from sccal.evidence.nonsense import COUNT, NAME, WHERE
from sccal.evidence.posterior import Posterior
from sccal.results.diagnosis import Diagnosis
from tests.diagnose.logs import (
    HARMONIC_DEG,
    OPTIONS,
    PER_AMPERE_DEG,
    SLOW,
    diagnosis,
    diagnosis_of,
    with_motor_field,
    with_third_harmonic,
)
from tests.evidence.logs import aligned

MISSING = (
    ("lever_arm=0.3,-0.1",),
    ("speed_offset=0.02", "heading_step=5,100"),
    ("missed_left=0.03,9",),
    ("eccentric_right=0.04,0", "base_shift=0.3,-0.2,90"),
    ("heading_smoothing=0.8",),
    ("fix_smoothing=0.7",),
)

each_log = pytest.mark.parametrize("texts", MISSING, ids=" and ".join)


def names(found: Diagnosis) -> list[str]:
    return [one.name for one in found.findings]


def require_truth(found: Diagnosis, text: str, share: float = 0.0) -> None:
    """Within three sigmas and a share of the effect's size; moments within a reading or two."""
    effect, values = parse_effect(text)
    (finding,) = (one for one in found.findings if one.name == effect.name)
    assert set(finding.parameters) == set(values)
    size = max(abs(values[one.name]) for one in effect.parameters if not one.shape)
    for parameter in effect.parameters:
        estimate, truth = finding.parameters[parameter.name], values[parameter.name]
        assert finding.units[parameter.name] == parameter.unit
        if parameter.name == "at_s":
            assert estimate.value == pytest.approx(truth, abs=0.25)
        elif parameter.shape:
            assert abs(estimate.value - truth) < 3.0 * estimate.sigma + share * truth, (parameter.name, estimate)
        else:
            assert abs(estimate.value - truth) < 3.0 * estimate.sigma + share * size, (parameter.name, estimate)
            assert estimate.sigma < 0.2 * size


def require_better(found: Diagnosis) -> None:
    assert found.after.nll_per_measurement < found.before.nll_per_measurement
    assert len(found.after.windows) == len(found.before.windows) >= 3
    for judged in (found.before, found.after):
        low, high = judged.outage_end_interval_m
        assert low < judged.outage_end_rms_m < high


def require_constants(found: Diagnosis) -> None:
    p = found.parameters_after
    for estimate, truth in ((p.radius_right_m, 0.0808), (p.radius_left_m, 0.0796), (p.track_m, 0.728)):
        assert abs(estimate.value - truth) < 4.0 * estimate.sigma


@each_log
def test_what_is_missing_is_named_with_its_size_and_sign_and_nothing_else(texts):
    found = diagnosis(*texts)
    assert sorted(names(found)) == sorted(text.split("=")[0] for text in texts)
    for text in texts:
        require_truth(found, text)
    require_better(found)
    require_constants(found)
    assert not found.unexplained.significant
    assert found.placebo.passed == 0


@each_log
def test_a_finding_says_why_it_was_made(texts):
    found = diagnosis(*texts)
    for finding in found.findings:
        assert finding.evidence_nats >= LEAST_NATS
        assert finding.held_out_gain_nats > 0.0
        assert finding.t > LEAST_T
        gains = [one.evidence_nats for one in finding.ranking]
        assert gains == sorted(gains, reverse=True)
        assert finding.name in [one.name for one in finding.ranking]
        assert bool(finding.advice) == bool(finding.indistinguishable_from)
    drifts = [one.drift_after_m for one in found.findings]
    assert [one.drift_before_m for one in found.findings] == [found.before.outage_end_rms_m, *drifts[:-1]]
    assert drifts[-1] == found.after.outage_end_rms_m


@each_log
def test_the_model_is_there_to_start_from(texts):
    found = diagnosis(*texts)
    for text in texts:
        effect, values = parse_effect(text)
        (saved,) = (one for one in found.model.effects if one.told and one.name == effect.name)
        assert set(saved.parameters) | set(saved.shapes) == set(values)
    assert found.model.parameters == found.parameters_after
    assert set(found.model.noises) == set(found.runs)


def test_a_moment_belongs_to_its_run():
    found = diagnosis(*MISSING[1])
    run = {one.name: one.run for one in found.model.effects}
    assert (run["speed_offset"], run["heading_step"]) == ("", found.runs[0])


def test_what_a_clean_log_calls_detectable_was_found():
    detectable = {one.name: one.smallest for one in diagnosis().detectable}
    assert max(detectable["lever_arm"].values()) < 0.1
    assert detectable["speed_offset"]["mps"] < 0.02


@each_log
def test_a_picture_shows_the_residual_go(texts):
    for finding in diagnosis(*texts).findings:
        picture = finding.picture
        if finding.name == "eccentric_right":
            # A short log has too few windows of some seconds to draw what a wheel does over time.
            continue
        assert picture is not None
        arrays = (picture.before, picture.before_sigma, picture.after, picture.after_sigma, picture.model)
        assert all(one.shape == picture.x.shape and np.all(np.isfinite(one)) for one in arrays)
        assert np.all(np.diff(picture.x) > 0)
        if finding.name in ("lever_arm", "heading_step", "base_shift"):
            assert np.std(picture.after) < 0.5 * np.std(picture.before)


def test_the_model_before_is_the_papers():
    """The lever arm drifts by much more there."""
    found = diagnosis("lever_arm=0.3,-0.1")
    assert found.before.outage_end_rms_m > 2.0 * found.after.outage_end_rms_m
    assert found.before.gnss_innovation_rms_m > found.after.gnss_innovation_rms_m


def test_nothing_is_found_where_nothing_is():
    found = diagnosis()
    assert found.findings == ()
    assert not found.unexplained.significant
    assert found.placebo.tried == COUNT * len(WHERE)
    assert found.placebo.passed == 0
    assert found.placebo.highest_nats < LEAST_NATS == found.placebo.needed_nats
    assert found.after.outage_end_rms_m == pytest.approx(found.before.outage_end_rms_m, rel=0.05)
    assert found.detectable
    require_constants(found)


@pytest.mark.slow
def test_a_users_column_and_an_effect_are_found_together():
    """Both missing, the likeliest noise is a wandering heading and slipping wheels, and nothing seems to lack."""
    found = diagnosis_of(with_motor_field("turn_slip=0.2"))
    assert sorted(names(found)) == ["heading~motor_current_a", "turn_slip"]
    current = next(one for one in found.findings if one.name.startswith("heading"))
    estimate = current.parameters["deg_per_unit"]
    assert abs(estimate.value - PER_AMPERE_DEG) < 3.0 * estimate.sigma
    assert estimate.sigma < 0.1 * PER_AMPERE_DEG
    assert current.units == {"deg_per_unit": "deg/unit"}
    assert current.picture.x_label == "motor_current_a"
    require_truth(found, "turn_slip=0.2")
    require_better(found)
    require_constants(found)
    assert found.findings[0].drift_after_m == found.findings[1].drift_before_m
    assert found.findings[1].drift_after_m == found.after.outage_end_rms_m
    assert not found.unexplained.significant


def test_without_its_column_no_other_effect_takes_the_blame():
    found = diagnosis_of(with_motor_field(column=False))
    assert names(found) == []
    assert found.placebo.passed == 0


def test_strong_iron_behind_a_slow_ahrs():
    """34 deg, let in over 20 s."""
    text = "hard_iron=28,-19,20"
    found = diagnosis(text, duration_s=300.0, settings=SLOW)
    assert names(found)[0] == "hard_iron"
    require_truth(found, text, share=0.05)
    require_better(found)
    require_constants(found)


def test_what_has_no_name_is_told_by_port_and_by_what_it_follows():
    found = diagnosis_of(with_third_harmonic())
    assert names(found) == []
    left = found.unexplained
    assert left.significant
    assert left.port == "heading"
    assert left.depends_on == "heading (third harmonic)"
    assert left.evidence_nats > 50.0
    assert float(left.size.removeprefix("up to ").removesuffix(" deg")) == pytest.approx(HARMONIC_DEG, rel=0.2)


def test_what_has_no_name_is_told_with_its_share_of_the_error():
    """The AHRS errs by 0.43 deg beside the harmonic's rms."""
    share = HARMONIC_DEG**2 / 2.0
    left = diagnosis_of(with_third_harmonic()).unexplained
    assert left.variance_fraction == pytest.approx(share / (share + 0.43**2), abs=0.08)


def test_runs_share_what_is_found_and_each_is_left_out_in_its_turn():
    runs = [aligned("lever_arm=0.3,-0.1", duration_s=90.0, seed=seed) for seed in (1, 2)]
    found = diagnose(runs, OPTIONS)
    assert names(found) == ["lever_arm"]
    require_truth(found, "lever_arm=0.3,-0.1")
    assert found.held_out_how.startswith("each of 2 runs")
    assert [one.run for one in found.noises] == [run.name for run in runs]
    assert found.after.nll_per_measurement < found.before.nll_per_measurement


def test_nonsense_is_never_told_as_a_cause():
    for found in (diagnosis(), diagnosis("lever_arm=0.3,-0.1"), diagnosis_of(with_third_harmonic())):
        told = [one.name for one in (*found.findings, *found.not_excited, *found.detectable)]
        told += [one.name for finding in found.findings for one in finding.ranking]
        told += [name for finding in found.findings for name in finding.indistinguishable_from]
        told += [*found.taken_back, *(one.name for one in found.model.effects)]
        told += [name for one in found.inseparable for name in one.names]
        assert told
        assert not [name for name in told if NAME in name]


# Aliases, by a posterior made by hand


def aliases_of(share: float, shadows=None) -> tuple[str, ...]:
    """Of a cause that a log shows well, beside another candidate whose column is nearly the same."""
    rng = np.random.default_rng(6)
    x = rng.normal(size=(400, 3))
    x[:, 1] = share * x[:, 0] + np.sqrt(1.0 - share**2) * x[:, 1]
    y = 0.6 * x[:, 0] + rng.normal(size=400)
    everything = np.hstack((rng.normal(size=(400, 3)), x))
    covariance = np.linalg.inv(everything.T @ everything + np.eye(6))
    rows = {name: np.array([3 + k]) for k, name in enumerate(("lever_arm", "gnss_latency", "turn_slip"))}
    posterior = Posterior(rows, covariance @ everything.T @ y, covariance, np.ones(6), dict.fromkeys(rows, 3.0))
    free = SimpleNamespace(effect=CATALOGUE["lever_arm"])
    one = SimpleNamespace(
        accepted=SimpleNamespace(key="lever_arm", free=free), worth_nats=posterior.worth("lever_arm", ["lever_arm"])
    )
    loop = SimpleNamespace(posterior=posterior, kept=["lever_arm"], candidates=SimpleNamespace(shadows=shadows or {}))
    return _aliases(loop, one)


def test_candidates_with_the_same_column_are_named_beside_each_other():
    assert aliases_of(0.9999) == ("gnss_latency",)
    assert aliases_of(0.5) == ()


def test_columns_that_follow_what_the_effect_follows_stand_beside_it():
    shadows = {"heading~mag_x": ("lever_arm", "hard_iron"), "along~command": ("speed_slip",)}
    assert aliases_of(0.5, shadows) == ("heading~mag_x",)
