"""The command line: parse, call, print, exit code. Everything heavy is imported by the command that needs it."""

from __future__ import annotations

import functools
import inspect
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sccal import __version__
from sccal.errors import Exit, Failure, SccalError, UsageError

if TYPE_CHECKING:
    from sccal.calibration.result import Calibration
    from sccal.convert.paths import ConvertedRun
    from sccal.degrade.folder import DegradedRun
    from sccal.logs.options import ReadOptions
    from sccal.logs.run import RunSource

app = typer.Typer(
    name="sccal",
    help="Calibrate an outdoor robot's wheel radii, track width and heading offset from the logs it writes anyway.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

READ_OPTIONS = {
    "wheels_topic": "Topic of the wheels, where several could be.",
    "heading_topic": "Topic of the heading, where several could be.",
    "fix_topic": "Topic of the fixes, where several could be.",
    "left_joint": "Joint of the left wheel, where the names do not say.",
    "right_joint": "Joint of the right wheel.",
    "left_ticks": "Field with the left wheel's ticks, as TOPIC:path, of any message.",
    "right_ticks": "Field with the right wheel's ticks.",
    "left_rad": "Field with the left wheel's angle, instead.",
    "right_rad": "Field with the right wheel's angle, instead.",
    "yaw": "Field with the heading: radians, or degrees where its name ends in deg.",
    "latitude": "Field with the latitude of the fixes, degrees.",
    "longitude": "Field with the longitude of the fixes, degrees.",
    "time": "Time of messages: header (their own stamp, where not zero), log or publish.",
    "orientation": "Quaternions in messages: enu (as ROS asks) or ned.",
}
"""How logs of messages (.mcap, .db3, .bag) are read: the fields of ReadOptions, with their help."""
_READ_CHOICES = {"time": ("header", "log", "publish"), "orientation": ("enu", "ned")}

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


def _with_read_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with an option for each field of ReadOptions, which it gets together as ``read``."""

    @functools.wraps(command)
    def with_options(**given: Any) -> None:
        from sccal.logs.options import ReadOptions

        chosen = {name: given.pop(name).strip() for name in READ_OPTIONS}
        for name, choices in _READ_CHOICES.items():
            if chosen[name] not in choices:
                raise UsageError(f"--{name} {chosen[name]}: must be {', '.join(choices[:-1])} or {choices[-1]}")
        command(**given, read=ReadOptions(**chosen))

    command.__annotations__["read"] = object  # its module is heavy, and typer never sees it
    own = inspect.signature(command, eval_str=True)
    kept = [parameter for name, parameter in own.parameters.items() if name != "read"]
    added = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=_READ_CHOICES.get(name, ("",))[0],
            annotation=Annotated[str, typer.Option(help=text, show_default=name in _READ_CHOICES)],
        )
        for name, text in READ_OPTIONS.items()
    ]
    parameters = [*kept, *added]
    del with_options.__wrapped__
    with_options.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {one.name: one.annotation for one in parameters}
    return with_options


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
@_with_read_options
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
    withhold: Annotated[
        list[str] | None,
        typer.Option(help="Withhold the fixes from 60 to 120 s, say, and tell how far the robot drifts (repeatable)."),
    ] = None,
    mcap: Annotated[
        bool, typer.Option("--mcap", help="Write calibration.mcap too: the results as messages beside the log's.")
    ] = False,
    *,
    read: ReadOptions,
) -> None:
    """Wheel radii, track width and heading offset of every run below PATHS, and of each vehicle."""
    from sccal.logs.mcap_magic import require_any_mcap

    require_any_mcap(paths)
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
            gate_sigmas=gate,
        ),
        outage_window_s=window,
        output_rate_hz=rate,
        heading_rate_hz=heading_rate,
        effects=tuple(name.strip() for name in effects.split(",") if name.strip()),
        withhold_s=tuple(parse_window(text) for text in withhold or []),
    )
    batch = calibrate_paths(paths, out, options, _tell, read, mcap)
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
@_with_read_options
def diagnose(
    paths: Paths,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("out"),
    window: Annotated[float, typer.Option(help="Length of the outage windows, s.", min=1.0)] = 30.0,
    heading_rate: Annotated[float, typer.Option(help="Use at most so many AHRS readings per second.", min=0.1)] = 10.0,
    *,
    read: ReadOptions,
) -> None:
    """What the model lacks in the runs below PATHS: name it, add it, and judge before and after on data held out."""
    from sccal.logs.mcap_magic import require_any_mcap

    require_any_mcap(paths)
    from sccal.batch import diagnose_paths
    from sccal.calibration.options import CalibrationOptions
    from sccal.report.diagnosis_text import diagnosis_text

    options = CalibrationOptions(outage_window_s=window, heading_rate_hz=heading_rate)
    diagnosed, failures = diagnose_paths(paths, out, options, read)
    width = _width()
    for diagnosis, page in diagnosed:
        print(diagnosis_text(diagnosis, width), end="")
        print()
        print(f"results in {page.parent}/, report: {page}")
    _tell_failures(failures, len(failures) + sum(len(diagnosis.runs) for diagnosis, _ in diagnosed))


@app.command("inspect")
@_with_read_options
def inspect_(
    paths: Paths,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for a page and JSON of each run.", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")] = False,
    *,
    read: ReadOptions,
) -> None:
    """What is in the logs below PATHS before anything is estimated, and what their drives can show."""
    from sccal.batch import inspect_paths
    from sccal.report.as_json import json_text
    from sccal.report.inspect_json import inspections_json
    from sccal.report.inspect_text import inspection_text

    inspected, failures = inspect_paths(paths, out, read)
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
    samples: Annotated[bool, typer.Option("--samples", help="Make the sample runs in OUT instead.")] = False,
) -> None:
    """A tracked robot's logs with known truth: encoder.csv, ahrs.csv, gnss.nmea, vehicle.toml and truth.json."""
    from sccal.effects.catalogue import parse_effect
    from sccal.simulate.choose import describe_settings, settings_from
    from sccal.simulate.files import write_run, write_vehicle_file
    from sccal.simulate.run import simulate_run

    if show:
        print("\n".join(describe_settings()))
        return
    if samples:
        from sccal.samples import write_all_samples

        write_all_samples(out)
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
def degrade(
    paths: Paths,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for the degraded runs, outside of the logs.", show_default=False)
    ],
    sigma: Annotated[float, typer.Option(help="White noise on the fixes, m per axis.")] = 0.0,
    loss: Annotated[
        list[str] | None, typer.Option(help="No fixes from 60 to 120 s, say, both included: 60:120 (repeatable).")
    ] = None,
    from_: Annotated[
        float | None, typer.Option("--from", help="Start of sigma, multipath, outliers and quality, s.")
    ] = None,
    quality: Annotated[
        int | None, typer.Option(help="GGA quality to write with it; without it, what the noise means.")
    ] = None,
    multipath: Annotated[float, typer.Option(help="Correlated noise on the fixes, m per axis.")] = 0.0,
    tau: Annotated[float, typer.Option(help="Correlation time of --multipath, s.")] = 30.0,
    outliers: Annotated[
        float, typer.Option(help="Fraction of the fixes that jump by 5 to 50 m and claim what they claimed.")
    ] = 0.0,
    heading_drift: Annotated[
        float, typer.Option(help="Drift of the AHRS yaw, degrees an hour, counter-clockwise positive.")
    ] = 0.0,
    encoder_dropout: Annotated[
        float, typer.Option(help="Fraction of the encoder rows lost, in bursts of a few.")
    ] = 0.0,
    latency: Annotated[float, typer.Option(help="Fixes show where the antenna was so many seconds earlier.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Same seed, same bytes.")] = 0,
    drop: Annotated[
        bool, typer.Option("--drop", help="Leave lost fixes out instead of writing that there is none.")
    ] = False,
    gst: Annotated[bool, typer.Option("--gst", help="Add the noise to the sigmas in GST too.")] = False,
) -> None:
    """Write the runs below PATHS again with a fault, everything else byte for byte as it was."""
    from sccal.degrade.faults import Faults
    from sccal.degrade.paths import degrade_paths
    from sccal.logs.windows import parse_window

    faults = Faults(
        sigma_m=sigma,
        losses_s=tuple(parse_window(text) for text in loss or []),
        from_s=from_,
        quality=quality,
        multipath_m=multipath,
        tau_s=tau,
        outliers=outliers,
        heading_drift_deg_per_hour=heading_drift,
        encoder_dropout=encoder_dropout,
        latency_s=latency,
        seed=seed,
        drop=drop,
        gst=gst,
    )
    degraded, failures = degrade_paths(paths, out, faults, _tell_degraded)
    _tell_failures(failures, len(failures) + len(degraded))


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


@app.command()
@_with_read_options
def convert(
    paths: Paths,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", help="Folder for what is written, outside of the logs.", show_default=False),
    ],
    to: Annotated[str, typer.Option(help="mcap or folder; without it, MCAP becomes folders and all else MCAP.")] = "",
    *,
    read: ReadOptions,
) -> None:
    """Runs below PATHS from folders or ROS bags into MCAP, or into folders; nothing that is read is lost."""
    from sccal.convert.paths import convert_paths

    forms: dict[str, Literal["mcap", "folder"] | None] = {"": None, "mcap": "mcap", "folder": "folder"}
    if to not in forms:
        raise UsageError(f"--to {to}: must be mcap or folder")
    converted, failures = convert_paths(paths, out, forms[to], read, _tell_converted)
    _tell_failures(failures, len(failures) + len(converted))


def _tell_converted(source: RunSource, result: ConvertedRun | SccalError) -> None:
    if isinstance(result, SccalError):
        print(f"{source.name}: not written", flush=True)
        return
    print(f"{source.name}: {source.path} -> {result.path}", flush=True)
    for notice in result.notices:
        print(f"  {notice}", flush=True)


@app.command()
def experiments(
    paths: Annotated[
        list[Path] | None, typer.Argument(help="Runs of yours to put the same faults into.", show_default=False)
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("out"),
    seeds: Annotated[int, typer.Option(help="Simulated drives of each kind.", min=1, max=1000)] = 20,
    duration: Annotated[float, typer.Option(help="Length of the simulated drives, s.", min=120.0)] = 600.0,
    jobs: Annotated[
        int | None, typer.Option(help="Processes; all cores without it.", min=1, show_default=False)
    ] = None,
) -> None:
    """The paper's experiments: fixes lost or noised, with and without the heading offset as a state."""
    from sccal.batch import experiment_on_paths
    from sccal.report.experiments_text import experiments_text

    done, page, failures = experiment_on_paths(paths or [], out, seeds, duration, jobs, _tell_line)
    print()
    print(experiments_text(done, _width()), end="")
    print()
    print(f"results in {out}/, report: {page}")
    _tell_failures(failures, len(failures) + len({cell.path for cell in done.cells if cell.measured}))


def _tell_line(line: str) -> None:
    print(line, flush=True)


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
