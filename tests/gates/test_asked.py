"""What the command line asks is read before anything is calibrated, and judged after."""

import pytest

from sccal.errors import UsageError
from sccal.gates.asked import read_asked
from tests.results.documents import calibration, estimate, saved, stored, vehicle


def test_gates_and_drift_are_judged_together(tmp_path):
    stored(tmp_path, vehicle(), "vehicle.json")
    asked = read_asked(["verdict==good"], tmp_path / "vehicle.json", ["2sigma"], ())
    (tmp_path / "vehicle.json").unlink()
    judged = asked.judge([saved(calibration("new", track_m=estimate(0.8, 1e-3)))], [saved(vehicle())])
    assert (judged[0].expression, judged[0].outcome) == ("verdict==good", "passed")
    assert [one.run for one in judged if one.outcome == "failed"] == ["new"]
    assert len(judged) == 1 + 4 + 4


def test_a_baseline_alone_allows_three_sigma(tmp_path):
    stored(tmp_path, calibration())
    (allowance,) = read_asked([], tmp_path, [], ()).allowances
    assert (allowance.amount, allowance.unit) == (3.0, "sigma")


def test_nothing_asked_is_nothing_judged():
    assert read_asked([], None, [], ()).judge([saved(calibration())], [saved(vehicle())]) == ()


def test_drift_needs_a_baseline():
    with pytest.raises(UsageError, match="--baseline"):
        read_asked([], None, ["2sigma"], ())


def test_gates_are_checked_beforehand():
    with pytest.raises(UsageError, match="did you mean"):
        read_asked(["parameters.trak_m<1"], None, [], ())
    with pytest.raises(UsageError, match="--effects slope"):
        read_asked(["effects.slope.ratio<1"], None, [], ())
