"""A diagnosis into a folder; a reader meets each file whole or not at all."""

from __future__ import annotations

from pathlib import Path

from sccal.logs.write import write_text
from sccal.results.converter import document_of, json_text
from sccal.results.diagnosis import Diagnosis
from sccal.results.files import DIAGNOSIS_FILE, MODEL_FILE


def write_diagnosis(d: Diagnosis, out: Path) -> None:
    """``diagnosis.json`` and ``model.json`` first, which need no matplotlib, then the page ``diagnosis.html``."""
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / DIAGNOSIS_FILE, json_text(document_of(d)))
    write_text(out / MODEL_FILE, json_text(document_of(d.model)))
    from sccal.report.diagnosis_html import diagnosis_html

    write_text(out / "diagnosis.html", diagnosis_html(d))
