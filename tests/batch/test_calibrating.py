"""Many runs in one call: none takes another with it, whatever happens to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from sccal.batch import tasks
from sccal.batch.calibrating import calibrate_paths
from sccal.calibration.options import CalibrationOptions
from sccal.errors import Exit, UsageError
from tests.calibration.test_single import GIVEN
from tests.runs import written

OPTIONS = CalibrationOptions(noise=GIVEN)


def run(paths: list[Path], out: Path):
    told = []
    found = calibrate_paths(paths, out, OPTIONS, lambda source, result: told.append((source.name, result)))
    return found, told


def test_a_bug_in_one_run_leaves_the_others_their_results(tmp_path, monkeypatch, capsys):
    for name in ("a", "b", "c"):
        written(tmp_path / "logs" / name, duration_s=60)
    honest = tasks.calibrate_run

    def buggy(one, options):
        if one.name == "b":
            raise ZeroDivisionError("float division by zero")
        return honest(one, options)

    monkeypatch.setattr(tasks, "calibrate_run", buggy)
    found, told = run([tmp_path / "logs"], tmp_path / "out")
    assert [name for name, _ in told] == ["a", "b", "c"]
    assert [one.run for one in found.runs] == ["a", "c"]
    assert found.failures[0].error.exit_code == Exit.INTERNAL
    assert "ZeroDivisionError" in capsys.readouterr().err
    assert (tmp_path / "out" / "c" / "calibration.json").is_file()
    assert (tmp_path / "out" / "vehicle.json").is_file()


def test_vehicles_are_told_apart_by_what_is_declared(tmp_path):
    written(tmp_path / "logs" / "a", duration_s=60)
    written(tmp_path / "logs" / "b", "vehicle.name=other robot", duration_s=60)
    found, _ = run([tmp_path / "logs"], tmp_path / "out")
    files = sorted(file.name for _, file in found.vehicles)
    assert files == ["vehicle-other-robot.json", "vehicle-tracked-demo.json"]
    assert all((tmp_path / "out" / file).is_file() for file in files)


def test_results_do_not_land_among_the_logs(tmp_path):
    folder = written(tmp_path / "logs" / "a", duration_s=60)
    with pytest.raises(UsageError, match="run's own folder"):
        run([tmp_path / "logs"], folder.parent)
