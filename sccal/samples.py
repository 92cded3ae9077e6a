"""The sample logs: three runs as folders and one as an MCAP file, the same bytes every time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from sccal.convert.from_folder import tables_of_folder
from sccal.convert.to_mcap import write_mcap_of
from sccal.logs.formats import MCAP
from sccal.logs.names import VEHICLE_FILE
from sccal.logs.run import RunSource
from sccal.simulate.files import sample_settings, write_run, write_samples
from sccal.simulate.run import simulate_run
from sccal.simulate.settings import ClockSettings, DriveSettings, SimulationSettings

MCAP_SAMPLE = "figure8"


def write_all_samples(folder: Path) -> None:
    """The runs of ``write_samples``, and ``figure8.mcap`` with ``figure8.truth.json`` beside it."""
    write_samples(folder)
    with TemporaryDirectory() as temporary:
        run = Path(temporary) / MCAP_SAMPLE
        write_run(simulate_run(_mcap_settings()), run)
        tables = tables_of_folder(RunSource(MCAP_SAMPLE, run, folder / VEHICLE_FILE))
        # Not compressed: compressors of other versions give other bytes.
        write_mcap_of(tables, folder / f"{MCAP_SAMPLE}{MCAP.suffix}", compression="")
        (folder / f"{MCAP_SAMPLE}.truth.json").write_bytes((run / "truth.json").read_bytes())


def _mcap_settings() -> SimulationSettings:
    """The vehicle and mounting of the other samples; slower streams, stamps in Unix time as message logs have."""
    others = sample_settings()
    last = list(others.values())[-1]
    start_utc_s = last.clock.start_utc_s + 1200.0
    return replace(
        last,
        seed=len(others) + 1,
        drive=DriveSettings(path="figure8", duration_s=160.0, stand_first_s=5.0),
        encoder=replace(last.encoder, rate_hz=20.0),
        ahrs=replace(last.ahrs, rate_hz=10.0),
        clock=ClockSettings(start_utc_s),
    )
