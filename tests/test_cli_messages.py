"""The command line on logs of messages."""

from __future__ import annotations

import inspect
import json
from dataclasses import fields
from pathlib import Path

import pytest

from sccal.batch import diagnosing
from sccal.cli.calibrate import calibrate
from sccal.cli.diagnose import diagnose
from sccal.cli.reading import Reading
from sccal.logs.options import ReadOptions
from sccal.logs.run import discover, read_run
from tests.message_logs import messages_of, ros2_bytes, write_mcap
from tests.runs import written
from tests.test_cli_inputs import sccal as command

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated run as folder/csv and folder/drive.mcap, with one vehicle.toml above."""
    folder = tmp_path_factory.mktemp("logs")
    written(folder / "csv", duration_s=120.0)
    (folder / "csv" / "vehicle.toml").rename(folder / "vehicle.toml")
    run = read_run(discover([folder])[0])
    nmea = (folder / "csv" / "gnss.nmea").read_bytes()
    write_mcap(run, folder / "drive.mcap", nmea)
    twice = messages_of(run, nmea)
    twice += [("/imu/second", kind, ns, raw) for topic, kind, ns, raw in twice if topic.startswith("/imu")]
    (folder / "twice").mkdir()
    (folder / "twice" / "two.mcap").write_bytes(ros2_bytes(twice))
    return folder


def test_every_read_option_is_on_both_commands() -> None:
    names = [field.name for field in fields(Reading)]
    assert names == [field.name for field in fields(ReadOptions)]
    assert Reading().options() == ReadOptions()
    for one in (calibrate, diagnose):
        assert set(names) <= set(inspect.signature(one).parameters)
    assert "--left-ticks" in command("diagnose", "--help").out


def test_a_file_and_a_folder_calibrate_alike(folder: Path, tmp_path: Path) -> None:
    found = command("calibrate", folder / "csv", folder / "drive.mcap", "--out", tmp_path / "out")
    assert (found.code, found.err) == (0, "")
    csv, mcap = (
        json.loads((tmp_path / "out" / name / "calibration.json").read_text())["parameters"]
        for name in ("csv", "drive")
    )
    for name, estimate in csv.items():
        assert mcap[name]["value"] == pytest.approx(estimate["value"], rel=1e-6)
        assert mcap[name]["status"] == estimate["status"]


def test_a_cut_file_gives_a_result_and_says_so(folder: Path, tmp_path: Path) -> None:
    data = (folder / "drive.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(0.6 * len(data))])
    (tmp_path / "vehicle.toml").write_bytes((folder / "vehicle.toml").read_bytes())
    found = command("calibrate", tmp_path / "cut.mcap", "--out", tmp_path / "out")
    assert (found.code, found.err) == (0, "")
    notices = json.loads((tmp_path / "out" / "cut" / "calibration.json").read_text())["notices"]
    [told] = [notice for notice in notices if notice["source"] == "cut.mcap"]
    assert told["severity"] == "warning"
    assert "breaks off" in told["what"]
    assert "t = " in told["where"]


def test_candidates_are_listed_and_chosen(folder: Path, tmp_path: Path) -> None:
    found = command("calibrate", folder / "twice" / "two.mcap", "--out", tmp_path / "out")
    assert found.code == 3
    [line] = found.failures
    assert all(part in line for part in ("/imu/data", "/imu/second", "--heading-topic"))
    chosen = command(
        "calibrate", folder / "twice" / "two.mcap", "--out", tmp_path / "out", "--heading-topic", "/imu/second"
    )
    assert chosen.code == 0


@pytest.mark.parametrize("content", [b"", bytes(1000), b"\x89PNG\r\n\x1a\n123", b"text\n", b"\x89MCAP0\r\n"])
@pytest.mark.parametrize("name", ["calibrate", "diagnose"])
def test_no_log_at_all_is_one_line(name: str, content: bytes, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_bytes(content)
    (tmp_path / "vehicle.toml").write_bytes((folder / "vehicle.toml").read_bytes())
    found = command(name, tmp_path / "log.mcap", "--out", tmp_path / "out")
    assert found.code == 3
    [line] = found.failures
    assert "log.mcap" in line


@pytest.mark.parametrize(
    "option", [("--time", "now"), ("--orientation", "up"), ("--yaw", "/imu"), ("--left-ticks", "/a:b")]
)
def test_options_that_cannot_be(option: tuple[str, str], folder: Path, tmp_path: Path) -> None:
    found = command("calibrate", folder / "drive.mcap", "--out", tmp_path / "out", *option)
    assert found.code == 2
    [line] = found.failures
    assert option[0] in line


def test_diagnose_hands_the_options_on(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def note(
        paths: object, out: object, options: object, read: ReadOptions, workers: object
    ) -> tuple[list[object], list[object]]:
        seen.append(read)
        return [], []

    monkeypatch.setattr(diagnosing, "diagnose_paths", note)
    assert command("diagnose", folder, "--out", tmp_path, "--left-joint", "l", "--time", "log").code == 0
    assert seen == [ReadOptions(left_joint="l", time="log")]
