"""Parameters of robot_localization's ekf_node and navsat_transform_node, as YAML; radians and metres.

navsat_transform turns fixes into the EKF's world frame by one rotation that it takes from one IMU message
(src/navsat_transform.cpp, computeTransform, in github.com/cra-ros-pkg/robot_localization):

    heading = imu_yaw + magnetic_declination_radians + yaw_offset (+ meridian convergence of UTM)
    world from map grid = R(odometry_yaw) R(heading)⁻¹

and ``heading`` must be 0 facing east, counter-clockwise positive. sccal's heading offset is what the AHRS reads, turned
into enu, minus the robot's heading, so that yaw_offset is minus the offset. Both parameters are only ever added, and
the offset found holds the declination of a magnetic AHRS already: all of it stands in yaw_offset, the declination is 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from sccal import __version__
from sccal.export.estimates import usable, why_not, with_sigma
from sccal.export.result import Result
from sccal.export.ros2_control import ros_double
from sccal.logs.names import VEHICLE_FILE
from sccal.results.calibration import Estimate

_EKF = """\
# Topics and frames are placeholders. Node names must be those of your launch file.
ekf_filter_node:
  ros__parameters:
    frequency: 30.0
    two_d_mode: true
    map_frame: map
    odom_frame: odom
    base_link_frame: base_link  # the middle between the wheels, x forward, y left
    world_frame: map  # another node must give odom -> base_link; if none does: odom
    # Each config: x, y, z, roll, pitch, yaw, their six velocities, three accelerations.
    odom0: diff_drive_controller/odom  # calibrate it first: sccal export ros2_control
    odom0_config: [false, false, false, false, false, false,
                   true, true, false, false, false, true, false, false, false]
    odom1: odometry/gps  # from navsat_transform
    odom1_config: [true, true, false, false, false, false,
                   false, false, false, false, false, false, false, false, false]
    odom1_differential: false
    imu0: imu/data
    # Yaw goes in as the AHRS reads it: map is then turned against east by the heading offset, and so are the fixes,
    # by yaw_offset below. Do not correct the yaw in the driver as well.
    imu0_config: [false, false, false, false, false, true,
                  false, false, false, false, false, true, false, false, false]
    imu0_differential: false
    imu0_relative: false
"""


def write_robot_localization(result: Result) -> str:
    """A snippet for both nodes, and the antenna's static transform as a comment."""
    return "\n".join(
        [
            f"# {result.subject}",
            f"# {result.verdict}",
            f"# Written by sccal {__version__}.",
            *(f"# {line}" for line in _antenna(result.effects.get("lever_arm"))),
            _EKF.rstrip("\n"),
            "navsat_transform_node:",
            "  ros__parameters:",
            "    frequency: 30.0",
            "    delay: 3.0  # s; the heading is taken from one IMU message after this: stand still",
            "    # Heading used = imu yaw + magnetic_declination_radians + yaw_offset, counter-clockwise from east.",
            f'    # The IMU message must be enu, as ROS asks: where {VEHICLE_FILE} says convention = "ned", or the',
            "    # heading is a receiver's (HDT and the like), the driver has to publish 90 deg - yaw.",
            *_offset(result.parameters["heading_offset_deg"]),
            "    zero_altitude: true",
            "    publish_filtered_gps: true",
            "    use_odometry_yaw: false",
            "    wait_for_datum: false",
            "",
        ]
    )


def _offset(offset: Estimate) -> list[str]:
    if not usable(offset):
        return [
            "    magnetic_declination_radians: 0.0  # of a magnetic AHRS: minus what maps give, which is positive east",
            f"    yaw_offset: 0.0  # no value from this data: {why_not(offset)}",
        ]
    return [
        "    # The offset found holds the declination already (if the AHRS is magnetic): no further one may be added.",
        "    magnetic_declination_radians: 0.0",
        f"    # Minus the heading offset of {with_sigma(offset, 'deg')} (reading minus heading, counter-clockwise).",
        f"    yaw_offset: {ros_double(-math.radians(offset.value))}  # rad",
    ]


def _antenna(lever_arm: Mapping[str, Estimate] | None) -> list[str]:
    if lever_arm is None:
        return ["The antenna's place was not estimated; give base_link -> gps by your own static transform."]
    said, shift = [], {}
    for axis, key, what in (("x", "forward_m", "forward"), ("y", "left_m", "left")):
        known = usable(lever_arm[key])
        said.append(f"{what} {with_sigma(lever_arm[key], 'm') if known else f'0, {why_not(lever_arm[key])}'}")
        shift[axis] = lever_arm[key].value if known else 0.0
    return [
        f"Antenna: {'; '.join(said)}. Its height is not estimated. The fixes' frame_id must be gps.",
        f"ros2 run tf2_ros static_transform_publisher --x {ros_double(shift['x'], 4)} --y {ros_double(shift['y'], 4)} "
        "--z 0.0 --frame-id base_link --child-frame-id gps",
    ]
