"""A Dask cluster of two workers on the loopback, one of them killed in the middle: the bytes of one process here."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

from sccal.batch.calibrating import calibrate_paths
from sccal.calibration.options import CalibrationOptions
from sccal.errors import UsageError
from tests.batch.logs import contents, some_runs
from tests.calibration.test_single import GIVEN

pytest.importorskip("distributed")
from sccal.batch import cluster as cluster_module
from sccal.batch.cluster import Cluster

NAMES = tuple("abcdef")


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@pytest.fixture(scope="module")
def scheduler():
    """Address of a scheduler, and the processes of its two workers."""
    address = f"tcp://127.0.0.1:{free_port()}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    environment = {**os.environ, "NUMBA_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", address, "--no-dashboard", "--no-show"]
    started = [subprocess.Popen(command, **quiet, env=environment)]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny"]
    workers = [
        subprocess.Popen([*worker, "--no-dashboard", "--local-directory", "/tmp"], **quiet, env=environment)
        for _ in range(2)
    ]
    yield address, workers
    for process in (*workers, *started):
        process.kill()
        process.wait()


def connected(address: str, workers: int) -> Cluster:
    give_up = time.monotonic() + 60
    while True:
        try:
            cluster = Cluster(address)
            if len(cluster._client.scheduler_info(n_workers=-1)["workers"]) >= workers:
                return cluster
            cluster.close()
        except UsageError:
            pass
        assert time.monotonic() < give_up
        time.sleep(0.2)


@pytest.mark.slow
def test_a_killed_worker_loses_nothing(scheduler, tmp_path):
    address, workers = scheduler
    logs = some_runs(tmp_path / "logs", NAMES)
    options = CalibrationOptions(noise=GIVEN)
    calibrate_paths([logs], tmp_path / "here", options, lambda *_: None)
    cluster = connected(address, 2)
    seen = threading.Event()

    def kill_one() -> None:
        seen.wait(60)
        workers[0].send_signal(signal.SIGKILL)

    killer = threading.Thread(target=kill_one)
    killer.start()

    class AtFirst:
        def found(self, runs: int) -> None:
            assert runs == len(NAMES)

        def done(self) -> None:
            seen.set()

    try:
        found = calibrate_paths(
            [logs], tmp_path / "there", options, lambda *_: None, workers=cluster, progress=AtFirst()
        )
    finally:
        cluster.close()
        seen.set()
        killer.join()
    workers[0].wait(10)
    assert not found.failures
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_workers_with_another_sccal_are_refused(scheduler, monkeypatch):
    connected(scheduler[0], 1).close()
    monkeypatch.setattr(cluster_module.sccal, "__version__", "9.9.9")
    with pytest.raises(UsageError, match=r"another sccal .*here: 9\.9\.9"):
        Cluster(scheduler[0])


def test_a_scheduler_that_is_not_there_is_one_line(monkeypatch):
    monkeypatch.setattr(cluster_module, "CONNECT_S", 0.5)
    with pytest.raises(UsageError, match="cannot be reached"):
        Cluster(f"tcp://127.0.0.1:{free_port()}")


def test_without_the_extra_the_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"sccal-robotics\[dask\]"):
        Cluster("tcp://127.0.0.1:1")
