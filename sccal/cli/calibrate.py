"""``sccal calibrate``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sccal.cli.app import app
from sccal.cli.progress import progress_on
from sccal.cli.reading import PathsOrUrls, local_or_url, with_read_options
from sccal.cli.telling import columns, tell_failures
from sccal.errors import SccalError

if TYPE_CHECKING:
    from sccal.batch.tasks import Source
    from sccal.calibration.result import Calibration
    from sccal.logs.options import ReadOptions


@app.command()
@with_read_options
def calibrate(
    paths: PathsOrUrls,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("out"),
    no_offset: Annotated[
        bool, typer.Option("--no-offset", help="The paper's SC EKF: no heading-offset state, the AHRS is true.")
    ] = False,
    window: Annotated[float, typer.Option(help="Length of the outage windows, s.", min=1.0)] = 30.0,
    rate: Annotated[float, typer.Option(help="Rate of the written trajectory, Hz.", min=0.1, max=1000.0)] = 10.0,
    heading_rate: Annotated[float, typer.Option(help="Use at most so many AHRS readings per second.", min=0.1)] = 10.0,
    radius_prior: Annotated[
        float, typer.Option(help="Prior sigma of each wheel radius, % of nominal.", min=0.01)
    ] = 10.0,
    difference_prior: Annotated[
        float, typer.Option(help="Prior sigma of the radii's difference, % of nominal.", min=0.001)
    ] = 4.0,
    track_prior: Annotated[float, typer.Option(help="Prior sigma of the track width, % of nominal.", min=0.01)] = 30.0,
    radius_walk: Annotated[float, typer.Option(help="Random walk of each radius, ppm per √s.", min=0.0)] = 1.0,
    track_walk: Annotated[float, typer.Option(help="Random walk of the track, ppm per √s.", min=0.0)] = 3.0,
    offset_walk: Annotated[float, typer.Option(help="Random walk of the heading offset, deg per √s.", min=0.0)] = 0.002,
    outlier_gate: Annotated[
        float, typer.Option(help="Reject measurements further off than this, sigmas.", min=1.0)
    ] = 5.0,
    effects: Annotated[
        str, typer.Option(help="Estimate these effects too, e.g. lever_arm,soft_iron (see `sccal effects`).")
    ] = "",
    withhold: Annotated[
        list[str] | None,
        typer.Option(help="Withhold the fixes from 60 to 120 s, say, and tell how far the robot drifts (repeatable)."),
    ] = None,
    mcap: Annotated[
        bool, typer.Option("--mcap", help="Write calibration.mcap too: the results as messages beside the log's.")
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(help="Runs at a time; by default one on each core.", min=1, show_default=False)
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Skip runs whose results stand in OUT, from the same inputs and options.")
    ] = False,
    scheduler: Annotated[str, typer.Option(help="Work on this Dask cluster instead, tcp://host:8786.")] = "",
    *,
    read: ReadOptions,
) -> None:
    """Wheel radii, track width and heading offset of every run below PATHS, and of each vehicle."""
    from sccal.cli.crew import crew_for, one_thread_each
    from sccal.logs.mcap_magic import require_any_mcap

    given = [local_or_url(path) for path in paths]
    require_any_mcap([path for path in given if isinstance(path, Path)])
    one_thread_each()
    crew = crew_for(given, jobs, scheduler)
    import numpy as np

    from sccal.batch import calibrate_paths
    from sccal.calibration.options import CalibrationOptions
    from sccal.filter.options import FilterOptions
    from sccal.logs.windows import parse_window
    from sccal.report.text import run_text, vehicle_text

    options = CalibrationOptions(
        filter=FilterOptions(
            with_offset=not no_offset,
            radius_prior=radius_prior / 100.0,
            radius_difference_prior=difference_prior / 100.0,
            track_prior=track_prior / 100.0,
            radius_walk=radius_walk * 1e-6,
            track_walk=track_walk * 1e-6,
            offset_walk_rad=float(np.radians(offset_walk)),
            gate_sigmas=outlier_gate,
        ),
        outage_window_s=window,
        output_rate_hz=rate,
        heading_rate_hz=heading_rate,
        effects=tuple(name.strip() for name in effects.split(",") if name.strip()),
        withhold_s=tuple(parse_window(text) for text in withhold or []),
    )
    try:
        with progress_on(sys.stdout) as progress:
            batch = calibrate_paths(given, out, options, _tell, read, mcap, crew=crew, resume=resume, progress=progress)
    finally:
        crew.close()
    if batch.unchanged:
        print(f"{batch.unchanged} of {len(batch.calibrated)} results stood already and were not made again")
    width = columns()
    for vehicle, file in batch.vehicles:
        print()
        print(vehicle_text(vehicle, width) if len(vehicle.runs) > 1 else run_text(vehicle.runs[0], width), end="")
        print()
        page = out / vehicle.runs[0].run / "report.html" if len(vehicle.runs) == 1 else file.with_suffix(".html")
        print(f"results in {out}/, report: {page}")
    tell_failures(batch.failures, len(batch.failures) + len(batch.calibrated))


def _tell(source: Source, result: Calibration | SccalError) -> None:
    if isinstance(result, SccalError):
        print(f"{source.name}: no result", flush=True)
    else:
        from sccal.report.verdict import run_verdict

        print(f"{source.name}: {run_verdict(result)}", flush=True)
