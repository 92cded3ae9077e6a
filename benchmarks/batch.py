"""``python -m benchmarks.batch``: runs of five minutes in one call, here and in processes, and resumed."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run

RUNS = 24


def main() -> None:
    """Write the runs, and calibrate them in one process, in two, and again with nothing left to do."""
    print(f"{f'batch of {RUNS} runs of 5 min':<44}{'wall s':>8}{'CPU s':>8}  a run")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for seed in range(RUNS):
            settings = settings_from(["drive.path=general", "drive.duration_s=300"], seed)
            write_run(simulate_run(settings), folder / "logs" / f"run{seed}")
        write_vehicle_file(settings, folder / "logs")
        command = [sys.executable, "-m", "sccal", "calibrate", str(folder / "logs"), "--out", str(folder / "out")]
        for what, options in (
            ("one run, whatever is compiled first", ["--jobs", "1"]),
            ("--jobs 1", ["--jobs", "1"]),
            ("--jobs 2", ["--jobs", "2"]),
            ("--jobs 2 --resume, all done", ["--jobs", "2", "--resume"]),
        ):
            given = [*command, *options]
            runs = RUNS
            if what.startswith("one run"):
                given[4], runs = str(folder / "logs" / "run0"), 1
            before, begin = _cpu_s(), time.perf_counter()
            subprocess.run(given, check=True, capture_output=True)
            wall, cpu = time.perf_counter() - begin, _cpu_s() - before
            print(f"{what:<44}{wall:8.2f}{cpu:8.2f}  {1e3 * wall / runs:.0f} ms, {1e3 * cpu / runs:.0f} ms of CPU")


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
