"""The summary of a batch into the folder of results; a reader meets each file whole or not at all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sccal.logs.write import write_text
from sccal.report.as_json import json_text
from sccal.report.index_csv import summary_csv
from sccal.report.index_json import summary_json
from sccal.results.gates import GateResult
from sccal.results.saved import SUMMARY_FILE
from sccal.results.summary import Summary

INDEX_FILE = "index.html"
TABLE_FILE = "summary.csv"


def write_summary(summary: Summary, out: Path, gates: Sequence[GateResult] = ()) -> Path:
    """summary.json, summary.csv and index.html, which expects the runs' folders beside it; returns the page."""
    from sccal.report.index_html import index_html

    out.mkdir(parents=True, exist_ok=True)
    write_text(out / SUMMARY_FILE, json_text(summary_json(summary, gates)))
    write_text(out / TABLE_FILE, summary_csv(summary))
    write_text(out / INDEX_FILE, index_html(summary, gates))
    return out / INDEX_FILE
