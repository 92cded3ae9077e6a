"""A diagnosis into a folder; a reader meets each file whole or not at all."""

from __future__ import annotations

from pathlib import Path

from sccal.diagnose.result import Diagnosis
from sccal.logs.write import write_text
from sccal.report.as_json import json_text
from sccal.report.diagnosis_json import diagnosis_json


def write_diagnosis(d: Diagnosis, out: Path) -> None:
    """``diagnosis.json`` first, which needs no matplotlib, then the page ``diagnosis.html``."""
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / "diagnosis.json", json_text(diagnosis_json(d)))
    from sccal.report.diagnosis_html import diagnosis_html

    write_text(out / "diagnosis.html", diagnosis_html(d))
