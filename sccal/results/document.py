"""JSON files of any schema."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sccal.errors import DataError


def read_document(path: Path, option: str = "") -> tuple[Any, str | None]:
    """A JSON file's content and the schema that it names; None where it names none.

    ``option`` is the one on the command line that the path came with, for the message.

    Raises:
        DataError: it cannot be read, or is no JSON.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"{option} {path}: cannot be read as JSON ({error})".lstrip()) from error
    schema = document.get("schema") if isinstance(document, dict) else None
    return document, schema if isinstance(schema, str) else None
