"""``sccal degrade``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sccal.cli.app import app
from sccal.cli.messages import tell_failures
from sccal.cli.options import grouped
from sccal.cli.reading import Paths
from sccal.errors import SccalError

if TYPE_CHECKING:
    from sccal.degrade.faults import Faults
    from sccal.degrade.folder import DegradedRun
    from sccal.logs.run import RunSource


@dataclass(frozen=True)
class Spoiling:
    """What is done to the logs."""

    sigma: Annotated[float, typer.Option(help="White noise on the fixes, m per axis.")] = 0.0
    loss: Annotated[
        list[str] | None, typer.Option(help="No fixes from 60 to 120 s, say, both included: 60:120 (repeatable).")
    ] = None
    from_: Annotated[
        float | None, typer.Option("--from", help="Start of sigma, multipath, outliers and quality, s.")
    ] = None
    quality: Annotated[
        int | None, typer.Option(help="GGA quality to write with it; without it, what the noise means.")
    ] = None
    multipath: Annotated[float, typer.Option(help="Correlated noise on the fixes, m per axis.")] = 0.0
    tau: Annotated[float, typer.Option(help="Correlation time of --multipath, s.")] = 30.0
    outliers: Annotated[
        float, typer.Option(help="Fraction of the fixes that jump by 5 to 50 m and claim what they claimed.")
    ] = 0.0
    heading_drift: Annotated[
        float, typer.Option(help="Drift of the AHRS yaw, degrees an hour, counter-clockwise positive.")
    ] = 0.0
    encoder_dropout: Annotated[float, typer.Option(help="Fraction of the encoder rows lost, in bursts of a few.")] = 0.0
    latency: Annotated[float, typer.Option(help="Fixes show where the antenna was so many seconds earlier.")] = 0.0
    seed: Annotated[int, typer.Option(help="Same seed, same bytes.")] = 0
    drop: Annotated[
        bool, typer.Option("--drop", help="Leave lost fixes out instead of writing that there is none.")
    ] = False
    gst: Annotated[bool, typer.Option("--gst", help="Add the noise to the sigmas in GST too.")] = False

    def faults(self) -> Faults:
        """As what spoils logs takes them."""
        from sccal.degrade.faults import Faults
        from sccal.logs.windows import parse_window

        return Faults(
            sigma_m=self.sigma,
            losses_s=tuple(parse_window(text) for text in self.loss or []),
            from_s=self.from_,
            quality=self.quality,
            multipath_m=self.multipath,
            tau_s=self.tau,
            outliers=self.outliers,
            heading_drift_deg_per_hour=self.heading_drift,
            encoder_dropout=self.encoder_dropout,
            latency_s=self.latency,
            seed=self.seed,
            drop=self.drop,
            gst=self.gst,
        )


@app.command()
@grouped
def degrade(
    paths: Paths,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for the degraded runs, outside of the logs.", show_default=False)
    ],
    *,
    spoiling: Spoiling,
) -> None:
    """Write the runs below PATHS again with a fault, everything else byte for byte as it was."""
    from sccal.degrade.paths import degrade_paths

    degraded, failures = degrade_paths(paths, out, spoiling.faults(), _tell_degraded)
    tell_failures(failures, len(failures) + len(degraded))


def _tell_degraded(source: RunSource, result: DegradedRun | SccalError) -> None:
    if isinstance(result, SccalError):
        print(f"{source.name}: not written", flush=True)
        return
    did = [f"{count} {what}" for what, count in result.fixes.items() if what not in ("before", "same") and count]
    parts = [f"of {result.fixes['before']} fixes {', '.join(did)}"] if did else []
    parts += [f"{count} rows of {name} left out" for name, count in result.rows_dropped.items()]
    print(f"{source.name}: {'; '.join(parts) or 'written'} -> {result.folder}", flush=True)
    for notice in result.notices:
        print(f"  {notice}", flush=True)
