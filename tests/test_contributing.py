"""CONTRIBUTING.md: the files that it names are there, and its first three recipes work as they stand."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(new|edit) (\S+)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
"""Kind, file and content of each block."""
SENTENCES = """
import numpy as np
from sccal.logs.nmea import parse_nmea_heading
lines = ["$GPZDA,120000.00,01,06,2024,00,00"]
for second, (yaw, state) in enumerate([(10, "A"), (20, "A"), (30, "V"), (40, "A")]):
    lines += [f"$GPGGA,12000{second}.00,4800.0,N,01100.0,E,4,12,0.8,500.0,M,47.0,M,,", f"$GPXHD,{yaw}.0,{state}"]
heading, _ = parse_nmea_heading("\\n".join([*lines, ""]).encode(), "gnss.nmea")
print(heading.source, np.degrees(heading.yaw_rad).round(3).tolist())
"""
PAGE = """
from sccal.report.run.page import run_html
from tests.report.conftest import run
print(run_html(run()))
"""


def edited(text: str, hunks: str) -> str:
    """The text with each hunk's lines put in: what stands before and after it tells the place."""
    for hunk in hunks.split("@@\n"):
        lines = hunk.splitlines(keepends=True)
        before = "".join(line[1:] for line in lines if line[0] in " -")
        assert text.count(before) == 1, f"stands {text.count(before)} times:\n{before}"
        text = text.replace(before, "".join(line[1:] for line in lines if line[0] in " +"))
    return text


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the package on which the recipes were carried out."""
    folder = tmp_path_factory.mktemp("changed")
    shutil.copytree(ROOT / "sccal", folder / "sccal", ignore=shutil.ignore_patterns("__pycache__"))
    for kind, name, content in BLOCKS:
        path = folder / name
        assert path.exists() == (kind == "edit"), name
        path.write_text(edited(path.read_text("utf-8"), content) if kind == "edit" else content, "utf-8")
    return folder


def ran(folder: Path, *arguments: str) -> str:
    """What Python says with the changed package."""
    call = [sys.executable, *arguments]
    path = os.pathsep.join((str(folder), str(ROOT)))
    found = subprocess.run(
        call, cwd=folder, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr
    return found.stdout


def test_every_file_that_is_named_is_there_or_made():
    made = {name for kind, name, _ in BLOCKS if kind == "new"}
    named = set(re.findall(r"\b(?:sccal|tests|docs|fuzz)/[\w/.]*\w", TEXT)) - made
    assert {name for name in named if not (ROOT / name).exists()} == set()


def test_the_recipes_change_the_files_that_the_table_counts():
    assert [kind for kind, *_ in BLOCKS] == ["new", "edit", "edit", "new", "edit"]


def test_the_new_sentence_is_read(changed):
    assert ran(changed, "-c", SENTENCES).strip() == "gnss.nmea (XHD) [10.0, 20.0, 40.0]"


def test_the_new_figure_stands_in_the_page(changed):
    page = ran(changed, "-c", PAGE)
    assert '<figure id="heading"' in page
    assert "Counter-clockwise from east, without jumps at full turns." in page


def test_the_new_effect_is_shown_and_put_into_a_log(changed):
    assert "tracks that slip when they drive backwards" in ran(changed, "-m", "sccal", "effects", "reverse_slip")
    small = ["--set", "encoder.rate_hz=20", "--set", "ahrs.rate_hz=10"]
    drive = ["--path", "calibration", "--duration", "200", *small]
    ran(changed, "-m", "sccal", "simulate", "log", *drive, "--effect", "reverse_slip=0.1")
    assert json.loads((changed / "log" / "truth.json").read_text("utf-8"))["effects"]["reverse_slip"] == {"ratio": 0.1}


@pytest.mark.slow
def test_the_new_effect_is_calibrated(changed):
    """Slow, since the copy's kernel has to be compiled anew."""
    test_the_new_effect_is_shown_and_put_into_a_log(changed)
    ran(changed, "-m", "sccal", "calibrate", "log", "--effects", "reverse_slip", "--jobs", "1")
    result = json.loads((changed / "out" / "log" / "calibration.json").read_text("utf-8"))
    found = result["effects"]["reverse_slip"]["ratio"]
    assert found["status"] == "estimated"
    assert abs(found["value"] - 0.1) < 4.0 * found["sigma"] < 0.1
