"""The summary of a batch into the folder of results; a reader meets each file whole or not at all."""

from __future__ import annotations

from pathlib import Path

from sccal.logs.write import write_text
from sccal.report.index_csv import summary_csv
from sccal.report.index_lines import with_sentences
from sccal.results.converter import document_of, json_text
from sccal.results.files import SUMMARY_FILE
from sccal.results.summary import Summary

INDEX_FILE = "index.html"
TABLE_FILE = "summary.csv"


def write_summary(summary: Summary, out: Path) -> Path:
    """summary.json, summary.csv and index.html, which expects the runs' folders beside it; returns the page."""
    from sccal.report.index_html import index_html

    summary = with_sentences(summary)
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / SUMMARY_FILE, json_text(document_of(summary)))
    write_text(out / TABLE_FILE, summary_csv(summary))
    write_text(out / INDEX_FILE, index_html(summary))
    return out / INDEX_FILE
