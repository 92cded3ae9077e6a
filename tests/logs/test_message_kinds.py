"""Types of messages that hold a stream elsewhere than the usual ones, and logs of messages that lack one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sccal.inspect.read import read_streams
from sccal.logs.run import RunSource, discover, read_run
from sccal.logs.write import gga, rmc
from tests.logs.test_mcap_run import YAW, T, fixes, imus, joints, told
from tests.message_logs import VEHICLE, json_bytes, read_bytes, ros2_bytes

AHEAD_S = 1717243200.0


def ns(t: float) -> int:
    return round(t * 1e9)


def turned(yaw: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": float(np.sin(0.5 * yaw)), "w": float(np.cos(0.5 * yaw))}


def usual(*leave_out: str) -> list[tuple[str, str, int, dict[str, object]]]:
    """Joints, orientations and fixes in JSON, some of them left out."""
    found = []
    for i, t in enumerate(T.tolist()):
        position = [0.2 * i, 0.3 * i]
        found += [
            ("/joints", "JointState", ns(t), {"name": ["left", "right"], "position": position}),
            ("/imu", "Imu", ns(t), {"orientation": turned(YAW[i])}),
            ("/fix", "NavSatFix", ns(t), {"latitude": 52 + 2e-6 * i, "longitude": 5.0}),
        ]
    return [one for one in found if one[1] not in leave_out]


def test_sentences_in_strings_are_read_and_other_strings_are_not(tmp_path: Path) -> None:
    said = []
    for i, t in enumerate(T.tolist()):
        place = (52.0 + 2e-6 * i, 5.0)
        utc = t + AHEAD_S
        text = rmc(utc, *place, 1.0, 0.0) if i % 10 == 9 else gga(utc, *place, 40.0, 4, 12, 0.6, 0.8)
        said += [("/nmea", "String", ns(t + 0.03), {"data": text}), ("/state", "String", ns(t), {"data": "driving"})]
    run = read_bytes(tmp_path, json_bytes(usual("NavSatFix") + said))
    late = run.fixes.host_t_s - run.fixes.utc_s + AHEAD_S
    assert late == pytest.approx(np.full(run.fixes.lat_deg.size, 0.03), abs=1e-4)


@pytest.mark.parametrize(("flags", "quality"), [(131, 4), (67, 5), (3, 2), (1, 1)])
def test_a_nav_pvt_is_read_in_its_own_units(tmp_path: Path, flags: int, quality: int) -> None:
    rest = {"lon": 50000000, "height": 41000, "h_acc": 20, "fix_type": 3, "flags": flags}
    said = [
        ("/pvt", "ublox_msgs/msg/NavPVT", ns(t), {"lat": 520000000 + 20 * i, **rest}) for i, t in enumerate(T.tolist())
    ]
    run = read_bytes(tmp_path, json_bytes(usual("NavSatFix") + said))
    assert run.fixes.lat_deg[:2] == pytest.approx([52.0, 52.000002])
    assert run.fixes.alt_m[0] == pytest.approx(41.0)
    assert set(run.fixes.quality.tolist()) == {quality}
    named = read_bytes(tmp_path, json_bytes(usual("NavSatFix") + said), latitude="/pvt:lat", longitude="/pvt:lon")
    assert named.fixes.lat_deg[:2] == pytest.approx([52.0, 52.000002])
    assert "ten-millionths" in told(named)


def test_an_odometry_with_a_pose_and_no_twist_drives_two_virtual_wheels(tmp_path: Path) -> None:
    said, yaw, x, y = [], 0.0, 0.0, 0.0
    for t in T.tolist():
        pose = {"pose": {"position": {"x": x, "y": y}, "orientation": turned(yaw)}}
        twist = {"twist": {"linear": {"x": 0.0}, "angular": {"z": 0.0}}}
        said.append(("/odom", "nav_msgs/msg/Odometry", ns(t), {"pose": pose, "twist": twist}))
        x, y, yaw = x - 0.05 * np.cos(yaw + 0.01), y - 0.05 * np.sin(yaw + 0.01), yaw + 0.02
    run = read_bytes(tmp_path, json_bytes(usual("JointState") + said))
    assert np.diff(run.wheels.left_rad) == pytest.approx(np.full(T.size - 1, (-0.05 - 0.02 * 0.35) / 0.08))
    assert np.diff(run.wheels.right_rad) == pytest.approx(np.full(T.size - 1, (-0.05 + 0.02 * 0.35) / 0.08))
    assert "poses of an odometry without twist" in told(run)


def test_a_twist_drives_two_virtual_wheels_but_a_command_does_not(tmp_path: Path) -> None:
    def twists(topic: str, speed: float) -> list[tuple[str, str, int, dict[str, object]]]:
        twist = {"linear": {"x": speed}, "angular": {"z": 0.0}}
        return [(topic, "geometry_msgs/msg/TwistStamped", ns(t), {"twist": twist}) for t in T.tolist()]

    run = read_bytes(tmp_path, json_bytes(usual("JointState") + twists("/cmd_vel", 9.0) + twists("/base", 0.5)))
    assert run.wheels.left_rad[-1] == pytest.approx(0.5 / 0.08 * (T[-1] - T[0]))


@pytest.mark.parametrize("missing", ["NavSatFix", "Imu", "JointState"])
def test_what_a_log_of_messages_holds_is_shown_where_a_stream_is_missing(tmp_path: Path, missing: str) -> None:
    (tmp_path / "log.mcap").write_bytes(json_bytes(usual(missing)))
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    streams = read_streams(RunSource("log", tmp_path / "log.mcap", tmp_path / "vehicle.toml"))
    there = {"JointState": streams.wheels, "Imu": streams.heading, "NavSatFix": streams.fixes}
    assert {kind for kind, stream in there.items() if stream is None} == {missing}
    assert len(streams.unread) == 1
    assert streams.run is None


def test_what_a_log_of_messages_holds_is_shown_without_a_vehicle(tmp_path: Path) -> None:
    (tmp_path / "log.mcap").write_bytes(json_bytes(usual()))
    streams = read_streams(RunSource("log", tmp_path / "log.mcap", None))
    assert streams.wheels is not None
    assert streams.heading is not None
    assert not streams.declared
    assert [one.what for one in streams.unread] == ["vehicle"]


def test_parts_of_one_drive_are_one_run(tmp_path: Path) -> None:
    log = sorted(joints() + imus() + fixes(), key=lambda one: one[2])
    third = len(log) // 3
    names = [f"drive_{part}.mcap" for part in range(3)]
    for part, name in enumerate(names):
        (tmp_path / name).write_bytes(ros2_bytes(log[part * third : (part + 1) * third if part < 2 else None]))
    (tmp_path / "metadata.yaml").write_text("relative_file_paths:\n" + "".join(f"  - {name}\n" for name in names))
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    sources = discover([tmp_path])
    assert len(sources) == 1
    run = read_run(sources[0])
    assert run.wheels.t_s == pytest.approx(T)
    assert "further files of the same drive read, up to drive_2.mcap" in told(run)
