"""The MCAP container: every way of writing it, and every way of breaking it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sccal.errors import DataError, SccalError
from sccal.logs.messages.mcap_chunks import DamagedError, decompressed
from sccal.logs.streams import Run
from tests.message_logs import (
    LZ4,
    NO_CHUNKS,
    NO_INDEX,
    PLAIN,
    Message,
    as_json,
    as_protobuf,
    cdr,
    read_bytes,
    ros2_bytes,
    stamp,
)

pytestmark = pytest.mark.filterwarnings("error")
ROWS = 300


def run_messages(rows: int = ROWS) -> list[Message]:
    """Wheels that turn at 2 and 3 rad/s, a yaw that follows, and fixes, 10 Hz each."""
    found: list[Message] = []
    for i in range(rows):
        t = 100.0 + 0.1 * i
        ns = round(t * 1e9)
        joint = {"header": stamp(t), "name": ["left", "right"], "position": [0.2 * i, 0.3 * i]}
        found.append(("/joints", "sensor_msgs/msg/JointState", ns, cdr("sensor_msgs/msg/JointState", joint)))
        turn = {"x": 0.0, "y": 0.0, "z": float(np.sin(0.01 * i)), "w": float(np.cos(0.01 * i))}
        imu = {"header": stamp(t), "orientation": turn}
        found.append(("/imu", "sensor_msgs/msg/Imu", ns, cdr("sensor_msgs/msg/Imu", imu)))
        fix = {"header": stamp(t), "status": {"status": 2}, "latitude": 52 + 1e-6 * i, "longitude": 5.0}
        found.append(("/fix", "sensor_msgs/msg/NavSatFix", ns, cdr("sensor_msgs/msg/NavSatFix", fix)))
    return found


MESSAGES = run_messages()
WAYS: dict[str, dict[str, Any]] = {
    "zstd": {},
    "lz4": LZ4,
    "plain": PLAIN,
    "no_chunks": NO_CHUNKS,
    "no_index": NO_INDEX,
    "no_index_no_chunks": {**NO_INDEX, **NO_CHUNKS},
    "one_chunk": {"chunk_size": 1 << 30},
    "data_crc": {"enable_data_crcs": True},
    "tiny_chunks": {"chunk_size": 10},
}
each_way = pytest.mark.parametrize("way", WAYS)


def lost(run: Run) -> list[str]:
    return [str(notice) for notice in run.notices if notice.severity == "warning"]


@each_way
def test_every_way_of_writing_reads_the_same(way: str, tmp_path: Path) -> None:
    run = read_bytes(tmp_path, ros2_bytes(MESSAGES, **WAYS[way]))
    i = np.arange(ROWS)
    np.testing.assert_allclose(run.wheels.t_s, 100 + 0.1 * i, atol=1e-9)
    np.testing.assert_allclose(run.wheels.left_rad, 0.2 * i, atol=1e-12)
    np.testing.assert_allclose(run.wheels.right_rad, 0.3 * i, atol=1e-12)
    np.testing.assert_allclose(np.unwrap(run.heading.yaw_rad), 0.02 * i, atol=1e-12)
    np.testing.assert_allclose(run.fixes.lat_deg, 52 + 1e-6 * i, atol=1e-12)
    assert lost(run) == []


@each_way
@pytest.mark.parametrize("share", [0.6, 0.95])
def test_a_cut_file_is_read_up_to_the_cut(way: str, share: float, tmp_path: Path) -> None:
    data = ros2_bytes(MESSAGES, **WAYS[way])
    cut = int(share * len(data))
    run = read_bytes(tmp_path, data[:cut])
    [told] = lost(run)
    assert "log.mcap" in told
    assert "breaks off" in told or "cut index" in told
    assert " byte " in told
    assert " t = 1" in told
    rows = run.wheels.t_s.size
    if way == "no_index_no_chunks":  # nothing but messages in the file
        assert abs(rows - share * ROWS) < 0.03 * ROWS
    assert 0.2 * ROWS < rows <= ROWS
    np.testing.assert_allclose(run.wheels.left_rad, 0.2 * np.arange(rows), atol=1e-12)
    assert abs(run.fixes.lat_deg.size - rows) <= 1


@pytest.mark.parametrize("way", ["zstd", "lz4", "plain"])
def test_of_a_cut_chunk_its_part_is_read(way: str, tmp_path: Path) -> None:
    noisy = []
    noise = np.random.default_rng(1).normal(size=len(MESSAGES))
    for (topic, kind, ns, raw), extra in zip(run_messages(3000), np.resize(noise, 9000), strict=True):
        noisy.append((topic, kind, ns, raw[:-8] + struct.pack("<d", extra) if topic == "/imu" else raw))
    data = ros2_bytes(noisy, **WAYS[way], chunk_size=1 << 30)
    run = read_bytes(tmp_path, data[: int(0.5 * len(data))])
    assert run.wheels.t_s.size > 600


def test_nothing_but_zeros_after_the_cut(tmp_path: Path) -> None:
    data = ros2_bytes(MESSAGES, **NO_CHUNKS)
    run = read_bytes(tmp_path, data[: len(data) // 2] + bytes(len(data) // 2))
    assert run.wheels.t_s.size > 0.4 * ROWS
    assert any("breaks off" in told for told in lost(run))


@pytest.mark.parametrize("content", [b"", bytes(100_000), b"\x89PNG\r\n\x1a\n" + bytes(99), b"t,left_ticks\n1,2\n"])
def test_no_mcap_at_all(content: bytes, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"log\.mcap: (not an MCAP file|is empty)"):
        read_bytes(tmp_path, content)


def test_an_mcap_without_messages(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"log\.mcap: no message can be read"):
        read_bytes(tmp_path, ros2_bytes([]))


def chunk_places(data: bytes) -> list[int]:
    """Where the chunk records begin."""
    places, position = [], 8
    while position + 9 < len(data):
        opcode, length = struct.unpack_from("<BQ", data, position)
        if opcode == 6:
            places.append(position)
        position += 9 + length
    return places


def test_a_wrong_crc_leaves_its_chunk_out_and_is_told(tmp_path: Path) -> None:
    data = bytearray(ros2_bytes(MESSAGES, **PLAIN))
    places = chunk_places(data)
    data[places[5] + 2000] ^= 0xFF
    run = read_bytes(tmp_path, bytes(data))
    told = lost(run)[0]
    assert "CRC is wrong" in told
    assert f"byte {places[5]}" in told
    assert 0.8 * ROWS < run.wheels.t_s.size < ROWS


def test_a_wrong_crc_of_all_data_is_told(tmp_path: Path) -> None:
    data = bytearray(ros2_bytes(MESSAGES, **NO_CHUNKS, enable_data_crcs=True))
    data[data.index(b"/joints") + 400] ^= 1
    run = read_bytes(tmp_path, bytes(data))
    assert any("CRC is wrong" in told for told in lost(run))


def test_a_record_with_a_broken_length_is_passed_by_the_index(tmp_path: Path) -> None:
    data = bytearray(ros2_bytes(MESSAGES))
    places = chunk_places(data)
    struct.pack_into("<Q", data, places[4] + 1, 1 << 60)
    run = read_bytes(tmp_path, bytes(data))
    assert any("breaks off" in told for told in lost(run))
    assert run.wheels.t_s[-1] > 129
    assert run.wheels.t_s.size > 0.8 * ROWS


@pytest.mark.parametrize("claimed", [1 << 62, 1 << 31, 0, 17])
@pytest.mark.parametrize("way", ["zstd", "lz4", "plain"])
def test_a_size_that_is_only_claimed_is_not_believed(way: str, claimed: int, tmp_path: Path) -> None:
    data = bytearray(ros2_bytes(MESSAGES, **WAYS[way]))
    place = chunk_places(data)[3]
    struct.pack_into("<Q", data, place + 9 + 16, claimed)
    run = read_bytes(tmp_path, bytes(data))
    assert any("chunks left out" in told and f"byte {place}" in told for told in lost(run))
    assert run.wheels.t_s.size > 0.8 * ROWS


def test_unknown_compression_is_named(tmp_path: Path) -> None:
    data = ros2_bytes(MESSAGES, **LZ4).replace(b"\x03\x00\x00\x00lz4", b"\x03\x00\x00\x00abc")
    with pytest.raises(DataError, match="compression 'abc' is not known"):
        read_bytes(tmp_path, data)


def test_messages_out_of_order_in_the_file_are_read_by_their_times(tmp_path: Path) -> None:
    shuffled = MESSAGES[450:] + MESSAGES[:450]
    run = read_bytes(tmp_path, ros2_bytes(shuffled))
    assert run.wheels.t_s.size == ROWS
    assert lost(run) == []


@pytest.mark.parametrize("way", ["no_chunks", "plain", "lz4", "zstd", "json", "protobuf"])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_bytes_whatever_do_more_than_lose_messages(way: str, tmp_path: Path, data: st.DataObject) -> None:
    """Random changes and cuts give a run or one clear error that names the file."""
    whole = SMALL[way]
    broken = bytearray(whole[: data.draw(st.integers(0, len(whole)), "cut")] if data.draw(st.booleans()) else whole)
    for _ in range(data.draw(st.integers(0, 6), "changes")):
        if broken:
            place = data.draw(st.integers(0, len(broken) - 1), "place")
            value = data.draw(st.sampled_from([0, 1, 0x7F, 0x80, 0xFF]) | st.integers(0, 255), "value")
            width = data.draw(st.sampled_from([1, 1, 2, 8]), "width")
            broken[place : place + width] = bytes([value]) * len(broken[place : place + width])
    outcome = read_or_error(tmp_path, bytes(broken))
    if isinstance(outcome, str):
        assert "log.mcap" in outcome
        assert "\n" not in outcome
    else:
        assert (np.diff(outcome.wheels.t_s) > 0).all()


def read_or_error(folder: Path, data: bytes) -> Run | str:
    try:
        return read_bytes(folder, data)
    except SccalError as error:
        return str(error)


SMALL = {way: ros2_bytes(run_messages(12), **{"chunk_size": 1000, **WAYS[way]}) for way in WAYS}
SMALL["json"] = as_json(run_messages(12), **NO_CHUNKS)
SMALL["protobuf"] = as_protobuf(run_messages(12), **NO_CHUNKS)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_of_very_many_zeros_is_small_work(compression: str, tmp_path: Path) -> None:
    """Honest about its size, within what may be believed, and of no use."""
    zeros = bytes(60 << 20)
    packed = zstandard.compress(zeros) if compression == "zstd" else lz4.frame.compress(zeros)
    body = struct.pack("<QQQI", 0, 0, len(zeros), 0) + struct.pack("<I", len(compression)) + compression.encode()
    body += struct.pack("<Q", len(packed)) + packed
    data = ros2_bytes(MESSAGES)
    place = chunk_places(data)[2]
    run = read_bytes(tmp_path, data[:place] + struct.pack("<BQ", 6, len(body)) + body + data[place:])
    assert run.wheels.t_s.size == ROWS
    assert any("end within a record" in told for told in lost(run))


@given(st.binary(max_size=4000), st.sampled_from(["zstd", "lz4", ""]), st.floats(0, 1))
def test_a_cut_chunk_gives_its_beginning(content: bytes, compression: str, share: float) -> None:
    packed = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "": bytes}[compression](content)
    part = decompressed(memoryview(packed)[: int(share * len(packed))], compression, len(content), cut=True)
    assert content.startswith(part)
    assert decompressed(memoryview(packed), compression, len(content), cut=False) == content
    with pytest.raises(DamagedError):
        decompressed(memoryview(packed), compression, len(content) + 1, cut=False)
