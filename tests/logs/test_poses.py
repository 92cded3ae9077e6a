"""Poses in metres: positions and headings with their signs, what comes before them, and frames that are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sccal.align import align
from sccal.errors import DataError
from sccal.geodesy import TangentPlane
from sccal.logs.messages.poses import on_the_equator
from tests.logs.test_mcap_run import T, message, told
from tests.logs.test_message_kinds import ns, turned, usual
from tests.message_logs import VEHICLE, json_bytes, read_bytes, ros2_bytes

BEND = 0.02
X_M = 3.0 + np.cumsum(0.1 * np.cos(BEND * np.arange(T.size)))
Y_M = -1.0 + np.cumsum(0.1 * np.sin(BEND * np.arange(T.size)))
YAW = BEND * np.arange(T.size)
Y_UP = {"x": np.sqrt(0.5), "y": 0.0, "z": 0.0, "w": np.sqrt(0.5)}


def poses(topic: str = "/mocap/base/pose", kind: str = "PoseStamped", z_m: Any = 0.2, **more: Any) -> list[Any]:
    rows = []
    for i, t in enumerate(T.tolist()):
        place = {"x": float(X_M[i]), "y": float(Y_M[i]), "z": float(np.broadcast_to(z_m, T.shape)[i])}
        pose = {"position": place, "orientation": turned(YAW[i])} | more
        rows.append(
            (topic, kind, ns(t), {"pose": {"pose": pose, "covariance": COVARIANCE} if "With" in kind else pose})
        )
    return rows


COVARIANCE = [0.0] * 36
COVARIANCE[0], COVARIANCE[1], COVARIANCE[7], COVARIANCE[35] = 0.0009, 0.0002, 0.0016, 0.0004


def read(tmp_path: Path, *parts: list[Any], **options: Any) -> Any:
    log = sorted((one for part in parts for one in part), key=lambda one: one[2])
    return read_bytes(tmp_path, json_bytes(log), **options)


def test_positions_are_the_frames_metres(tmp_path: Path) -> None:
    run = read(tmp_path, usual("NavSatFix", "Imu"), poses())
    plane = TangentPlane(float(run.fixes.lat_deg[0]), float(run.fixes.lon_deg[0]))
    east_m, north_m = plane.to_east_north(run.fixes.lat_deg, run.fixes.lon_deg)
    np.testing.assert_allclose(east_m, X_M - X_M[0], atol=1e-6)
    np.testing.assert_allclose(north_m, Y_M - Y_M[0], atol=1e-6)
    np.testing.assert_allclose(run.fixes.host_t_s, T)
    np.testing.assert_allclose(run.fixes.sigma_east_m, 0.02)
    assert "is put at latitude 0, longitude 1" in told(run)


@pytest.mark.parametrize("far_m", [1.0, 1e3, 9e4])
def test_the_frame_on_the_equator_is_exact(far_m: float) -> None:
    angle = np.linspace(0.0, 6.0, 13)
    east_m, north_m = far_m * np.cos(angle), far_m * np.sin(angle)
    lat_deg, lon_deg = on_the_equator(east_m, north_m)
    expected = TangentPlane(0.0, 1.0).to_lat_lon(east_m, north_m)
    np.testing.assert_allclose((lat_deg, lon_deg), expected, atol=1e-11)


@pytest.mark.parametrize(("convention", "sign", "zero"), [("enu", 1.0, 0.0), ("ned", -1.0, 0.5 * np.pi)])
def test_yaw_turns_as_the_path_does(tmp_path: Path, convention: str, sign: float, zero: float) -> None:
    vehicle = VEHICLE + f'\n[ahrs]\nconvention = "{convention}"\n'
    run = read(tmp_path, usual("NavSatFix", "Imu"), poses(), vehicle=vehicle)
    assert np.unwrap(run.heading.yaw_rad) == pytest.approx(zero + sign * YAW)
    path = np.unwrap(np.arctan2(np.diff(Y_M), np.diff(X_M)))
    np.testing.assert_allclose(sign * (np.unwrap(run.heading.yaw_rad) - zero)[1:], path, atol=0.03)


def test_a_run_of_poses_alone_aligns_and_a_mirrored_one_does_not(tmp_path: Path) -> None:
    """The wheels drive the path; where y is mirrored and yaw is not, the path of the fixes contradicts both."""
    half_m = 0.35 * BEND
    wheels = [
        (
            "/joints",
            "JointState",
            ns(t),
            {"name": ["left", "right"], "position": [i * (0.1 - half_m) / 0.08, i * (0.1 + half_m) / 0.08]},
        )
        for i, t in enumerate(T.tolist())
    ]
    aligned = align(read(tmp_path, wheels, poses()))
    assert aligned.fix_t_s.size > 150
    mirrored = poses()
    for row in mirrored:
        row[3]["pose"]["position"]["y"] *= -1.0
    (tmp_path / "mirrored").mkdir()
    with pytest.raises(DataError, match="mirror"):
        align(read(tmp_path / "mirrored", wheels, mirrored))


def test_a_covariance_is_believed(tmp_path: Path) -> None:
    run = read(tmp_path, usual("NavSatFix", "Imu"), poses(kind="PoseWithCovarianceStamped"))
    np.testing.assert_allclose(run.fixes.sigma_east_m, 0.03)
    np.testing.assert_allclose(run.fixes.sigma_north_m, 0.04)
    np.testing.assert_allclose(run.fixes.cov_en_m2, 0.0002)
    np.testing.assert_allclose(run.heading.yaw_sigma_rad, 0.02)


@pytest.mark.parametrize("kind", ["PoseStamped", "PoseWithCovarianceStamped"])
def test_a_log_without_definitions_is_read_too(tmp_path: Path, kind: str) -> None:
    rows = [
        message(topic, f"geometry_msgs/msg/{type_}", ns_ * 1e-9, **values)
        for topic, type_, ns_, values in poses(kind=kind)
    ]
    wheels = [
        message(topic, "sensor_msgs/msg/JointState", at * 1e-9, **v) for topic, k, at, v in usual() if k == "JointState"
    ]
    run = read_bytes(tmp_path, ros2_bytes(sorted(wheels + rows, key=lambda one: one[2])))
    assert run.fixes.lat_deg.size == T.size
    assert np.unwrap(run.heading.yaw_rad) == pytest.approx(YAW)


def test_a_receiver_and_an_imu_come_before_poses_unless_they_are_asked_for(tmp_path: Path) -> None:
    run = read(tmp_path, usual(), poses())
    np.testing.assert_allclose(run.fixes.lat_deg[:2], [52.0, 52.000002])
    assert run.heading.yaw_rad == pytest.approx(0.01 * np.arange(T.size))
    assert "other topics for the fixes not read: /mocap/base/pose; --fix-topic chooses" in told(run)
    topic = "/mocap/base/pose"
    run = read(tmp_path, usual(), poses(), fix_topic=topic, heading_topic=topic)
    assert abs(run.fixes.lat_deg[0]) < 1e-9
    assert np.unwrap(run.heading.yaw_rad) == pytest.approx(YAW)


@pytest.mark.parametrize("topic", ["/goal_pose", "/initialpose", "/robot_pose_ekf/pose", "/amcl_pose", "/odom_pose"])
def test_wishes_and_filters_are_no_measurement_unless_they_are_asked_for(tmp_path: Path, topic: str) -> None:
    with pytest.raises(DataError, match=rf"taken with --fix-topic \({topic}\)"):
        read(tmp_path, usual("NavSatFix"), poses(topic))
    run = read(tmp_path, usual("NavSatFix"), poses(topic), fix_topic=topic)
    assert run.fixes.lat_deg.size == T.size


def test_two_bodies_are_to_be_chosen_from(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"2 topics may be the fixes: .*choose one with --fix-topic"):
        read(tmp_path, usual("NavSatFix"), poses("/mocap/base"), poses("/mocap/wand"))


def test_poses_without_orientation_are_positions_only(tmp_path: Path) -> None:
    still = poses(orientation=turned(0.0))
    assert read(tmp_path, usual("NavSatFix"), still).fixes.lat_deg.size == T.size
    with pytest.raises(DataError, match="no topic holds the heading"):
        read(tmp_path, usual("NavSatFix", "Imu"), still)


def test_a_frame_with_y_up_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"leans by 90 degrees .*z up \(not y\)"):
        read(tmp_path, usual("NavSatFix"), poses(orientation=Y_UP))
    flat = poses(z_m=Y_M, orientation=turned(0.0))
    for row in flat:
        row[3]["pose"]["position"]["y"] = 0.1
    with pytest.raises(DataError, match=r"0\.00 m in y, .* so z is not up"):
        read(tmp_path, usual("NavSatFix"), flat)


def test_poses_that_are_none_are_dropped_and_counted(tmp_path: Path) -> None:
    rows = poses()
    rows[5][3]["pose"]["position"]["x"] = 1e9
    run = read(tmp_path, usual("NavSatFix"), rows)
    assert run.fixes.lat_deg.size == T.size - 1
    assert "1 poses more than 100 km from the first one dropped (first at message 6)" in told(run)
