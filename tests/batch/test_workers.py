"""Who does the work is decided by what lies there at first sight."""

from __future__ import annotations

import pytest

from sccal.cli import workers
from sccal.errors import UsageError
from sccal.processes import Here, Processes


@pytest.fixture
def counted(monkeypatch):
    """Processes that only say how many they would be, on four cores."""

    class Counted(Processes):
        def __init__(self, count, loads):
            self.count = count

    monkeypatch.setattr(workers, "Processes", Counted)
    monkeypatch.setattr(workers, "usable_cores", lambda: 4)
    return lambda *paths, jobs=None: getattr(workers.workers_for(paths, jobs), "count", 1)


def laid(folder, runs, size_bytes=10):
    for k in range(runs):
        (folder / f"run{k}").mkdir(parents=True)
        (folder / f"run{k}" / "encoder.csv").write_bytes(bytes(size_bytes))
    return folder


@pytest.mark.parametrize(("runs", "processes"), [(0, 1), (1, 1), (2, 1), (3, 1), (4, 2), (8, 4), (50, 4)])
def test_short_runs_need_company(tmp_path, counted, runs, processes):
    tmp_path.joinpath("empty").mkdir()
    assert counted(laid(tmp_path, runs)) == processes


def test_long_runs_are_worth_a_process_each(tmp_path, counted):
    assert counted(laid(tmp_path, 2, 12_000_000)) == 2
    assert counted(laid(tmp_path / "one", 1, 12_000_000)) == 1


def test_jobs_are_what_is_asked_but_no_more_than_runs(tmp_path, counted):
    folder = laid(tmp_path, 3)
    assert counted(folder, jobs=2) == 2
    assert counted(folder, jobs=16) == 3
    assert counted(folder, jobs=1) == 1


def test_files_folders_and_urls(tmp_path, counted):
    for k in range(5):
        (tmp_path / f"{k}.mcap").write_bytes(b"")
    assert counted(tmp_path / "0.mcap") == 1
    assert counted(*(tmp_path / f"{k}.mcap" for k in range(5))) == 2
    assert counted(tmp_path) == 2
    assert counted("s3://bucket/**") == 4


def test_a_cluster_has_its_own_workers():
    assert isinstance(workers.workers_for([], 1), Here)
    with pytest.raises(UsageError, match="--jobs"):
        workers.workers_for([], 2, "tcp://nowhere:1")
