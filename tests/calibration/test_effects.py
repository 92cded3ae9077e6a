"""Effects injected exactly into raw streams, and estimated by the filter with its columns."""

from __future__ import annotations

import json

import pytest

from sccal.calibration.combine import combine
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.effects.catalogue import CATALOGUE, parse_effect
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run
from tests.calibration.test_single import GIVEN
from tests.effects.test_catalogue import SIZES
from tests.runs import read

FREE = sorted(name for name, effect in CATALOGUE.items() if effect.search == "none")
RATES = (
    "encoder.rate_hz=50",
    "ahrs.rate_hz=20",
    "ahrs.tilt_sigma_deg=0",
    "gnss.receive_delay_s=0",
    "gnss.receive_jitter_s=0",
)
"""Lines arrive at once: what they take to arrive would be part of the latency, and of all that is like it."""


def injected(folder, *texts, path="general", duration_s=300, seed=4, settings=()):
    effects = [parse_effect(text) for text in texts]
    chosen = settings_from([f"drive.path={path}", f"drive.duration_s={duration_s}", *RATES, *settings], seed)
    write_run(simulate_run(chosen, [effect.physics(values) for effect, values in effects]), folder)
    write_vehicle_file(chosen, folder)
    return folder


def written_as(name):
    return f"{name}={','.join(str(v) for v in SIZES[name])}"


@pytest.mark.parametrize("name", FREE)
def test_what_is_injected_is_estimated(tmp_path, name):
    """Under the noise that the log has, which other tests estimate."""
    folder = injected(tmp_path, written_as(name), duration_s=600 if name == "clock_skew" else 300)
    calibration, _ = calibrate_run(read(folder), CalibrationOptions(effects=(name,), noise=GIVEN))
    for parameter, truth in zip(CATALOGUE[name].parameters, SIZES[name], strict=True):
        found = calibration.effects[name][parameter.name]
        assert abs(found.value - truth) < 3.5 * found.sigma, (parameter.name, found.value, found.sigma)
    true = json.loads((folder / "truth.json").read_text())["parameters"]
    p = calibration.parameters
    for one, value in (
        (p.radius_right_m, true["radius_right_m"]),
        (p.radius_left_m, true["radius_left_m"]),
        (p.track_m, true["track_m"]),
    ):
        assert abs(one.value - value) < 4 * one.sigma


def test_an_effect_that_is_not_there_comes_out_as_nothing(tmp_path):
    folder = injected(tmp_path)
    calibration, _ = calibrate_run(read(folder), CalibrationOptions(effects=("lever_arm", "turn_slip"), noise=GIVEN))
    for name in ("lever_arm", "turn_slip"):
        for found in calibration.effects[name].values():
            assert abs(found.value) < 3.5 * found.sigma
            assert found.status == "estimated"


def test_two_effects_at_once(tmp_path):
    """And their noise with them, which a log with an unknown arm hides."""
    folder = injected(tmp_path, "lever_arm=0.3,-0.1", "turn_slip=0.2", duration_s=150)
    calibration, _ = calibrate_run(read(folder), CalibrationOptions(effects=("lever_arm", "turn_slip")))
    arm, slip = calibration.effects["lever_arm"], calibration.effects["turn_slip"]
    for found, truth in ((arm["forward_m"], 0.3), (arm["left_m"], -0.1), (slip["per_radps"], 0.2)):
        assert abs(found.value - truth) < 3.5 * found.sigma


def test_what_the_drive_does_not_show_is_unobserved(tmp_path):
    folder = injected(tmp_path, path="straight", duration_s=200)
    calibration, _ = calibrate_run(read(folder), CalibrationOptions(effects=("lever_arm", "turn_slip"), noise=GIVEN))
    slip = calibration.effects["turn_slip"]["per_radps"]
    assert slip.status == "unobserved"
    assert CATALOGUE["turn_slip"].excited_by in slip.reason


def test_runs_share_the_lever_arm_but_not_their_latency(tmp_path):
    pairs = []
    options = CalibrationOptions(effects=("lever_arm", "gnss_latency"), noise=GIVEN)
    for k, latency in enumerate((0.15, 0.02)):
        folder = injected(tmp_path / str(k), "lever_arm=0.3,-0.1", f"gnss_latency={latency}", duration_s=150, seed=k)
        pairs.append(calibrate_run(read(folder), options))
    vehicle = combine([run for run, _ in pairs], [problem for _, problem in pairs])
    arm = vehicle.effects["lever_arm"]
    assert set(vehicle.effects) == {"lever_arm"}
    for found, truth in ((arm["forward_m"], 0.3), (arm["left_m"], -0.1)):
        assert abs(found.value - truth) < 3.5 * found.sigma
        assert found.sigma < 0.05
    for (run, _), truth in zip(pairs, (0.15, 0.02), strict=True):
        latency = run.effects["gnss_latency"]["s"]
        assert abs(latency.value - truth) < 3.5 * latency.sigma
