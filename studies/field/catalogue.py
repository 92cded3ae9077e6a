"""Every field case, in the order in which the table shows them."""

from __future__ import annotations

from studies.field import known_clocks
from studies.field.wanted import FieldCase

CHAPTERS = (*known_clocks.CHAPTERS,)
CASES: tuple[FieldCase, ...] = tuple(case for chapter in CHAPTERS for case in chapter.cases)
