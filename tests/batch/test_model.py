"""``sccal calibrate --model``: the model that a diagnosis judged is the one that is calibrated, and judged alike."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from sccal.calibration.judged_model import read_judged_model
from sccal.effects.catalogue import CATALOGUE, parse_effect
from sccal.results.calibration import Estimate
from sccal.results.converter import document_of, json_text
from sccal.results.model import JudgedEffect
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run
from tests.runs import SMALL
from tests.test_cli_inputs import sccal, strict_json

ALIKE = 0.05


def simulated(folder: Path, *effects: str, duration_s: float, seed: int, settings: tuple[str, ...] = ()) -> Path:
    chosen = settings_from([f"drive.duration_s={duration_s}", *SMALL, *settings], seed)
    physics = [effect.physics(values) for effect, values in map(parse_effect, effects)]
    write_run(simulate_run(chosen, physics), folder)
    write_vehicle_file(chosen, folder)
    return folder


def both(tmp: Path) -> tuple[dict, dict]:
    """The diagnosis of tmp/logs, and the vehicle as its model calibrates it."""
    called = sccal("diagnose", tmp / "logs", "--out", tmp / "found")
    assert (called.code, called.err) == (0, "")
    model = tmp / "found" / "model.json"
    assert f"next: sccal calibrate {tmp / 'logs'} --model {model}" in called.out
    called = sccal("calibrate", tmp / "logs", "--model", model, "--out", tmp / "out", "--jobs", 1)
    assert (called.code, called.err) == (0, "")
    assert "drift after 30 s without fixes, held out: " in called.out
    return strict_json(tmp / "found" / "diagnosis.json"), strict_json(tmp / "out" / "vehicle.json")


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    tmp = tmp_path_factory.mktemp("one")
    simulated(tmp / "logs" / "a", "lever_arm=0.4,-0.2", "turn_slip=0.2", duration_s=300.0, seed=4)
    return tmp, *both(tmp)


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    tmp = tmp_path_factory.mktemp("three")
    for seed in (1, 2, 3):
        simulated(tmp / "logs" / f"r{seed}", "lever_arm=0.4,-0.2", duration_s=150.0, seed=seed)
    return tmp, *both(tmp)


@pytest.mark.parametrize("case", ["one", pytest.param("three", marks=pytest.mark.slow)])
def test_both_commands_judge_the_same_drift(case, request):
    _, diagnosis, vehicle = request.getfixturevalue(case)
    found = [finding["effect"] for finding in diagnosis["findings"]]
    assert "lever_arm" in found
    for key in ("outage_rms_m", "outage_end_rms_m"):
        assert vehicle["held_out"][key] == pytest.approx(diagnosis["after"][key], rel=ALIKE)
    assert vehicle["held_out"]["how"] == diagnosis["held_out"]["how"]
    assert diagnosis["after"]["outage_end_rms_m"] < 0.5 * diagnosis["before"]["outage_end_rms_m"]
    arm = vehicle["effects"]["lever_arm"]
    for name, truth in (("forward_m", 0.4), ("left_m", -0.2)):
        assert arm[name]["value"] == pytest.approx(truth, abs=4.0 * arm[name]["sigma"] + 0.002)


def test_a_run_of_one_tells_the_drift_itself(one):
    tmp, _, vehicle = one
    assert strict_json(tmp / "out" / "a" / "calibration.json")["held_out"] == vehicle["held_out"]


def test_runs_without_effects_are_judged_by_each_other_too(three):
    tmp, diagnosis, _ = three
    gates = ("--gate", "vehicle:held_out.outage_end_rms_m<0.01", "--gate", "held_out.outage_end_rms_m>0")
    called = sccal("calibrate", tmp / "logs", "--out", tmp / "bare", "--jobs", 1, *gates)
    assert called.code == 1
    vehicle = strict_json(tmp / "bare" / "vehicle.json")
    for key in ("outage_rms_m", "outage_end_rms_m"):
        assert vehicle["held_out"][key] == pytest.approx(diagnosis["before"][key], rel=ALIKE)
    assert vehicle["held_out"]["how"].startswith("each of 3 runs judged by")
    assert called.out.count("held_out.outage_end_rms_m") >= 1


def test_the_model_is_part_of_what_a_result_is_made_from(one):
    tmp, _, _ = one
    model = tmp / "found" / "model.json"
    provenance = strict_json(tmp / "out" / "a" / "calibration.json")["provenance"]
    assert len(provenance["options"]["model"]) == 64
    again = sccal("calibrate", tmp / "logs", "--model", model, "--out", tmp / "out", "--resume")
    assert "1 of 1 results stood already" in again.out
    other = tmp / "other.json"
    read = read_judged_model(model)
    noises = {run: replace(noise, fix_scale=1.1 * noise.fix_scale) for run, noise in read.noises.items()}
    other.write_text(json_text(document_of(replace(read, noises=noises))))
    again = sccal("calibrate", tmp / "logs", "--model", other, "--out", tmp / "out2", "--resume")
    assert again.code == 0
    again = sccal("calibrate", tmp / "logs", "--model", model, "--out", tmp / "out2", "--resume")
    assert "stood already" not in again.out


def test_effects_beside_the_model_are_added(one):
    tmp, _, _ = one
    model = tmp / "found" / "model.json"
    called = sccal("calibrate", tmp / "logs", "--model", model, "--effects", "slope,lever_arm", "--out", tmp / "more")
    assert called.code == 0
    assert {"lever_arm", "turn_slip", "slope"} <= set(strict_json(tmp / "more" / "vehicle.json")["effects"])


def with_effect(model: Path, folder: Path, run: str) -> Path:
    """The same model with a jump of the heading in one run alone."""
    step = CATALOGUE["heading_step"]
    effect = JudgedEffect(
        "heading_step",
        step.title,
        {"deg": Estimate(0.0, 1.0, "estimated")},
        {one.name: one.unit for one in step.parameters},
        {"at_s": 80.0},
        run,
    )
    read = read_judged_model(model)
    path = folder / "with-step.json"
    path.write_text(json_text(document_of(replace(read, effects=(effect, *read.effects)))))
    return path


@pytest.mark.parametrize("run", ["r1", "r3"])
def test_an_effect_of_one_run_is_estimated_there_alone(three, tmp_path, run):
    tmp, _, vehicle = three
    model = with_effect(tmp / "found" / "model.json", tmp_path, run)
    called = sccal("calibrate", tmp / "logs", "--model", model, "--out", tmp_path / "out", "--jobs", 1)
    assert (called.code, called.err) == (0, "")
    for name in ("r1", "r2", "r3"):
        effects = strict_json(tmp_path / "out" / name / "calibration.json")["effects"]
        assert ("heading_step" in effects) is (name == run)
    found = strict_json(tmp_path / "out" / "vehicle.json")
    assert "heading_step" not in found["effects"]
    arm, before = found["effects"]["lever_arm"], vehicle["effects"]["lever_arm"]
    assert arm["left_m"]["value"] == pytest.approx(before["left_m"]["value"], abs=0.005)
    assert found["held_out"]["outage_end_rms_m"] == pytest.approx(vehicle["held_out"]["outage_end_rms_m"], rel=0.5)


def test_a_model_of_another_vehicle(one, tmp_path):
    tmp, _, _ = one
    model = tmp / "found" / "model.json"
    simulated(tmp_path / "renamed", duration_s=100.0, seed=4, settings=("vehicle.name=the old one",))
    called = sccal("calibrate", tmp_path / "renamed", "--model", model, "--out", tmp_path / "a")
    assert called.code == 0
    (notice,) = [
        one for one in strict_json(next((tmp_path / "a").glob("*/calibration.json")))["notices"]
        if one["source"] == "model"
    ]  # fmt: skip
    assert "'tracked-demo'" in notice["text"]
    assert "'the old one'" in notice["text"]
    other = ("vehicle.name=wide one", "vehicle.nominal_track_m=1.4")
    simulated(tmp_path / "wide", duration_s=100.0, seed=4, settings=other)
    called = sccal("calibrate", tmp_path / "wide", "--model", model, "--out", tmp_path / "b")
    assert called.code == 2
    assert "'tracked-demo'" in called.failures[0]
    assert "'wide one'" in called.failures[0]


def test_a_model_that_cannot_be_read_is_told_before_any_run(one, tmp_path):
    tmp, _, _ = one
    missing = sccal("calibrate", tmp / "logs", "--model", tmp_path / "none.json", "--out", tmp_path / "out")
    assert (missing.code, len(missing.failures)) == (2, 1)
    broken = tmp_path / "model.json"
    broken.write_text(json.dumps({"schema": "sccal.model/1"}))
    wrong = sccal("calibrate", tmp / "logs", "--model", broken, "--out", tmp_path / "out")
    assert (wrong.code, len(wrong.failures)) == (3, 1)
    assert str(broken) in wrong.failures[0]
    assert not (tmp_path / "out").exists()


def test_a_model_is_exported_as_a_vehicle_is(one):
    tmp, _, _ = one
    model = tmp / "found" / "model.json"
    for name, words in (
        ("ros2_control", "left_wheel_radius_multiplier"),
        ("ardupilot", "GPS1_POS_X,0.4"),
        ("robot_localization", "--x 0.4"),
    ):
        called = sccal("export", name, model)
        assert called.code == 0
        assert words in called.out
        assert sccal("export", name, model.parent).out == called.out
    path = sccal("export", "gpx", model)
    assert path.code == 2
