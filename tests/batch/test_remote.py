"""Runs behind URLs: found by the same rules as on disk, with the same results, and nothing left of the copies."""

from __future__ import annotations

import json
import sys
import tempfile
import uuid

import pytest

from sccal.batch.calibrating import calibrate_paths
from sccal.batch.remote import RemoteRun, fetched, find_sources
from sccal.calibration.options import CalibrationOptions
from sccal.errors import UsageError
from sccal.logs.run import RunSource
from tests.batch.logs import contents, some_runs
from tests.calibration.test_single import GIVEN

fsspec = pytest.importorskip("fsspec")


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Two runs of one vehicle, its vehicle.toml above them."""
    folder = some_runs(tmp_path_factory.mktemp("disk") / "2026", ("may/run2", "may/run10"))
    (folder / "may" / "run2" / "vehicle.toml").rename(folder / "vehicle.toml")
    (folder / "may" / "run10" / "vehicle.toml").unlink()
    return folder


@pytest.fixture(scope="module")
def in_memory(logs):
    """URL of the folder, as a store in this process's memory has it."""
    prefix = f"/{uuid.uuid4().hex}/2026"
    store = fsspec.filesystem("memory")
    for path in logs.rglob("*"):
        if path.is_file():
            store.pipe_file(f"{prefix}/{path.relative_to(logs).as_posix()}", path.read_bytes())
    return f"memory:/{prefix}"


@pytest.mark.parametrize("pattern", ["", "/", "/**", "/*/run*", "/may/run[0-9]*/**"])
def test_the_same_runs_are_found_as_on_disk(logs, in_memory, pattern):
    on_disk, _ = find_sources([logs])
    found, failures = find_sources([in_memory + pattern])
    assert not failures
    assert all(isinstance(one, RemoteRun) for one in found)
    if pattern.startswith("/may"):
        assert [one.name for one in found] == ["run2", "run10"]
        assert all(one.vehicle_toml is None for one in found)
    else:
        assert [one.name for one in found] == [one.name for one in on_disk] == ["may/run2", "may/run10"]
        assert all(one.vehicle_toml == "vehicle.toml" for one in found)


def test_a_pattern_leaves_out_what_does_not_match(in_memory):
    found, _ = find_sources([f"{in_memory}/*/run?"])
    assert [one.name for one in found] == ["may/run2"]


def test_results_are_those_from_disk_and_no_copy_is_left(logs, in_memory, tmp_path, monkeypatch):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    options = CalibrationOptions(noise=GIVEN)
    calibrate_paths([logs], tmp_path / "disk", options, lambda *_: None)
    found = calibrate_paths([f"{in_memory}/**"], tmp_path / "url", options, lambda *_: None)
    assert not found.failures
    assert contents(tmp_path / "url") == contents(tmp_path / "disk")
    assert not list(scratch.iterdir())


def test_a_url_that_holds_nothing_is_a_failure_of_its_own(logs, in_memory):
    found, failures = find_sources([logs, f"{in_memory}/june/**", f"{in_memory}/may/run2/gnss.nmeb"])
    assert [type(one) for one in found] == [RunSource, RunSource]
    assert len(failures) == 2
    assert "june" in failures[0].name


def test_messages_name_the_url_and_not_the_copy(in_memory, tmp_path):
    store = fsspec.filesystem("memory")
    url = f"memory://{uuid.uuid4().hex}"
    store.pipe_file(url.removeprefix("memory:/") + "/bad/encoder.csv", b"t,left_ticks,right_ticks\n")
    found = calibrate_paths([url], tmp_path / "out", CalibrationOptions(), lambda *_: None)
    (failure,) = found.failures
    assert f"{url}/bad" in str(failure.error)
    assert tempfile.gettempdir() not in str(failure.error)


def test_a_local_run_is_used_where_it_stands(logs):
    (source, _), _ = find_sources([logs])
    with fetched(source) as there:
        assert there is source


def test_a_store_that_is_not_known_is_one_line():
    with pytest.raises(UsageError, match="nonsense"):
        find_sources(["nonsense://bucket/**"])


def test_without_the_extra_the_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(UsageError, match=r"sccal-robotics\[s3\]"):
        find_sources(["s3://fleet/2026/**"])


def test_a_bucket_gives_what_the_disk_gives(logs, tmp_path, monkeypatch):
    pytest.importorskip("s3fs")
    server_module = pytest.importorskip("moto.server")
    server = server_module.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    try:
        host, port = server.get_host_and_port()
        for name, value in {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}",
            "AWS_ACCESS_KEY_ID": "someone",
            "AWS_SECRET_ACCESS_KEY": "something",
            "AWS_DEFAULT_REGION": "us-east-1",
        }.items():
            monkeypatch.setenv(name, value)
        store = fsspec.filesystem("s3", skip_instance_cache=True)
        store.mkdir("fleet")
        store.put(str(logs), "fleet/2026", recursive=True)
        options = CalibrationOptions(noise=GIVEN)
        calibrate_paths([logs], tmp_path / "disk", options, lambda *_: None)
        found = calibrate_paths(["s3://fleet/2026/**"], tmp_path / "s3", options, lambda *_: None)
        assert not found.failures
        assert contents(tmp_path / "s3") == contents(tmp_path / "disk")
        document = json.loads((tmp_path / "s3" / "vehicle.json").read_text())
        assert [run["run"] for run in document["runs"]] == ["may/run2", "may/run10"]
    finally:
        server.stop()
