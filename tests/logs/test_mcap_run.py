"""Streams out of messages: every encoding gives the same run, signs, choices, times and clear errors."""

from __future__ import annotations

import io
import shutil
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer
from numpy.typing import NDArray

from sccal.align import align
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.errors import DataError, UsageError
from sccal.logs.messages.definitions import full_text
from sccal.logs.messages.heading import euler
from sccal.logs.messages.topics import seconds_of
from sccal.logs.messages.write import nanoseconds_of
from sccal.logs.options import ReadOptions
from sccal.logs.quality import quality_of
from sccal.logs.run import discover, read_run
from sccal.logs.streams import Run
from tests.message_logs import (
    VEHICLE,
    Message,
    as_json,
    as_protobuf,
    as_ros1,
    cdr,
    fill,
    json_bytes,
    messages_of,
    proto_classes,
    read_bytes,
    ros1_definition,
    ros2_bytes,
    stamp,
    write_db3,
    write_mcap,
    write_ros1,
)
from tests.runs import written

ROWS = 200
T = 1000.0 + 0.1 * np.arange(ROWS)
JOINTS, IMU, FIX = "sensor_msgs/msg/JointState", "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix"
YAW = 0.01 * np.arange(ROWS)
LEFT, RIGHT = 0.2 * np.arange(ROWS), 0.3 * np.arange(ROWS)


def message(topic: str, kind: str, t: float, header: float | None = None, **values: Any) -> Message:
    head = {} if kind.startswith("std_msgs") else {"header": stamp(t if header is None else header)}
    return topic, kind, round(t * 1e9), cdr(kind, {**head, **values})


def joints(
    topic: str = "/joints", names: tuple[str, ...] = ("left_wheel", "right_wheel"), **columns: Any
) -> list[Message]:
    columns = columns or {"position": np.column_stack((LEFT, RIGHT))}
    rows = {quantity: np.asarray(table).tolist() for quantity, table in columns.items()}
    return [
        message(topic, JOINTS, t, name=list(names), **{quantity: table[i] for quantity, table in rows.items()})
        for i, t in enumerate(T)
    ]


def imus(topic: str = "/imu", yaw: Any = YAW, **values: Any) -> list[Message]:
    half = 0.5 * np.asarray(yaw)
    return [
        message(topic, IMU, t, orientation={"z": float(np.sin(h)), "w": float(np.cos(h))}, **values)
        for t, h in zip(T.tolist(), half.tolist(), strict=True)
    ]


def fixes(topic: str = "/fix", **values: Any) -> list[Message]:
    values = {"status": {"status": 2}, **values}
    return [message(topic, FIX, t, latitude=52 + 1e-6 * i, longitude=5.0, **values) for i, t in enumerate(T.tolist())]


def whole(tmp_path: Path, *more: list[Message], **options: Any) -> Run:
    """A run of joints, orientations and fixes, and what more is given."""
    log = sorted(joints() + imus() + fixes() + [one for part in more for one in part], key=lambda one: one[2])
    return read_bytes(tmp_path, ros2_bytes(log), **options)


def told(run: Run) -> str:
    return "\n".join(map(str, run.notices))


# One run, every encoding


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated run as CSV and NMEA, and in every encoding with the same stamps and values."""
    folder = tmp_path_factory.mktemp("logs")
    written(folder / "csv", duration_s=70.0)
    shutil.move(folder / "csv" / "vehicle.toml", folder / "vehicle.toml")
    run = read_run(discover([folder])[0])
    nmea = (folder / "csv" / "gnss.nmea").read_bytes()
    messages = messages_of(run, nmea)
    (folder / "json.mcap").write_bytes(as_json(messages))
    (folder / "protobuf.mcap").write_bytes(as_protobuf(messages))
    write_mcap(run, folder / "ros2.mcap", nmea)
    write_db3(messages, folder / "bag")
    shutil.copy(next((folder / "bag").glob("*.db3")), folder / "bare.db3")
    positions = messages_of(run, None)
    (folder / "positions.mcap").write_bytes(ros2_bytes(positions))
    write_ros1(positions, folder / "ros1.bag")
    return folder


def read_named(folder: Path, name: str) -> Run:
    return read_run(next(source for source in discover([folder]) if source.name == name))


def require_same(one: Run, other: Run) -> None:
    for of_one, of_other in ((one.wheels, other.wheels), (one.heading, other.heading), (one.fixes, other.fixes)):
        for field in fields(of_one):
            a, b = getattr(of_one, field.name), getattr(of_other, field.name)
            if field.name == "yaw_rad":
                a, b = np.unwrap(a), np.unwrap(b)
            if isinstance(a, np.ndarray):
                np.testing.assert_allclose(b, a, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("name", ["ros2", "json", "protobuf", "bag", "bare"])
def test_every_encoding_gives_the_same_streams(name: str, logs: Path) -> None:
    require_same(read_named(logs, "csv"), read_named(logs, name))


def test_ros1_bags_give_the_same_streams(logs: Path) -> None:
    require_same(read_named(logs, "positions"), read_named(logs, "ros1"))


def test_messages_calibrate_as_the_csv_does(logs: Path) -> None:
    csv, ros2 = (calibrate_run(read_named(logs, name), CalibrationOptions())[0].parameters for name in ("csv", "ros2"))
    for field in fields(csv):
        assert getattr(ros2, field.name).value == pytest.approx(getattr(csv, field.name).value, rel=1e-6)


def test_without_rosbags_the_error_names_the_extra(logs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    for name in ("bag", "bare", "ros1"):
        with pytest.raises(DataError, match=r"pip install 'sccal-robotics\[ros\]'"):
            read_named(logs, name)
    read_named(logs, "ros2")


@pytest.mark.parametrize("name", ["log.db3", "log.bag"])
@pytest.mark.parametrize(
    "content", [b"", b"\0" * 5000, b"SQLite format 3\0" + b"\1" * 5000, b"#ROSBAG V2.0\n" + b"\1" * 99]
)
def test_broken_bags_give_one_line(name: str, content: bytes, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=name) as caught:
        read_bytes(tmp_path, content, name)
    assert "\n" not in str(caught.value)


def test_a_cut_database_is_refused(logs: Path, tmp_path: Path) -> None:
    data = (logs / "bare.db3").read_bytes()
    vehicle = (logs / "vehicle.toml").read_text()
    with pytest.raises(DataError, match=r"log\.db3: cannot be read as a ROS 2 bag"):
        read_bytes(tmp_path, data[: int(0.6 * len(data))], "log.db3", vehicle)


# Finding runs


def test_files_of_messages_are_runs_of_their_own(logs: Path) -> None:
    names = {source.name: source for source in discover([logs])}
    assert set(names) == {"csv", "ros2", "json", "protobuf", "bag", "bare", "positions", "ros1"}
    assert all(source.vehicle_toml == logs / "vehicle.toml" for source in names.values())
    [alone] = discover([logs / "json.mcap"])
    assert (alone.name, alone.path) == ("json", logs / "json.mcap")
    assert alone.vehicle_toml is not None


def test_vehicle_toml_of_a_file_is_the_nearest_up_to_the_path_given(tmp_path: Path) -> None:
    below = tmp_path / "fleet" / "robot" / "day"
    below.mkdir(parents=True)
    data = ros2_bytes(joints() + imus() + fixes())
    (below / "a.mcap").write_bytes(data)
    (below / "b.MCAP").write_bytes(data)
    (tmp_path / "fleet" / "vehicle.toml").write_text(VEHICLE)
    found = discover([tmp_path / "fleet"])
    assert [source.name for source in found] == ["robot/day/a", "robot/day/b"]
    assert found[0].vehicle_toml == tmp_path / "fleet" / "vehicle.toml"
    assert discover([below / "a.mcap"])[0].vehicle_toml is None
    with pytest.raises(DataError, match=r"no vehicle\.toml"):
        read_run(discover([below / "a.mcap"])[0])
    (below.parent / "vehicle.toml").write_text(VEHICLE)
    assert discover([below / "a.mcap"])[0].vehicle_toml == (below.parent / "vehicle.toml").resolve()


# Heading: conventions and signs


def rotated(q: NDArray[np.float64], v: tuple[float, float, float]) -> NDArray[np.float64]:
    """A body vector in the world, by the rotation matrix of a quaternion (x, y, z, w)."""
    x, y, z, w = q / np.linalg.norm(q)
    matrix = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(matrix) @ np.array(v)


quaternions = st.tuples(*[st.floats(-1, 1)] * 4).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.3)


@given(quaternions)
def test_angles_are_where_the_axes_point(q: NDArray[np.float64]) -> None:
    nose, left = rotated(q, (1, 0, 0)), rotated(q, (0, 1, 0))
    yaw, pitch, roll = euler(*(q[:, None]))
    if np.hypot(nose[0], nose[1]) > 1e-3:
        assert np.exp(1j * yaw[0]) == pytest.approx((nose[0] + 1j * nose[1]) / np.hypot(nose[0], nose[1]), abs=1e-6)
        assert np.sin(roll[0]) * np.cos(pitch[0]) == pytest.approx(left[2], abs=1e-6)
    assert np.sin(-pitch[0]) == pytest.approx(nose[2], abs=1e-6)


def test_sccal_s_pitch_is_nose_up_and_roll_left_side_up(tmp_path: Path) -> None:
    q = np.array([0.1, -0.2, 0.3, 0.9])
    nose, left = rotated(q, (1, 0, 0)), rotated(q, (0, 1, 0))
    assert nose[2] > 0 < left[2]
    turn = dict(zip("xyzw", q.tolist(), strict=True))
    log = joints() + fixes() + [message("/imu", IMU, t, orientation=turn) for t in T.tolist()]
    heading = read_bytes(tmp_path, ros2_bytes(log)).heading
    assert heading.pitch_rad is not None
    assert heading.roll_rad is not None
    assert heading.yaw_rad[0] == pytest.approx(np.arctan2(nose[1], nose[0]))
    assert heading.pitch_rad[0] == pytest.approx(np.arcsin(nose[2]))
    assert heading.roll_rad[0] == pytest.approx(np.arcsin(left[2] / np.cos(heading.pitch_rad[0])))
    mirrored = read_bytes(tmp_path, ros2_bytes(log), orientation="ned").heading
    assert mirrored.pitch_rad is not None
    assert mirrored.pitch_rad[0] == pytest.approx(-heading.pitch_rad[0])


@pytest.mark.parametrize("declared", ["enu", "ned"])
def test_an_orientation_is_enu_whatever_the_vehicle_declares(declared: str, logs: Path, tmp_path: Path) -> None:
    vehicle = (logs / "vehicle.toml").read_text().replace('"enu"', f'"{declared}"')
    run = read_bytes(tmp_path, (logs / "ros2.mcap").read_bytes(), vehicle=vehicle)
    assert run.vehicle.convention == declared
    np.testing.assert_allclose(align(run).yaw_rad, align(read_named(logs, "csv")).yaw_rad, atol=1e-9)


def test_a_ned_orientation_is_turned(tmp_path: Path) -> None:
    yaw_ned = 0.3 + 0.01 * np.arange(ROWS)
    log = ros2_bytes(joints() + imus(yaw=yaw_ned) + fixes())
    for declared in ("enu", "ned"):
        run = read_bytes(tmp_path, log, vehicle=VEHICLE + f'[ahrs]\nconvention = "{declared}"\n', orientation="ned")
        wanted = yaw_ned if declared == "ned" else np.pi / 2 - yaw_ned
        np.testing.assert_allclose(np.unwrap(run.heading.yaw_rad), wanted, atol=1e-12)


def test_a_yaw_by_path_is_in_the_vehicle_s_convention(tmp_path: Path) -> None:
    yaws = [message("/compass/yaw_deg", "std_msgs/msg/Float64", t, data=0.5 * i) for i, t in enumerate(T.tolist())]
    run = whole(tmp_path, yaws, yaw="/compass/yaw_deg:data")
    np.testing.assert_allclose(run.heading.yaw_rad, np.radians(0.5 * np.arange(ROWS)))
    assert "read as degrees, enu" in told(run)


def test_messages_without_an_orientation_are_no_heading(tmp_path: Path) -> None:
    absent = {"orientation_covariance": [-1.0] + [0.0] * 8}
    log = joints() + imus("/imu/raw", **absent) + imus("/imu/data") + fixes()
    assert "/imu/raw" not in told(read_bytes(tmp_path, ros2_bytes(log)))
    with pytest.raises(DataError, match=r"no topic holds the heading .* --yaw TOPIC:path"):
        read_bytes(tmp_path, ros2_bytes(joints() + imus("/imu/raw", **absent) + fixes()))
    with pytest.raises(DataError, match=r"/imu/raw: 200 messages without an orientation"):
        read_bytes(tmp_path, ros2_bytes(log), heading_topic="/imu/raw")


def test_yaw_sigmas_and_rates_come_along(tmp_path: Path) -> None:
    values = {"orientation_covariance": [0.04] * 9, "angular_velocity": {"z": 0.7}}
    heading = read_bytes(tmp_path, ros2_bytes(joints() + imus(**values) + fixes())).heading
    assert heading.yaw_sigma_rad == pytest.approx(np.full(ROWS, 0.2))
    assert heading.gyro_z_radps == pytest.approx(np.full(ROWS, 0.7))


def tilted(yaw: float, pitch: float, roll: float) -> NDArray[np.float64]:
    """Quaternion (x, y, z, w) of rotations about z, y' and x''."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(a / 2), np.sin(a / 2)) for a in (yaw, pitch, roll))
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


@pytest.mark.parametrize("levelled_by", ["orientation", "acceleration", "nothing"])
def test_a_magnetometer_is_levelled_with_the_imu(levelled_by: str, tmp_path: Path) -> None:
    field_world = np.array([0.0, 2e-5, -4e-5])
    yaw = 0.3 + 0.02 * np.arange(ROWS)
    log = joints() + fixes()
    for i, t in enumerate(T.tolist()):
        q = tilted(yaw[i], 0.2, -0.1)
        back = np.array([-q[0], -q[1], -q[2], q[3]])
        field = dict(zip("xyz", rotated(back, tuple(field_world)), strict=True))
        log.append(message("/mag", "sensor_msgs/msg/MagneticField", t, magnetic_field=field))
        acceleration = dict(zip("xyz", rotated(back, (0.0, 0.0, 9.81)), strict=True))
        # The IMU has no idea of north: only its tilt may be used.
        turn = dict(zip("xyzw", tilted(1.0, 0.2, -0.1).tolist(), strict=True))
        if levelled_by == "orientation":
            log.append(message("/imu", IMU, t, orientation=turn))
        elif levelled_by == "acceleration":
            absent = [-1.0] + [0.0] * 8
            log.append(message("/imu", IMU, t, orientation_covariance=absent, linear_acceleration=acceleration))
    run = read_bytes(tmp_path, ros2_bytes(log), heading_topic="/mag")
    off = np.abs(np.angle(np.exp(1j * (run.heading.yaw_rad - yaw)))).max()
    if levelled_by == "nothing":
        assert off > 0.1
        assert "not levelled" in told(run)
    else:
        assert off < 1e-9
        assert run.heading.pitch_rad == pytest.approx(np.full(ROWS, -0.2))


# Wheels


def test_wrapped_joint_angles_are_unwrapped(tmp_path: Path) -> None:
    for low in (-np.pi, 0.0):
        position = (np.column_stack((LEFT, -RIGHT)) - low) % (2 * np.pi) + low
        run = read_bytes(tmp_path, ros2_bytes(joints(position=position) + imus() + fixes()))
        np.testing.assert_allclose(run.wheels.left_rad - run.wheels.left_rad[0], LEFT, atol=1e-9)
        np.testing.assert_allclose(run.wheels.right_rad - run.wheels.right_rad[0], -RIGHT, atol=1e-9)
        assert "wrapped wheel angles unwrapped" in told(run)
        assert not run.wheels.loose.any()


def test_velocities_are_integrated_where_there_are_no_positions(tmp_path: Path) -> None:
    speed = np.column_stack((np.sin(T), np.cos(T)))
    run = read_bytes(tmp_path, ros2_bytes(joints(velocity=speed) + imus() + fixes()))
    np.testing.assert_allclose(run.wheels.left_rad, np.cos(T[0]) - np.cos(T), atol=2e-3)
    assert "velocities integrated" in told(run)


def test_joints_that_come_in_messages_of_their_own(tmp_path: Path) -> None:
    left = [message("/joints", JOINTS, t, name=["l"], position=[2 * t]) for t in T.tolist()]
    right = [message("/joints", JOINTS, t + 0.03, name=["r"], position=[3 * t + 0.09]) for t in T.tolist()]
    log = sorted(left + right, key=lambda one: one[2])
    run = read_bytes(tmp_path, ros2_bytes(log + imus() + fixes()), left_joint="l", right_joint="r")
    np.testing.assert_allclose(run.wheels.right_rad, 3 * run.wheels.t_s, atol=1e-6)
    np.testing.assert_allclose(run.wheels.left_rad, 2 * run.wheels.t_s, atol=1e-6)


def test_joints_are_chosen_by_name(tmp_path: Path) -> None:
    names = ("front_left_wheel", "rear_left_wheel", "front_right_wheel", "rear_right_wheel", "left_arm")
    table = np.column_stack((LEFT, LEFT + 1, RIGHT, RIGHT + 1, LEFT))
    log = ros2_bytes(joints(names=names, position=table) + imus() + fixes())
    with pytest.raises(DataError, match=r"front_left_wheel.*choose with --left-joint and --right-joint"):
        read_bytes(tmp_path, log)
    run = read_bytes(tmp_path, log, left_joint="rear_left_wheel", right_joint="rear_right_wheel")
    np.testing.assert_allclose(run.wheels.left_rad, LEFT + 1)
    np.testing.assert_allclose(run.wheels.right_rad, RIGHT + 1)


def test_ticks_by_dotted_path(tmp_path: Path) -> None:
    def rows(wrap: int) -> list[tuple[str, str, int, dict[str, Any]]]:
        found = []
        for i, t in enumerate(T.tolist()):
            left, right = (50_000 + 300 * i) % wrap, (65_000 - 200 * i) % wrap
            values = {"wheels": [{"ticks": left}, {"ticks": right}], "motor_current_a": 0.1 * (i % 7)}
            found.append(("/base", "", round(t * 1e9), values))
            pose = {"yaw_deg": 0.5 * i, "position": {"lat": 52 + 1e-6 * i, "lon": 5.0}}
            found.append(("pose", "my.Pose", round(t * 1e9), pose))
        return found

    options = {
        "left_ticks": "/base:wheels[0].ticks",
        "right_ticks": "base:wheels.1.ticks",
        "yaw": "pose:yaw_deg",
        "latitude": "pose:position.lat",
        "longitude": "pose:position.lon",
    }
    run = read_bytes(tmp_path, json_bytes(rows(1 << 16)), **options)
    turn = 2 * np.pi / 1000
    np.testing.assert_allclose(np.diff(run.wheels.left_rad), 300 * turn)
    np.testing.assert_allclose(np.diff(run.wheels.right_rad), -200 * turn)
    np.testing.assert_allclose(run.heading.yaw_rad, np.radians(0.5 * np.arange(ROWS)))
    np.testing.assert_allclose(run.fixes.lat_deg, 52 + 1e-6 * np.arange(ROWS))
    np.testing.assert_allclose(run.wheels.extras["base.motor_current_a"], 0.1 * (np.arange(ROWS) % 7))
    with pytest.raises(DataError, match=r"--left-ticks: no number wheels\[2\]\.ticks in /base .*motor_current_a"):
        read_bytes(tmp_path, json_bytes(rows(1 << 16)), **{**options, "left_ticks": "/base:wheels[2].ticks"})
    with pytest.raises(DataError, match=r"--yaw: no messages on /compass; the log has /base"):
        read_bytes(tmp_path, json_bytes(rows(1 << 16)), **{**options, "yaw": "/compass:yaw"})
    no_ticks = VEHICLE.replace("ticks_per_rev = 1000", "")
    with pytest.raises(DataError, match="ticks_per_rev"):
        read_bytes(tmp_path, json_bytes(rows(1 << 16)), vehicle=no_ticks, **options)


def test_ticks_of_two_topics(tmp_path: Path) -> None:
    log = imus() + fixes()
    for i, t in enumerate(T.tolist()):
        log.append(message("/left", "std_msgs/msg/Int32", t, data=3 * i))
        log.append(message("/right", "std_msgs/msg/Int32", t + 0.02, data=5 * i))
    run = read_bytes(tmp_path, ros2_bytes(log), left_ticks="/left:data", right_ticks="/right:data")
    turn = 2 * np.pi / 1000
    np.testing.assert_allclose(run.wheels.left_rad, turn * 30 * (run.wheels.t_s - T[0]), atol=1e-6)
    np.testing.assert_allclose(run.wheels.right_rad, turn * 50 * (run.wheels.t_s - T[0] - 0.02), atol=1e-6)


def test_the_twist_of_an_odometry_drives_two_virtual_wheels(tmp_path: Path) -> None:
    twist = {"twist": {"linear": {"x": 0.5}, "angular": {"z": 0.2}}}
    odometry = [message("/odom", "nav_msgs/msg/Odometry", t, twist=twist) for t in T.tolist()]
    run = read_bytes(tmp_path, ros2_bytes(odometry + imus() + fixes()))
    left, right = (0.5 - 0.2 * 0.35) / 0.08, (0.5 + 0.2 * 0.35) / 0.08
    np.testing.assert_allclose(run.wheels.left_rad, left * (T - T[0]), atol=1e-9)
    np.testing.assert_allclose(run.wheels.right_rad, right * (T - T[0]), atol=1e-9)
    assert "0.7 m apart" in told(run)
    both = whole(tmp_path, odometry)
    np.testing.assert_allclose(both.wheels.left_rad, LEFT)
    assert "other topics for the wheels not read: /odom" in told(both)


# Fixes


@pytest.mark.parametrize(
    ("status", "sigma", "quality"),
    [(-1, np.nan, 0), (0, 0.01, 1), (1, 1.0, 2), (2, np.nan, 4), (2, 0.02, 4), (2, 0.4, 5), (np.nan, 0.02, -1)],
)
def test_quality_of_a_status(status: float, sigma: float, quality: int) -> None:
    assert quality_of(np.array([status]), np.array([sigma])).tolist() == [quality]


def test_covariances_are_east_and_north(tmp_path: Path) -> None:
    covariance = [0.04, 0.003, 0, 0.003, 0.01, 0, 0, 0, 1]
    for kind, stated in ((0, False), (1, True), (2, True), (3, True)):
        log = (
            joints() + imus() + fixes(position_covariance=[float(c) for c in covariance], position_covariance_type=kind)
        )
        found = read_bytes(tmp_path, ros2_bytes(log)).fixes
        assert np.isfinite(found.sigma_east_m).all() == stated
        if stated:
            assert found.sigma_east_m[0] == pytest.approx(0.2)
            assert found.sigma_north_m[0] == pytest.approx(0.1)
            assert found.cov_en_m2[0] == pytest.approx(0.003)
            assert found.quality[0] == 5


def test_messages_without_a_fix_are_dropped_and_counted(tmp_path: Path) -> None:
    none = [message("/fix", FIX, t - 0.05, status={"status": -1}, latitude=float("nan")) for t in T[:30].tolist()]
    zero = [message("/fix", FIX, t - 0.04, status={"status": 0}) for t in T[:7].tolist()]
    run = whole(tmp_path, none, zero)
    assert run.fixes.lat_deg.size == ROWS
    assert "30 messages without a fix" in told(run)
    assert "7 messages at latitude 0" in told(run)


def test_foxglove_location_fixes_in_protobuf(tmp_path: Path) -> None:
    types = {
        "LocationFix": {
            "latitude": "double",
            "longitude": "double",
            "altitude": "double",
            "position_covariance": "double*",
            "position_covariance_type": "int32",
            "timestamp": "Timestamp",
            "frame_id": "string",
        },
        "Timestamp": {"seconds": "int64", "nanos": "int32"},
    }
    classes, descriptors = proto_classes("foxglove", types)
    file = io.BytesIO()
    writer = Writer(file)
    writer.start()
    schema = writer.register_schema("foxglove.LocationFix", "protobuf", descriptors)
    channel = writer.register_channel("/gps", "protobuf", schema)
    texts = {}
    for topic, kind, ns, raw in joints() + imus():
        if topic not in texts:
            number = writer.register_schema(kind, "ros2msg", full_text(kind.replace("/msg/", "/")).encode())
            texts[topic] = writer.register_channel(topic, "cdr", number)
        writer.add_message(texts[topic], ns, raw, ns)
    for i, t in enumerate(T.tolist()):
        ns = round(t * 1e9)
        values = {
            "latitude": 52 + 1e-6 * i,
            "longitude": 5.0,
            "position_covariance": [0.0004, 0.0, 0.0, 0.0, 0.0001, 0.0, 0.0, 0.0, 1.0],
            "position_covariance_type": 2,
            "timestamp": {"seconds": ns // 10**9, "nanos": ns % 10**9},
        }
        raw = fill(classes["LocationFix"](), values).SerializeToString()
        writer.add_message(channel, ns + 10**9, raw, ns + 10**9)
    writer.finish()
    run = read_bytes(tmp_path, file.getvalue())
    np.testing.assert_allclose(run.fixes.host_t_s, T, atol=1e-6)
    np.testing.assert_allclose(run.fixes.lat_deg, 52 + 1e-6 * np.arange(ROWS))
    assert run.fixes.sigma_east_m[0] == pytest.approx(0.02)
    assert run.fixes.sigma_north_m[0] == pytest.approx(0.01)


# Choices and times


@pytest.mark.parametrize(
    ("make", "topics", "option"),
    [
        (joints, ("/a/joints", "/b/joints"), "wheels_topic"),
        (imus, ("/a/imu", "/b/imu"), "heading_topic"),
        (fixes, ("/a/fix", "/b/fix"), "fix_topic"),
    ],
)
def test_two_candidates_are_listed_with_the_option_that_chooses(
    make: Callable[..., list[Message]], topics: tuple[str, str], option: str, tmp_path: Path
) -> None:
    others = [one for maker in (joints, imus, fixes) if maker is not make for one in maker()]
    log = ros2_bytes(others + make(topics[0]) + make(topics[1]))
    with pytest.raises(DataError) as caught:
        read_bytes(tmp_path, log)
    assert all(part in str(caught.value) for part in (*topics, "--" + option.replace("_", "-"), "200 messages"))
    for topic in (topics[1], topics[1][1:]):
        read_bytes(tmp_path, log, **{option: topic})
    with pytest.raises(DataError, match=r"--\w+-topic /c: no such topic .*/a/"):
        read_bytes(tmp_path, log, **{option: "/c"})


@pytest.mark.parametrize("missing", ["wheels", "heading", "fixes"])
def test_a_missing_stream_is_named_with_what_is_there(missing: str, tmp_path: Path) -> None:
    parts = {"wheels": joints(), "heading": imus(), "fixes": fixes()}
    log = ros2_bytes([one for name, part in parts.items() if name != missing for one in part])
    with pytest.raises(DataError, match=f"log.mcap: no topic holds the {missing} .*the log has /"):
        read_bytes(tmp_path, log)


@pytest.mark.parametrize(
    "options", [{"yaw": "/imu"}, {"yaw": "nothing:"}, {"left_ticks": "/a:b"}, {"longitude": "/a:b"}]
)
def test_options_that_are_no_path_or_half_a_pair(options: dict[str, str], tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"--\w+"):
        whole(tmp_path, **options)


def test_the_time_asked_for_is_read(tmp_path: Path) -> None:
    log = [(topic, kind, ns + 2 * 10**9, raw) for topic, kind, ns, raw in joints() + imus() + fixes()]
    for time, first in (("header", T[0]), ("log", T[0] + 2), ("publish", T[0] + 2)):
        run = read_bytes(tmp_path, ros2_bytes(log), time=time)
        assert run.wheels.t_s[0] == pytest.approx(first)
        assert run.heading.t_s[0] == pytest.approx(first)
        assert run.fixes.host_t_s[0] == pytest.approx(first)


@given(st.lists(st.floats(0.0, 4e9), min_size=1, max_size=20))
def test_stamps_come_back_as_they_were(t_s: list[float]) -> None:
    """To half a nanosecond; for Unix times that is the very same number."""
    given_s = np.array(t_s)
    back_s = seconds_of(nanoseconds_of(given_s))
    np.testing.assert_allclose(back_s, given_s, rtol=0, atol=1e-9)
    unix = given_s > 1e8
    assert (back_s[unix] == given_s[unix]).all()


def test_empty_stamps_are_read_by_their_log_time(tmp_path: Path) -> None:
    unset = [message("/imu", IMU, t, header=0.0, orientation={"z": 0.1, "w": 1.0}) for t in T.tolist()]
    run = read_bytes(tmp_path, ros2_bytes(joints() + unset + fixes()))
    np.testing.assert_allclose(run.heading.t_s, T, atol=1e-9)


def test_stamps_of_another_clock_are_named(tmp_path: Path) -> None:
    since_boot = [message("/imu", IMU, t, header=t - 990.0, orientation={"w": 1.0}) for t in T.tolist()]
    log = ros2_bytes(joints() + since_boot + fixes())
    with pytest.raises(DataError, match=r"/imu 10\.000 .* give --time log"):
        read_bytes(tmp_path, log)
    read_bytes(tmp_path, log, time="log")


# Further columns


def test_further_numbers_are_columns(tmp_path: Path) -> None:
    battery = [
        message("/battery", "sensor_msgs/msg/BatteryState", t + 0.01, voltage=25.0 - 0.01 * i, current=1.0 + i % 3)
        for i, t in enumerate(T.tolist())
    ]
    load = [message("/payload_kg", "std_msgs/msg/Float64", t, data=0.5 * i) for i, t in enumerate(T.tolist())]
    run = whole(tmp_path, battery, load)
    np.testing.assert_allclose(run.wheels.extras["payload_kg"], 0.5 * np.arange(ROWS))
    np.testing.assert_allclose(run.wheels.extras["battery.voltage"][:-1], 25 - 0.01 * np.arange(ROWS - 1), rtol=1e-6)
    assert "battery.current" in run.wheels.extras


def test_several_channels_of_one_topic_are_one_topic(tmp_path: Path) -> None:
    log = joints() + imus() + fixes()
    mixed = [
        (topic, kind if i % 3 else kind.replace("/msg", ""), ns, raw) for i, (topic, kind, ns, raw) in enumerate(log)
    ]
    run = read_bytes(tmp_path, ros2_bytes(mixed))
    np.testing.assert_allclose(run.wheels.left_rad, LEFT)
    np.testing.assert_allclose(np.unwrap(run.heading.yaw_rad), YAW)
    assert run.fixes.lat_deg.size == ROWS


def test_ros1_messages_in_mcap(tmp_path: Path) -> None:
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(profile="ros1")
    channels: dict[str, int] = {}
    for topic, kind, ns, raw in joints() + imus() + fixes():
        if topic not in channels:
            text = ros1_definition(kind).encode()
            schema = writer.register_schema(kind.replace("/msg", ""), "ros1msg", text)
            channels[topic] = writer.register_channel(topic, "ros1", schema)
        writer.add_message(channels[topic], ns, as_ros1(kind, raw), ns)
    writer.finish()
    run = read_bytes(tmp_path, file.getvalue())
    np.testing.assert_allclose(run.wheels.t_s, T, atol=1e-9)
    np.testing.assert_allclose(run.wheels.right_rad, RIGHT)
    assert run.fixes.quality.tolist() == [4] * ROWS


def test_old_and_short_type_names(tmp_path: Path) -> None:
    log = [(topic, kind.replace("/msg/", "/"), ns, raw) for topic, kind, ns, raw in joints() + imus() + fixes()]
    assert read_bytes(tmp_path, ros2_bytes(log)).wheels.t_s.size == ROWS


def test_default_options_leave_csv_alone(logs: Path) -> None:
    (csv,) = (source for source in discover([logs]) if source.name == "csv")
    require_same(read_run(csv), read_run(csv, ReadOptions(wheels_topic="/x")))
