"""What CI reads of a batch: JUnit XML, the page of a step, JSON. Parsers that are not ours judge them."""

import json
import re
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import junitparser
import pytest
import xmlschema
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sccal.errors import DataError, Failure, SccalError, UsageError
from sccal.gates.allowance import parse_allowance
from sccal.gates.baseline import Baseline, Earlier, judge_drift
from sccal.gates.expression import parse_gates
from sccal.gates.judge import judge
from sccal.report.fleet.gates import gates_text
from sccal.report.fleet.junit import junit_xml
from sccal.report.fleet.step_summary import MOST_BYTES, append_step_summary, cut, escaped, step_summary
from sccal.results.converter import document_of, json_text
from sccal.results.gates import BatchOutcome, GateResult
from tests.results.documents import calibration, estimate, saved, vehicle

XSD = xmlschema.XMLSchema(str(Path(__file__).with_name("junit.xsd")))
anything = st.text(max_size=30)


def batch(gates=("fit.nis_gnss<3", "outage.percent_of_distance<0.1", "vehicle:verdict==good")):
    runs = (
        saved(calibration("good")),
        saved(calibration("straight", track_m=estimate(0.7, 0.2, "unobserved", "turn both ways"))),
        saved(calibration("wrong-gear", radius_left_m=estimate(0.1, 1e-5, "at_bound", "check ticks_per_rev"))),
    )
    vehicles = {"vehicle.json": saved(vehicle())}
    failures = (Failure("torn", DataError("torn/encoder.csv line 3: no number")), Failure("odd", SccalError("bug")))
    asked = (*gates, "parameters.track_m.sigma<0.01")
    return BatchOutcome(runs, vehicles, failures, judge(parse_gates(asked), runs, tuple(vehicles.values())))


def read(text):
    XSD.validate(text)
    return {suite.name: suite for suite in junitparser.JUnitXml.fromstring(text.encode())}


def outcomes(suite):
    return {case.name: type(case.result[0]).__name__ if case.result else "passed" for case in suite}


def test_another_parser_reads_the_same_outcomes():
    suites = read(junit_xml(batch(), {"good": 1.5}))
    assert list(suites) == ["good", "straight", "wrong-gear", "torn", "odd", "(vehicle) demo"]
    assert outcomes(suites["good"]) == {
        "calibrate": "passed",
        "parameters.radius_right_m": "passed",
        "parameters.radius_left_m": "passed",
        "parameters.track_m": "passed",
        "parameters.heading_offset_deg": "passed",
        "gate fit.nis_gnss<3": "passed",
        "gate outage.percent_of_distance<0.1": "Failure",
        "gate parameters.track_m.sigma<0.01": "passed",
    }
    straight = outcomes(suites["straight"])
    assert straight["parameters.track_m"] == straight["gate parameters.track_m.sigma<0.01"] == "Skipped"
    assert outcomes(suites["wrong-gear"])["parameters.radius_left_m"] == "Failure"
    assert outcomes(suites["torn"]) == {"calibrate": "Error"}
    assert outcomes(suites["(vehicle) demo"]) == {"gate vehicle:verdict==good": "passed"}
    assert suites["good"].time == 1.5


def test_messages_say_why_in_the_attribute_and_in_the_text():
    suites = read(junit_xml(batch()))
    (torn,) = suites["torn"]
    assert (torn.result[0].type, torn.result[0].message) == ("DataError", "torn/encoder.csv line 3: no number")
    assert torn.result[0].text == torn.result[0].message
    failed = next(case for case in suites["good"] if "outage" in case.name)
    assert "measured 0.4, threshold 0.1" in failed.result[0].message
    skipped = next(case for case in suites["straight"] if case.name == "parameters.track_m")
    assert skipped.result[0].message == "not excited: turn both ways"


def test_counts_are_what_is_there():
    text = junit_xml(batch())
    root = ET.fromstring(text)
    for element in (root, *root):
        for count, tag in (("failures", "failure"), ("errors", "error"), ("tests", "testcase")):
            assert int(element.get(count)) == len(element.findall(f".//{tag}"))
    for suite in root:
        assert int(suite.get("skipped")) == len(suite.findall(".//skipped"))
    assert {root.get("errors"), root.get("failures")} == {"2", "4"}


@settings(suppress_health_check=[HealthCheck.too_slow])
@given(anything, anything, anything, anything)
def test_whatever_names_hold_the_document_is_valid(name, of, reason, message):
    runs = (saved(calibration(name, of, track_m=estimate(0.7, 0.2, "unobserved", reason))), saved(calibration(name)))
    gates = tuple(GateResult(name, of, message, outcome, message, None, reason) for outcome in ("failed", "passed"))
    outcome = BatchOutcome(runs, {"vehicle.json": saved(vehicle(of))}, (Failure(name, DataError(message)),), gates)
    suites = read(junit_xml(outcome))
    assert len(suites) == 3
    assert json.loads(json_text(document_of(outcome)))["gates"][0]["outcome"] == "failed"
    rows = [line for line in step_summary(outcome).splitlines() if line.startswith("|")]
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in rows} <= {3, 8}
    assert len(gates_text(gates).splitlines()) >= 2


def test_a_batch_without_gates_fails_nothing():
    runs = (saved(calibration()),)
    suites = read(junit_xml(BatchOutcome(runs, {"vehicle.json": saved(vehicle())}, ())))
    assert list(suites) == ["yard"]
    assert set(outcomes(suites["yard"]).values()) == {"passed"}
    assert gates_text(()) == ""
    assert read(junit_xml(BatchOutcome((), {}, ()))) == {}


def test_drift_tells_both_values_wherever_it_is_shown():
    runs = (saved(calibration(track_m=estimate(0.71, 1e-3))),)
    before = saved(calibration()).parameters.by_key
    earlier = Earlier("yard", "demo", {f"parameters.{key}": one for key, one in before.items()})
    gates = judge_drift(Baseline(Path("previous.json"), (earlier,)), [parse_allowance("2sigma")], runs)
    outcome = BatchOutcome(runs, {}, (), gates)
    for text in (junit_xml(outcome), gates_text(gates, 400), json_text(document_of(outcome))):
        assert "0.71 against 0.728 m of run yard in previous.json: -0.018 m, -12.7 sigma; allowed 0.00283 m" in text


def test_the_json_holds_whole_documents_and_the_exit_code():
    outcome = batch()
    document = json.loads(json_text(document_of(outcome)))
    assert document["schema"] == "sccal.batch/1"
    assert document["exit_code"] == 4
    assert [one["run"] for one in document["runs"]] == ["good", "straight", "wrong-gear"]
    assert document["runs"][0] == document_of(outcome.runs[0])
    assert document["failures"][0] == {
        "run": "torn",
        "error": "DataError",
        "exit_code": 3,
        "message": "torn/encoder.csv line 3: no number",
    }
    skipped = [gate for gate in document["gates"] if gate["outcome"] == "skipped"]
    assert [(gate["run"], gate["measured"]) for gate in skipped] == [("straight", None)]


def test_the_page_says_what_failed_first(tmp_path):
    text = step_summary(batch())
    assert text.splitlines()[0] == "### sccal: 3 of 5 runs calibrated, gates: 6 passed, 3 failed, 1 skipped"
    order = ["| no result |", "| gate failed |", "| run |", "| gate skipped |"]
    assert sorted(order, key=text.index) == order
    assert "| straight | ✅ good | 80.800 ± 0.020 | 79.600 ± 0.020 | not observed | 12.50 ± 0.20 | 0.40 |" in text


def test_the_page_is_appended_to(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n")
    assert append_step_summary(batch(), {"GITHUB_STEP_SUMMARY": str(page)}) == page
    assert page.read_text() == "before\n" + step_summary(batch())
    assert append_step_summary(batch(), {}) is None
    with pytest.raises(UsageError, match="GITHUB_STEP_SUMMARY"):
        append_step_summary(batch(), {"GITHUB_STEP_SUMMARY": str(tmp_path / "no" / "page.md")})


@cache
def thousands() -> BatchOutcome:
    """More runs than a page takes, with long names, made once."""
    return BatchOutcome(tuple(saved(calibration(f"ü{k}" * 40)) for k in range(8000)), {}, ())


@pytest.mark.parametrize("there", [0, 1000, MOST_BYTES - 500, MOST_BYTES - 20, MOST_BYTES])
def test_the_page_is_cut_at_what_github_takes(tmp_path, there):
    page = tmp_path / "page.md"
    page.write_bytes(b"x" * there)
    append_step_summary(thousands(), {"GITHUB_STEP_SUMMARY": str(page)})
    content = page.read_bytes()
    assert len(content) <= MOST_BYTES
    assert ("Cut here" in content[there:].decode()) is (there < MOST_BYTES - 20)


@given(st.text(), st.integers(0, 300))
def test_what_is_cut_fits_and_is_a_beginning(text, most):
    content = cut(text, most)
    whole = text.encode("utf-8", "replace")
    assert len(content) <= most
    kept = content.partition(b"\n_Cut here")[0]
    assert whole.startswith(kept)
    assert content == whole or kept == b"" or kept.endswith(b"\n") or whole[len(kept) :].startswith(b"\n")


def test_marks_of_markdown_are_text():
    assert escaped("a|b_c*d`e<f>&\n# [x](y)") == r"a\|b\_c\*d\`e&lt;f&gt;&amp; \# \[x\](y)"


def test_the_terminal_tells_no_more_than_fits():
    gates = tuple(GateResult(f"r{k}", "demo", "fit.nis_gnss<1", "failed", 2.0, 1.0, "") for k in range(30))
    lines = gates_text(gates).splitlines()
    assert lines[0] == "gate failed: r0: fit.nis_gnss<1: measured 2, threshold 1"
    assert lines[-2:] == ["… and 18 more failed", "gates: 0 passed, 30 failed, 0 skipped"]
