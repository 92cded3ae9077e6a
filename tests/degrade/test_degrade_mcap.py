"""MCAP stays MCAP: the messages that a fault concerns change, everything else is byte for byte as it was."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import SeekingReader, make_reader
from mcap.writer import CompressionType, Writer

from sccal.calibration.options import CalibrationOptions
from sccal.calibration.single import calibrate_run
from sccal.convert.paths import convert_paths
from sccal.degrade.faults import Faults
from sccal.degrade.paths import degrade_paths
from sccal.errors import DataError, SccalError, UsageError
from sccal.logs.messages.definitions import full_text
from sccal.logs.options import ReadOptions
from sccal.logs.run import discover, read_run
from sccal.logs.streams import Run
from sccal.logs.write import write_vehicle
from tests.message_logs import LZ4, NO_CHUNKS, PLAIN, as_json, as_protobuf, messages_of, ros2_bytes
from tests.runs import read, written

FAULTS = Faults(sigma_m=2.0, losses_s=((20.0, 30.0),), seed=3)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return read(written(tmp_path_factory.mktemp("simulated") / "run", duration_s=60.0))


def degrade(path: Path, out: Path, faults: Faults) -> Run:
    _, failures = degrade_paths([path], out, faults, lambda *_: None)
    if failures:
        raise failures[0].error
    (source,) = discover([out])
    return read_run(source)


def log(run: Run, folder: Path, content: bytes) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    write_vehicle(folder / "vehicle.toml", run.vehicle)
    (folder / "run.mcap").write_bytes(content)
    return folder / "run.mcap"


ENCODINGS: dict[str, Callable[[list[Any]], bytes]] = {
    "cdr": ros2_bytes,
    "cdr lz4": lambda messages: ros2_bytes(messages, **LZ4),
    "cdr plain": lambda messages: ros2_bytes(messages, **PLAIN),
    "cdr without chunks": lambda messages: ros2_bytes(messages, **NO_CHUNKS),
    "json": as_json,
    "protobuf": as_protobuf,
}


@pytest.mark.parametrize("encoding", list(ENCODINGS))
@pytest.mark.parametrize("form", ["fixes", "nmea"])
def test_every_encoding_is_displaced_as_the_folder_is(run: Run, tmp_path: Path, encoding: str, form: str) -> None:
    nmea = None if form == "fixes" else (run.path / "gnss.nmea").read_bytes()
    path = log(run, tmp_path / "in", ENCODINGS[encoding](messages_of(run, nmea)))
    before = read_run(discover([path])[0])
    after = degrade(path, tmp_path / "out", FAULTS)
    folder = degrade(run.path, tmp_path / "folder" / "x", FAULTS)
    np.testing.assert_array_equal(after.wheels.left_rad, before.wheels.left_rad)
    np.testing.assert_array_equal(after.heading.yaw_rad, before.heading.yaw_rad)
    begin = before.wheels.t_s[0] if before.wheels.t_s[0] > 20 else 0.0
    kept = ~((before.fixes.host_t_s >= begin + 20) & (before.fixes.host_t_s <= begin + 30))
    assert after.reference is not None
    assert int(after.reference.lost.sum()) == int((~kept).sum()) > 0
    assert after.fixes.lat_deg.size == int(kept.sum())
    moved_m = 111_000 * (after.fixes.lat_deg - before.fixes.lat_deg[kept])
    assert 1.5 < moved_m.std() < 2.5
    if form == "nmea":
        np.testing.assert_array_equal(after.fixes.lat_deg, folder.fixes.lat_deg)
        np.testing.assert_array_equal(after.fixes.quality, folder.fixes.quality)
    assert set(after.fixes.quality.tolist()) == {1}
    assert b"NaN" not in (tmp_path / "out" / "run.mcap").read_bytes() or encoding != "json"


def everything(path: Path) -> tuple[dict[str, list[tuple[int, int, int, bytes]]], Any]:
    """By the index, as viewers read it: messages by topic with times and sequence; and all the rest."""
    with path.open("rb") as file:
        reader = make_reader(file)
        assert isinstance(reader, SeekingReader)
        messages: dict[str, list[tuple[int, int, int, bytes]]] = {}
        for _, channel, one in reader.iter_messages():
            messages.setdefault(channel.topic, []).append((one.log_time, one.publish_time, one.sequence, one.data))
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        counts = {summary.channels[k].topic: n for k, n in summary.statistics.channel_message_counts.items()}
        assert counts == {topic: len(rows) for topic, rows in messages.items()}
        rest = (
            [(m.name, m.metadata) for m in reader.iter_metadata()],
            [(a.name, a.data, a.log_time) for a in reader.iter_attachments()],
            {k: (s.name, s.encoding, s.data) for k, s in summary.schemas.items()},
            {k: (c.topic, c.metadata) for k, c in summary.channels.items()},
            {c.compression for c in summary.chunk_indexes},
        )
    with path.open("rb") as file:
        assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages()) == sum(counts.values())
    return messages, rest


def rich(run: Run, compression: CompressionType) -> bytes:
    """A log with further topics, metadata, an attachment, and all CRCs."""
    file = io.BytesIO()
    writer = Writer(file, chunk_size=20_000, compression=compression, enable_data_crcs=True)
    writer.start(profile="ros2", library="test")
    writer.add_metadata("made", {"by": "a test"})
    channels: dict[str, int] = {}
    camera = writer.register_channel("/camera", "jpeg", 0, {"lens": "wide"})
    for number, (topic, kind, ns, raw) in enumerate(messages_of(run, None)):
        if topic not in channels:
            schema = writer.register_schema(kind, "ros2msg", full_text(kind.replace("/msg/", "/")).encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        writer.add_message(channels[topic], log_time=ns + 5, publish_time=ns + 3, data=raw, sequence=number)
        if number % 50 == 0:
            writer.add_message(camera, log_time=ns, publish_time=ns, data=b"\xff\xd8" + bytes(number % 7))
    writer.add_attachment(7, 8, "notes.txt", "text/plain", b"wet grass")
    writer.finish()
    return file.getvalue()


def test_a_second_channel_under_the_name_of_a_stream_is_left_alone(run: Run, tmp_path: Path) -> None:
    """Pictures on the fixes' topic are nobody's fixes, and are numbered on their own."""
    file = io.BytesIO()
    writer = Writer(file)
    writer.start(profile="ros2", library="test")
    picture = writer.register_channel("/fix", "cdr", writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b""))
    channels = {
        topic: writer.register_channel(
            topic, "cdr", writer.register_schema(kind, "ros2msg", full_text(kind.replace("/msg/", "/")).encode())
        )
        for topic, kind in {topic: kind for topic, kind, *_ in messages_of(run, None)}.items()
    }
    for topic, _, ns, raw in messages_of(run, None):
        writer.add_message(channels[topic], ns, raw, ns)
        if topic == "/fix":
            writer.add_message(picture, ns, b"picture %d" % ns, ns)
    writer.finish()
    path = log(run, tmp_path / "logs", file.getvalue())
    degrade(path, tmp_path / "out", replace(FAULTS, drop=True))
    pictures = [message.data for message in of_type(path, "Image")]
    assert len(pictures) > len(of_type(tmp_path / "out" / "run.mcap", "NavSatFix"))
    assert [message.data for message in of_type(tmp_path / "out" / "run.mcap", "Image")] == pictures


def of_type(path: Path, name: str) -> list[Any]:
    with path.open("rb") as file:
        return [message for schema, _, message in make_reader(file).iter_messages() if schema and name in schema.name]


@pytest.mark.parametrize("kind", list(CompressionType))
@pytest.mark.parametrize("drop", [False, True])
def test_what_no_fault_concerns_is_kept(run: Run, tmp_path: Path, kind: CompressionType, drop: bool) -> None:
    path = log(run, tmp_path / "in", rich(run, kind))
    degrade(path, tmp_path / "out", Faults(sigma_m=1.0, losses_s=((20.0, 30.0),), drop=drop))
    before, rest = everything(path)
    after, rest_after = everything(tmp_path / "out" / "run.mcap")
    assert rest == rest_after
    for topic in ("/joint_states", "/imu/data", "/camera"):
        assert before[topic] == after[topic]
    heads = {row[:3]: row[3] for row in before["/fix"]}
    assert all(row[:3] in heads and len(row[3]) == len(heads[row[:3]]) for row in after["/fix"])
    assert (len(after["/fix"]) < len(before["/fix"])) == drop
    manifest = json.loads((tmp_path / "out" / "run.mcap.degrade.json").read_text())
    raw = (tmp_path / "out" / "run.mcap").read_bytes()
    assert manifest["files"][0]["sha256_after"] == hashlib.sha256(raw).hexdigest()
    assert set(manifest["files"][0]["messages"]["rewritten"]) == {"/fix"}


def test_without_a_fault_the_file_is_the_same(run: Run, tmp_path: Path) -> None:
    path = log(run, tmp_path / "in", rich(run, CompressionType.ZSTD))
    degrade(path, tmp_path / "out", Faults())
    assert (tmp_path / "out" / "run.mcap").read_bytes() == path.read_bytes()


@pytest.mark.parametrize("encoding", ["cdr", "json", "protobuf"])
def test_heading_drifts_counter_clockwise_and_wheels_drop_out(run: Run, tmp_path: Path, encoding: str) -> None:
    path = log(run, tmp_path / "in", ENCODINGS[encoding](messages_of(run, None)))
    before = read_run(discover([path])[0])
    after = degrade(path, tmp_path / "out", Faults(heading_drift_deg_per_hour=600.0, encoder_dropout=0.1))
    turned = np.degrees(np.angle(np.exp(1j * (after.heading.yaw_rad - before.heading.yaw_rad))))
    t_s = before.heading.t_s
    np.testing.assert_allclose(turned, 600.0 / 3600 * (t_s - t_s[0]), atol=1e-9)
    np.testing.assert_allclose(after.heading.pitch_rad, before.heading.pitch_rad, atol=1e-12)
    np.testing.assert_allclose(after.heading.roll_rad, before.heading.roll_rad, atol=1e-12)
    folder = degrade(run.path, tmp_path / "folder" / "x", Faults(encoder_dropout=0.1))
    np.testing.assert_allclose(after.wheels.t_s, folder.wheels.t_s, atol=1e-9)
    np.testing.assert_array_equal(after.fixes.lat_deg, before.fixes.lat_deg)


def test_a_converted_log_degrades_as_its_folder(run: Run, tmp_path: Path) -> None:
    """gnss.csv with a quality and a sigma: the columns beside the fixes change with them."""
    folder = tmp_path / "logs" / "run"
    folder.mkdir(parents=True)
    for name in ("encoder.csv", "ahrs.csv", "vehicle.toml"):
        (folder / name).write_bytes((run.path / name).read_bytes())
    fixes = run.fixes
    quality = np.resize([4, 4, 5, 9], fixes.lat_deg.size)
    lines = [
        f"{t:.3f},{lat:.10f},{lon:.10f},{q},0.02"
        for t, lat, lon, q in zip(fixes.host_t_s, fixes.lat_deg, fixes.lon_deg, quality, strict=True)
    ]
    (folder / "gnss.csv").write_text("\n".join(["t,lat_deg,lon_deg,fix_quality,sigma_m", *lines]) + "\n")
    convert_paths([tmp_path / "logs"], tmp_path / "mcap", None, ReadOptions(), lambda *_: None)
    by_folder = degrade(tmp_path / "logs", tmp_path / "a", FAULTS)
    by_file = degrade(tmp_path / "mcap", tmp_path / "b", FAULTS)
    np.testing.assert_array_equal(by_file.fixes.quality, by_folder.fixes.quality)
    np.testing.assert_allclose(by_file.fixes.lat_deg, by_folder.fixes.lat_deg, rtol=0, atol=1e-10)
    np.testing.assert_allclose(by_file.fixes.lon_deg, by_folder.fixes.lon_deg, rtol=0, atol=1e-10)
    np.testing.assert_allclose(by_file.fixes.sigma_east_m, by_folder.fixes.sigma_east_m, atol=1e-3)


def test_calibrate_judges_the_losses(run: Run, tmp_path: Path) -> None:
    path = log(run, tmp_path / "in", ros2_bytes(messages_of(run, None)))
    calibration, _ = calibrate_run(degrade(path, tmp_path / "out", FAULTS), CalibrationOptions())
    assert calibration.against_reference is not None
    assert calibration.against_reference.losses is not None


def test_what_cannot_be_degraded_is_told(run: Run, tmp_path: Path) -> None:
    content = ros2_bytes(messages_of(run, None))
    path = log(run, tmp_path / "cut", content[: len(content) // 2])
    with pytest.raises(DataError, match="mcap recover"):
        degrade(path, tmp_path / "a", FAULTS)
    path = log(run, tmp_path / "wheels", ros2_bytes([m for m in messages_of(run, None) if m[0] == "/joint_states"]))
    with pytest.raises(SccalError, match="no topic with fixes"):
        degrade(path, tmp_path / "b", FAULTS)
    path = log(run, tmp_path / "in", content)
    log(run, tmp_path / "c", b"mine")
    with pytest.raises(UsageError, match="was not written by sccal degrade"):
        degrade(path, tmp_path / "c", FAULTS)
    assert (tmp_path / "c" / "run.mcap").read_bytes() == b"mine"
