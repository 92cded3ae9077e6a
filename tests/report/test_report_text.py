"""What the terminal shows, word for word; the ugly cases more than the fine one."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from sccal.logs.streams import Notice
from sccal.report.layout import NOTICES_SHOWN, shortened
from sccal.report.run.text import run_text
from sccal.report.vehicle.text import vehicle_text
from sccal.results.calibration import Calibration, VehicleCalibration

GOLDEN = Path(__file__).parent / "golden"


def test_a_fine_run(a_run: Calibration) -> None:
    assert run_text(a_run, 80) == (GOLDEN / "run.txt").read_text(encoding="utf-8")


def test_an_ugly_run(an_ugly_run: Calibration) -> None:
    assert run_text(an_ugly_run, 80) == (GOLDEN / "ugly_run.txt").read_text(encoding="utf-8")


def test_several_runs(a_vehicle: VehicleCalibration) -> None:
    assert vehicle_text(a_vehicle, 80) == (GOLDEN / "vehicle.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("width", [80, 100, 120])
def test_no_line_is_wider_than_asked(
    width: int, a_run: Calibration, an_ugly_run: Calibration, a_vehicle: VehicleCalibration
) -> None:
    texts = run_text(a_run, width) + run_text(an_ugly_run, width) + vehicle_text(a_vehicle, width)
    assert max(len(line) for line in texts.splitlines()) <= width


def test_one_line_per_run_with_marks_and_their_meaning(a_vehicle: VehicleCalibration) -> None:
    lines = vehicle_text(a_vehicle, 100).splitlines()
    assert [line.split()[0] for line in lines[3:5]] == ["yard/figure-eight", "yard/square"]
    assert "96.000 ±0.010!" in lines[5]
    assert "±n/a              ? " in lines[5]
    assert lines[6] == "? not observed, ! at bound, = held, drift m: by what was learnt so far"


def test_warnings_come_first_and_the_rest_is_counted(a_run: Calibration) -> None:
    infos = tuple(Notice("encoder.csv", f"oddities of kind {k}", 1) for k in range(NOTICES_SHOWN + 3))
    text = run_text(replace(a_run, notices=(*infos, Notice("ahrs.csv", "yaw stood still", 1, "", "warning"))))
    notices = text[text.index("notices") :].splitlines()
    assert notices[0] == "notices  warning: ahrs.csv: 1 yaw stood still"
    assert notices[-1].strip() == "… and 4 more in calibration.json"
    assert len(notices) == NOTICES_SHOWN + 1


def test_names_from_outside_cannot_steer_the_terminal(a_run: Calibration) -> None:
    text = run_text(replace(a_run, run="a\x1b[2Jb\nc"))
    assert "\x1b" not in text
    assert "a�[2Jb c (tracked-demo)" in text


def test_long_names_keep_both_ends() -> None:
    assert shortened("campaign/2024/run-07", 16) == "campa…024/run-07"
    assert shortened("campaign/2024/run-07", 9) == "…4/run-07"
    assert shortened("run", 9) == "run"


def test_the_terminal_report_needs_neither_matplotlib_nor_jinja2() -> None:
    code = "import sys, sccal.report.run.text, sccal.report.write; print({'matplotlib', 'jinja2'} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "set()\n"
