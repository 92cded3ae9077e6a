"""Formats of parameters: what was estimated is in force, what was not is left alone and said."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

from sccal.export.ardupilot import write_ardupilot
from sccal.export.catalogue import FORMATS, format_named, left_out
from sccal.export.result import Result
from sccal.export.robot_localization import write_robot_localization
from sccal.export.ros2_control import write_ros2_control
from sccal.results.calibration import Estimate


def loaded(text):
    """Name to value, as pymavlink's mavparm.py loads a file: lines of # are comments, and any other has two words."""
    lines = [line.strip() for line in text.splitlines()]
    pairs = [line.replace(",", " ").split() for line in lines if line and not line.startswith("#")]
    assert all(len(pair) == 2 for pair in pairs)
    return {name: float(value) for name, value in pairs}


def altered(result: Result, key: str, **block) -> Result:
    """With one parameter, or ``effect/parameter``, told otherwise."""
    block = {name: math.nan if value is None else value for name, value in block.items()}
    if "/" in key:
        effect, name = key.split("/")
        named = result.effects[effect]
        return replace(result, effects={**result.effects, effect: {**named, name: replace(named[name], **block)}})
    return replace(result, parameters={**result.parameters, key: replace(result.parameters[key], **block)})


UNSEEN = {"status": "unobserved", "reason": "drive turns"}


def test_ros2_control_is_the_runs_own_file(enu_robot, ned_robot, straight_robot):
    for robot in (enu_robot, ned_robot, straight_robot):
        assert write_ros2_control(robot.exported).encode() == (robot.results / "ros2_control.yaml").read_bytes()


def test_ros2_control_of_a_line_keeps_the_track(straight_robot):
    assert straight_robot.exported.parameters["track_m"].status == "unobserved"
    text = write_ros2_control(straight_robot.exported)
    assert yaml.safe_load(text)["diff_drive_controller"]["ros__parameters"]["wheel_separation_multiplier"] == 1.0
    assert re.search(r"wheel_separation_multiplier: 1\.0  # not observed in this data: \w", text)
    assert any(
        "track_m is not set: not observed" in line
        for line in left_out(FORMATS["ros2_control"], straight_robot.exported)
    )


def test_ardupilot_turns_y_to_the_right(enu_robot):
    truth = enu_robot.simulated.settings
    found = loaded(write_ardupilot(enu_robot.exported))
    assert set(found) == {"WENC_RADIUS", "WENC2_RADIUS", "WENC_POS_Y", "WENC2_POS_Y", "GPS1_POS_X", "GPS1_POS_Y"}
    assert truth.vehicle.radius_left_m != truth.vehicle.radius_right_m
    assert found["WENC_RADIUS"] == pytest.approx(truth.vehicle.radius_left_m, rel=2e-3)
    assert found["WENC2_RADIUS"] == pytest.approx(truth.vehicle.radius_right_m, rel=2e-3)
    assert found["WENC_POS_Y"] == pytest.approx(-truth.vehicle.track_m / 2, rel=0.02)
    assert found["WENC2_POS_Y"] == pytest.approx(truth.vehicle.track_m / 2, rel=0.02)
    assert found["GPS1_POS_X"] == pytest.approx(0.4, abs=0.05)
    assert found["GPS1_POS_Y"] == pytest.approx(0.25, abs=0.05)


def test_ardupilot_wheels_turn_the_body_as_the_positions_say(enu_robot):
    """A wheel at y to the right, of a body that turns clockwise by ψ, travels s - ψ y forward: left is negative."""
    found = loaded(write_ardupilot(enu_robot.exported))
    motion, angle = enu_robot.simulated.motion, enu_robot.simulated.wheel_angle_rad
    left, right = angle.left[-1] - angle.left[0], angle.right[-1] - angle.right[0]
    travel = (found["WENC_RADIUS"] * left, found["WENC2_RADIUS"] * right)
    clockwise = (travel[1] - travel[0]) / (found["WENC_POS_Y"] - found["WENC2_POS_Y"])
    true_clockwise = -(motion.yaw_rad[-1] - motion.yaw_rad[0])
    assert abs(true_clockwise) > 0.5
    assert clockwise == pytest.approx(true_clockwise, abs=0.2)


def test_ardupilot_tells_what_to_add_to_a_clockwise_heading(enu_robot):
    """ArduPilot adds its declination to the compass heading (AP_Compass::calculate_heading)."""
    text = write_ardupilot(enu_robot.exported)
    assert "COMPASS_DEC" not in loaded(text)
    add_rad = float(re.search(r"clockwise reading is ([-+]\d\.\d+) rad", text)[1])
    true_yaw = enu_robot.simulated.motion.at(enu_robot.simulated.ahrs.true_t_s).yaw_rad
    reading, truth = np.pi / 2 - enu_robot.yaw_enu_rad, np.pi / 2 - true_yaw
    assert abs(np.angle(np.mean(np.exp(1j * (reading + add_rad - truth))))) < np.radians(1.5)


@pytest.mark.parametrize(
    ("key", "names"),
    [
        ("radius_left_m", {"WENC_RADIUS"}),
        ("radius_right_m", {"WENC2_RADIUS"}),
        ("track_m", {"WENC_POS_Y", "WENC2_POS_Y"}),
        ("lever_arm/left_m", {"GPS1_POS_Y"}),
        ("lever_arm/forward_m", {"GPS1_POS_X"}),
        ("heading_offset_deg", set()),
    ],
)
@pytest.mark.parametrize("status", ["unobserved", "held", "at_bound"])
def test_ardupilot_leaves_alone_what_was_not_estimated(enu_robot, key, names, status):
    before = loaded(write_ardupilot(enu_robot.exported))
    result = altered(enu_robot.exported, key, status=status, reason="drive\nWENC_RADIUS,9")
    text = write_ardupilot(result)
    assert loaded(text) == {name: value for name, value in before.items() if name not in names}
    assert "drive WENC_RADIUS,9" in text
    (told,) = left_out(FORMATS["ardupilot"], result)
    assert key.split("/")[-1] in told


@pytest.mark.parametrize(
    ("age", "says", "set_ms"),
    [
        ({"value": 0.1234, "sigma": 0.02}, "age of the fixes 0.123 +/- 0.020 s", 123),
        ({"value": 0.011, "sigma": 0.02}, "may as well be zero", None),
        ({"value": 0.4, "sigma": 0.02}, "it holds 1 to 250 ms", None),
        ({"value": -0.1, "sigma": 0.02}, "it holds 1 to 250 ms", None),
        ({"value": 0.1, "sigma": 0.2, **UNSEEN}, "left as it is: not observed in this data: drive turns", None),
    ],
)
def test_ardupilot_takes_an_age_of_the_fixes_that_is_sure(enu_robot, age, says, set_ms):
    latency = {"s": Estimate(**{"status": "estimated", **age})}
    result = enu_robot.exported
    text = write_ardupilot(replace(result, effects={**result.effects, "gnss_latency": latency}))
    assert says in text
    assert loaded(text).get("GPS1_DELAY_MS") == set_ms


def test_robot_localization_makes_up_no_offset(enu_robot):
    result = altered(enu_robot.exported, "heading_offset_deg", **UNSEEN)
    text = write_robot_localization(result)
    assert yaml.safe_load(text)["navsat_transform_node"]["ros__parameters"]["yaw_offset"] == 0.0
    assert "no value from this data: not observed in this data: drive turns" in text
    (told,) = left_out(FORMATS["robot_localization"], result)
    assert told == "heading_offset_deg is not set: not observed in this data: drive turns"


def test_robot_localization_keeps_the_half_of_an_antenna_that_is_known(enu_robot):
    text = write_robot_localization(altered(enu_robot.exported, "lever_arm/left_m", **UNSEEN))
    assert re.search(r"--x 0\.\d+ --y 0\.0 --z", text)
    assert "left 0, not observed in this data: drive turns" in text


def test_null_is_no_value(enu_robot):
    for key in ("track_m", "heading_offset_deg"):
        result = altered(enu_robot.exported, key, value=None, sigma=None)
        assert "nan" not in write_ardupilot(result) + write_ros2_control(result) + write_robot_localization(result)


def test_what_no_format_holds_is_told(enu_robot):
    (told,) = left_out(FORMATS["ros2_control"], enu_robot.exported)
    assert told == "lever_arm was estimated too and is not written in this format"
    assert left_out(FORMATS["ardupilot"], enu_robot.exported) == []
    assert left_out(FORMATS["gpx"], enu_robot.exported) == []


def test_a_doubtful_result_is_told(enu_robot):
    told = left_out(format_named("gpx"), replace(enu_robot.exported, verdict="doubtful: no fixes"))
    assert told == ["the result is doubtful: no fixes"]
