"""The table of formats: light, complete, and as the documentation has it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from sccal.logs.folder import listed_folder
from sccal.logs.formats import FOLDER_FILES, MESSAGE_FORMATS, RUN_FILES, are_of_a_bag, message_format

DOCS = Path(__file__).parents[2] / "docs" / "files.md"


def test_names_are_known_before_anything_heavy_is_loaded() -> None:
    script = "import sys, sccal.logs.formats; print('numpy' in sys.modules, 'mcap' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["False", "False"]


def test_every_form_reads_something_and_has_a_name_of_its_own() -> None:
    assert all(one.wheels or one.heading or one.fixes for one in FOLDER_FILES)
    names = [one.name for one in FOLDER_FILES] + [one.suffix for one in MESSAGE_FORMATS]
    assert len(set(names)) == len(names)


def test_the_docs_say_what_every_reader_forgives() -> None:
    text = DOCS.read_text(encoding="utf-8")
    names = [(one.name, one.forgives) for one in FOLDER_FILES] + [(one.suffix, one.forgives) for one in MESSAGE_FORMATS]
    rows = [f"| `{name}` | {forgives} |" for name, forgives in names]
    assert "\n".join(rows) in text, "docs/files.md should hold\n" + "\n".join(rows)


@pytest.mark.parametrize("one", MESSAGE_FORMATS, ids=lambda one: one.suffix)
def test_a_file_of_messages_goes_by_its_ending_and_a_folder_does_not(one, tmp_path: Path) -> None:
    (tmp_path / f"log{one.suffix.upper()}").write_bytes(b"")
    (tmp_path / f"folder{one.suffix}").mkdir()
    assert message_format(tmp_path / f"log{one.suffix.upper()}") is one
    assert message_format(tmp_path / f"folder{one.suffix}") is None
    assert message_format(tmp_path / f"missing{one.suffix}") is None


def test_a_bag_is_told_by_its_own_file_and_its_database() -> None:
    assert are_of_a_bag(["metadata.yaml", "a.DB3"])
    assert not are_of_a_bag(["metadata.yaml"])
    assert not are_of_a_bag(["a.db3"])


def test_a_folder_is_listed_once(tmp_path: Path) -> None:
    for name in reversed(RUN_FILES[1:]):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / RUN_FILES[0]).symlink_to(tmp_path / RUN_FILES[0])
    (tmp_path / "metadata.yaml").write_bytes(b"")
    (tmp_path / "a.db3").write_bytes(b"")
    folder = listed_folder(tmp_path)
    assert folder.there == RUN_FILES[1:]
    assert folder.odd == RUN_FILES[:1]
    assert not folder.is_bag
    for name in folder.there:
        (tmp_path / name).unlink()
    assert folder.there == RUN_FILES[1:]
    assert listed_folder(tmp_path).is_bag
