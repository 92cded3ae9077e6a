"""``sccal compare``: which files it takes, what it prints, how it ends."""

import json

import pytest
from typer.testing import CliRunner

from sccal.cli import app as application
from sccal.errors import DataError, SccalError, UsageError
from sccal.results.converter import document_of, json_text
from tests.compare.test_diagnoses import ARM
from tests.compare.test_diagnoses import document as diagnosis
from tests.results.documents import calibration, estimate, stored, vehicle

app = application


def call(*arguments):
    """Exit code and standard output; what the front door would print as one line is raised."""
    result = CliRunner().invoke(app, ["compare", *map(str, arguments)])
    if isinstance(result.exception, SccalError):
        raise result.exception
    return result.exit_code, result.stdout


@pytest.fixture
def results(tmp_path):
    stored(tmp_path / "a", calibration("a"))
    stored(tmp_path / "b", calibration("b", track_m=estimate(0.8, 1e-3)))
    stored(tmp_path / "out", vehicle(), "vehicle.json")
    for name, document in (("d1", diagnosis()), ("d2", diagnosis(ARM))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "diagnosis.json").write_text(json.dumps(document))
    return tmp_path


def test_folders_and_files_are_the_same(results):
    a, b = results / "a", results / "b"
    assert call(a, b) == call(a / "calibration.json", b / "calibration.json")
    assert call(a, results / "out")[1] == call(a, results / "out" / "vehicle.json")[1]


def test_a_change_fails_only_where_it_is_asked_to(results):
    a, b = results / "a", results / "b"
    assert call(a, b)[0] == 0
    assert call(a, b, "--fail-on-change")[0] == 1
    assert call(a, b, "--fail-on-change", "--sigmas", "60")[0] == 0
    assert call(a, a, "--fail-on-change")[0] == 0
    assert call(results / "d1", results / "d2", "--fail-on-change")[0] == 1
    assert call(results / "d2", results / "d2", "--fail-on-change")[0] == 0


def test_json_and_nothing_else(results):
    code, printed = call(results / "a", results / "b", "--json", "--fail-on-change")
    assert code == 1
    assert json.loads(printed)["changed"] == ["parameters.track_m"]


def test_a_calibration_is_not_compared_with_a_diagnosis(results):
    with pytest.raises(UsageError, match=r"is a calibration, .* a diagnosis"):
        call(results / "a", results / "d1")


def test_a_folder_with_both_is_read_as_the_other_side(results):
    stored(results / "d1", calibration("a"))
    assert "findings: lever_arm gained" in call(results / "d1", results / "d2")[1]
    assert "track" in call(results / "d1", results / "b")[1].splitlines()[0]
    stored(results / "d2", calibration("b"))
    with pytest.raises(UsageError, match="name two files"):
        call(results / "d1", results / "d2")


def test_what_cannot_be_compared_is_told(results):
    with pytest.raises(UsageError, match="no such file"):
        call(results / "a", results / "nowhere")
    with pytest.raises(UsageError, match="holds no calibration"):
        call(results, results / "a")
    for content, says in (("{", "JSON"), ('{"schema": "sccal.summary/1"}', "sccal.summary/1"), ("[]", "None")):
        (results / "odd.json").write_text(content)
        with pytest.raises(DataError, match=says):
            call(results / "odd.json", results / "a")
    (results / "odd.json").write_text('{"schema": "sccal.diagnosis/1", "runs": []}')
    with pytest.raises(DataError, match="diagnose again"):
        call(results / "odd.json", results / "d1")


def test_nothing_estimated_in_both_cannot_support_an_answer(results):
    keys = calibration()["parameters"]
    stored(results / "blank", calibration(**{key: estimate(1.0, 1.0, "unobserved") for key in keys}))
    with pytest.raises(DataError, match="no parameter is estimated in both"):
        call(results / "a", results / "blank")


def test_what_diagnose_writes_can_be_compared(results, tmp_path):
    from tests.report.test_diagnosis_report import diagnosis as reported

    document = json_text(document_of(reported()))
    (tmp_path / "real.json").write_text(document)
    code, printed = call(tmp_path / "real.json", tmp_path / "real.json", "--fail-on-change")
    assert code == 0
    assert printed.startswith("the same findings; 0 of ")
