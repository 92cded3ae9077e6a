"""``python -m benchmarks.degrade``: a million lines of NMEA through ``sccal degrade``, the whole process."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.timing import head, show, timed
from sccal.logs.write import gga, rmc

EPOCHS = 500_000
START_S = 1717243200.0


def write_log(path: Path) -> None:
    """GGA and RMC at 10 Hz, each after its receive time."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        for i in range(EPOCHS):
            utc_s = START_S + 0.1 * i
            lat, lon = 52.1 + 1e-7 * i, 5.3 - 1e-7 * i
            file.write(f"{utc_s + 0.05:.4f} {gga(utc_s, lat, lon, 10.0, 4, 12, 0.6, 0.8)}\n")
            file.write(f"{utc_s + 0.05:.4f} {rmc(utc_s, lat, lon, 1.0, 90.0, 'R')}\n")


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        run = Path(name) / "run"
        run.mkdir()
        write_log(run / "gnss.nmea")
        megabytes = (run / "gnss.nmea").stat().st_size / 1e6
        head("degrade")
        for options in (["--sigma", "5"], ["--sigma", "5", "--multipath", "2", "--loss", "1000:20000"]):
            command = [sys.executable, "-m", "sccal", "degrade", str(run), "--out", str(Path(name) / "out"), *options]
            times = timed(lambda command=command: subprocess.run(command, check=True, capture_output=True), 3)
            peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
            show(
                f"degrade {2 * EPOCHS:,} lines",
                times,
                f"{' '.join(options)}: {megabytes:.0f} MB, {peak_mb:.0f} MB at most",
            )


if __name__ == "__main__":
    main()
