"""``python -m benchmarks.pipeline``: one hour of log through the readers, the kernel and the whole command."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from benchmarks.timing import head, show, timed
from sccal.align import align, build_timeline
from sccal.calibration.options import CalibrationOptions
from sccal.filter.iterate import RunProblem
from sccal.filter.start import find_start
from sccal.logs.nmea import parse_nmea, parse_nmea_heading
from sccal.logs.run import discover, read_run
from sccal.logs.write import gga, gst, rmc
from sccal.results.noise import Noise
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run

HOUR = ("drive.path=general", "drive.duration_s=3600", "ahrs.rate_hz=100")
NOISE = Noise(0.0026, 0.007, 15.0, 0.67, 0.01, 60.0, 0.003, "given")


def hour_of_nmea(*further: Callable[[float], str]) -> bytes:
    """GGA and RMC at 10 Hz after their receive times, and further sentences by their epoch."""
    lines = []
    for i in range(36_000):
        utc_s = 1717243200.0 + 0.1 * i
        here = 52.1 + 1e-7 * i, 5.3 - 2e-7 * i
        sentences = [gga(utc_s, *here, 40.0, 4, 12, 0.6, 0.8), rmc(utc_s, *here, 1.0, 0.1 * i, "R")]
        sentences += [make(utc_s) for make in further]
        lines += [f"{utc_s + 0.02 + 0.001 * k:.4f} {sentence}\n" for k, sentence in enumerate(sentences)]
    return "".join(lines).encode()


def time_nmea() -> None:
    """An hour of a receiver's lines, plain and with all that a heading receiver adds."""
    from tests.receiver import hdt, ksxt, vtg

    plain = hour_of_nmea()
    rich = hour_of_nmea(lambda utc_s: gst(utc_s, 0.012, 0.015), lambda utc_s: vtg(90.0, 3.6), lambda utc_s: hdt(90.0))
    ksxt_only = "".join(ksxt(1717243200.0 + 0.1 * i, compass_deg=90.0) + "\n" for i in range(36_000)).encode()
    for name, raw in (("GGA, RMC", plain), ("GGA, RMC, GST, VTG, HDT", rich), ("KSXT", ksxt_only)):
        show(f"fixes, 1 h of 10 Hz {name}", timed(partial(parse_nmea, raw, name)))
    for name, raw in (("HDT", rich), ("KSXT", ksxt_only)):
        show(f"headings, 1 h of 10 Hz {name}", timed(partial(parse_nmea_heading, raw, name)))


def kernel_against_oracle(count: int = 2000) -> tuple[float, float]:
    """Seconds per event of the kernel, and how many times longer the plain dense filter takes."""
    from tests.filter import oracle
    from tests.filter.events import make
    from tests.filter.test_kernel import run

    events, columns, model, x, P = make(count)
    long = make(200_000)
    begin = time.perf_counter()
    oracle.run(events, columns, model, x, P)
    plain = (time.perf_counter() - begin) / count
    kernel = timed(lambda: run(*long), 3)[1] / 200_000
    return kernel, plain / kernel


def main() -> None:
    """Time them."""
    head("pipeline")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "hour"
        settings = settings_from(HOUR, 1)
        write_run(simulate_run(settings), folder)
        write_vehicle_file(settings, folder)
        (source,) = discover([folder])

        time_nmea()
        show("read one hour (100 Hz, 100 Hz, 5 Hz)", timed(lambda: read_run(source)))
        run = read_run(source)
        show("align it", timed(lambda: align(run)))
        aligned = align(run)
        problem = RunProblem(aligned, build_timeline(aligned), find_start(aligned), NOISE, CalibrationOptions().filter)
        at = problem.at_centre()
        laid = problem.laid_out(at)
        events = problem.timeline.t_s.size
        passes = timed(lambda: problem.begun(at, False, laid).finish())
        show("one pass of the filter", passes, f"{1e9 * passes[1] / events:.0f} ns an event, {events:,} events")

        command = [sys.executable, "-m", "sccal", "calibrate", str(folder), "--out", str(Path(name) / "out")]
        whole = timed(lambda: subprocess.run(command, check=True, capture_output=True), 3)
        peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        show("sccal calibrate, the whole process", whole, f"{peak_mb:.0f} MB at most")
        command[3] = "diagnose"
        whole = timed(lambda: subprocess.run(command, check=True, capture_output=True), 1)
        peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        show("sccal diagnose, the whole process", whole, f"{peak_mb:.0f} MB at most")
        help_command = [sys.executable, "-m", "sccal", "--help"]
        show("sccal --help", timed(lambda: subprocess.run(help_command, check=True, capture_output=True)))
    seconds, ratio = kernel_against_oracle()
    print(f"the kernel takes {1e9 * seconds:.0f} ns an event; plain dense numpy beside it {ratio:.0f} times as long")


if __name__ == "__main__":
    main()
