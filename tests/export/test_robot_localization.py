"""The snippet, put through the formula of robot_localization's own node.

src/navsat_transform.cpp (computeTransform, getRobotOriginCartesianPose, cartesianToMap), branch ros2:
``imu_yaw += magnetic_declination_ + yaw_offset_ + utm_meridian_convergence_`` (0 for a local cartesian grid),
``cartesian_world_transform_ = world_pose * pose(fix - R(imu_yaw) antenna, imu_yaw)⁻¹``. Poses are complex numbers here.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
import yaml

from sccal.export.robot_localization import write_robot_localization
from sccal.geodesy import TangentPlane


def parameters_of(text):
    return yaml.safe_load(text)["navsat_transform_node"]["ros__parameters"]


def antenna_of(text):
    found = re.search(r"static_transform_publisher --x (\S+) --y (\S+) --z 0.0 --frame-id base_link", text)
    return complex(float(found[1]), float(found[2])) if found else 0j


def fixes_in_world(fixes, world_yaw_rad, imu_yaw_rad, parameters, antenna):
    """The node's odometry/gps: fixes of the grid in the world frame, whose origin is the robot at the first fix."""
    heading = imu_yaw_rad + parameters["magnetic_declination_radians"] + parameters["yaw_offset"]
    origin = fixes[0] - np.exp(1j * heading) * antenna
    return np.exp(1j * (world_yaw_rad - heading)) * (fixes - origin)


def drive(robot):
    """Fixes (n,) in a local cartesian grid, AHRS yaw in enu (n,), and the body's steps between (n - 1,), true."""
    simulated = robot.simulated
    log = simulated.gnss
    east, north = TangentPlane(log.lat_deg[0], log.lon_deg[0], 800.0).to_east_north(log.lat_deg, log.lon_deg)
    yaw = np.interp(log.true_t_s, simulated.ahrs.true_t_s, np.unwrap(robot.yaw_enu_rad))
    state = simulated.motion.at(log.true_t_s)
    position = state.east_m + 1j * state.north_m
    return east + 1j * north, yaw, np.diff(position) * np.exp(-1j * state.yaw_rad[:-1])


def turned_deg(of, against):
    """The one angle by which a path, seen from its middle, is turned against another."""
    return np.degrees(np.angle(np.vdot(against - against.mean(), of - of.mean())))


def disagreement_deg(robot, parameters, antenna, fused_yaw):
    """Between the node's fixes and the odometry, with the AHRS yaw fused as it reads, or yaw from zero on."""
    fixes, yaw, steps = drive(robot)
    world_yaw = yaw if fused_yaw else yaw - yaw[0]
    odometry = np.concatenate(([0.0], np.cumsum(steps * np.exp(1j * world_yaw[:-1]))))
    seen = fixes_in_world(fixes, world_yaw[0], yaw[0], parameters, antenna)
    return abs(turned_deg(seen, odometry))


@pytest.mark.parametrize("fused_yaw", [True, False])
@pytest.mark.parametrize("name", ["enu_robot", "ned_robot"])
def test_fixes_and_odometry_agree_in_direction(name, fused_yaw, request):
    robot = request.getfixturevalue(name)
    text = write_robot_localization(robot.exported)
    parameters, antenna = parameters_of(text), antenna_of(text)
    assert disagreement_deg(robot, parameters, antenna, fused_yaw) < 2.0
    flipped = parameters | {"yaw_offset": -parameters["yaw_offset"]}
    assert disagreement_deg(robot, flipped, antenna, fused_yaw) > 35.0
    assert disagreement_deg(robot, parameters | {"yaw_offset": 0.0}, antenna, fused_yaw) > 19.0


def test_yaw_offset_is_minus_the_truth(enu_robot, ned_robot):
    for robot, truth_deg in ((enu_robot, -23.5), (ned_robot, 160.0)):
        parameters = parameters_of(write_robot_localization(robot.exported))
        assert np.degrees(parameters["yaw_offset"]) == pytest.approx(-truth_deg, abs=1.5)
        assert parameters["magnetic_declination_radians"] == 0.0


def test_the_antennas_transform_leads_from_the_robot_to_its_antenna(enu_robot):
    text = write_robot_localization(enu_robot.exported)
    antenna = antenna_of(text)
    fixes, yaw, _ = drive(enu_robot)
    heading = yaw + parameters_of(text)["yaw_offset"]
    state = enu_robot.simulated.motion.at(enu_robot.simulated.gnss.true_t_s)
    truth = state.east_m + 1j * state.north_m

    def off_m(place):
        apart = fixes - np.exp(1j * heading) * place - truth
        return np.sqrt(np.mean(np.abs(apart - apart.mean()) ** 2))

    assert off_m(antenna) < 0.05
    assert off_m(antenna.conjugate()) > 0.2
    assert off_m(-antenna.conjugate()) > 0.2
    assert "antenna's place was not estimated" not in text


def test_without_a_lever_arm_no_transform_is_made_up(ned_robot):
    text = write_robot_localization(ned_robot.exported)
    assert "static_transform_publisher" not in text
    assert "The antenna's place was not estimated" in text


def test_every_config_has_fifteen_places_and_fuses_what_it_says(ned_robot):
    ekf = yaml.safe_load(write_robot_localization(ned_robot.exported))["ekf_filter_node"]["ros__parameters"]
    names = ["x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "vroll", "vpitch", "vyaw", "ax", "ay", "az"]
    used = {
        sensor: [name for name, on in zip(names, ekf[f"{sensor}_config"], strict=True) if on]
        for sensor in ("odom0", "odom1", "imu0")
    }
    assert used == {"odom0": ["vx", "vy", "vyaw"], "odom1": ["x", "y"], "imu0": ["yaw", "vyaw"]}
