"""``sccal init`` as it is typed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sccal.cli import main
from tests.propose.logs import TICKS_PER_TURN, Form, drive, write_log


def run_command(*arguments: str | Path) -> int:
    """The exit code of a command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["sccal", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


def test_init_then_calibrate_without_an_edit(tmp_path, capsys):
    logs = write_log(drive(11, 80.0), Form(), tmp_path / "logs")
    assert run_command("calibrate", logs, "--out", tmp_path / "out") == 3
    assert f"`sccal init {logs}` proposes a mapping" in capsys.readouterr().err
    assert run_command("init", logs) == 0
    said = capsys.readouterr().out
    assert "- wheel.csv: enc_l is the left wheel" in said
    assert "What the log does not tell" in said
    assert f"next: sccal calibrate {logs}" in said
    assert run_command("init", logs) == 2
    assert "--force writes over it" in capsys.readouterr().err
    assert run_command("init", logs, "--force", "--ticks-per-turn", TICKS_PER_TURN, "--crs", "EPSG:32633") == 0
    assert "What the log does not tell" not in capsys.readouterr().out
    assert run_command("calibrate", logs, "--out", tmp_path / "out", "--jobs", "1") == 0
    assert re.search(r"right radius +0\.08[01]", capsys.readouterr().out)


def test_what_cannot_be_mapped_writes_nothing(tmp_path, capsys):
    logs = write_log(drive(11, 80.0), Form(), tmp_path / "logs")
    (logs / "gps.csv").unlink()
    assert run_command("init", logs) == 3
    assert "no fixes" in capsys.readouterr().err
    assert not (logs / "vehicle.toml").exists()
    assert run_command("init", tmp_path / "nowhere") == 2
