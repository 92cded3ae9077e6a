"""Every field case, in the order in which the table shows them."""

from __future__ import annotations

from studies.field import known_clocks, known_messages, known_sentences, known_tables
from studies.field.wanted import FieldCase

CHAPTERS = (*known_clocks.CHAPTERS, *known_tables.CHAPTERS, *known_sentences.CHAPTERS, *known_messages.CHAPTERS)
CASES: tuple[FieldCase, ...] = tuple(case for chapter in CHAPTERS for case in chapter.cases)
