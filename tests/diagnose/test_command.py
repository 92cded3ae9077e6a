"""``sccal diagnose``: what it writes, what it says, and with which exit code."""

from __future__ import annotations

import json

import pytest

from tests.runs import written
from tests.test_cli_inputs import sccal, strict_json

LIGHT = ("gnss.rate_hz=5", "gnss.outlier_fraction=0.01")


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two good runs of a vehicle and one without its AHRS."""
    folder = tmp_path_factory.mktemp("logs")
    for seed, name in enumerate(("one", "three", "two"), 1):
        written(folder / name, *LIGHT, duration_s=120.0, seed=seed)
    (folder / "three" / "ahrs.csv").write_text("t,yaw_deg\n")
    return folder


@pytest.fixture(scope="module")
def outcome(logs, tmp_path_factory):
    out = tmp_path_factory.mktemp("results") / "out"
    return sccal("diagnose", logs, "--out", out, "--heading-rate", 5), out


def test_a_broken_run_does_not_take_the_good_ones_with_it(outcome):
    called, out = outcome
    assert called.code == 3
    broken, count = called.failures
    assert broken.startswith("sccal: three: ")
    assert "ahrs" in broken
    assert count == "sccal: 1 of 3 gave no result"
    assert (out / "diagnosis.html").is_file()
    document = strict_json(out / "diagnosis.json")
    assert document["schema"] == "sccal.diagnosis/1"
    assert document["runs"] == ["one", "two"]
    assert document["findings"] == []
    assert document["held_out"]["how"].startswith("each of 2 runs")
    assert {one["run"] for one in document["noise"]} == {"one", "two"}
    assert document["placebo"]["passed"] == 0


def test_the_folder_and_the_page_are_told(outcome):
    called, out = outcome
    assert f"results in {out}/, report: {out / 'diagnosis.html'}" in called.out
    page = (out / "diagnosis.html").read_text(encoding="utf-8")
    assert page.startswith("<!")
    assert "http://" not in page.replace("http://www.w3.org", "")


def test_an_empty_folder_is_no_result(tmp_path):
    (tmp_path / "empty").mkdir()
    called = sccal("diagnose", tmp_path / "empty", "--out", tmp_path / "out")
    assert called.code == 3
    (line,) = called.failures
    assert "empty" in line
    assert not (tmp_path / "out").exists()


def test_a_path_that_is_not_there_is_a_mistake_in_the_call(tmp_path):
    called = sccal("diagnose", tmp_path / "nowhere", "--out", tmp_path / "out")
    assert called.code == 2
    assert "nowhere" in called.failures[0]


def test_where_no_run_is_good_nothing_is_written(logs, tmp_path):
    called = sccal("diagnose", logs / "three", "--out", tmp_path / "out")
    assert called.code == 3
    assert len(called.failures) == 1
    assert not (tmp_path / "out").exists()


def test_each_vehicle_gets_a_folder(tmp_path):
    written(tmp_path / "logs" / "a", *LIGHT, duration_s=100.0)
    written(tmp_path / "logs" / "b", *LIGHT, "vehicle.name=other robot", duration_s=100.0)
    out = tmp_path / "out"
    called = sccal("diagnose", tmp_path / "logs", "--out", out, "--heading-rate", 5)
    assert (called.code, called.err) == (0, "")
    assert sorted(path.name for path in out.iterdir()) == ["other-robot", "tracked-demo"]
    for name, run, vehicle in (("other-robot", "b", "other robot"), ("tracked-demo", "a", "tracked-demo")):
        document = json.loads((out / name / "diagnosis.json").read_text())
        assert (document["runs"], document["vehicle"]) == ([run], vehicle)
        assert (out / name / "diagnosis.html").is_file()
        assert json.loads((out / name / "model.json").read_text())["vehicle"] == vehicle
        assert str(out / name / "diagnosis.html") in called.out


def test_results_do_not_land_among_the_logs(logs):
    called = sccal("diagnose", logs / "one", "--out", logs)
    assert called.code == 2
    assert not (logs / "diagnosis.json").exists()
