"""``python -m benchmarks.messages``: one hour of ROS 2 messages read by sccal, and by the stock decoder beside it."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.timing import head, show, timed
from sccal.logs.messages.write import imu, joint_states, nav_sat_fixes, write_topics
from sccal.logs.run import RunSource, read_run
from sccal.simulate.choose import settings_from
from sccal.simulate.files import write_run, write_vehicle_file
from sccal.simulate.run import simulate_run

HOUR = (
    "drive.path=general",
    "drive.duration_s=3600",
    "encoder.rate_hz=100",
    "ahrs.rate_hz=100",
    "gnss.rate_hz=10",
)


def stock_decoder(path: Path) -> float:
    """Seconds that mcap-ros2-support takes to decode every message."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    begin = time.perf_counter()
    with path.open("rb") as file:
        for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            pass
    return time.perf_counter() - begin


def main() -> None:
    """Write the hour in each compression, read it, and compare."""
    head("messages")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        settings = settings_from(HOUR, 1)
        write_run(simulate_run(settings), folder / "csv")
        write_vehicle_file(settings, folder)
        vehicle = folder / "vehicle.toml"
        csv = RunSource("csv", folder / "csv", vehicle)
        show("read one hour (100 Hz, 100 Hz, 10 Hz), CSV", timed(lambda: read_run(csv)))
        run = read_run(csv)
        topics = [joint_states(run.wheels), imu(run.heading, run.vehicle.convention), nav_sat_fixes(run.fixes)]
        for compression in ("zstd", "lz4", ""):
            path = folder / f"hour{compression}.mcap"
            write_topics(path, topics, compression=compression)
            source = RunSource("mcap", path, vehicle)
            times = timed(lambda source=source: read_run(source))
            show(f"the same, MCAP {compression or 'not compressed'}", times, f"{path.stat().st_size / 1e6:.0f} MB")
            if compression == "zstd":
                ours = times
        stock = stock_decoder(folder / "hourzstd.mcap")
        print(f"{'mcap-ros2-support decodes it in':<44}{stock:8.3f}{'':16}  {stock / ours[1]:.0f} times as long")
        script = (
            "import sys; from pathlib import Path; from sccal.logs.run import RunSource, read_run\n"
            "def peak(): return int(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])\n"
            "before = peak()\n"
            "read_run(RunSource('mcap', Path(sys.argv[1]), Path(sys.argv[2])))\n"
            "print((peak() - before) / 1024)"
        )
        for compression in ("zstd", ""):
            path = folder / f"hour{compression}.mcap"
            command = [sys.executable, "-c", script, str(path), str(vehicle)]
            found = subprocess.run(command, check=True, capture_output=True, text=True)
            size = path.stat().st_size / 1e6
            print(f"memory to read {size:.0f} MB {compression or 'not compressed'}: {float(found.stdout):.0f} MB more")


if __name__ == "__main__":
    main()
