"""Every field case, in the order in which the table shows them."""

from __future__ import annotations

from studies.field import (
    further_clocks,
    further_receivers,
    further_tables,
    further_wheels,
    known_clocks,
    known_headings,
    known_messages,
    known_places,
    known_sentences,
    known_tables,
    known_wheels,
)
from studies.field.wanted import FieldCase

CHAPTERS = (
    *known_clocks.CHAPTERS,
    *known_tables.CHAPTERS,
    *known_sentences.CHAPTERS,
    *known_messages.CHAPTERS,
    *known_wheels.CHAPTERS,
    *known_headings.CHAPTERS,
    *known_places.CHAPTERS,
    *further_clocks.CHAPTERS,
    *further_tables.CHAPTERS,
    *further_receivers.CHAPTERS,
    *further_wheels.CHAPTERS,
)
CASES: tuple[FieldCase, ...] = tuple(case for chapter in CHAPTERS for case in chapter.cases)
