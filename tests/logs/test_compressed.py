"""Compressed logs: the same run out of every tool's files, and what is cut, broken or a bomb is refused."""

from __future__ import annotations

import bz2
import gzip
import lzma
import shutil
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard

from sccal.errors import DataError
from sccal.logs import compressed
from sccal.logs.compressed import bytes_of, head_of, most_bytes, plain_file
from sccal.logs.first_look import require_any_log
from sccal.logs.run import discover, read_run
from sccal.logs.streams import Run
from tests.message_logs import messages_of, write_mcap, write_ros1
from tests.runs import written

PACK: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.compress,
    ".bz2": bz2.compress,
    ".xz": lzma.compress,
    ".zst": zstandard.ZstdCompressor().compress,
}
each_tool = pytest.mark.parametrize("ending", PACK)
TEXT = b"".join(b"%d,%d\n" % (i, i * i) for i in range(300_000))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plain")
    written(folder, duration_s=40.0)
    return folder


def packed(source: Path, target: Path, ending: str) -> Path:
    """The folder with every log compressed."""
    target.mkdir()
    for file in source.iterdir():
        if file.suffix in (".csv", ".nmea"):
            (target / f"{file.name}{ending}").write_bytes(PACK[ending](file.read_bytes()))
    shutil.copy(source / "vehicle.toml", target)
    return target


def read(path: Path) -> Run:
    (source,) = discover([path])
    return read_run(source)


def require_same(one: Run, other: Run) -> None:
    np.testing.assert_array_equal(one.wheels.left_rad, other.wheels.left_rad)
    np.testing.assert_array_equal(one.heading.yaw_rad, other.heading.yaw_rad)
    np.testing.assert_array_equal(one.fixes.lat_deg, other.fixes.lat_deg)


@each_tool
def test_a_folder_of_compressed_files_is_the_same_run(plain: Path, tmp_path: Path, ending: str) -> None:
    folder = packed(plain, tmp_path / "run", ending)
    require_any_log([folder])
    run = read(folder)
    require_same(run, read(plain))
    assert run.name == "run"
    assert read(folder / f"encoder.csv{ending}").fixes.lat_deg.size == run.fixes.lat_deg.size


@each_tool
def test_messages_are_the_same_run_and_its_name_has_no_endings(plain: Path, tmp_path: Path, ending: str) -> None:
    run, nmea = read(plain), (plain / "gnss.nmea").read_bytes()
    write_mcap(run, tmp_path / "drive.mcap", nmea)
    (tmp_path / f"drive.mcap{ending}").write_bytes(PACK[ending]((tmp_path / "drive.mcap").read_bytes()))
    shutil.copy(plain / "vehicle.toml", tmp_path)
    expected = read(tmp_path)
    (tmp_path / "drive.mcap").unlink()
    require_any_log([tmp_path / f"drive.mcap{ending}"])
    found = read(tmp_path)
    require_same(found, expected)
    assert found.name == expected.name == "drive"


def test_a_bag_is_read_too(plain: Path, tmp_path: Path) -> None:
    path = write_ros1(messages_of(read(plain), None), tmp_path / "drive.bag")
    path.with_name("drive.bag.gz").write_bytes(gzip.compress(path.read_bytes()))
    path.unlink()
    shutil.copy(plain / "vehicle.toml", tmp_path)
    assert read(tmp_path).wheels.t_s.size == read(plain).wheels.t_s.size


def test_a_file_that_is_there_unpacked_is_read_once_and_as_it_is(plain: Path, tmp_path: Path) -> None:
    shutil.copytree(plain, tmp_path / "run")
    (tmp_path / "run" / "encoder.csv.gz").write_bytes(b"never opened")
    write_mcap(read(plain), tmp_path / "drive.mcap", (plain / "gnss.nmea").read_bytes())
    (tmp_path / "drive.mcap.gz").write_bytes(gzip.compress((tmp_path / "drive.mcap").read_bytes()))
    assert [source.name for source in discover([tmp_path])] == ["drive", "run"]
    require_same(read(tmp_path / "run"), read(plain))


@each_tool
def test_all_bytes_come_out_also_of_several_streams(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"log{ending}"
    path.write_bytes(PACK[ending](TEXT) + PACK[ending](TEXT[:100]))
    assert bytes_of(path) == TEXT + TEXT[:100]
    assert head_of(path, 5) == TEXT[:5]


@each_tool
def test_a_cut_file_is_refused_with_its_name_and_the_tool(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"log{ending}"
    whole = PACK[ending](TEXT)
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(
        DataError,
        match=rf"log\{ending}: cannot be unpacked beyond its first \d+ bytes .*`(gunzip|bunzip2|unxz|zstd -d) log",
    ):
        bytes_of(path)


@each_tool
@pytest.mark.parametrize("content", [b"", b"t,left_ticks,right_ticks\n0,0,0\n"])
def test_what_is_not_compressed_is_no_more_than_an_error(tmp_path: Path, ending: str, content: bytes) -> None:
    path = tmp_path / f"encoder.csv{ending}"
    path.write_bytes(content)
    if content:
        with pytest.raises(DataError, match=r"cannot be unpacked beyond its first 0 bytes"):
            bytes_of(path)


@each_tool
def test_a_bomb_is_stopped_at_the_bound_with_the_numbers(
    tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compressed, "UNPACKED_FREE_BYTES", 1 << 20)
    path = tmp_path / f"encoder.csv{ending}"
    path.write_bytes(PACK[ending](bytes(64 << 20)))
    most = most_bytes(path.stat().st_size)
    with pytest.raises(DataError, match=rf"its {path.stat().st_size} bytes unpack to more than {most} bytes"):
        bytes_of(path)
    with pytest.raises(DataError, match="unpack to more than"), plain_file(path):
        raise AssertionError("never opened")
    with pytest.raises(DataError, match="unpack to more than"):  # blanks are looked through before anything is read
        require_any_log([tmp_path])


def test_the_bound_grows_with_the_file_up_to_a_cap() -> None:
    assert most_bytes(0) == 64 << 20
    assert most_bytes(1 << 20) == (64 << 20) + 200 * (1 << 20)
    assert most_bytes(1 << 40) == 4 << 30


def test_a_dictionary_that_needs_much_memory_is_refused(tmp_path: Path) -> None:
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 1, "dict_size": 1 << 20}]
    raw = bytearray(lzma.compress(TEXT, filters=filters))
    at = raw.index(b"\x21\x01", 12)
    raw[at + 2] = 38  # a dictionary of 2 GiB
    size = (raw[12] + 1) * 4
    raw[12 + size - 4 : 12 + size] = struct.pack("<I", zlib.crc32(bytes(raw[12 : 12 + size - 4])))
    (tmp_path / "log.xz").write_bytes(bytes(raw))
    with pytest.raises(DataError, match=r"(?i)memory"):
        bytes_of(tmp_path / "log.xz")


def test_errors_of_what_is_inside_name_the_compressed_file(tmp_path: Path) -> None:
    (tmp_path / "drive.mcap.gz").write_bytes(gzip.compress(b"no such thing"))
    with pytest.raises(DataError, match=r"drive\.mcap\.gz: not an MCAP file"):
        require_any_log([tmp_path / "drive.mcap.gz"])
    with (
        pytest.raises(DataError, match=rf"{tmp_path}/drive\.mcap\.gz: bad"),
        plain_file(tmp_path / "drive.mcap.gz") as plain,
    ):
        raise DataError(f"{plain}: bad")
    assert not plain.exists()
