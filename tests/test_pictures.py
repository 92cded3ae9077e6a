"""The pictures of the README and of docs/ can be drawn again, and stand without a page around them."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import pytest

from tests.report.test_diagnosis_report import picture as residual
from tests.runs import written

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
TEXT = "{http://www.w3.org/2000/svg}text"


def script() -> dict[str, Any]:
    """The names of docs/picture.py, as its functions see them."""
    return runpy.run_path(str(DOCS / "picture.py"))


def texts(svg: str) -> str:
    """Everything that is written in a picture, which must be whole and need no style sheet."""
    assert "var(" not in svg
    return "\n".join(one.text or "" for one in ElementTree.fromstring(svg).iter(TEXT))


def globals_of(drawing: dict[str, Any], name: str) -> dict[str, Any]:
    """Where a drawing function looks its names up, to give it something small."""
    found: dict[str, Any] = drawing[name].__globals__
    return found


def test_the_parameters_of_a_run_are_drawn(tmp_path):
    drawing = script()
    logs = written(tmp_path / "run", path="circle", duration_s=60.0)
    drawn = texts(drawing["standing_alone"](drawing["calibration"](str(logs))))
    for title in ("right radius (m)", "left radius (m)", "track (m)", "heading offset (deg)"):
        assert title in drawn


def test_a_drive_and_what_it_shows_are_drawn():
    drawing = script()
    globals_of(drawing, "drives").update(DRIVES=("circle",), DRIVE_S=60.0)
    drawn = texts(drawing["standing_alone"](drawing["drives"]()))
    assert "circle (m)" in drawn
    assert re.search(r"^right radius: ± [0-9.]+ mm$", drawn, re.MULTILINE)
    assert re.search(r"^effects shown: \d+ of \d+$", drawn, re.MULTILINE)


def test_the_residual_of_a_finding_is_drawn(tmp_path):
    drawing = script()
    found = SimpleNamespace(findings=[SimpleNamespace(picture=residual())])
    globals_of(drawing, "diagnosis").update(diagnose=lambda *_: found)
    logs = written(tmp_path / "run", duration_s=20.0)
    assert residual().x_label in texts(drawing["standing_alone"](drawing["diagnosis"](str(logs))))


STORED = sorted(path for path in DOCS.glob("*.svg") if path.stem != "architecture")
"""All but the one that has a script and a test of its own."""


@pytest.mark.parametrize("stored", STORED, ids=lambda path: path.stem)
def test_stored_pictures_are_ones_that_the_script_draws(stored):
    assert stored.stem in script()["PICTURES"]
    assert texts(stored.read_text(encoding="utf-8")), "letters as outlines: older than the style of the figures"
