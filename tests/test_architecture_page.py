"""docs/architecture.md tells of the building as it is: its picture, its types and the rooms that they live in."""

from __future__ import annotations

import importlib
import re
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[1] / "docs"
ROWS = re.findall(
    r"^\| `sccal\.([\w.]+)\.(\w+)` \| (\w+) \|", (DOCS / "architecture.md").read_text("utf-8"), re.MULTILINE
)


def test_the_picture_is_drawn_from_the_rooms_that_there_are():
    drawn = runpy.run_path(str(DOCS / "architecture.py"))["picture"]()
    assert drawn == (DOCS / "architecture.svg").read_text("utf-8")


def test_what_goes_up_in_the_picture_comes_from_rooms_that_there_are():
    script = runpy.run_path(str(DOCS / "architecture.py"))
    assert set(script["MADE"]) <= {room for rooms in script["floors"]() for room in rooms}


def test_about_two_dozen_types_are_listed():
    assert 20 <= len(ROWS) <= 30


@pytest.mark.parametrize(("module", "name", "room"), ROWS)
def test_a_listed_type_lives_where_the_page_says(module, name, room):
    assert module.split(".")[0] == room
    found = getattr(importlib.import_module(f"sccal.{module}"), name)
    assert found.__module__ == f"sccal.{module}"
    assert found.__doc__


def test_a_type_that_the_text_names_is_listed():
    text = (DOCS / "architecture.md").read_text("utf-8").split("## The types")[0]
    assert set(re.findall(r"`([A-Z]\w+)`", text)) <= {listed for _, listed, _ in ROWS}
