"""Write the JSON Schema of every document that sccal writes into docs/schemas/: ``make schemas``."""

from __future__ import annotations

from pathlib import Path

from sccal.results.converter import json_text
from sccal.results.schema import DOCUMENTS, schema_of

FOLDER = Path(__file__).parent / "schemas"


def main() -> None:
    """One file for each kind of document."""
    FOLDER.mkdir(exist_ok=True)
    for name, kind in DOCUMENTS.items():
        (FOLDER / f"{name}.json").write_text(json_text(schema_of(kind)), encoding="utf-8")


if __name__ == "__main__":
    main()
