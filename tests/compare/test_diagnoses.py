"""Two diagnosed models side by side."""

import pytest

from sccal.compare.diagnoses import compare_diagnoses
from sccal.report.comparison.text import compare_text, headline
from sccal.results.converter import document_of, result_from
from sccal.results.diagnosis import Diagnosis

_JUDGED = {
    "outage_rms_m": 0.9,
    "outage_end_rms_m": 1.25,
    "gnss_innovation_rms_m": 0.5,
    "heading_innovation_rms_deg": 0.2,
    "nll_per_measurement": -1.6,
}


def finding(effect, rivals=(), nats=100.0, **parameters):
    """As the contract has it: nothing beyond value and sigma."""
    return {
        "effect": effect,
        "parameters": {name: {"value": value, "sigma": sigma} for name, (value, sigma) in parameters.items()},
        "evidence": {"evidence_nats": nats, "held_out_gain_nats": 0.5 * nats, "t": 10.0},
        "indistinguishable_from": list(rivals),
    }


def diagnosis(*findings, runs=("a",), **more):
    return result_from(document(*findings, runs=runs, **more), Diagnosis)


def document(*findings, runs=("a",), **more):
    return {
        "schema": "sccal.diagnosis/1",
        "runs": list(runs),
        "findings": list(findings),
        "not_excited": [],
        "before": dict(_JUDGED),
        "after": _JUDGED | {"outage_end_rms_m": 0.7},
        "held_out": {"how": "…"},
        "unexplained": {"significant": False, "port": None, "depends_on": None, "variance_fraction": 0},
    } | more


ARM = finding("lever_arm", forward_m=(-0.4, 0.2), left_m=(-0.72, 0.05))


def effects(a, b):
    return {one.effect: one for one in compare_diagnoses(a, b, 3.0).effects}


def test_findings_are_gained_in_b_and_lost_from_a():
    assert effects(diagnosis(), diagnosis(ARM))["lever_arm"].change == "gained"
    assert effects(diagnosis(ARM), diagnosis())["lever_arm"].change == "lost"
    comparison = compare_diagnoses(diagnosis(), diagnosis(ARM), 3.0)
    assert comparison.changed == ("lever_arm",)
    assert headline(comparison) == "findings: lever_arm gained; no parameter could be compared"


def test_a_finding_that_both_have_is_compared():
    other = finding("lever_arm", nats=200.0, forward_m=(-0.5, 0.2), left_m=(0.10, 0.05))
    comparison = compare_diagnoses(diagnosis(ARM), diagnosis(other), 3.0)
    assert [(one.change, one.nats_a, one.nats_b) for one in comparison.effects] == [("kept", 100.0, 200.0)]
    assert comparison.changed == ("effects.lever_arm.left_m",)
    left = next(pair for pair in comparison.pairs if pair.name.endswith("left_m"))
    assert left.difference.amount == pytest.approx(0.82)


def test_a_moment_of_one_log_is_not_compared_with_another():
    a, b = (diagnosis(finding("heading_step", deg=(2.0, 0.1), at_s=(at, 1.0))) for at in (60.0, 90.0))
    pair = {one.name: one.change for one in compare_diagnoses(a, b, 3.0).pairs}
    assert pair == {"effects.heading_step.deg": "unchanged", "effects.heading_step.at_s": "not comparable"}


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"taken_back": {"lever_arm": "it no longer gains"}}, "B took it back: it no longer gains"),
        ({"not_excited": [{"effect": "lever_arm", "advice": "turn on the spot"}]}, "turn on the spot"),
        ({"detectable": [{"effect": "lever_arm", "smallest": {"left_m": 0.1}}]}, "would have found it at this size"),
        ({"detectable": [{"effect": "lever_arm", "smallest": {"left_m": 2.0}}]}, "from left_m 2 on only"),
        ({"detectable": [{"effect": "lever_arm", "smallest": {"left_m": None}}]}, ""),
        ({}, ""),
    ],
)
def test_why_a_finding_is_lost(more, says):
    reason = effects(diagnosis(ARM), diagnosis(**more))["lever_arm"].reason
    assert says in reason
    assert bool(says) is bool(reason)


def test_a_rival_by_another_name_is_told_on_both_sides():
    late = finding("gnss_latency", rivals=("lever_arm",), s=(0.2, 0.01))
    there = effects(diagnosis(ARM), diagnosis(late))
    assert there["lever_arm"].reason == "B has gnss_latency, which could as well be this"
    assert there["gnss_latency"].reason == "A has lever_arm, which could as well be this"


def test_figures_before_and_after_stand_beside_each_other():
    better = diagnosis(after=_JUDGED | {"outage_end_rms_m": None})
    figures = {one.name: (one.a, one.b) for one in compare_diagnoses(diagnosis(), better, 3.0).figures}
    assert figures["after.outage_end_rms_m"] == (0.7, None)
    assert figures["before.outage_end_rms_m"] == (1.25, 1.25)


def test_runs_and_what_is_left_are_told():
    left = {"significant": True, "port": "heading", "depends_on": "motor_current_a", "variance_fraction": 0.1}
    comparison = compare_diagnoses(diagnosis(runs=("a", "b")), diagnosis(runs=("b",), unexplained=left), 3.0)
    told = " / ".join(comparison.remarks)
    assert "1 of A's 2 and B's 1 runs have the same name" in told
    assert "nothing in A, heading following motor_current_a in B" in told
    assert compare_diagnoses(diagnosis(runs=("a",)), diagnosis(runs=("b",)), 3.0).remarks == ()


def test_text_and_json_tell_the_same():
    comparison = compare_diagnoses(diagnosis(ARM), diagnosis(), 3.0)
    text = compare_text(comparison, 80)
    assert "lever_arm     100       -  lost" in text
    document = document_of(comparison)
    assert document["findings"][0] == {
        "effect": "lever_arm",
        "change": "lost",
        "evidence_nats_a": 100.0,
        "evidence_nats_b": None,
        "held_out_gain_nats_a": 50.0,
        "held_out_gain_nats_b": None,
        "reason": "",
    }
