"""The experiments into a folder; a reader meets each file whole or not at all."""

from __future__ import annotations

from pathlib import Path

from sccal.logs.write import write_text
from sccal.results.converter import document_of, json_text
from sccal.results.experiments import Experiments


def write_experiments(e: Experiments, out: Path) -> Path:
    """``experiments.json`` first, which needs no matplotlib, then ``experiments.html``; returns the page's path."""
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / "experiments.json", json_text(document_of(e)))
    from sccal.report.experiments_html import experiments_html

    write_text(out / "experiments.html", experiments_html(e))
    return out / "experiments.html"
