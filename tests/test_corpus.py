"""What fuzzing found once is never found again: every kept input ends in a stream or in one line with its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from fuzz.readers import READERS, feed
from fuzz.seeds import seeds_of

CORPUS = Path(__file__).parent / "corpus"
FOUND = sorted(path for path in CORPUS.glob("*/*") if path.is_file())


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("path", FOUND, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_what_was_found_stays_mended(path, tmp_path):
    assert feed(READERS[path.parent.name], path.read_bytes(), tmp_path)


@pytest.mark.parametrize("name", sorted(READERS))
def test_the_seeds_are_read(name, tmp_path):
    seeds = seeds_of(name)[:1] if name == "cli" else seeds_of(name)
    for seed in seeds:
        assert " " not in feed(READERS[name], seed, tmp_path)
