"""An inspection into a folder; a reader meets each file whole or not at all."""

from __future__ import annotations

from pathlib import Path

from sccal.logs.write import write_text
from sccal.results.converter import document_of, json_text
from sccal.results.inspection import Inspection, Inspections


def write_inspection(i: Inspection, folder: Path) -> Path:
    """``inspect.json`` first, which needs no matplotlib, then ``inspect.html``, whose path is returned."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "inspect.json", json_text(document_of(Inspections((i,)))))
    from sccal.report.inspect_html import inspection_html

    page = folder / "inspect.html"
    write_text(page, inspection_html(i))
    return page
