"""Processes: all tasks done, one that is killed told and replaced, none left behind."""

from __future__ import annotations

import os
import pickle
import signal
import time
from dataclasses import dataclass

import pytest

from sccal.errors import SccalError
from sccal.processes import Here, Processes


@dataclass(frozen=True)
class Square:
    number: int

    def __call__(self) -> int:
        return self.number**2


@dataclass(frozen=True)
class Killed:
    number: int

    def __call__(self) -> int:
        os.kill(os.getpid(), self.number)
        time.sleep(60)
        return 0


@pytest.fixture(scope="module")
def workers():
    processes = Processes(2)
    yield processes
    processes.stop()


def test_every_task_is_done_once_whoever_does_it(workers):
    tasks = [Square(k) for k in range(20)]
    assert sorted(workers.results(tasks)) == sorted(Here().results(tasks)) == [(k, k * k) for k in range(20)]


def test_a_killed_process_is_told_and_takes_no_other_task_with_it(workers):
    tasks = [Square(0), Killed(signal.SIGKILL), Square(2), Square(3), Square(4)]
    found = dict(workers.results(tasks))
    error = found.pop(1)
    assert isinstance(error, SccalError)
    assert "SIGKILL" in str(error)
    assert "--jobs" in str(error)
    assert found == {0: 0, 2: 4, 3: 9, 4: 16}
    assert dict(workers.results([Square(5)])) == {0: 25}


def test_after_a_task_that_cannot_be_sent_the_next_ones_get_their_own_results(workers):
    with pytest.raises((AttributeError, pickle.PicklingError)):
        list(workers.results([Square(7), lambda: 1, Square(8)]))
    assert dict(workers.results([Square(2), Square(3)])) == {0: 4, 1: 9}


def test_nothing_is_left_behind():
    workers = Processes(2)
    pids = [worker.process.pid for worker in workers._idle]
    workers.stop()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
