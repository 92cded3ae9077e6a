"""Names of runs in the order in which people count."""

from __future__ import annotations

import re
from pathlib import PurePath

NaturalKey = list[list[tuple[int, int, str]]]


def natural_key(path: PurePath) -> NaturalKey:
    """A key that sorts run2 before run10, part by part."""
    return [
        [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"([0-9]+)", name) if part]
        for name in path.parts
    ]
