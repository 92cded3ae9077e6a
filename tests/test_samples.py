"""The sample logs and the README: what a newcomer runs and reads first must be true."""

from __future__ import annotations

import json
import re
import shlex
import sys
from pathlib import Path

import pytest

from sccal.cli import main

ROOT = Path(__file__).resolve().parents[1]
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?")


def call(*arguments: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["sccal", *arguments])
        patch.setenv("COLUMNS", "100")
        with pytest.raises(SystemExit) as caught:
            main()
    return int(caught.value.code or 0)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """(output folder, what the terminal showed)"""
    import contextlib
    import io

    out = tmp_path_factory.mktemp("samples") / "out"
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown):
        assert call("calibrate", str(ROOT / "sample_logs"), "--out", str(out)) == 0
    return out, shown.getvalue()


@pytest.mark.parametrize("run", ["circle", "figure8", "general", "rectangle", ""])
def test_the_truth_lies_within_three_sigmas(calibrated, run):
    out, _ = calibrated
    file = out / run / "calibration.json" if run else out / "vehicle.json"
    found = json.loads(file.read_text())["parameters"]
    truth_file = "figure8.truth.json" if run == "figure8" else f"{run or 'general'}/truth.json"
    truth = json.loads((ROOT / "sample_logs" / truth_file).read_text())["parameters"]
    for name in ("radius_right_m", "radius_left_m", "track_m", "heading_offset_deg"):
        assert found[name]["status"] == "estimated"
        assert abs(found[name]["value"] - truth[name]) < 3 * found[name]["sigma"]
    assert abs(found["heading_offset_deg"]["value"] - truth["heading_offset_deg"]) < 0.3


def test_the_samples_are_made_to_the_byte(tmp_path):
    from sccal.samples import write_all_samples

    write_all_samples(tmp_path)
    there = {path.relative_to(ROOT / "sample_logs"): path for path in (ROOT / "sample_logs").rglob("*.*")}
    made = {path.relative_to(tmp_path): path for path in tmp_path.rglob("*.*")}
    assert there.keys() == made.keys()
    assert [name for name in there if there[name].read_bytes() != made[name].read_bytes()] == []


def test_the_samples_are_small():
    total = sum(path.stat().st_size for path in (ROOT / "sample_logs").rglob("*") if path.is_file())
    assert total < 4_000_000


def test_the_readme_shows_what_the_command_prints(calibrated):
    """Words to the letter; numbers to within a few units of their last digit, which differ between machines."""
    _, shown = calibrated
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = text.split("<!-- output of: sccal calibrate sample_logs -->")[1].split("<!-- end -->")[0]
    expected = [line.strip() for line in block.splitlines() if line.strip()]
    printed = [line.strip() for line in shown.splitlines()]
    first = printed.index(next(line for line in printed if line.startswith("run ")))
    printed = [line for line in printed[first : first + 2 * len(expected)] if line][: len(expected)]
    for ours, theirs in zip(expected, printed, strict=True):
        assert NUMBER.sub("#", ours).split() == NUMBER.sub("#", theirs).split()
        for a, b in zip(NUMBER.findall(ours), NUMBER.findall(theirs), strict=True):
            assert float(a) == pytest.approx(float(b), rel=0.02, abs=5 * 10.0 ** -len(a.partition(".")[2]))


def test_every_command_in_the_readme_is_understood(capsys):
    commands = re.findall(r"^\s+(?:\.venv/bin/)?sccal (.+?)(?:\s+#.*)?$", (ROOT / "README.md").read_text(), re.M)
    assert len(commands) >= 3
    for command in commands:
        name, *arguments = shlex.split(command)
        assert call(name, "--help") == 0
        options = capsys.readouterr().out
        for option in (one for one in arguments if one.startswith("--")):
            assert option in options


def test_make_targets_of_the_readme_exist():
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"`?make (\w+)`?", (ROOT / "README.md").read_text()):
        assert re.search(rf"^{target}:", makefile, re.M), target
