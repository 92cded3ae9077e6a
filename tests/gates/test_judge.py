"""Gates put to results."""

import operator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.errors import DataError, Exit, Failure, SccalError, UsageError
from sccal.gates.expression import parse_gates
from sccal.gates.judge import judge
from sccal.results.gates import BatchOutcome
from tests.results.documents import calibration, estimate, saved, vehicle

SIGNS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne}
numbers = st.sampled_from([-1.0, 0.0, 0.5, 1.0, 2.0])


def one(text, document):
    (result,) = judge(parse_gates([text]), [saved(document)], [])
    return result


@given(numbers, numbers, st.sampled_from(sorted(SIGNS)))
def test_a_number_is_compared_as_written(measured, threshold, sign):
    document = calibration()
    document["fit"]["nis_gnss"] = measured
    result = one(f"fit.nis_gnss{sign}{threshold}", document)
    assert (result.outcome == "passed") is SIGNS[sign](measured, threshold)
    assert (result.measured, result.threshold) == (measured, threshold)
    if result.outcome == "failed":
        assert f"measured {measured:g}, threshold {threshold:g}" in result.reason


def test_a_failure_tells_numbers_apart_that_are_close():
    result = one("outage.percent_of_distance<0.4", calibration() | {"outage": {"percent_of_distance": 0.4 + 1e-12}})
    assert "0.400000000001" in result.reason


def test_the_verdict_is_its_first_word():
    assert one("verdict==good", calibration()).outcome == "passed"
    assert one("verdict!=good", calibration()).outcome == "failed"
    doubtful = one("verdict==good", calibration() | {"verdict": "doubtful: fixes wander"})
    assert (doubtful.outcome, doubtful.measured) == ("failed", "doubtful")


def test_a_parameter_without_field_is_its_value():
    assert one("parameters.track_m<0.75", calibration()).measured == 0.728
    assert one("parameters.track_m.value<0.75", calibration()).measured == 0.728
    assert one("parameters.track_m.sigma<0.01", calibration()).measured == 1e-3


@pytest.mark.parametrize("status", ["unobserved", "held"])
@pytest.mark.parametrize("name", ["parameters.track_m", "parameters.track_m.sigma"])
def test_a_parameter_that_was_not_shown_is_skipped(status, name):
    result = one(f"{name}<100", calibration(track_m=estimate(0.7, 0.2, status, "turn both ways")))
    assert result.outcome == "skipped"
    assert result.measured is None
    assert "turn both ways" in result.reason
    if status == "unobserved":
        assert "not excited" in result.reason


def test_that_it_was_shown_can_be_demanded():
    document = calibration(track_m=estimate(0.7, 0.2, "unobserved", "turn both ways"))
    assert one("parameters.track_m.status==estimated", document).outcome == "failed"
    assert one("parameters.track_m.status==estimated", calibration()).outcome == "passed"


def test_a_parameter_at_its_bound_keeps_no_gate():
    result = one("parameters.track_m.sigma<1", calibration(track_m=estimate(0.9, 1e-5, "at_bound", "check the size")))
    assert result.outcome == "failed"
    assert "check the size" in result.reason


@pytest.mark.parametrize("sign", ["<", ">", "!="])
def test_what_is_missing_fails_whatever_the_operator(sign):
    document = calibration()
    document["outage"] |= {"percent_of_distance": None, "windows": 0}
    result = one(f"outage.percent_of_distance{sign}0.5", document)
    assert (result.outcome, result.measured) == ("failed", None)
    assert "no outage window" in result.reason
    assert one(f"reference.displaced_rms_m{sign}0.5", calibration()).outcome == "failed"


def test_runs_and_vehicles_are_judged_apart():
    runs = [saved(calibration("a")), saved(calibration("b", track_m=estimate(0.9, 1e-3)))]
    gates = parse_gates(["parameters.track_m<0.8", "vehicle:parameters.track_m.sigma<1e-4"])
    judged = judge(gates, runs, [saved(vehicle())])
    assert [(result.run, result.outcome) for result in judged] == [
        ("a", "passed"),
        ("b", "failed"),
        ("(vehicle)", "failed"),
    ]
    assert judged[2].vehicle == "demo"


def test_a_name_that_no_result_has_is_a_wrong_name():
    with pytest.raises(UsageError, match=r"effects\.lever_arm\.forward_m"):
        one("effects.lever_arm.forward_m<1", calibration())
    with pytest.raises(UsageError, match=r"did you mean noise\.fix_tau_s"):
        one("noise.fix_tau<1", calibration() | {"noise": {"fix_tau_s": 3.0}})
    with pytest.raises(UsageError, match="block"):
        one("effects.lever_arm<1", calibration() | {"effects": {"lever_arm": {"left_m": estimate(1.0, 0.1)}}})


def test_a_name_that_one_result_lacks_fails_there():
    there = calibration("a") | {"effects": {"lever_arm": {"left_m": estimate(0.1, 0.01)}}}
    judged = judge(parse_gates(["effects.lever_arm.left_m<1"]), [saved(there), saved(calibration("b"))], [])
    assert [result.outcome for result in judged] == ["passed", "failed"]


@pytest.mark.parametrize("text", ["verdict==1", "fit.nis_gnss==good"])
def test_words_are_not_compared_with_numbers(text):
    with pytest.raises(UsageError, match="compared with"):
        one(text, calibration())


def test_gates_without_results_judge_nothing():
    assert judge(parse_gates(["verdict==good"]), [], []) == ()


def outcome(failures, texts):
    runs = (saved(calibration()),)
    return BatchOutcome(runs, (), failures, judge(parse_gates(texts), runs, ())).exit_code


def test_the_exit_code_is_of_what_is_worst():
    unreadable = (Failure("x", DataError("no")),)
    assert outcome((), ["fit.nis_gnss<3"]) == Exit.FINE
    assert outcome((), ["fit.nis_gnss<0.1", "fit.nis_gnss<3"]) == Exit.GATE_FAILED
    assert outcome(unreadable, []) == Exit.DATA
    assert outcome(unreadable, ["fit.nis_gnss<0.1"]) == Exit.DATA
    assert outcome((*unreadable, Failure("y", SccalError("bug"))), []) == Exit.INTERNAL
