"""A quick look for what the model lacks: silent on a good log, and right where much is missing."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sccal.calibration import single
from sccal.calibration.missing import STRONG_NATS, Lacking, look_for_missing
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.effects.catalogue import CATALOGUE, parse_effect
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, refitted
from sccal.filter.iterate import reported_values
from tests.evidence.logs import HEADING_HZ, bare, write_log
from tests.runs import read


def lacking_in(*texts, path="general"):
    model = bare(*texts, path=path)
    return look_for_missing(model.problems[0], reported_values(model.path(0)), HEADING_HZ)


def missing_in(*texts, path="general"):
    return lacking_in(*texts, path=path).missing


def test_a_clean_log_lacks_nothing():
    assert missing_in() == ()
    assert missing_in(path="rectangle") == ()


def test_an_arm_of_40_cm_is_named():
    (one, *more) = missing_in("lever_arm=0.4,0")
    assert one.effect == "lever_arm"
    assert one.evidence_nats > 100.0 > STRONG_NATS
    assert one.size > 5.0
    assert [other.evidence_nats for other in (one, *more)] == sorted(
        (other.evidence_nats for other in (one, *more)), reverse=True
    )
    assert all(other.evidence_nats >= STRONG_NATS and other.size >= 1.0 for other in more)


def test_what_is_in_the_model_already_is_not_missing():
    model = refitted(bare("lever_arm=0.4,0"), [Accepted(Free(CATALOGUE["lever_arm"]))])
    values = reported_values(model.path(0))
    assert np.abs(values[4] - 0.4) < 0.05
    assert look_for_missing(model.problems[0], values, HEADING_HZ).missing == ()


def test_a_good_log_keeps_its_sigmas():
    covariance = np.diag([1e-8, 1e-8, 1e-6, 1e-6])
    assert np.array_equal(lacking_in().widened(covariance), covariance)


def test_constants_own_up_to_what_a_missing_effect_moves_them_by(monkeypatch, tmp_path):
    """Wheels that lose 6 % for each m/s make radii that are far too small, by many sigmas of the filter's own."""
    effect, values = parse_effect("speed_slip=0.06")
    write_log(tmp_path, [effect.physics(values)])
    told, _ = calibrate_run(read(tmp_path), CalibrationOptions())
    monkeypatch.setattr(single, "look_for_missing", lambda *_: Lacking())
    plain, _ = calibrate_run(read(tmp_path), CalibrationOptions())
    truth_m = json.loads((tmp_path / "truth.json").read_text("utf-8"))["parameters"]["radius_right_m"]
    right, as_if = told.parameters.radius_right_m, plain.parameters.radius_right_m
    assert right.value == as_if.value
    assert abs(as_if.value - truth_m) > 4.0 * as_if.sigma
    assert abs(right.value - truth_m) < 2.0 * right.sigma
    assert right.sigma < 0.1 * truth_m


def test_the_covariance_is_widened_along_what_moves_together():
    apart, sigmas = np.array([2e-3, 2e-3, -1e-2, 0.0]), np.array([1e-3, 1e-5, 1e-3, 0.01])
    covariance = np.diag([1e-4, 1e-4, 1e-4, 1e-4]) ** 2
    found = Lacking((), apart, sigmas).widened(covariance)
    assert np.sqrt(found[0, 0]) == pytest.approx(np.hypot(1e-3, 2e-3))
    assert np.sqrt(found[1, 1]) == pytest.approx(np.hypot(1e-4, 2e-3))
    assert np.sqrt(found[3, 3]) == pytest.approx(0.01)
    assert found[0, 2] == pytest.approx(-2e-5)


def test_an_offset_that_is_held_stays_held():
    covariance = np.diag([1e-8, 1e-8, 1e-6, 0.0])
    found = Lacking((), np.array([0.0, 0.0, 0.0, 0.1]), np.full(4, 1e-9)).widened(covariance)
    assert np.array_equal(found, covariance)


def test_a_calibration_tells_it(tmp_path):
    effect, values = parse_effect("lever_arm=0.4,0")
    write_log(tmp_path, [effect.physics(values)])
    calibration, _ = calibrate_run(read(tmp_path), CalibrationOptions())
    assert calibration.missing[0].effect == "lever_arm"
