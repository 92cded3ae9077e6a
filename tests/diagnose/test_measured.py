"""Diagnoses of measured logs, where they lie beside the checkout."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from sccal.align import align
from sccal.batch.calibrating import calibrate_paths
from sccal.calibration.options import CalibrationOptions
from sccal.diagnose.diagnose import diagnose
from sccal.logs.run import discover, read_run
from sccal.report.diagnosis.text import diagnosis_text

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
LOGS = Path(__file__).resolve().parents[2].parent / "shared" / "logs"

pytestmark = [
    pytest.mark.measured,
    pytest.mark.skipif(not LOGS.is_dir(), reason="measured logs are not beside the checkout"),
]


def diagnosed(name):
    return diagnose([align(read_run(source)) for source in discover([LOGS / name])], CalibrationOptions())


@pytest.mark.slow
def test_the_van_lacks_its_antenna_beside_the_middle():
    """The antenna's place is measured: 0.7375 m to the right of the middle."""
    found = diagnosed("psu-van")
    assert len(found.runs) == 7
    arm = found.findings[0]
    assert arm.name == "lever_arm"
    assert arm.parameters["left_m"].value == pytest.approx(-0.7375, abs=0.02)
    assert 1.4 < found.parameters_after.track_m.value < 1.7
    assert found.after.outage_end_rms_m <= 0.7 * found.before.outage_end_rms_m
    assert found.placebo.passed <= 1
    the_readme_shows(diagnosis_text(found, 100))


def the_readme_shows(printed):
    """The tables in the README: words to the letter, numbers to a few units of their last digit."""
    text = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")
    block = text.split("<!-- output of: sccal diagnose psu-van -->")[1].split("<!-- end -->")[0]
    lines = {NUMBER.sub("#", line.strip()): line for line in printed.splitlines()}
    for shown in (line.strip() for line in block.splitlines() if line.strip()):
        ours = lines[NUMBER.sub("#", shown)]
        for a, b in zip(NUMBER.findall(shown), NUMBER.findall(ours), strict=True):
            assert float(a) == pytest.approx(float(b), rel=0.05, abs=5 * 10.0 ** -len(a.partition(".")[2]))


@pytest.mark.slow
def test_the_husky_lacks_the_iron_at_its_compass():
    found = diagnosed("husky")
    iron = found.findings[0]
    assert iron.name == "hard_iron"
    assert 15.0 < np.hypot(iron.parameters["cos_deg"].value, iron.parameters["sin_deg"].value) < 45.0
    assert found.after.gnss_innovation_rms_m <= found.before.gnss_innovation_rms_m / 3.0


@pytest.mark.slow
def test_some_runs_of_the_van_cover_what_all_say_together(tmp_path):
    """Three or four of seven, whose own noise decides: with the lever arm alone, turns still differ from run to run."""
    batch = calibrate_paths(
        [LOGS / "psu-van"], tmp_path, CalibrationOptions(effects=("lever_arm",)), lambda source, result: None
    )
    ((vehicle, _),) = batch.vehicles
    joint = vehicle.effects["lever_arm"]
    assert joint["left_m"].value == pytest.approx(-0.7375, abs=max(0.02, 3.0 * joint["left_m"].sigma))
    covered = 0
    for run in batch.runs:
        own = run.effects["lever_arm"]
        covered += all(abs(own[name].value - joint[name].value) < 3.0 * own[name].sigma for name in own)
    assert len(batch.runs) == 7
    assert covered >= 3
