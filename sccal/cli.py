"""The command line: parse, call, print, exit code. Everything heavy is imported by the command that needs it."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sccal import __version__
from sccal.errors import Exit, SccalError, UsageError

if TYPE_CHECKING:
    from sccal.batch import Failure
    from sccal.calibration.result import Calibration
    from sccal.logs.run import RunSource

app = typer.Typer(
    name="sccal",
    help="Calibrate an outdoor robot's wheel radii, track width and heading offset from the logs it writes anyway.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

Paths = Annotated[list[Path], typer.Argument(help="Runs, or folders of runs at any depth.", show_default=False)]


def main() -> None:
    """Entry point: known failures are one line and an exit code, bugs a traceback and exit code 4."""
    try:
        app(standalone_mode=True)
    except SccalError as error:
        print(f"sccal: {error}", file=sys.stderr)
        sys.exit(int(error.exit_code))
    except BrokenPipeError:
        # The reader of a pipe went away (`| head`): not an error of ours, and nothing may be written any more.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(int(Exit.FINE))
    except Exception:
        import traceback

        traceback.print_exc()
        print("sccal: internal error; please report it with the lines above", file=sys.stderr)
        sys.exit(int(Exit.INTERNAL))


def _version(wanted: bool) -> None:
    if wanted:
        print(f"sccal {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Options before any command."""


@app.command()
def calibrate(
    paths: Paths,
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
    gate: Annotated[float, typer.Option(help="Reject measurements further off than this, sigmas.", min=1.0)] = 5.0,
    effects: Annotated[
        str, typer.Option(help="Estimate these effects too, e.g. lever_arm,soft_iron (see `sccal effects`).")
    ] = "",
) -> None:
    """Wheel radii, track width and heading offset of every run below PATHS, and of each vehicle."""
    import numpy as np

    from sccal.batch import calibrate_paths
    from sccal.calibration.options import CalibrationOptions
    from sccal.filter.options import FilterOptions
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
            gate_sigmas=gate,
        ),
        outage_window_s=window,
        output_rate_hz=rate,
        heading_rate_hz=heading_rate,
        effects=tuple(name.strip() for name in effects.split(",") if name.strip()),
    )
    batch = calibrate_paths(paths, out, options, _tell)
    width = _width()
    for vehicle, file in batch.vehicles:
        print()
        print(vehicle_text(vehicle, width) if len(vehicle.runs) > 1 else run_text(vehicle.runs[0], width), end="")
        print()
        page = out / vehicle.runs[0].run / "report.html" if len(vehicle.runs) == 1 else file.with_suffix(".html")
        print(f"results in {out}/, report: {page}")
    _tell_failures(batch.failures, len(batch.failures) + len(batch.calibrated))


def _tell_failures(failures: Sequence[Failure], total: int) -> None:
    """A line for every run that gave nothing, and the exit code of the worst."""
    if not failures:
        return
    print()
    for failure in failures:
        print(f"sccal: {failure.name}: {failure.error}", file=sys.stderr)
    if total > 1:
        print(f"sccal: {len(failures)} of {total} gave no result", file=sys.stderr)
    raise typer.Exit(int(max(failure.error.exit_code for failure in failures)))


def _width() -> int:
    """Columns to print in: the terminal's, within what tables need and eyes can follow."""
    return min(max(shutil.get_terminal_size((100, 24)).columns, 60), 120)


def _tell(source: RunSource, result: Calibration | SccalError) -> None:
    if isinstance(result, SccalError):
        print(f"{source.name}: no result", flush=True)
    else:
        from sccal.report.verdict import run_verdict

        print(f"{source.name}: {run_verdict(result)}", flush=True)


@app.command()
def diagnose(
    paths: Paths,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("out"),
    window: Annotated[float, typer.Option(help="Length of the outage windows, s.", min=1.0)] = 30.0,
    heading_rate: Annotated[float, typer.Option(help="Use at most so many AHRS readings per second.", min=0.1)] = 10.0,
) -> None:
    """What the model lacks in the runs below PATHS: name it, add it, and judge before and after on data held out."""
    from sccal.batch import diagnose_paths
    from sccal.calibration.options import CalibrationOptions
    from sccal.report.diagnosis_text import diagnosis_text

    options = CalibrationOptions(outage_window_s=window, heading_rate_hz=heading_rate)
    diagnosed, failures = diagnose_paths(paths, out, options)
    width = _width()
    for diagnosis, page in diagnosed:
        print(diagnosis_text(diagnosis, width), end="")
        print()
        print(f"results in {page.parent}/, report: {page}")
    _tell_failures(failures, len(failures) + sum(len(diagnosis.runs) for diagnosis, _ in diagnosed))


@app.command()
def inspect(
    paths: Paths,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for a page and JSON of each run.", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")] = False,
) -> None:
    """What is in the logs below PATHS before anything is estimated, and what their drives can show."""
    from sccal.batch import inspect_paths
    from sccal.report.as_json import json_text
    from sccal.report.inspect_json import inspections_json
    from sccal.report.inspect_text import inspection_text

    inspected, failures = inspect_paths(paths, out)
    if as_json:
        failed = [(failure.name, str(failure.error)) for failure in failures]
        print(json_text(inspections_json([one for one, _ in inspected], failed)), end="")
    else:
        for number, (one, page) in enumerate(inspected):
            print(("\n" if number else "") + inspection_text(one, _width()), end="")
            if page is not None:
                print(f"\nreport: {page}")
    if inspected:
        for failure in failures:
            print(f"sccal: {failure.name}: {failure.error}", file=sys.stderr)
    else:
        _tell_failures(failures, len(failures))


@app.command()
def simulate(
    out: Annotated[Path, typer.Argument(help="Folder for the run; its name is the run's.", show_default=False)],
    path: Annotated[str, typer.Option(help="rectangle, circle, general, straight, figure8 or rows.")] = "general",
    duration: Annotated[float, typer.Option(help="Length of the drive, s.", min=10.0)] = 600.0,
    seed: Annotated[int, typer.Option(help="Same seed, same bytes.", min=0)] = 0,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Any other setting, e.g. ahrs.heading_offset_deg=137 (repeatable; see --list)."),
    ] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(help="Put an effect into the log, e.g. lever_arm=0.3,-0.1 (repeatable; see `sccal effects`)."),
    ] = None,
    show: Annotated[bool, typer.Option("--list", help="List the settings and their defaults.")] = False,
    samples: Annotated[bool, typer.Option("--samples", help="Make the three sample runs in OUT instead.")] = False,
) -> None:
    """A tracked robot's logs with known truth: encoder.csv, ahrs.csv, gnss.nmea, vehicle.toml and truth.json."""
    from sccal.effects.catalogue import parse_effect
    from sccal.simulate.choose import describe_settings, settings_from
    from sccal.simulate.files import write_run, write_samples, write_vehicle_file
    from sccal.simulate.run import simulate_run

    if show:
        print("\n".join(describe_settings()))
        return
    if samples:
        write_samples(out)
        print(f"sample runs in {out}/")
        return
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out}: a file of that name is in the way")
    chosen = settings_from(
        [f"drive.path={path}", f"drive.duration_s={duration}", *(settings or [])],
        seed,
    )
    chosen_effects = [parse_effect(text) for text in effect or []]
    simulated = simulate_run(chosen, [one.physics(values) for one, values in chosen_effects])
    write_run(simulated, out)
    write_vehicle_file(chosen, out)
    print(f"a {path} of {duration:g} s in {out}/ (truth in {out / 'truth.json'})")


@app.command()
def effects(
    name: Annotated[str, typer.Argument(help="Explain this one.", show_default=False)] = "",
) -> None:
    """What the model may lack: list the effects of the catalogue, or explain one."""
    from sccal.effects.catalogue import CATALOGUE, effect_named
    from sccal.report.effects import effect_text, effects_text

    print(effect_text(effect_named(name), _width()) if name else effects_text(CATALOGUE.values(), _width()), end="")


if __name__ == "__main__":
    main()
