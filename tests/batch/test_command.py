"""The command with --jobs and --resume: the same bytes whoever did the work, and whatever came in between."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time

import pytest

from sccal.batch.record import RECORD_FILE
from tests.batch.logs import COMMAND, NAMES, calibrate, contents, some_runs


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    return some_runs(tmp_path_factory.mktemp("fleet") / "logs")


@pytest.fixture(scope="module")
def undisturbed(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    calibrate(logs, "--out", out, "--jobs", 1)
    return out


def somebody_in(group: int) -> bool:
    """Whether a process of the group is there still."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_two_jobs_leave_the_bytes_of_one_and_lines_in_the_order_of_the_runs(logs, undisturbed, tmp_path):
    told = calibrate(logs, "--out", tmp_path / "out", "--jobs", 2, CI="true")
    assert contents(tmp_path / "out") == contents(undisturbed)
    assert [line.split(":")[0] for line in told.splitlines()[:4]] == list(NAMES)
    assert "\x1b" not in told


def test_provenance_names_inputs_options_and_versions_and_no_machine(logs, undisturbed):
    text = (undisturbed / "a" / "calibration.json").read_text()
    provenance = json.loads(text)["provenance"]
    assert [one["name"] for one in provenance["inputs"]] == ["encoder.csv", "ahrs.csv", "gnss.nmea", "vehicle.toml"]
    assert provenance["options"]["outage_window_s"] == "30.0"
    assert provenance["options"]["with_offset"] == "true"
    assert set(provenance["versions"]) == {"sccal", "python", "numpy", "scipy", "numba"}
    assert str(logs.parent) not in text
    assert os.uname().nodename not in json.dumps(provenance)


@pytest.mark.slow
def test_after_kill_9_resume_repeats_only_what_was_not_finished(logs, undisturbed, tmp_path):
    out = tmp_path / "out"
    working = subprocess.Popen(
        [*COMMAND, str(logs), "--out", str(out), "--jobs", "2"], stdout=subprocess.DEVNULL, start_new_session=True
    )
    give_up = time.monotonic() + 60
    while not list(out.glob("*/calibration.json")) and time.monotonic() < give_up:
        time.sleep(0.005)
    os.killpg(working.pid, signal.SIGKILL)
    working.wait()
    whole = {path.parent.name: path.stat().st_mtime_ns for path in out.glob("*/calibration.json")}
    assert whole
    assert not (out / "vehicle.json").exists()
    told = calibrate(logs, "--out", out, "--jobs", 2, "--resume")
    assert f"{len(whole)} of {len(NAMES)} results stood already" in told
    for name, when in whole.items():
        assert (out / name / "calibration.json").stat().st_mtime_ns == when
    assert contents(out) == contents(undisturbed)


@pytest.mark.slow
def test_resume_repeats_what_is_damaged_or_was_made_otherwise(logs, undisturbed, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(undisturbed, out)
    (out / "a" / "report.html").unlink()
    (out / "b" / "trajectory.csv").write_text("t\n")
    (out / "c" / RECORD_FILE).write_text("{")
    told = calibrate(logs, "--out", out, "--jobs", 1, "--resume")
    assert "1 of 4 results stood already" in told
    assert contents(out) == contents(undisturbed)
    assert "stood already" not in calibrate(logs, "--out", out, "--jobs", 1, "--resume", "--window", 20)


@pytest.mark.slow
def test_ctrl_c_leaves_what_is_done_says_so_and_no_process(tmp_path):
    logs, out = some_runs(tmp_path / "logs", tuple("abcdefgh")), tmp_path / "out"
    working = subprocess.Popen(
        [*COMMAND, str(logs), "--out", str(out), "--jobs", "2"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    give_up = time.monotonic() + 60
    while not list(out.glob("*/calibration.json")) and time.monotonic() < give_up:
        time.sleep(0.005)
    os.killpg(working.pid, signal.SIGINT)
    _, told = working.communicate(timeout=30)
    assert working.returncode == 130
    assert "of 8 runs are done" in told
    assert "--resume" in told
    assert "Traceback" not in told
    give_up = time.monotonic() + 30
    while somebody_in(working.pid) and time.monotonic() < give_up:
        time.sleep(0.02)
    assert not somebody_in(working.pid)
    assert not list(out.rglob("*.part"))


def test_corrupted_runs_are_told_and_the_others_have_their_results(logs, tmp_path):
    broken = tmp_path / "logs"
    shutil.copytree(logs, broken)
    (broken / "a" / "encoder.csv").write_bytes(b"\0" * 1000)
    (broken / "b" / "gnss.nmea").write_text("")
    (broken / "c" / "ahrs.csv").unlink()
    out = tmp_path / "out"
    told = calibrate(broken, "--out", out, "--jobs", 2, expected=3)
    assert sorted(path.parent.name for path in out.glob("*/calibration.json")) == ["d"]
    assert "3 of 4 gave no result" in told
    for name, file in (("a", "encoder.csv"), ("b", "gnss.nmea"), ("c", "ahrs.csv")):
        assert any(line.startswith(f"sccal: {name}: ") and file in line for line in told.splitlines())
