"""Every document keeps to its JSON Schema, and the schemas in docs are those of the types."""

from __future__ import annotations

import runpy

import jsonschema
import pytest

from sccal.compare.calibrations import compare_calibrations
from sccal.compare.diagnoses import compare_diagnoses
from sccal.results.converter import document_of, json_text, result_from
from sccal.results.inspection import InspectFailure, Inspections
from sccal.results.schema import DOCUMENTS, schema_of
from tests.inspect.logs import inspected
from tests.report.test_ci_reports import batch
from tests.report.test_diagnosis_report import ALL as DIAGNOSES
from tests.report.test_diagnosis_report import TWO, diagnosis
from tests.report.test_experiments_report import ALL
from tests.report.test_model_json import MODEL
from tests.results.documents import SCHEMAS, held_to_its_schema
from tests.runs import written
from tests.summary.fleets import history, of_vehicle


def test_the_schemas_in_docs_are_those_of_the_types():
    """Where this fails, ``make schemas`` writes them again."""
    assert {path.stem for path in SCHEMAS.iterdir()} == set(DOCUMENTS)
    for name, kind in DOCUMENTS.items():
        assert (SCHEMAS / f"{name}.json").read_text("utf-8") == json_text(schema_of(kind)), name
        jsonschema.Draft202012Validator.check_schema(schema_of(kind))


def test_the_script_writes_all_of_them(tmp_path, monkeypatch):
    script = runpy.run_path(str(SCHEMAS.parent / "schemas.py"))
    script["main"].__globals__["FOLDER"] = tmp_path / "schemas"
    script["main"]()
    assert {path.name for path in (tmp_path / "schemas").iterdir()} == {path.name for path in SCHEMAS.iterdir()}


def test_documents_of_runs_and_vehicles(a_run, an_ugly_run, a_vehicle):
    for result in (a_run, an_ugly_run, a_vehicle):
        held_to_its_schema(document_of(result))


@pytest.mark.parametrize("result", [*DIAGNOSES.values(), MODEL, ALL, batch()], ids=lambda result: type(result).__name__)
def test_documents_of_searches_models_experiments_and_batches(result):
    held_to_its_schema(document_of(result))


def test_documents_of_comparisons(a_run, a_vehicle):
    held_to_its_schema(document_of(compare_calibrations(a_run, a_vehicle, 3.0)))
    held_to_its_schema(document_of(compare_diagnoses(diagnosis(), TWO, 3.0)))


def test_the_document_of_a_fleet(tmp_path):
    from sccal.report.fleet.lines import with_sentences
    from sccal.summary import summarise

    runs = history(12)
    held_to_its_schema(document_of(with_sentences(summarise(runs, of_vehicle(runs), [], tmp_path))))


def test_the_document_of_an_inspection(tmp_path):
    found = inspected(written(tmp_path / "run", duration_s=40.0))
    held_to_its_schema(document_of(Inspections((found,), (InspectFailure("torn", "no number"),))))


def test_the_experiments_of_the_readme():
    held_to_its_schema((SCHEMAS.parent / "experiments.json").read_text("utf-8"))


def test_a_schema_refuses_what_is_no_such_document(a_run):
    document = document_of(a_run)
    for wrong in ({**document, "run": 3}, {**document, "verdict": "fine"}, {**document, "fit": None}):
        with pytest.raises(jsonschema.ValidationError):
            held_to_its_schema(wrong)


def test_what_is_written_is_read_as_it_was(a_run, a_vehicle):
    for result in (a_run, a_vehicle):
        document = document_of(result)
        assert document_of(result_from(document, type(result))) == document
