"""Stretches of a run that contradict each other widen its sigmas and are told; those that agree change nothing."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sccal.calibration import single
from sccal.calibration.missing import Lacking
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.calibration.stretches import Stretches, compare_stretches
from sccal.filter.iterate import reported_values
from tests.evidence.logs import bare, write_log
from tests.runs import read


@pytest.mark.parametrize("path", ["general", "rectangle", "rows"])
def test_those_of_a_clean_log_agree(path):
    model = bare(path=path)
    found = compare_stretches(model.problems[0], reported_values(model.path(0)))
    assert not found.contradict
    assert found.notices == ()
    covariance = np.diag([1e-8, 1e-8, 1e-6, 1e-6])
    assert found.widened(covariance) is covariance


def test_a_counter_that_saturates_makes_fast_stretches_contradict_slow_ones(tmp_path, monkeypatch):
    """The look for missing effects held back: what it names owns up to itself, and there is much that has no name."""
    write_log(tmp_path, [])
    rows = np.loadtxt(tmp_path / "encoder.csv", delimiter=",", skiprows=1)
    header = (tmp_path / "encoder.csv").read_text("utf-8").splitlines()[0]
    right = header.split(",").index("right_ticks")
    steps = np.diff(rows[:, right], prepend=rows[0, right])
    most = 0.8 * np.quantile(np.abs(steps), 0.9)
    rows[:, right] = rows[0, right] + np.cumsum(np.clip(steps, -most, most))
    np.savetxt(tmp_path / "encoder.csv", rows, delimiter=",", header=header, comments="", fmt="%.6f")
    truth_m = json.loads((tmp_path / "truth.json").read_text("utf-8"))["parameters"]["radius_right_m"]
    monkeypatch.setattr(single, "look_for_missing", lambda *_: Lacking())
    found, _ = calibrate_run(read(tmp_path), CalibrationOptions())
    assert found.verdict.level == "doubtful"
    assert any("contradict each other" in reason for reason in found.verdict.because)
    value = found.parameters.radius_right_m
    assert abs(value.value - truth_m) < 4.0 * value.sigma
    monkeypatch.setattr(single, "compare_stretches", lambda *_: Stretches())
    as_if, _ = calibrate_run(read(tmp_path), CalibrationOptions())
    sure = as_if.parameters.radius_right_m
    assert sure.value == value.value
    assert abs(sure.value - truth_m) > 4.0 * sure.sigma


def test_what_chance_explains_is_no_contradiction():
    n = 40
    for chi2, contradict in ((1.0, False), (2.0, False), (2.2, True)):
        assert Stretches(n * chi2, n, np.eye(3)).contradict is contradict


def test_sigmas_are_widened_by_the_root_and_where_larger_by_the_scatter():
    covariance = np.diag([4.0, 4.0, 9.0, 0.0])
    covariance[0, 1] = covariance[1, 0] = 2.0
    wide = Stretches(90.0, 10, np.diag([16.0, 1.0, 1.0])).widened(covariance)
    assert np.sqrt(np.diag(wide)) == pytest.approx([3.0 * 4.0, 3.0 * 2.0, 3.0 * 3.0, 0.0])
    assert wide[0, 1] / np.sqrt(wide[0, 0] * wide[1, 1]) == pytest.approx(0.5)
