"""``sccal calibrate``."""

from __future__ import annotations

import math
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sccal.cli.app import app
from sccal.cli.messages import columns, tell_failures
from sccal.cli.options import grouped
from sccal.cli.progress import progress_on
from sccal.cli.reading import PathsOrUrls, Reading, local_or_url
from sccal.errors import SccalError

if TYPE_CHECKING:
    from sccal.batch.calibrating import Batch, Progress
    from sccal.batch.tasks import Source
    from sccal.calibration.options import CalibrationOptions
    from sccal.gates.asked import Asked
    from sccal.results.calibration import Calibration
    from sccal.results.gates import BatchOutcome


@dataclass(frozen=True)
class Estimating:
    """How the parameters are estimated, and the path written."""

    no_offset: Annotated[
        bool, typer.Option("--no-offset", help="The paper's SC EKF: no heading-offset state, the AHRS is true.")
    ] = False
    window: Annotated[float, typer.Option(help="Length of the outage windows, s.", min=1.0)] = 30.0
    rate: Annotated[float, typer.Option(help="Rate of the written trajectory, Hz.", min=0.1, max=1000.0)] = 10.0
    heading_rate: Annotated[float, typer.Option(help="Use at most so many AHRS readings per second.", min=0.1)] = 10.0
    radius_prior: Annotated[float, typer.Option(help="Prior sigma of each wheel radius, % of nominal.", min=0.01)] = (
        10.0
    )
    difference_prior: Annotated[
        float, typer.Option(help="Prior sigma of the radii's difference, % of nominal.", min=0.001)
    ] = 4.0
    track_prior: Annotated[float, typer.Option(help="Prior sigma of the track width, % of nominal.", min=0.01)] = 30.0
    radius_walk: Annotated[float, typer.Option(help="Random walk of each radius, ppm per √s.", min=0.0)] = 1.0
    track_walk: Annotated[float, typer.Option(help="Random walk of the track, ppm per √s.", min=0.0)] = 3.0
    offset_walk: Annotated[float, typer.Option(help="Random walk of the heading offset, deg per √s.", min=0.0)] = 0.002
    outlier_gate: Annotated[float, typer.Option(help="Reject measurements further off than this, sigmas.", min=1.0)] = (
        5.0
    )


@dataclass(frozen=True)
class Beyond:
    """What is estimated beside the model's own parameters, and what it is kept from."""

    effects: Annotated[
        str, typer.Option(help="Estimate these effects too, e.g. lever_arm,soft_iron (see `sccal effects`).")
    ] = ""
    model: Annotated[
        Path | None,
        typer.Option(
            help="Estimate the effects of this model.json of `sccal diagnose`, in its shapes and with its noise.",
            show_default=False,
        ),
    ] = None
    withhold: Annotated[
        list[str] | None,
        typer.Option(help="Withhold the fixes from 60 to 120 s, say, and tell how far the robot drifts (repeatable)."),
    ] = None

    def names(self) -> tuple[str, ...]:
        """Of the effects that are asked for one by one."""
        return tuple(name.strip() for name in self.effects.split(",") if name.strip())


@dataclass(frozen=True)
class Files:
    """What is written only where it is asked for."""

    mcap: Annotated[
        bool, typer.Option("--mcap", help="Write calibration.mcap too: the results as messages beside the log's.")
    ] = False
    pdf: Annotated[bool, typer.Option("--pdf", help="Write report.pdf too: the page on A4.")] = False


@dataclass(frozen=True)
class Work:
    """Who does the work, and how much of it."""

    jobs: Annotated[
        int | None, typer.Option(help="Runs at a time; by default one on each core.", min=1, show_default=False)
    ] = None
    resume: Annotated[
        bool, typer.Option("--resume", help="Skip runs whose results stand in OUT, from the same inputs and options.")
    ] = False
    scheduler: Annotated[str, typer.Option(help="Work on this Dask cluster instead, tcp://host:8786.")] = ""


@dataclass(frozen=True)
class Checks:
    """What the results are held to, and where CI reads how that ended."""

    gate: Annotated[
        list[str] | None,
        typer.Option(help='Fail with exit code 1 unless, e.g. "outage.percent_of_distance<0.5" (repeatable).'),
    ] = None
    baseline: Annotated[
        Path | None,
        typer.Option(help="Compare with this calibration.json, vehicle.json or summary.json.", show_default=False),
    ] = None
    allow_drift: Annotated[
        list[str] | None,
        typer.Option(help="How far from the baseline: 2sigma, 1%, 0.5mm, 0.2deg (repeatable; 3sigma without it)."),
    ] = None
    junit: Annotated[Path | None, typer.Option(help="Write JUnit XML for CI servers.", show_default=False)] = None

    def asked(self, effects: tuple[str, ...]) -> Asked:
        """As the gates take them, where these effects are estimated."""
        from sccal.gates.asked import read_asked

        return read_asked(self.gate or [], self.baseline, self.allow_drift or [], effects)


@app.command()
@grouped
def calibrate(
    paths: PathsOrUrls,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("out"),
    *,
    estimating: Estimating,
    beyond: Beyond,
    files: Files,
    work: Work,
    checks: Checks,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")] = False,
    read: Reading,
) -> None:
    """Wheel radii, track width and heading offset of every run below PATHS, and of each vehicle."""
    from sccal.cli.workers import one_thread_each, workers_for
    from sccal.logs.first_look import require_any_log

    given = [local_or_url(path) for path in paths]
    local = [path for path in given if isinstance(path, Path)]
    if len(local) == len(given):
        require_any_log(local)
    one_thread_each()
    workers = workers_for(given, work.jobs, work.scheduler)
    from sccal.batch.calibrating import calibrate_paths
    from sccal.batch.gating import judged, write_outcome
    from sccal.batch.tasks import AlsoWritten

    lines = sys.stderr if as_json else sys.stdout
    try:
        options = options_of(estimating, beyond)
        expected = () if options.model is None else tuple(effect.name for effect in options.model.effects)
        asked = checks.asked((*options.effects, *expected))
        with progress_on(lines) as bar, redirect_stdout(lines):
            teller = _Teller(bar)
            batch = calibrate_paths(
                given,
                out,
                options,
                teller.tell,
                read.options(),
                AlsoWritten(mcap=files.mcap, pdf=files.pdf),
                workers=workers,
                resume=work.resume,
                progress=teller,
            )
    finally:
        workers.close()
    outcome = judged(batch, asked)
    index = write_outcome(outcome, out, checks.junit)
    with redirect_stdout(lines):
        _tell_batch(batch, out, index)
        _tell_gates(outcome)
    if as_json:
        from sccal.results.converter import document_of, json_text

        print(json_text(document_of(outcome)), end="")
    with redirect_stdout(lines):
        tell_failures(batch.failures, len(batch.failures) + len(batch.runs))
    raise typer.Exit(int(outcome.exit_code))


def options_of(estimating: Estimating, beyond: Beyond) -> CalibrationOptions:
    """As the calibration takes them: shares instead of percent and ppm, radians instead of degrees.

    Raises:
        SccalError: the model cannot be read, or a window is none.
    """
    from sccal.calibration.judged_model import read_judged_model
    from sccal.calibration.options import CalibrationOptions
    from sccal.filter.options import FilterOptions
    from sccal.logs.windows import parse_window

    model = None if beyond.model is None else read_judged_model(beyond.model)
    return CalibrationOptions(
        filter=FilterOptions(
            with_offset=not estimating.no_offset,
            radius_prior=estimating.radius_prior / 100.0,
            radius_difference_prior=estimating.difference_prior / 100.0,
            track_prior=estimating.track_prior / 100.0,
            radius_walk=estimating.radius_walk * 1e-6,
            track_walk=estimating.track_walk * 1e-6,
            offset_walk_rad=math.radians(estimating.offset_walk),
            gate_sigmas=estimating.outlier_gate,
        ),
        outage_window_s=estimating.window,
        output_rate_hz=estimating.rate,
        heading_rate_hz=estimating.heading_rate,
        effects=beyond.names(),
        model=model,
        withhold_s=tuple(parse_window(text) for text in beyond.withhold or []),
    )


class _Teller:
    """A line for each run as the runs come, beside the bar if there is one."""

    def __init__(self, bar: Progress | None) -> None:
        self._bar = bar
        self._runs = 0

    def found(self, runs: int) -> None:
        self._runs = runs
        if self._bar is not None:
            self._bar.found(runs)

    def done(self) -> None:
        if self._bar is not None:
            self._bar.done()

    def tell(self, source: Source, result: Calibration | SccalError) -> None:
        if isinstance(result, SccalError):
            if self._runs > 1:  # of one run alone, why says all
                print(f"{source.name}: no result", flush=True)
        else:
            print(f"{source.name}: {result.verdict}", flush=True)


def _tell_batch(batch: Batch, out: Path, index: Path | None) -> None:
    from sccal.report.run.text import run_text
    from sccal.report.vehicle.text import vehicle_text

    if batch.unchanged:
        print(f"{batch.unchanged} of {len(batch.runs)} results stood already and were not made again")
    for vehicle, file in batch.vehicles:
        print()
        alone = len(vehicle.runs) == 1
        print(run_text(vehicle.runs[0], columns()) if alone else vehicle_text(vehicle, columns()), end="")
        print()
        page = out / vehicle.runs[0].run / "report.html" if alone else file.with_suffix(".html")
        print(f"results in {out}/, report: {page}")
    if index is not None and len(batch.runs) + len(batch.failures) > 1:
        print(f"all runs: {index}")


def _tell_gates(outcome: BatchOutcome) -> None:
    from sccal.report.fleet.gates import gates_text

    text = gates_text(outcome.gates, columns())
    if text:
        print(f"\n{text}", end="")
