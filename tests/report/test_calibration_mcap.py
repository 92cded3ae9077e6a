"""calibration.mcap as the stock decoders read it: the numbers, on the log's clock."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from sccal.batch.calibrating import calibrate_paths
from sccal.batch.tasks import AlsoWritten
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.geodesy import TangentPlane
from sccal.logs.run import discover
from sccal.results.calibration import Calibration
from tests.runs import read, written

Messages = dict[str, list[tuple[int, Any]]]


@pytest.fixture(scope="module", params=[0.0, 1717243230.0])
def result(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Calibration, Path]:
    root = tmp_path_factory.mktemp("calibrated")
    written(
        root / "logs" / "run",
        "clock.start_utc_s=1717243200",
        f"clock.host_epoch_offset_s={request.param}",
        duration_s=90.0,
    )
    calibrate_paths([root / "logs"], root / "out", CalibrationOptions(), lambda *_: None, also=AlsoWritten(mcap=True))
    calibration, _ = calibrate_run(read(root / "logs"), CalibrationOptions())
    return calibration, root / "out" / "run" / "calibration.mcap"


def decoded(path: Path) -> Messages:
    found: Messages = {}
    with path.open("rb") as file:
        for _, channel, message, value in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, value))
    return found


def assert_times(messages: list[tuple[int, Any]], t_s: Any, ahead_s: float) -> None:
    np.testing.assert_allclose([ns * 1e-9 for ns, _ in messages], np.asarray(t_s) + ahead_s, rtol=0, atol=3e-7)


def test_numbers_and_times(result: tuple[Calibration, Path]) -> None:
    c, path = result
    found = decoded(path)
    with path.open("rb") as file:
        reader = make_reader(file)
        (metadata,) = reader.iter_metadata()
        (attached,) = reader.iter_attachments()
    ahead_s = int(metadata.metadata["log_ahead_ns"]) / 1e9
    assert ahead_s == (0 if c.trajectory.t_s[0] >= 0 else np.ceil(-c.trajectory.t_s[0]))
    assert json.loads(attached.data) == json.loads((path.parent / "calibration.json").read_text())
    t, h, r = c.trajectory, c.history, c.residuals
    poses = found["/sccal/odometry"]
    assert_times(poses, t.t_s, ahead_s)
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for _, m in poses]
    np.testing.assert_allclose(stamps, t.t_s, atol=3e-7)
    np.testing.assert_array_equal([m.pose.pose.position.x for _, m in poses], t.east_m)
    np.testing.assert_array_equal([m.pose.pose.position.y for _, m in poses], t.north_m)
    yaw = 2 * np.arctan2(*np.array([(m.pose.pose.orientation.z, m.pose.pose.orientation.w) for _, m in poses]).T)
    assert np.abs(np.angle(np.exp(1j * (yaw - t.yaw_rad)))).max() < 1e-12
    np.testing.assert_allclose([m.pose.covariance[35] ** 0.5 for _, m in poses], t.sigma_yaw_rad)
    np.testing.assert_allclose([m.pose.covariance[7] ** 0.5 for _, m in poses], t.sigma_north_m)
    positions = [(m.latitude, m.longitude) for _, m in found["/sccal/position"]]
    back = TangentPlane(c.origin.lat_deg, c.origin.lon_deg, c.origin.alt_m).to_east_north(*np.array(positions).T)
    np.testing.assert_allclose(np.column_stack(back), np.column_stack((t.east_m, t.north_m)), atol=1e-6)
    for name, values, times in (
        ("radius_right_m", h.radius_right_m, h.t_s),
        ("track_m_sigma", h.sigma_track_m, h.t_s),
        ("heading_offset_deg", np.degrees(h.heading_offset_rad), h.t_s),
        ("heading_innovation_deg", np.degrees(r.heading_rad), r.heading_t_s),
        ("fix_accepted", r.fix_accepted, r.fix_t_s),
    ):
        np.testing.assert_array_equal([m.data for _, m in found[f"/sccal/{name}"]], values)
        assert_times(found[f"/sccal/{name}"], times, ahead_s)
    east = [m.vector.x for _, m in found["/sccal/fix_innovation_m"]]
    np.testing.assert_array_equal(east, r.fix_east_m)
    np.testing.assert_array_equal([m.vector.y for _, m in found["/sccal/fix_innovation_m"]], r.fix_north_m)


def test_beside_the_log_it_is_no_run(result: tuple[Calibration, Path], tmp_path: Path) -> None:
    shutil.copy(result[1], tmp_path / "calibration.mcap")
    written(tmp_path / "run", duration_s=20.0)
    assert [source.name for source in discover([tmp_path])] == ["run"]


def test_an_older_one_does_not_stay(result: tuple[Calibration, Path], tmp_path: Path) -> None:
    from sccal.report.write import write_calibration

    shutil.copy(result[1], tmp_path / "calibration.mcap")
    write_calibration(result[0], tmp_path)
    assert not (tmp_path / "calibration.mcap").exists()
